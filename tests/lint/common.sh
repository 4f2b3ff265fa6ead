# Shared by the lint scripts: `complain TEXT` reports, `finish` exits. The source root is $1.
# shellcheck shell=sh

cd "$1" || exit 1
complaints=$(mktemp)
trap 'rm -f "$complaints"' EXIT

complain() {
    echo "$*" | tee -a "$complaints" >&2
}

finish() {
    [ ! -s "$complaints" ]
    exit
}

skip() {
    echo "skip: $*"
    exit 77
}

# Our own sources; $1 is a find(1) name pattern.
sources() {
    for folder in base geo terrain render io config daemon bench tests; do
        [ -d "$folder" ] && find "$folder" -name "$1" -type f
    done | sort
}
