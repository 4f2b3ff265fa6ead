#!/bin/sh
# Two sources: the better one drives while it lives, the other one when it falls silent, and it is
# taken back at once when it returns.
. "$(dirname "$0")/common.sh"

best=$(free_port)
spare=$(free_port)
modbus=$(free_port)
write_flight spare.csv
sed 's/46\.5/10.5/' spare.csv >best.csv
cat >otwd.yaml <<YAML
display: {width: 160, height: 90, rate_hz: 20}
sources:
  - {name: spare, type: native, listen: "127.0.0.1:$spare", priority: 2, timeout_ms: 300}
  - {name: best, type: native, listen: "127.0.0.1:$best", priority: 1, timeout_ms: 300}
health: {modbus: {listen: "127.0.0.1:$modbus"}}
YAML
start_daemon otwd.yaml
start spare.log "$OTWD" send spare.csv --to "udp://127.0.0.1:$spare" --rate 30
wait_for 5 is source 1 || fail "the spare does not drive: $(field source)"
start best.log "$OTWD" send best.csv --to "udp://127.0.0.1:$best" --rate 30
wait_for 5 is source 2 || fail "the best does not drive: $(field source)"
wait_for 5 near lat_deg 10.51 1e-5 || fail "latitude $(field lat_deg), not the best's"
kill "$started"
wait_for 5 is source 1 || fail "the spare does not take over: $(field source)"
wait_for 5 near lat_deg 46.51 1e-5 || fail "latitude $(field lat_deg), not the spare's"
wait_for 5 is code 103 || fail "fault $(field code), not 103"
logged "source best: silent for more than 300 ms" || fail "the log does not name the silent source"
start best.log "$OTWD" send best.csv --to "udp://127.0.0.1:$best" --rate 30
wait_for 5 is source 2 || fail "the best is not taken back: $(field source)"
wait_for 5 logged "SOURCE_LOST is over fault=103 source=best" || fail "its return is not logged"
finish
