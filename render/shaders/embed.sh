#!/bin/sh
# embed.sh VALIDATOR OUTPUT FILE...: checks every shader stage with glslang and writes all files as
# C strings. The validator's complaints go to stderr, where Meson shows them.
set -eu
validator=$1 output=$2
shift 2

# The shared text that goes before a stage: common.glsl, and what the shading passes have in common.
shared_of()
{
    folder=$(dirname "$1")
    case ${1##*/} in
    shade*) cat "$folder/common.glsl" "$folder/images.glsl" "$folder/shade.glsl" ;;
    mesh.*) cat "$folder/common.glsl" "$folder/raster.glsl" "$folder/seen.glsl" ;;
    raster*) cat "$folder/common.glsl" "$folder/raster.glsl" ;;
    reach.* | select.*) cat "$folder/common.glsl" "$folder/blocks.glsl" ;;
    technique_persistent_grid*)
        cat "$folder/common.glsl" "$folder/field.glsl" "$folder/technique_persistent_grid.glsl" \
            "$folder/technique_persistent_grid_depth.glsl" ;;
    technique_rag*) cat "$folder/common.glsl" "$folder/field.glsl" "$folder/technique_rag.glsl" ;;
    technique_*) cat "$folder/common.glsl" "$folder/field.glsl" ;;
    *) cat "$folder/common.glsl" ;;
    esac
}

# Checks a stage in all its variants: with and without imagery; both steps of select.comp; one sample
# a pixel and several; triangles listed and drawn.
check()
{
    stage=${1##*.} fragment=0
    [ "$stage" != frag ] || fragment=1
    for variant in "0 0 0 1" "1 0 1 2" "0 1 0 2" "1 1 1 1"; do
        {
            printf '#version 450 core\n#define FRAGMENT %d\n' "$fragment"
            # shellcheck disable=SC2086 # four numbers
            printf '#define COLOUR %d\n#define WATER %d\n#define SPLIT %d\n#define SAMPLES %d\n' $variant
            printf '#define RASTER %d\n#define SENT %d\n' "${variant%% *}" "${variant%% *}"
            printf '#define BLOCK 8\n#define TABLE 32\n#define DRAWS 2\n#define BLOCKS_A_DRAW 9\n'
            printf '#define FIELD_COL 128\n#define FIELD_ROW 128\n#define FIELD_CELLS 256\n'
            printf '#define FIELD_PIECE 128\n'
            printf '#define FIELD_PANE 1\n#define GRID_CELLS 128\n#define LEVELS 10\n'
            printf '#define LANES 64\n#define PANE_LANES 64\n#define SQUARES %d\n' \
                "$(case $variant in "0 1"*) echo 1 ;; *) echo 0 ;; esac)"
            printf '#define GROUND 1\n#define SKY %d\n' "${variant%% *}"
            printf '#define SAMPLE_PLACES vec2(0.25), vec2(0.75)\n#define IMAGE_TAPS 4\n#define STORAGE 256\n'
            printf '#define PATCH_CELLS 128\n#define BLOCK_CELLS 16\n'
            printf '#define OBLIQUE %d\n#define LOOKS 1\n#define BOX_LOG 4\n' "${variant%% *}"
            printf '#define CORNERS 24\n#define WARP 1\n#define EDGES 1\n'
            case ${1##*/} in
            shade.*) echo '#define CARRIED' ;;
            reach.* | select.* | mesh.*) [ "${variant%% *}" = 0 ] || echo '#define HELD' ;;
            esac
            shared_of "$1"
            cat "$1"
        } | "$validator" --stdin -S "$stage" >"$output.log" 2>&1 ||
            { echo "$1:" >&2; cat "$output.log" >&2; exit 1; }
    done
}

for file; do
    case $file in *.glsl) ;; *) check "$file" ;; esac
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
