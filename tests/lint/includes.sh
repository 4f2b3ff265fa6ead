#!/bin/sh
# Who may include whom (docs/architecture.md), and which folder may see which library.
. "$(dirname "$0")/common.sh"

# shellcheck disable=SC2046 # none of our file names holds a blank
awk '
function complain(text) {
    print FILENAME ": " text
}
function check_ours(folder, name) {
    if (name !~ /\//) {
        if ((getline line <(folder "/" name)) >= 0)
            complain("includes \"" name "\"; write \"" folder "/" name "\"")
        return
    }
    target = name
    sub(/\/.*/, "", target)
    if ((folder in allowed) && index(" " allowed[folder] " ", " " target " ") == 0)
        complain(folder "/ must not include \"" name "\"")
}
function check_library(folder, name) {
    if (folder == "tests" || folder == "bench")
        return
    for (library in owner)
        if (index(name, library) == 1 && owner[library] != folder)
            complain("only " owner[library] "/ may include <" name ">")
}
BEGIN {
    allowed["base"] = "base"
    allowed["geo"] = "base geo"
    allowed["terrain"] = "base geo terrain"
    allowed["render"] = "base geo terrain render"
    allowed["io"] = "base geo io"
    allowed["config"] = "base geo terrain render io config"
    owner["GL/"] = owner["EGL/"] = owner["GLES"] = owner["GLFW/"] = owner["epoxy/"] = "render"
    owner["modbus"] = owner["linux/can"] = owner["pcap"] = "io"
    owner["gdal"] = owner["ogr"] = owner["cpl_"] = owner["sqlite3"] = owner["webp/"] = "terrain"
    owner["GeographicLib/"] = "geo"
    owner["systemd/"] = "daemon"
    owner["cyaml/"] = owner["yaml.h"] = "config"
}
/^[ \t]*#[ \t]*include[ \t]*["<]/ {
    folder = FILENAME
    sub(/\/.*/, "", folder)
    name = $0
    sub(/^[^"<]*["<]/, "", name)
    sub(/[">].*/, "", name)
    if ($0 ~ /include[ \t]*"/)
        check_ours(folder, name)
    else
        check_library(folder, name)
}' $(sources '*.[ch]') $(sources '*.cc') >>"$complaints"
cat "$complaints" >&2

for file in $(sources '*.h'); do
    [ "$(grep -c '^#pragma once$' "$file")" -eq 1 ] || complain "$file: no #pragma once"
done
finish
