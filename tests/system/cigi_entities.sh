#!/bin/sh
# A host's second entity is seen while it is there, and so is its orthographic view. At night the
# picture to the south does not change by itself.
# shellcheck disable=SC2317 # functions that wait_for calls
. "$(dirname "$0")/common.sh"
need mbpoll

port=$(free_port)
reply=$(free_port)
modbus=$(free_port)
cat >otwd.yaml <<YAML
display: {width: 160, height: 90, rate_hz: 10}
terrain: {pixel_error_most: 1} # as fine however long it takes: coarser terrain would be another picture
sources:
  - {name: host, type: cigi, listen: "127.0.0.1:$port", reply: "127.0.0.1:$reply", timeout_ms: 60000}
entities:
  - {type: 20, shape: vehicle, length_m: 60}
environment: {time_utc: "2024-06-21T00:00:00Z"}
health: {modbus: {listen: "127.0.0.1:$modbus", allow_control: true}}
record: {directory: $scratch/record}
YAML
start_daemon otwd.yaml

send() {
    frames=$(field frames_rendered)
    "$SYSTEM_TOOL" cigi "$port" "$1" || fail "$1: not sent"
    wait_for 10 at_least frames_rendered $((frames + 5)) || fail "$1: no frames"
}
taken=0
# snapshot NAME
snapshot() {
    taken=$((taken + 1))
    mbpoll -m tcp -p "$modbus" -a 1 -0 -1 -t 0 -r 1 127.0.0.1 1 >>mbpoll.log 2>&1 || fail "snapshot"
    wait_for 5 has_pictures "$taken" || fatal "no picture $1"
    sleep 1.1 # it is written by then, and the next is not refused
    # shellcheck disable=SC2012 # names are ours
    cp "$(ls record/frame-*.png | tail -n 1)" "$1.png"
}
has_pictures() {
    # shellcheck disable=SC2012 # names are ours
    [ "$(ls record/frame-*.png | wc -l)" -ge "$1" ]
}

send south
wait_for 5 near heading_deg 180 1e-3 || fail "heading $(field heading_deg)"
wait_for 15 is state running || wait_for 5 is code 302 || fail "state $(field state)"
send south # the same once more
snapshot alone
for _ in 1 2 3 4 5 6; do # until the terrain is all there
    mv alone.png before.png
    snapshot alone
    cmp -s before.png alone.png && break
done
cmp before.png alone.png || fail "nothing moves, and the picture changes"
send other
snapshot other
cmp -s alone.png other.png && fail "the second entity is not seen"
send gone
snapshot gone
cmp alone.png gone.png || fail "the second entity is gone, and the picture is another"

# an orthographic view from above, and back
send parallel
send down
snapshot parallel
cmp -s parallel.png gone.png && fail "an orthographic view is not drawn"
send perspective
snapshot down
cmp -s parallel.png down.png && fail "the projection does not change"
grep "view 0:" otwd.log && fail "a view is refused"
stop_daemon
[ "$stopped" -eq 0 ] || fail "status $stopped"
finish
