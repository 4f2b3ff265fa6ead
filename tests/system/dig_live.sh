#!/bin/sh
# Digging while the daemon draws: seen at once, acknowledged when it lasts, refused where it cannot.
# shellcheck disable=SC2317 # functions that wait_for calls
. "$(dirname "$0")/common.sh"
need mbpoll

port=$(free_port)
modbus=$(free_port)
{
    printf 'ncols 121\nnrows 121\nxllcorner 7.75\nyllcorner 46.35\ncellsize 0.0027777777778\n'
    awk 'BEGIN { for (i = 0; i < 121; i++) { for (j = 0; j < 121; j++) printf "1000 "; print "" } }'
} >flat.asc
"$OTWD" import flat.asc --crs EPSG:4326 -o dug.db -q 2>import.log
case $? in
0) ;;
69)
    echo "skip: no otwd-import"
    exit 77
    ;;
*) fatal "import" ;;
esac
cp dug.db other.db
write_flight flight.csv
cat >otwd.yaml <<YAML
display: {width: 320, height: 180, rate_hz: 10}
terrain: {database: dug.db, allow_dig: true}
channel: {offset: {pitch_deg: -60}}
sources:
  - {name: host, type: native, listen: "127.0.0.1:$port"}
health: {modbus: {listen: "127.0.0.1:$modbus", allow_control: true}}
record: {directory: $scratch/record}
YAML
url=udp://127.0.0.1:$port

# snapshot NUMBER: waits until there are so many.
snapshot() {
    mbpoll -m tcp -p "$modbus" -a 1 -0 -1 -t 0 -r 0 127.0.0.1 1 >>mbpoll.log 2>&1 # it stays as it is
    mbpoll -m tcp -p "$modbus" -a 1 -0 -1 -t 0 -r 1 127.0.0.1 1 >>mbpoll.log 2>&1 || fail "snapshot"
    wait_for 5 has_pictures "$1" || fail "no picture $1"
    mbpoll -m tcp -p "$modbus" -a 1 -0 -1 -t 0 -r 0 127.0.0.1 0 >>mbpoll.log 2>&1
}
has_pictures() {
    # shellcheck disable=SC2012 # names are ours
    [ "$(ls record/frame-*.png | wc -l)" -ge "$1" ]
}
above() {
    near height_above_terrain_m "$1" 2
}

start_daemon otwd.yaml
start send.log "$OTWD" send flight.csv --to "$url" --rate 30
host=$started
wait_for 8 near lat_deg 46.51 1e-6 || fail "latitude $(field lat_deg)"
wait_for 8 is state running || wait_for 8 is code 302 || fail "state $(field state)"
sleep 1
before=$(field height_above_terrain_m)
snapshot 1

"$OTWD" dig "$url" crater --at 46.51,7.91 --radius-m 900 --depth-m 300 >first.txt 2>&1 ||
    fail "a stamp is not acknowledged: $(cat first.txt)"
grep -q 'stamp 1, crater' first.txt || fail "it says $(cat first.txt)"
wait_for 2 above "$((${before%.*} + 300))" ||
    fail "the ground under the eye is $(field height_above_terrain_m) below, not $before + 300"
sleep 1
snapshot 2
# shellcheck disable=SC2012,SC2046 # names are ours
cmp -s $(ls record/frame-*.png | head -n 2) && fail "the crater is not in the picture"
"$OTWD" height dug.db 46.51 7.91 | grep -q '^70[01]' || fail "another program does not see it"

"$OTWD" dig "$url" --undo 1 -q || fail "undo"
wait_for 2 above "${before%.*}" || fail "undone, and the ground is $(field height_above_terrain_m) below"
"$OTWD" dig "$url" --undo 1 2>refused.log && fail "more is undone than there is"
grep -q 'has 0 stamps' refused.log || fail "refused with $(cat refused.log)"
# A strip that is there when the answer is, whatever comes next.
"$OTWD" dig "$url" flatten --at 46.51,7.91 --length-m 3000 --width-m 2000 --start-height-m 400 -q ||
    fail "a strip is not acknowledged"
kill -KILL "$daemon"
wait "$daemon" 2>/dev/null
"$OTWD" height dug.db 46.51 7.91 | grep -q '^400' || fail "lost: $("$OTWD" height dug.db 46.51 7.91)"
"$OTWD" verify -q dug.db || fail "verify after SIGKILL"

start_daemon otwd.yaml
wait_for 8 above "$((${before%.*} + 600))" || fail "after a restart the ground is as it was"
mv other.db dug.db
"$OTWD" dig "$url" crater --at 46.51,7.91 --radius-m 900 --depth-m 300 2>refused.log &&
    fail "a database that is gone is dug in"
grep -q 'another file' refused.log || fail "refused with $(cat refused.log)"
logged 'fault=204' || fail "no fault 204"
wait_for 5 at_least frames_rendered 20 || fail "it does not go on drawing"
stop_daemon
[ "$stopped" -eq 0 ] || fail "the daemon ended with $stopped"

sed -i 's/, allow_dig: true//' otwd.yaml
start_daemon otwd.yaml
"$OTWD" dig "$url" --undo 1 2>refused.log && fail "digging is allowed by default"
grep -q 'not allowed' refused.log || fail "refused with $(cat refused.log)"
kill "$host"
finish
