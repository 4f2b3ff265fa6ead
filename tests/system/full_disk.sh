#!/bin/sh
# A disk that fills up under an import, an addition and a merge, for every amount of room until they
# come through: each failure is status 74 and names a file and bytes, what was there is as it was,
# and with more room the same command ends in the same bytes.
self=$(realpath "$0")
. "$(dirname "$0")/common.sh"

if [ "${1:-}" != mounted ]; then
    unshare -rm mount -t tmpfs none "$scratch" 2>/dev/null || {
        echo "skip: a user may not mount a tmpfs here (unshare -rm)"
        exit 77
    }
    unshare -rm "$self" mounted
    exit
fi

# Hills beside each other: 300 x 240 posts from longitude $1 on.
hills() {
    awk -v west="$1" 'BEGIN {
        printf "ncols 300\nnrows 240\nxllcorner %s\nyllcorner 46\ncellsize 0.0041666666666666667\n", west
        for (i = 0; i < 240; i++) {
            for (j = 0; j < 300; j++)
                printf "%d ", 900 + 500 * sin(i / 7 + west) * cos(j / 5) + 60 * sin(i * j / 90)
            print ""
        }
    }'
}
hills 8 >west.asc
hills 9.25 >east.asc
printf 'Projection GEOGRAPHIC\nDatum WGS84\nUnits DD\n' | tee west.prj >east.prj
"$OTWD" import west.asc -o west.db -q 2>first.log
case $? in
0) ;;
69)
    echo "skip: no otwd-import"
    exit 77
    ;;
*) fatal "import: $(cat first.log)" ;;
esac
cp west.db both.db
"$OTWD" import east.asc -o both.db -q || fatal "no addition"
for i in 1 2; do
    "$OTWD" import west.asc east.asc -o shard$i -q --shard $i/2 || fatal "no shard $i"
done
"$OTWD" merge -q merged.db shard1 shard2 || fatal "no merge"
mkdir disk

room() {
    mount -t tmpfs -o "${2:-}size=$1k" none disk
}

# sweep EXPECTED OLD COMMAND...: with more and more room. OLD (or nothing) is at disk/x.db before.
sweep() {
    expected=$1 old=$2 refused=0
    shift 2
    for kib in 32 64 96 128 160 192 224 256 320 384 448 512 768; do
        room "$kib"
        if [ -z "$old" ] || cp "$old" disk/x.db 2>/dev/null; then
            "$@" 2>error.txt
            status=$?
            [ "$status" -ne 0 ] || break
            refused=$((refused + 1))
            [ "$status" -eq 74 ] || fail "$2: $kib KiB: status $status: $(cat error.txt)"
            grep -q 'disk/x.db.*: .*\(after [0-9]* bytes\|No space left on device\)' error.txt ||
                fail "$2: $kib KiB: $(cat error.txt)"
            if [ -n "$old" ]; then
                cmp -s "$old" disk/x.db || fail "$2: $kib KiB: the database is not as it was"
            else
                [ ! -e disk/x.db ] || fail "$2: $kib KiB: half a database"
            fi
            room 16384 remount,
            "$@" || fail "$2: $kib KiB: not resumed"
            cmp -s "$expected" disk/x.db || fail "$2: $kib KiB: other bytes after all"
            [ "$(ls disk)" = x.db ] || fail "$2: $kib KiB: left: $(ls disk)"
        fi
        umount disk
    done
    [ "$status" -eq 0 ] || fail "$2: never comes through"
    cmp -s "$expected" disk/x.db || fail "$2: other bytes"
    umount disk
    echo "$2: $refused amounts of room were too little, $kib KiB enough"
    [ "$refused" -ge 3 ] || fail "$2: hardly ever refused"
}
sweep west.db '' "$OTWD" import west.asc -o disk/x.db -q
sweep both.db west.db "$OTWD" import east.asc -o disk/x.db -q
sweep merged.db '' "$OTWD" merge -q disk/x.db shard1 shard2
finish
