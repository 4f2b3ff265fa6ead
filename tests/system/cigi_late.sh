#!/bin/sh
# A CIGI host in synchronous operation that is late, or answers a frame before: no frame is started by what
# answers another one, none waits longer than it may, and once the host is in step its frames are shown.
. "$(dirname "$0")/common.sh"

port=$(free_port)
reply=$(free_port)
modbus=$(free_port)
cat >otwd.yaml <<YAML
display: {width: 64, height: 36, rate_hz: 5}
terrain: {pixel_error: 8}
sources:
  - {name: host, type: cigi, listen: "127.0.0.1:$port", reply: "127.0.0.1:$reply",
     sync_wait_ms: 150, timeout_ms: 5000}
health: {modbus: {listen: "127.0.0.1:$modbus"}}
YAML
start_daemon otwd.yaml
start late.log "$SYSTEM_TOOL" cigi-late "$port" "$reply"
host=$started
wait_for 10 grep -q decoys late.log || fail "the host is not in step"
# what answers an older frame comes first in each, with a place of its own
while ! grep -q behind late.log; do
    near lat_deg 46.5 1e-3 || fail "a frame shows what answers another one: latitude $(field lat_deg)"
    kill -0 "$host" 2>/dev/null || break
    sleep 0.05
done
wait "$host" || fail "the host fails"
cat late.log
grep -q "^0 gaps" late.log || fail "Starts of Frame are missing"
wait_for 2 near lat_deg 46.7 1e-3 || fail "the last frame is not shown: latitude $(field lat_deg)"
is rejected 0 || fail "rejected $(field rejected)"
is lost 0 || fail "lost $(field lost)"
stop_daemon
# decoys, and those behind; one that is late may be on a busy machine
behind=$(sed -n 's/.* messages lost, \([0-9]*\) behind.*/\1/p' otwd.log | tail -n 1)
[ "${behind:-0}" -ge 12 ] || fail "those that are behind are not counted: ${behind:-none}"
finish
