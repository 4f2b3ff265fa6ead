#!/bin/sh
# Transport delay in synchronous operation at 60 Hz: from a message's receive stamp to the finished frame,
# half of them take at most 1.5 frames. A busy machine has worse seconds; one of twenty has to be so.
# shellcheck disable=SC2317 # functions that wait_for calls
. "$(dirname "$0")/common.sh"

port=$(free_port)
reply=$(free_port)
modbus=$(free_port)
cat >flight.csv <<'FLIGHT'
# altitude: ellipsoid
time_s,lat_deg,lon_deg,alt_m,roll_deg,pitch_deg,heading_deg
0,46.50,7.90,3900,0,0,90
60,46.50,7.98,4000,0,0,90
FLIGHT
cat >otwd.yaml <<YAML
display: {width: 64, height: 36, rate_hz: 60}
terrain: {pixel_error: 8}
sources:
  - {name: host, type: cigi, listen: "127.0.0.1:$port", reply: "127.0.0.1:$reply",
     sync_wait_ms: 8, timeout_ms: 2000}
health: {modbus: {listen: "127.0.0.1:$modbus"}}
YAML
start_daemon otwd.yaml
start send.log "$OTWD" send flight.csv --protocol cigi3 --sync --to "udp://127.0.0.1:$port" \
    --listen "127.0.0.1:$reply"
wait_for 5 is source 1 || fatal "the host does not drive"

# median: of the last second, ms
median() {
    status | sed -n '/"latency_ms"/,/}/s/^ *"p50": \([0-9.]*\).*/\1/p'
}
is_short() {
    awk -v ms="$(median)" 'BEGIN { exit !(ms > 0 && ms <= 25) }'
}
wait_for 20 is_short || fail "transport delay of $(median) ms"
status | grep -A 4 latency_ms
near lat_deg 46.50 1e-3 || fail "latitude $(field lat_deg)"
finish
