#!/bin/sh
# What the manual page and the completion say of each subcommand's options is what the built program
# ($2) says of itself.
. "$(dirname "$0")/common.sh"

command -v bash >/dev/null || skip "bash is not installed"
own=$(mktemp)
told=$(mktemp)
trap 'rm -f "$own" "$told" "$complaints"' EXIT

# Options of a subcommand, one a line: short and long ones of --help.
program_options() {
    "$program" "$1" --help | sed -n 's/^ *\(-.*\)/\1/p' |
        sed 's/   .*//; s/  \(--\)/, \1/g; s/, /\n/g' | sed -n 's/^\(--*[a-z?][a-z-]*\).*/\1/p'
}

manual_options() {
    awk -v section=".Ss otwd $1" '
        /^\.S[sh]/ { inside = $0 == section }
        inside && $1 == ".It" { for (i = 2; i < NF; i++) if ($i == "Fl") print "-" $(i + 1) }
    ' docs/man/otwd.1
}

completion_options() {
    bash -c '. docs/completion/otwd.bash 2>/dev/null; _otwd_options "$1"' bash "$1" | tr ' ' '\n'
}

# Every subcommand has these; the manual tells of them once.
but_common() {
    grep -vx -e '--help' -e '--usage' -e '-h' -e '-[?]' | sort -u
}

program=$2
for name in run replay demo import info verify height send status check-config; do
    if ! "$program" "$name" --help >/dev/null 2>&1; then
        [ "$name" = import ] || complain "$program $name --help fails"
        continue # built without GDAL
    fi
    program_options "$name" | but_common >"$own"
    [ -s "$own" ] || complain "otwd $name --help tells of no option"
    manual_options "$name" | but_common >"$told"
    diff -u "$own" "$told" >&2 || complain "docs/man/otwd.1: options of $name (-: program, +: manual)"
    completion_options "$name" | but_common | grep '^--' >"$told"
    grep '^--' "$own" | diff -u - "$told" >&2 ||
        complain "docs/completion/otwd.bash: options of $name (-: program, +: completion)"
done
finish
