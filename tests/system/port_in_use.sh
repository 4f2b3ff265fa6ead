#!/bin/sh
# A port in use: one message names the source and the address, the other source drives, and the
# first is taken up once the port is free.
. "$(dirname "$0")/common.sh"

taken=$(free_port)
port=$(free_port)
modbus=$(free_port)
write_flight flight.csv
start hold.log "$SYSTEM_TOOL" hold-port "$taken"
holder=$started
wait_for 3 grep -q held hold.log || fatal "the port is not held"
cat >otwd.yaml <<YAML
display: {width: 160, height: 90, rate_hz: 5}
sources:
  - {name: first, type: native, listen: "127.0.0.1:$taken"}
  - {name: second, type: native, listen: "127.0.0.1:$port"}
health: {modbus: {listen: "127.0.0.1:$modbus"}}
YAML
start_daemon otwd.yaml
logged "source first: cannot listen on udp 127.0.0.1:$taken: another program has that port" ||
    fail "the log does not name source, address and reason"
grep -q 'another program has that port fault=105 source=first' otwd.log || fail "no fault code"
start send.log "$OTWD" send flight.csv --to "udp://127.0.0.1:$port" --rate 30
wait_for 8 is source 2 || fail "active source $(field source)"
wait_for 8 near lat_deg 46.51 1e-5 || fail "latitude $(field lat_deg)"
wait_for 4 is code 105 || fail "fault $(field code)"
is state degraded || fail "state $(field state)"
grep -c 'another program has that port' otwd.log | grep -qx 1 || fail "the retries repeat the message"

kill "$holder"
wait_for 5 logged "SOURCE_FAILED is over fault=105 source=first" || fail "the port is not taken up"
wait_for 5 is state running || fail "state $(field state), fault $(field code)"

# A second daemon with the same ports draws without them.
kill "$holder" 2>/dev/null
start second.log "$OTWD" run -c otwd.yaml
second=$started
wait_for 10 grep -q 'first frame is out' second.log || fail "a port in use stops the picture"
for source in first second; do
    grep -q "another program has that port fault=105 source=$source" second.log ||
        fail "the second daemon does not name the source $source"
done
grep -q "Modbus cannot listen at 127.0.0.1:$modbus" second.log || fail "Modbus: no message"
kill "$second"
wait "$second" || fail "the second daemon ended with $?"
finish
