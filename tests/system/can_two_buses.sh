#!/bin/sh
# One aircraft on two CAN buses: the better one drives while it lives, the other one when it falls silent.
. "$(dirname "$0")/common.sh"

modbus=$(free_port)
write_flight right.csv
sed 's/46\.5/10.5/' right.csv >left.csv
cat >otwd.yaml <<YAML
display: {width: 160, height: 90, rate_hz: 20}
sources:
  - {name: left, type: canaerospace, interface: "sim:$scratch/can0", timeout_ms: 400}
  - {name: right, type: canaerospace, interface: "sim:$scratch/can1", timeout_ms: 400}
health: {modbus: {listen: "127.0.0.1:$modbus"}}
YAML
start_daemon otwd.yaml

# fly SIDE BUS
fly() {
    start "$1.log" "$OTWD" send "$1.csv" --to "sim:$scratch/$2" --rate 40
}
fly right can1
wait_for 5 is source 2 || fail "the right bus alone does not drive: $(field source)"
wait_for 5 near lat_deg 46.51 1e-5 || fail "latitude $(field lat_deg), not the right bus's"
fly left can0
wait_for 5 is source 1 || fail "the left bus does not drive: $(field source)"
wait_for 5 near lat_deg 10.51 1e-5 || fail "latitude $(field lat_deg), not the left bus's"
kill "$started"
wait_for 5 is source 2 || fail "the right bus does not take over: $(field source)"
wait_for 5 near lat_deg 46.51 1e-5 || fail "latitude $(field lat_deg), not the right bus's"
logged "right drives, before it left" || fail "the log does not tell of the switch"
fly left can0
wait_for 5 is source 1 || fail "the left bus is not taken back: $(field source)"
is rejected 0 || fail "rejected $(field rejected)"
status | grep -q '"state": "active"' || fail "the CAN state is not active"
finish
