#!/bin/sh
# With --quiet every command says nothing where nothing is wrong, --json excepted; with --verbose it says
# at last, on standard error, what it took.
. "$(dirname "$0")/common.sh"

{
    printf 'ncols 60\nnrows 60\nxllcorner 7.9\nyllcorner 46.4\ncellsize 0.01\n'
    awk 'BEGIN { for (i = 0; i < 60; i++) { for (j = 0; j < 60; j++) printf "%d ", 1234 + i; print "" } }'
} >flat.asc
printf 'display: {width: 64, height: 36}\n' >good.yaml
cat >short.csv <<'END'
# altitude: ellipsoid
time_s,lat_deg,lon_deg,alt_m,roll_deg,pitch_deg,heading_deg
0,46.7,8.1,3000,0,0,0
0.2,46.7001,8.1,3000,0,0,0
END

# try COMMAND...: with --$option.
try() {
    "$OTWD" "$@" "--$option" >said.out 2>said.txt || fail "$*: status $?"
    if [ "$option" = verbose ]; then
        tail -n 1 said.txt | grep -q '^otwd: [0-9.]* s, [0-9.]* s of processor time, at most [0-9]* MiB' ||
            fail "$*: --verbose says not what it took but \"$(tail -n 1 said.txt)\""
    elif [ -s said.out ] || [ -s said.txt ]; then
        fail "$*: --quiet says \"$(cat said.out said.txt)\""
    fi
}
"$OTWD" import flat.asc --crs EPSG:4326 -o first.db >import.log 2>&1
[ $? -ne 69 ] || {
    echo "skip: no otwd-import"
    exit 77
}
for option in quiet verbose; do
    rm -f shard.db made.db merged.db
    try import flat.asc --crs EPSG:4326 --shard 1/1 -o shard.db
    try import flat.asc --crs EPSG:4326 -o made.db
    try merge merged.db shard.db
    try info made.db
    try verify made.db
    try verify made.db --against flat.asc --crs EPSG:4326
    try dig made.db crater --at 46.7,8.1 --radius-m 20 --depth-m 3
    try check-config good.yaml
    try bench codec flat.asc
    try bench motion --duration 10 --protocol native
    try replay short.csv --terrain made.db --size 64x36 --speed max
done
for arguments in 'info first.db' 'verify first.db' 'height first.db 46.7 8.1'; do
    # shellcheck disable=SC2086
    "$OTWD" $arguments --quiet --json >said.json || fail "$arguments: status $?"
    [ -s said.json ] || fail "$arguments: no JSON with --quiet"
done
"$OTWD" info none.db --quiet 2>said.txt && fail "a database that is not there is no error"
[ -s said.txt ] || fail "--quiet hides what is wrong"
finish
