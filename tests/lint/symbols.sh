#!/bin/sh
# No global name of ours is also one of a shared library that the program loads: whoever means the
# library's function would silently get ours. $2 is the program; our archives lie beside it.
. "$(dirname "$0")/common.sh"

for tool in nm ldd comm; do
    command -v "$tool" >/dev/null || skip "$tool is not installed"
done
ours=$(mktemp)
trap 'rm -f "$ours" "$complaints"' EXIT
find "$(dirname "$2")/.." -name '*.a' -exec nm -g --defined-only {} + 2>/dev/null |
    awk '$2 ~ /[TDBR]/ && $3 !~ /^_/ { print $3 }' | sort -u >"$ours"
grep -qx config_load "$ours" || complain "$2: our archives are not found"
ldd "$2" | awk '$3 ~ /^\// { print $3 }' | while read -r library; do
    nm -D --defined-only "$library" | awk '{ sub(/@.*/, "", $3); print $3 }' | sort -u |
        comm -12 - "$ours" | while read -r name; do
        complain "$name is also a name of ${library##*/}"
    done
done
finish
