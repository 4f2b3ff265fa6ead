#!/bin/sh
# `otwd dig` on a file: every kind of stamp, its list, its undoing, what is refused, an import on top.
. "$(dirname "$0")/common.sh"

# write_grid FILE COLUMNS ROWS WEST SOUTH CELL EXPRESSION: an ASCII grid; i counts rows, j columns.
write_grid() {
    {
        printf 'ncols %s\nnrows %s\nxllcorner %s\nyllcorner %s\ncellsize %s\n' "$2" "$3" "$4" "$5" "$6"
        awk "BEGIN { for (i = 0; i < $3; i++) { for (j = 0; j < $2; j++) printf \"%g \", $7; print \"\" } }"
    } >"$1"
}

# height LAT LON METRES: within 0.3 m.
height() {
    "$OTWD" height dug.db "$1" "$2" >height.txt || fail "height $1 $2"
    awk -v m="$3" '{ d = $1 - m; exit !(d < 0.3 && d > -0.3) }' height.txt ||
        fail "height $1 $2 is $(cat height.txt), not $3"
}

write_grid flat.asc 121 121 7.9 46.4 0.0027777777778 1000
"$OTWD" import flat.asc --crs EPSG:4326 -o dug.db -q 2>import.log
case $? in
0) ;;
69)
    echo "skip: no otwd-import"
    exit 77
    ;;
*) fatal "import" ;;
esac
cp dug.db undug.db

"$OTWD" dig dug.db crater --at 46.5,8.0 --radius-m 40 --depth-m 12 >crater.log 2>&1 || fail "crater"
grep -q 'stamp 1, crater' crater.log || fail "what was done is not told"
height 46.5 8.0 988
"$OTWD" dig dug.db berm --point 46.51,8.0 --point 46.51,8.01 --height-m 5 -q || fail "berm"
height 46.51 8.005 1005
"$OTWD" dig dug.db flatten --at 46.52,8.02 --length-m 1500 --width-m 40 --heading-deg 90 \
    --start-height-m 1100 --end-height-m 1120 -q || fail "flatten"
height 46.52 8.02 1110
# 1.5 everywhere but on the border, in units of two metres.
write_grid change.asc 40 30 8.05 46.45 0.0001 '(i > 2 && i < 27 && j > 2 && j < 37) ? 1.5 : 0'
"$OTWD" dig dug.db raster change.asc --crs EPSG:4326 --scale 2 -q || fail "raster"
height 46.4515 8.052 1003
"$OTWD" dig dug.db --list >list.txt || fail "list"
listed() {
    grep -qx " *$1" list.txt || fail "list has no \"$1\": $(cat list.txt)"
}
listed "1  crater  *46.5000000  *8.0000000  radius 40 m, rim 20 m wide  *12 m deep, rim 1.2 m high"
listed "2  berm  *46.51000[0-9]*  *8.0050000  767.5 m by 2 points, crest 4 m, slope 0.5  *+5 m"
listed "3  flatten  *46.5200000  *8.0200000  1500 x 40 m, heading 90, blend 30 m  *to 1100 .. 1120 m"
listed "4  raster  *46.4515000  *8.0520000  28 x 31 posts of 11.1 m  *-0.[0-9]* .. +3.[0-9]* m"
"$OTWD" dig dug.db --list --json >list.json || fail "list --json"
for part in "\"kind\": \"raster\"" "\"radius_m\": 40.0" "\"depth_m\": 12.0" "\"rim_width_m\": 20.0" \
    "\"height_m\": 5.0" "\"side_slope\": 0.5" "\"lat_deg\": 46.51" "\"heading_deg\": 90.0" \
    "\"end_height_m\": 1120.0" "\"columns\": 28" "\"highest_m\": 3"; do
    grep -q "$part" list.json || fail "list --json has no $part"
done
"$OTWD" info dug.db | grep -q '^dug .*4 stamps' || fail "info does not tell of it"
"$OTWD" verify -q dug.db || fail "verify"
[ ! -e dug.db-wal ] || fail "a journal is left beside the database"

# What is added to a dug database does not take away what was dug.
write_grid more.asc 121 121 8.3 46.4 0.0027777777778 500
"$OTWD" import more.asc --crs EPSG:4326 -o dug.db -q || fail "an import on top"
height 46.5 8.0 988
height 46.5 8.5 500
"$OTWD" verify -q dug.db || fail "verify after an import"

"$OTWD" dig dug.db --undo 3 -q || fail "undo"
height 46.51 8.005 1000
height 46.52 8.02 1000
height 46.5 8.0 988
"$OTWD" dig dug.db --undo 1 --json | grep -q '"undone": 1' || fail "undo --json"
height 46.5 8.0 1000

# refused STATUS TEXT ARGUMENT...
refused() {
    expected=$1 text=$2
    shift 2
    "$OTWD" dig "$@" 2>refused.log
    status=$?
    [ "$status" -eq "$expected" ] || fail "dig $*: status $status, not $expected"
    grep -qF -- "$text" refused.log || fail "dig $*: \"$(cat refused.log)\" has no \"$text\""
}
refused 64 'needs --depth-m' dug.db crater --at 46.5,8 --radius-m 40
refused 64 'LAT,LON' dug.db crater --at 46.5 --radius-m 40 --depth-m 3
refused 64 'the radius' dug.db crater --at 46.5,8 --radius-m 10500 --depth-m 3
refused 64 'no stamp' dug.db volcano --at 46.5,8
refused 64 '--list, or --undo' dug.db
refused 64 'has 0 stamps' dug.db --undo 1
refused 66 'none.db' none.db crater --at 46.5,8 --radius-m 40 --depth-m 3
refused 65 'change.asc' change.asc crater --at 46.5,8 --radius-m 40 --depth-m 3
refused 66 'none.asc' dug.db raster none.asc
refused 64 'a stamp reaches' dug.db raster more.asc --crs EPSG:4326
refused 69 'does not answer' "udp://127.0.0.1:$(free_port)" --undo 1
finish
