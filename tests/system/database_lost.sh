#!/bin/sh
# A terrain database that is moved away, cut short and overwritten under the daemon that draws it: it draws
# on, counts what it cannot read (fault 201) and draws the parents instead. With the file's bytes back,
# other tiles are read again and the fault is over.
# shellcheck disable=SC2317 # functions that wait_for calls
. "$(dirname "$0")/common.sh"

port=$(free_port)
modbus=$(free_port)
# Five places of rough ground, so far from each other that none is read ahead: $1 degrees east.
rough() {
    awk -v west="$1" 'BEGIN {
        print "ncols 181\nnrows 181\nxllcorner " west "\nyllcorner 46\ncellsize 0.0027777777778"
        for (i = 0; i < 181; i++) {
            for (j = 0; j < 181; j++) {
                seed = (seed * 69069 + 12345) % 1048576
                printf "%d ", 900 + 300 * sin(i / 17) * cos(j / 13) + seed % 257
            }
            print ""
        }
    }' >"place$1.asc"
}
for west in 0 15 30 45 60; do rough $west; done
"$OTWD" import place*.asc --crs EPSG:4326 -o rough.db -q 2>import.log
case $? in
0) ;;
69)
    echo "skip: no otwd-import"
    exit 77
    ;;
*) fatal "import: $(cat import.log)" ;;
esac
size=$(wc -c <rough.db)
cp rough.db good.db
cat >otwd.yaml <<YAML
display: {width: 160, height: 90, rate_hz: 10}
terrain: {database: rough.db, cache_mib: 16}
channel: {offset: {pitch_deg: -60}}
sources:
  - {name: host, type: native, listen: "127.0.0.1:$port"}
health: {modbus: {listen: "127.0.0.1:$modbus"}}
YAML

# at LON: the aircraft is over that place, and its terrain has come or is given up.
at() {
    [ -z "${host:-}" ] || kill "$host" 2>/dev/null
    {
        echo '# altitude: ellipsoid'
        echo time_s,lat_deg,lon_deg,alt_m,roll_deg,pitch_deg,heading_deg
        echo "0,46.25,$1,1900,0,0,90"
        echo "600,46.25,$1,1900,0,0,90"
    } >flight.csv
    start send.log "$OTWD" send flight.csv --to "udp://127.0.0.1:$port" --rate 20
    host=$started
    wait_for 20 near lon_deg "$1" 1e-6 || fatal "the aircraft does not come to $1: $(field lon_deg)"
    frames=$(field frames_rendered)
    wait_for 20 at_least frames_rendered $((frames + 10)) || fatal "at $1: no more frames"
    wait_for 20 is tiles_pending 0 || fail "at $1: $(field tiles_pending) tiles are awaited for ever"
    near height_above_terrain_m 1000 700 ||
        fail "at $1: the ground is $(field height_above_terrain_m) m below"
}
# told TEXT: how often it was logged.
told() {
    grep -cF -- "$1" otwd.log
}
raised='terrain tiles could not be read fault=201'
over='TERRAIN_READ_ERROR is over'
fault_is_over() {
    [ "$(told "$over")" -eq "$1" ]
}

start_daemon otwd.yaml
at 0.25
is read_errors 0 || fail "$(field read_errors) errors of a sound database"

# Moved away, and removed: who has it open reads on.
mv rough.db elsewhere.db
at 15.25
is read_errors 0 || fail "moved away: $(field read_errors) errors"
mv elsewhere.db rough.db

# Cut short.
truncate -s $((size / 3)) rough.db
at 30.25
wait_for 10 at_least read_errors 1 || fail "cut short: no error is counted"
wait_for 10 logged "$raised" || fail "cut short: no fault"
cut=$(field read_errors)
cat good.db >rough.db
wait_for 20 fault_is_over 1 || fail "cut short: the fault does not end"
at 45.25
is read_errors "$cut" || fail "whole again, and still $(field read_errors) errors, not $cut"

# Rotten: all but the first pages, and the file is as long as it was.
head -c $((size - size / 4)) /dev/urandom | dd of=rough.db bs=4096 seek=2 conv=notrunc 2>/dev/null
truncate -s "$size" rough.db
at 60.25
wait_for 10 at_least read_errors $((cut + 1)) || fail "rotten: no error is counted"
[ "$(told "$raised")" -ge 2 ] || fail "rotten: no fault"
cat good.db >rough.db
wait_for 20 fault_is_over 2 || fail "rotten: the fault does not end"
echo "$cut tiles of a file that was cut short, $(($(field read_errors) - cut)) of a rotten one"
stop_daemon
[ "$stopped" -eq 0 ] || fail "the daemon ended with $stopped"
finish
