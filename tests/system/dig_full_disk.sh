#!/bin/sh
# A disk that fills up under a daemon that digs: what does not fit is refused with the reason, what was
# acknowledged stays, drawing goes on, and with room again digging does, too.
# shellcheck disable=SC2317 # functions that wait_for calls
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

port=$(free_port)
modbus=$(free_port)
{
    printf 'ncols 121\nnrows 121\nxllcorner 7.75\nyllcorner 46.35\ncellsize 0.0027777777778\n'
    awk 'BEGIN { for (i = 0; i < 121; i++) { for (j = 0; j < 121; j++) printf "1000 "; print "" } }'
} >flat.asc
"$OTWD" import flat.asc --crs EPSG:4326 -o flat.db -q 2>import.log
case $? in
0) ;;
69)
    echo "skip: no otwd-import"
    exit 77
    ;;
*) fatal "import: $(cat import.log)" ;;
esac
mkdir disk
trap "umount -l disk; end" EXIT
mount -t tmpfs -o size=4m none disk
cp flat.db disk/dug.db
write_flight flight.csv
cat >otwd.yaml <<YAML
display: {width: 160, height: 90, rate_hz: 10}
terrain: {database: disk/dug.db, allow_dig: true}
sources:
  - {name: host, type: native, listen: "127.0.0.1:$port"}
health: {modbus: {listen: "127.0.0.1:$modbus"}}
YAML

fill_disk() {
    dd if=/dev/zero of=disk/filler bs=4k 2>/dev/null
    truncate -s -65536 disk/filler # a few stamps fit
}
# dig METRES: lowers the level ground under the eye by that much.
dig() {
    "$OTWD" dig "udp://127.0.0.1:$port" crater --at 46.51,7.91 --radius-m 900 --depth-m "$1" -q \
        --rim-height-m 0 2>refused.log
}
# dig_until_refused: by a metre each; counts in $acknowledged.
dig_until_refused() {
    tries=0
    while dig 1; do
        acknowledged=$((acknowledged + 1))
        tries=$((tries + 1))
        [ "$tries" -lt 200 ] || fatal "a full disk takes $tries stamps"
    done
    grep -qi 'full\|no space' refused.log || fail "refused with \"$(cat refused.log)\""
}
is_faulty() {
    is code 204
}
is_not_faulty() {
    ! is code 204
}
# The eye is $before above the undug ground.
is_as_deep_as() {
    near height_above_terrain_m "$((before + $1))" 2
}

start_daemon otwd.yaml
start send.log "$OTWD" send flight.csv --to "udp://127.0.0.1:$port" --rate 30
wait_for 8 near lat_deg 46.51 1e-6 || fail "latitude $(field lat_deg)"
sleep 1
before=$(field height_above_terrain_m)
before=${before%.*}
acknowledged=0

dig 1 || fail "with room: $(cat refused.log)"
acknowledged=1
fill_disk
dig_until_refused
echo "$acknowledged stamps fit, then: $(cat refused.log)"
[ "$acknowledged" -ge 2 ] || fail "none of them fits"
wait_for 3 is_faulty || fail "no fault 204, but $(field code)"
logged 'fault=204' || fail "fault 204 is not logged"
frames=$(field frames_rendered)
wait_for 5 at_least frames_rendered "$((frames + 10))" || fail "it does not go on drawing"
wait_for 3 is_as_deep_as "$acknowledged" ||
    fail "$(field height_above_terrain_m) m above, not $before + $acknowledged"

rm disk/filler
dig 100 || fail "with room again: $(cat refused.log)"
wait_for 3 is_not_faulty || fail "fault 204 stays"
wait_for 3 is_as_deep_as "$((acknowledged + 100))" || fail "not seen with room again"

fill_disk
dig_until_refused
depth=$((acknowledged + 100))
acknowledged=$((acknowledged + 1))
kill -KILL "$daemon"
wait "$daemon" 2>/dev/null
for disk in full roomy; do
    [ "$disk" = full ] || rm disk/filler
    "$OTWD" dig disk/dug.db --list --json >list.json 2>list.log || fail "$disk: list: $(cat list.log)"
    [ "$(grep -c '"stamp"' list.json)" -eq "$acknowledged" ] ||
        fail "$disk: $(grep -c '"stamp"' list.json) stamps, not $acknowledged"
    "$OTWD" verify -q disk/dug.db 2>verify.log || fail "$disk: verify: $(cat verify.log)"
    "$OTWD" height disk/dug.db 46.51 7.91 | awk -v m="$((1000 - depth))" \
        '{ d = $1 - m; exit !(d < 1 && d > -1) }' || fail "$disk: the ground is elsewhere"
    start_daemon otwd.yaml
    wait_for 8 is_as_deep_as "$depth" || fail "$disk: after a restart it is as it was"
    [ "$disk" = full ] || dig 200 || fail "after a restart with room: $(cat refused.log)"
    stop_daemon
    [ "$stopped" -eq 0 ] || fail "$disk: the daemon ended with $stopped"
done
finish
