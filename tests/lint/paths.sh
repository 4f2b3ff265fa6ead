#!/bin/sh
# Nothing in the tree may depend on where somebody happened to have it.
. "$(dirname "$0")/common.sh"

for folder in home root work mnt Users; do
    grep -rnIE "(^|[^A-Za-z0-9_.\$})-])/$folder/" --include='*' \
        base geo terrain render io config daemon systemd tests docs meson.build README.md HACKING.md |
        grep -v '^tests/lint/' | while read -r line; do
        complain "absolute path: $line"
    done
done
finish
