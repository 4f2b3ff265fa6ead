#!/bin/sh
# A scripted CIGI host holds the synchronous handshake for 10 000 frames: each Start of Frame is answered,
# each frame shows the host's frame, each next Start of Frame echoes it. As fast as it goes.
. "$(dirname "$0")/common.sh"

port=$(free_port)
reply=$(free_port)
modbus=$(free_port)
frames=$(rounds 10000 1000)
cat >flight.csv <<FLIGHT
# altitude: ellipsoid
time_s,lat_deg,lon_deg,alt_m,roll_deg,pitch_deg,heading_deg
0,46.50,7.90,3900,0,0,90
$((frames / 60 + 1)),46.50,8.10,4000,0,0,90
FLIGHT
cat >otwd.yaml <<YAML
display: {width: 64, height: 36, rate_hz: 1000}
terrain: {pixel_error: 8}
sources:
  - {name: host, type: cigi, listen: "127.0.0.1:$port", reply: "127.0.0.1:$reply",
     sync_wait_ms: 1000, timeout_ms: 5000}
health: {modbus: {listen: "127.0.0.1:$modbus"}}
YAML
start_daemon otwd.yaml
"$OTWD" send flight.csv --protocol cigi3 --sync --database 1 --to "udp://127.0.0.1:$port" \
    --listen "127.0.0.1:$reply" >send.log || fail "the host fails"
cat send.log
grep -q " 0 refused; .* 0 gaps in their numbers, 0 refused, 0 not in step" send.log ||
    fail "the handshake is not held"
awk -v frames="$frames" '{ exit !($1 >= frames) }' send.log || fail "less than $frames frames"
is rejected 0 || fail "rejected $(field rejected)"
is lost 0 || fail "lost $(field lost)"
at_least accepted "$frames" || fail "accepted $(field accepted)"
near lon_deg 8.10 1e-4 || fail "the last frame is not shown: longitude $(field lon_deg)"
logged "the host wants database 1, which is drawn" || fail "no database was asked for"
# a host of another version than is spoken until it has spoken
cat >short.csv <<'FLIGHT'
# altitude: ellipsoid
time_s,lat_deg,lon_deg,alt_m,roll_deg,pitch_deg,heading_deg
0,46.60,7.90,3900,0,0,90
1,46.60,7.90,4000,0,0,90
FLIGHT
stop_daemon
start_daemon otwd.yaml
"$OTWD" send short.csv --protocol cigi4 --sync --to "udp://127.0.0.1:$port" \
    --listen "127.0.0.1:$reply" >send.log || fail "the host of 4.0 fails"
cat send.log
grep -q " 0 gaps in their numbers, [0-9]* refused, 0 not in step" send.log || fail "4.0 is not held"
awk '{ exit !($1 >= 60) }' send.log || fail "less than 60 frames of 4.0"
# a host that hangs: the picture goes on without it, and is in step again when it is back
stop_daemon
sed -i 's/rate_hz: 1000/rate_hz: 20/; s/wait_ms: 1000/wait_ms: 20/; s/out_ms: 5000/out_ms: 500/' otwd.yaml
start_daemon otwd.yaml
start hang.log "$OTWD" send flight.csv --protocol cigi3 --sync --to "udp://127.0.0.1:$port" \
    --listen "127.0.0.1:$reply"
wait_for 5 is source 1 || fail "the host does not drive"
kill -STOP "$started"
wait_for 5 is code 102 || fail "the host's silence is not told: $(field code)"
frames=$(field frames_rendered)
wait_for 5 at_least frames_rendered $((frames + 30)) || fail "the picture waits for a host that hangs"
kill -CONT "$started"
wait_for 5 is source 1 || fail "the host does not drive again"
kill "$started"
finish
