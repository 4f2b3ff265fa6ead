#!/bin/sh
# CANaerospace over the simulated bus.
. "$(dirname "$0")/common.sh"

modbus=$(free_port)
write_flight flight.csv
cat >otwd.yaml <<YAML
display: {width: 160, height: 90, rate_hz: 5}
sources:
  - {name: bus, type: canaerospace, interface: "sim:$scratch/bus", altitude: ellipsoid}
health: {modbus: {listen: "127.0.0.1:$modbus"}}
YAML
start_daemon otwd.yaml
start send.log "$OTWD" send flight.csv --to "sim:$scratch/bus" --rate 30
# CANaerospace has its latitude and longitude in 1e-7 degrees, its altitude as a 32-bit float.
wait_for 8 near lat_deg 46.51 1e-6 || fail "latitude $(field lat_deg)"
wait_for 8 is state running || fail "state $(field state), fault $(field code)"
near lon_deg 7.91 1e-5 || fail "longitude $(field lon_deg)"
near heading_deg 90 0.02 || fail "heading $(field heading_deg)"
is source 1 || fail "active source $(field source)"
is rejected 0 || fail "rejected $(field rejected)"
at_least frames 100 || fail "CAN frames $(field frames)"
status | grep -q '"state": "active"' || fail "the CAN state is not active"
finish
