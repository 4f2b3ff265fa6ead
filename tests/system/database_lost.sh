#!/bin/sh
# A terrain database that is moved away, cut short and overwritten under the daemon that draws it: it draws
# on, counts what it cannot read (fault 201) and draws the parents instead. With the file's bytes back it
# reads again what it could not, where it stands: the ground and the picture are those of a sound file.
# shellcheck disable=SC2317 # functions that wait_for calls
. "$(dirname "$0")/common.sh"
need mbpoll

port=$(free_port)
modbus=$(free_port)
# Four places of rough ground, so far from each other that none is read with another, neither ahead nor in
# the same pages of the file: $1 degrees east, 46 to 52 degrees north.
south_of() {
    echo $((46 + ${1%.*} * 2 / 15))
}
rough() {
    awk -v west="$1" -v south="$(south_of "$1")" 'BEGIN {
        print "ncols 361\nnrows 361\nxllcorner " west "\nyllcorner " south "\ncellsize 0.0027777777778"
        for (i = 0; i < 361; i++) {
            for (j = 0; j < 361; j++) {
                seed = (seed * 69069 + 12345) % 1048576
                printf "%d ", 900 + 300 * sin(i / 17) * cos(j / 13) + int(seed / 4096)
            }
            print ""
        }
    }' >"place$1.asc"
}
for west in 0 15 30 45; do rough $west; done
"$OTWD" import place*.asc --crs EPSG:4326 --max-error 0 -o rough.db -q 2>import.log
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
terrain: {database: rough.db, cache_mib: 16, pixel_error: 4, pixel_error_most: 4}
environment: {time_utc: "2024-06-21T12:00:00Z"}
channel: {offset: {pitch_deg: -60}}
sources:
  - {name: host, type: native, listen: "127.0.0.1:$port"}
health: {modbus: {listen: "127.0.0.1:$modbus", allow_control: true}}
record: {directory: $scratch/record}
YAML

# at LON: the aircraft is over that place, and its terrain has come or is given up.
at() {
    [ -z "${host:-}" ] || kill "$host" 2>/dev/null
    {
        echo '# altitude: ellipsoid'
        echo time_s,lat_deg,lon_deg,alt_m,roll_deg,pitch_deg,heading_deg
        echo "0,$(south_of "$1").5,$1,1900,0,0,90"
        echo "600,$(south_of "$1").5,$1,1900,0,0,90"
    } >flight.csv
    start send.log "$OTWD" send flight.csv --to "udp://127.0.0.1:$port" --rate 20
    host=$started
    wait_for 20 near lon_deg "$1" 1e-6 || fatal "the aircraft does not come to $1: $(field lon_deg)"
    frames=$(field frames_rendered)
    wait_for 20 at_least frames_rendered $((frames + 5)) || fatal "at $1: no more frames"
    wait_for 20 has_settled || fail "at $1: $(field tiles_pending) tiles are awaited for ever"
}
has_settled() {
    is tiles_pending 0 && is complete true
}
told() {
    grep -cF -- "$1" otwd.log
}
raised='terrain tiles could not be read'
has_been_told() {
    [ "$(told "$1")" -ge "$2" ]
}

# snapshot NAME
snapshot() {
    rm -f record/*.png
    sleep 1.1 # there is one a second at most
    mbpoll -m tcp -p "$modbus" -a 1 -0 -1 -t 0 -r 1 127.0.0.1 0 >>mbpoll.log 2>&1
    mbpoll -m tcp -p "$modbus" -a 1 -0 -1 -t 0 -r 1 127.0.0.1 1 >>mbpoll.log 2>&1 || fail "snapshot"
    wait_for 10 has_picture || fail "no picture $1"
    mv record/*.png "$1"
}
# The ground under the aircraft is what a sound file has there.
is_true_ground() {
    truth=$(awk -v h="$("$OTWD" height --datum=ellipsoid good.db "$(south_of "$1").5" "$1")" \
        'BEGIN { print 1900 - h }')
    near height_above_terrain_m "$truth" 0.5
}
# has_detail_of FILE: the picture is that one. The sun goes on, which changes shades a little; coarser heights
# move edges and turn slopes.
has_detail_of() {
    snapshot now.png
    differing=$("$SYSTEM_TOOL" picture-differs now.png "$1" 4) || fatal "no pictures to compare"
    echo "$1: $differing of 10000 pixels differ"
    [ "$differing" -le 20 ]
}

# The pictures of a sound file.
start_daemon otwd.yaml
for lon in 30.5 45.5; do
    at $lon
    is_true_ground $lon || fail "at $lon: the ground is $(field height_above_terrain_m) m below"
    snapshot sound$lon.png
done
stop_daemon

start_daemon otwd.yaml
at 0.5
# Moved away, and removed: who has it open reads on.
mv rough.db elsewhere.db
at 15.5
is_true_ground 15.5 || fail "moved away: the ground is $(field height_above_terrain_m) m below"
is read_errors 0 || fail "moved away: $(field read_errors) errors"
mv elsewhere.db rough.db

# fails_at LON WHAT TIMES: the file is broken; then its bytes are back.
fails_at() {
    before=$(field read_errors)
    at "$1"
    wait_for 10 at_least read_errors $((before + 1)) || fail "$2: no error is counted"
    wait_for 10 has_been_told "$raised" "$3" || fail "$2: no fault"
    has_detail_of "sound$1.png" && fail "$2: the picture is no coarser"
    # A file that stays broken is not read without a pause.
    before=$(field read_errors)
    sleep 2
    rise=$(($(field read_errors) - before))
    [ "$rise" -le 24 ] || fail "$2: $rise errors in two seconds of standing still"
    cat good.db >rough.db
    wait_for 30 is_true_ground "$1" ||
        fail "$2, and whole again: the ground is $(field height_above_terrain_m)"
    pictures=0
    until has_detail_of "sound$1.png" || [ "$pictures" -eq 8 ]; do
        pictures=$((pictures + 1))
    done
    [ "$pictures" -lt 8 ] || fail "$2, and whole again: the picture is coarser than before"
}
truncate -s $((size / 3)) rough.db
fails_at 30.5 "cut short" 1
errors=$(field read_errors)
wait_for 30 has_been_told 'TERRAIN_READ_ERROR is over' 1 || fail "cut short: the fault does not end"
is read_errors "$errors" || fail "whole again, and still $(field read_errors) errors, not $errors"

# Rotten: all but the first pages, and the file is as long as it was.
head -c "$size" /dev/urandom | dd of=rough.db bs=4096 seek=2 conv=notrunc 2>/dev/null
truncate -s "$size" rough.db
fails_at 45.5 rotten 2
rotten=$(($(field read_errors) - errors))
echo "$errors readings of a file that was cut short failed, $rotten of a rotten one"
stop_daemon
[ "$stopped" -eq 0 ] || fail "the daemon ended with $stopped"
finish
