#!/bin/sh
# What is written of the options agrees: each subcommand's --help, otwd(1) and the bash completion.
source_root=$(cd "$(dirname "$0")/../.." && pwd)
. "$(dirname "$0")/common.sh"

# What all have, and the manual tells once.
everywhere='help\|usage\|version\|quiet\|verbose'

# The options of a subcommand by its own help; by the manual's section on it; by the completion.
helped() {
    sed -n 's/^ *\(-., \)\{0,1\} *--\([a-z-]*\).*/\2/p' help.txt | grep -vx "$everywhere"
}
told() {
    awk -v name="$1" '/^\.S[sh] / { on = $0 == ".Ss otwd " name } on && /^\.It Fl/' \
        "$source_root/docs/man/otwd.1" | grep -o 'Fl -[a-z-]*' | sed 's/Fl -//'
}
# shellcheck disable=SC2016,SC2086 # the inner shell's variables; a name may be two words
completed() {
    bash -c '. "$1"; COMP_WORDS=("${@:2}" --); COMP_CWORD=$(($# - 1)); _otwd
        printf "%s\n" "${COMPREPLY[@]}"' \
        bash "$source_root/docs/completion/otwd.bash" "$OTWD" $1 |
        sed 's/^--//' | grep -vx "$everywhere"
}
# shellcheck disable=SC2086 # a name may be two words
for name in run replay demo import merge info verify height dig send 'bench codec' \
    bench 'bench motion' 'bench quality' 'bench stability' status check-config; do
    "$OTWD" $name --help >help.txt 2>&1
    if [ $? -eq 69 ]; then # no GDAL, no import
        cat help.txt
        continue
    fi
    for option in quiet verbose; do
        grep -q -- "-., --$option" help.txt || fail "$name: no --$option"
    done
    helped | sort >helped.txt
    told "$name" | sort >told.txt
    completed "$name" | sort >completed.txt
    [ -s helped.txt ] || fail "$name: --help tells of no option"
    diff helped.txt told.txt >"$name.log" || fail "$name: --help (<) and the manual (>) differ"
    diff helped.txt completed.txt >>"$name.log" ||
        fail "$name: --help (<) and the completion (>) differ"
    [ "$("$OTWD" $name --version)" = "$("$OTWD" --version)" ] || fail "$name: no --version, or another"
    "$OTWD" $name --no-such-option 2>wrong.txt
    [ $? -eq 64 ] || fail "$name: a wrong option is not 64"
    grep -q -- '--no-such-option' wrong.txt || fail "$name: a wrong option is not named"
done
finish
