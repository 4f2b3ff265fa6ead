#!/bin/sh
# A flight in each protocol over UDP, as `otwd send` sends it.
. "$(dirname "$0")/common.sh"

modbus=$(free_port)
flightgear=$(free_port)
xplane=$(free_port)
dis=$(free_port)
write_flight flight.csv
cat >otwd.yaml <<YAML
display: {width: 160, height: 90, rate_hz: 10}
sources:
  - {name: dis, type: dis, listen: "127.0.0.1:$dis", timeout_ms: 1000}
  - {name: xplane, type: xplane, listen: "127.0.0.1:$xplane", subscribe: ""}
  - {name: flightgear, type: flightgear, listen: "127.0.0.1:$flightgear"}
  - name: vendor
    type: can-table
    interface: "sim:$scratch/vendor"
    fields:
      - {id: 10000001, field: latitude, scale: 1.0e-7}
      - {id: 10000001, field: longitude, bit: 32, scale: 1.0e-7}
      - {id: 120, field: height, bits: 16, type: unsigned, order: little}
health: {modbus: {listen: "127.0.0.1:$modbus"}}
YAML
start_daemon otwd.yaml

status | grep -q '"state": "active"' || fail "the bus of the table is not active"

# flies PROTOCOL PORT SOURCE LATITUDE: a flight that ends at a latitude of its own, so that no
# place of the flight before it is taken for its end, arrives and drives.
flies() {
    sed "s/46\.51,/$4,/" flight.csv >"$1.csv"
    start "$1.log" "$OTWD" send "$1.csv" --to "udp://127.0.0.1:$2" --protocol "$1" --rate 30
    wait_for 8 is source "$3" || fail "$1: active source $(field source)"
    wait_for 8 near lat_deg "$4" 1e-6 || fail "$1: latitude $(field lat_deg)"
    wait_for 8 near lon_deg 7.91 1e-6 || fail "$1: longitude $(field lon_deg)"
    wait_for 8 near height_m 4000 0.05 || fail "$1: height $(field height_m)"
    near heading_deg 90 0.02 || fail "$1: heading $(field heading_deg)"
    is rejected 0 || fail "$1: rejected $(field rejected)"
    kill "$started"
}

flies flightgear "$flightgear" 3 46.51
flies xplane "$xplane" 2 46.52
flies dis "$dis" 1 46.53
# a candump log is read by the table, and is nothing without it
cat >vendor.log <<'LOG'
(1700000000.000000) can0 120#A00F
(1700000000.100000) can0 10000001#1BB813C004B52320
(1700000000.200000) can0 10000001#1BB817A804B52708
LOG
"$OTWD" replay vendor.log -c otwd.yaml --size 64x36 --report report --quiet ||
    fail "the candump log is not flown"
grep -q '"received": 3' report/report.json || fail "$(grep received report/report.json)"
"$OTWD" replay vendor.log --size 64x36 --quiet 2>/dev/null && fail "it is no CANaerospace"

wait_for 5 is code 102 || fail "after all have gone the fault is $(field code), not 102"
finish
