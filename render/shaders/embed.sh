#!/bin/sh
# embed.sh VALIDATOR OUTPUT FILE...: checks every shader stage with glslang and writes all files as
# C strings. The validator's complaints go to stderr, where Meson shows them.
set -eu
validator=$1 output=$2
shift 2

# The shared text that goes before a stage: common.glsl, and shade.glsl for the shading passes.
shared_of()
{
    folder=$(dirname "$1")
    case ${1##*/} in
    shade*) cat "$folder/common.glsl" "$folder/shade.glsl" ;;
    *) cat "$folder/common.glsl" ;;
    esac
}

for file; do
    case $file in *.glsl) continue ;; esac
    stage=${file##*.}
    { echo '#version 450 core'; echo '#define INSTANCES 1'; shared_of "$file"; cat "$file"; } |
        "$validator" --stdin -S "$stage" >"$output.log" 2>&1 ||
        { echo "$file:" >&2; cat "$output.log" >&2; exit 1; }
done
rm -f "$output.log"
{
    echo '#include "render/program.h"'
    echo 'const struct shader_file shader_files[] = {'
    for file; do
        echo "{\"${file##*/}\","
        sed -e 's/\\/\\\\/g' -e 's/"/\\"/g' -e 's/^/"/' -e 's/$/\\n"/' "$file"
        echo '},'
    done
    echo '{0, 0}};'
} >"$output"
