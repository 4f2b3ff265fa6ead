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
health: {modbus: {listen: "127.0.0.1:$modbus"}}
YAML
start_daemon otwd.yaml

# flies PROTOCOL PORT SOURCE: the flight arrives and drives.
flies() {
    start "$1.log" "$OTWD" send flight.csv --to "udp://127.0.0.1:$2" --protocol "$1" --rate 30
    wait_for 8 is source "$3" || fail "$1: active source $(field source)"
    wait_for 8 near lat_deg 46.51 1e-6 || fail "$1: latitude $(field lat_deg)"
    near lon_deg 7.91 1e-6 || fail "$1: longitude $(field lon_deg)"
    near height_m 4000 0.05 || fail "$1: height $(field height_m)"
    near heading_deg 90 0.02 || fail "$1: heading $(field heading_deg)"
    is rejected 0 || fail "$1: rejected $(field rejected)"
    kill "$started"
}

flies flightgear "$flightgear" 3
flies xplane "$xplane" 2
flies dis "$dis" 1
wait_for 5 is code 102 || fail "after all have gone the fault is $(field code), not 102"
finish
