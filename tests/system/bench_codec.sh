#!/bin/sh
# `otwd bench codec`: every row is there, each within its bound, and what it cannot read is named.
. "$(dirname "$0")/common.sh"

# Steep waves in tenths of a metre, with a void in the middle; DIVISOR 10 makes metres with fractions.
waves() {
    awk -v divisor="$1" 'BEGIN {
        printf "ncols 200\nnrows 150\nxllcorner 8\nyllcorner 46\ncellsize 0.005\n"
        print "NODATA_value -9999"
        for (i = 0; i < 150; i++) {
            for (j = 0; j < 200; j++) {
                height = int(5000 + 3000 * sin(i / 9) * cos(j / 13)) / divisor
                printf "%s ", i == 75 && j == 75 ? -9999 : height
            }
            print ""
        }
    }'
}
waves 1 >tenths.asc
waves 10 >metres.asc
echo 'no raster' >garbage.tif

export TMPDIR="$scratch"
"$OTWD" bench codec tenths.asc --scale 0.1 --max-error 0.3 >table.txt 2>bench.log
case $? in
0) ;;
69)
    echo "skip: no otwd-import"
    exit 77
    ;;
*) fatal "bench codec: $(cat bench.log)" ;;
esac
grep -q '^tenths.asc: 200 x 150 Int32 in units of 0.1 m, .* 0.3 m, as if at the equator$' table.txt ||
    fail "no heading: $(cat table.txt)"

# row NAME MOST [LEAST]: bits and speeds are above 0, the error is at least LEAST and at most MOST.
row() {
    sed -n "s/^  $1  *//p" table.txt | awk -v most="$2" -v least="${3:-0}" '
        { good = NF == 4 && $1 > 0 && $2 > 0 && $3 > 0 && $4 <= most && $4 >= least }
        END { exit !good }' || fail "$1: $(cat table.txt)"
}
all_rows() {
    row 'otwd, the whole database' "$1" "$2"
    row 'otwd, the payloads alone' "$1" "$2"
    row 'LERC and zstd-19, GeoTIFF' "$1"
    row 'zstd-19 of the samples' 0
    row 'PNG, 16 bits' "$3"
}
all_rows 0.3001 0.2999 0 # seven tenths a step: the bound is used, and kept

"$OTWD" bench codec metres.asc --max-error 0.25 >table.txt 2>>bench.log || fail "fractions"
all_rows 0.25 0.2 0.2501
"$OTWD" bench codec metres.asc --max-error 0 >table.txt 2>>bench.log || fail "lossless"
row 'otwd, the whole database' 0
grep -q '^  PNG (no room in 16 bits)  *-  *-  *-  *-$' table.txt || fail "PNG: $(cat table.txt)"

# Where it lies on a grid of its own it stays there.
printf 'Projection GEOGRAPHIC\nDatum WGS84\nUnits DD\n' >tenths.prj
"$OTWD" bench codec tenths.asc metres.asc --json >two.json 2>>bench.log || fail "two rasters"
grep -c '"as_if_at_equator": true' two.json | grep -qx 1 || fail "the first is placed: $(cat two.json)"
[ "$(grep -c '"bits_per_sample": [0-9]' two.json)" -eq 10 ] || fail "not ten rows: $(cat two.json)"
[ -z "$(find . -name 'otwd-bench*')" ] || fail "something is left"

# expect STATUS TEXT ARGUMENT...: of otwd bench.
expect() {
    expected=$1 text=$2
    shift 2
    "$OTWD" bench "$@" >out.txt 2>error.txt
    status=$?
    [ "$status" -eq "$expected" ] || fail "$*: status $status, not $expected"
    grep -qF -- "$text" error.txt || fail "$*: \"$(cat error.txt)\" has no \"$text\""
}
expect 65 'garbage.tif cannot be read as a raster' codec garbage.tif
expect 66 'absent.tif: No such file' codec absent.tif
expect 64 '--max-eror' codec tenths.asc --max-eror 1
expect 64 'a number from' codec tenths.asc --max-error much
expect 64 'RASTER is missing' codec
expect 64 'there is no subject "codecs"' codecs
expect 64 'codec RASTER' # says what there is
finish
