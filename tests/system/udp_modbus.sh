#!/bin/sh
# A flight over UDP, read back over Modbus by a stranger's tool and by our own.
. "$(dirname "$0")/common.sh"
need mbpoll

port=$(free_port)
modbus=$(free_port)
write_flight flight.csv
cat >otwd.yaml <<YAML
display: {width: 160, height: 90, rate_hz: 5}
sources:
  - {name: host, type: native, listen: "127.0.0.1:$port"}
health: {modbus: {listen: "127.0.0.1:$modbus"}}
YAML

# poll ARGUMENT...: the values, one a line.
poll() {
    mbpoll -m tcp -p "$modbus" -a 1 -0 -1 "$@" 127.0.0.1 |
        sed -n 's/^\[[0-9]*\]:[ \t]*\(-\{0,1\}[0-9]*\).*/\1/p'
}

# state_is NUMBER: the state register, which leaves 1 for a second when a busy machine is late.
# shellcheck disable=SC2317 # wait_for calls it
state_is() {
    [ "$(poll -t 3 -r 1)" = "$1" ]
}

# at_least_us REGISTER VALUE
# shellcheck disable=SC2317 # wait_for calls it
at_least_us() {
    [ "$(poll -t 3:int -B -r "$1")" -ge "$2" ]
}

start_daemon otwd.yaml
wait_for 5 is code 101 || fail "before any pose the fault is $(field code), not 101"
is state stale || is state "pose stale" || [ "$(poll -t 3 -r 1)" = 3 ] ||
    fail "before any pose the state is $(field state)"

start send.log "$OTWD" send flight.csv --to "udp://127.0.0.1:$port" --rate 30
wait_for 8 near lat_deg 46.51 1e-6 || fail "latitude $(field lat_deg)"
wait_for 8 is state running || fail "state $(field state), fault $(field code)"
near lon_deg 7.91 1e-5 || fail "longitude $(field lon_deg)"
near height_m 4000 0.02 || fail "height $(field height_m)"
near heading_deg 90 0.02 || fail "heading $(field heading_deg)"
is source 1 || fail "active source $(field source)"
is rejected 0 || fail "rejected $(field rejected)"
is lost 0 || fail "lost $(field lost)"
at_least accepted 20 || fail "accepted $(field accepted)"

# the same by mbpoll: latitude, longitude in 1e-7 degrees, height in cm; state; active source
position=$(poll -t 3:int -B -r 32 -c 3 | tr '\n' ' ')
echo "mbpoll: $position"
echo "$position" | awk '
    function off(a, b) { return a > b ? a - b : b - a }
    { exit !(NF == 3 && off($1, 465100000) <= 100 && off($2, 79100000) <= 100 && off($3, 400000) <= 2) }' ||
    fail "mbpoll reads $position"
wait_for 8 state_is 1 || fail "state register $(poll -t 3 -r 1)"
[ "$(poll -t 3 -r 15)" = 1 ] || fail "active source register $(poll -t 3 -r 15)"
frames=$(poll -t 3:int -B -r 2)
wait_for 10 at_least frames_rendered $((frames + 20)) || fail "the frame counter stands at $frames"
# transport delay: registers 48 to 51, and the same by name
wait_for 5 at_least_us 48 1000 || fail "transport delay p50 $(poll -t 3:int -B -r 48) us"
[ "$(poll -t 3:int -B -r 50)" -ge "$(poll -t 3:int -B -r 48)" ] || fail "transport delay p99 is below p50"
status | awk '/"latency_ms"/ { on = 1 } on && /"p50"/ { gsub(",", ""); exit !($2 > 0 && $2 < 5000) }' ||
    fail "the latency is not told: $(status)"
[ "$(poll -t 1 -r 1)" = 1 ] || fail "the discrete input says that the pose is not valid"

# silence
kill "$started"
wait_for 5 is code 102 || fail "after the host has gone the fault is $(field code), not 102"
wait_for 3 state_is 3 || fail "after the host has gone the state is $(poll -t 3 -r 1)"
near lat_deg 46.51 1e-5 || fail "the last pose is not held: $(field lat_deg)"
finish
