#!/bin/sh
# The units parse, and expose no more than they must. $2... are the configured unit files.
. "$(dirname "$0")/common.sh"

command -v systemd-analyze >/dev/null || skip "systemd-analyze is not installed"
shift
units=$(mktemp -d)
trap 'rm -rf "$units" "$complaints"' EXIT
for unit in "$@"; do
    [ -s "$unit" ] || complain "$unit is missing"
    # The program and its manual need not be installed for this.
    sed -e 's|^ExecStart=[^ ]*|ExecStart=/bin/true|' -e '/^Documentation=/d' "$unit" \
        >"$units/${unit##*/}"
done
for unit in "$units"/*; do
    name=${unit##*/}
    if ! verdict=$(systemd-analyze verify "$unit" 2>&1) || [ -n "$verdict" ]; then
        complain "$name: $verdict"
    fi
    level=$(systemd-analyze security --offline=true "$unit" |
        sed -n 's/.*exposure level for [^:]*: \([0-9.]*\).*/\1/p')
    echo "$name: exposure $level"
    awk -v level="${level:-10}" 'BEGIN { exit !(level <= 2.5) }' ||
        complain "$name: exposure $level is above 2.5"
done
finish
