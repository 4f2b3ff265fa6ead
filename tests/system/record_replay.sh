#!/bin/sh
# What a run records, a replay flies: as many poses as were accepted.
. "$(dirname "$0")/common.sh"

port=$(free_port)
modbus=$(free_port)
write_flight all.csv
head -n 5 all.csv >flight.csv
cat >otwd.yaml <<YAML
display: {width: 160, height: 90, rate_hz: 20}
sources:
  - {name: host, type: native, listen: "127.0.0.1:$port"}
health: {modbus: {listen: "127.0.0.1:$modbus"}}
record: {directory: $scratch/record, max_mib: 16}
YAML
start_daemon otwd.yaml
"$OTWD" send flight.csv --to "udp://127.0.0.1:$port" --rate 30 --quiet || fail "send: $?"
wait_for 5 is code 102 || fail "the flight does not end"
accepted=$(field accepted)
# a source, then a packet and a pose for each
recorded=$(status | awk '/"record"/ { found = 1 } found && /"frames"/ { gsub(/[^0-9]/, ""); print; exit }')
stop_daemon
[ "$stopped" -eq 0 ] || fail "the daemon ended with $stopped"
[ "$accepted" -ge 60 ] || fail "accepted $accepted"
[ "$recorded" -eq $((2 * accepted + 1)) ] || fail "recorded $recorded for $accepted poses"
"$OTWD" replay record/*.otwlog --quiet --json --speed max --rate 5 --size 64x36 >report.json ||
    fail "replay: $?"
replayed=$(sed -n 's/^ *"received": \([0-9]*\),*$/\1/p' report.json)
[ "$replayed" = "$accepted" ] || fail "replayed $replayed of $accepted poses"

# latency TIMES: of a replay at that speed, the 50th percentile in ms; nothing where it has none.
latency() {
    "$OTWD" replay flight.csv --quiet --speed "$1" --rate 10 --size 64x36 --report . ||
        fail "replay: $?"
    awk '/"latency_ms"/ { on = 1 } on && /"p50"/ { gsub(/[^0-9.enul]/, "", $2); print $2; exit }' report.json
}
[ "$(latency max)" = null ] || fail "at full speed the latency is $(latency max)"
latency 1 | awk '{ exit !($1 > 0 && $1 < 1000) }' || fail "the latency is $(latency 1) ms"
finish
