#!/bin/sh
# Controls over Modbus: freeze, visibility, the time, counters, snapshot; and none of it unless allowed.
# shellcheck disable=SC2317 # functions that wait_for calls
. "$(dirname "$0")/common.sh"
need mbpoll

port=$(free_port)
modbus=$(free_port)
write_flight flight.csv
cat >otwd.yaml <<YAML
display: {width: 160, height: 90, rate_hz: 20}
sources:
  - {name: host, type: native, listen: "127.0.0.1:$port"}
health: {modbus: {listen: "127.0.0.1:$modbus", allow_control: true}}
record: {directory: $scratch/record}
YAML
# put TABLE REFERENCE VALUE
put() {
    mbpoll -m tcp -p "$modbus" -a 1 -0 -1 -t "$1" -r "$2" 127.0.0.1 "$3" >>mbpoll.log 2>&1
}
# get TABLE REFERENCE
get() {
    mbpoll -m tcp -p "$modbus" -a 1 -0 -1 -t "$1" -r "$2" 127.0.0.1 2>/dev/null |
        sed -n 's/^\[[0-9]*\]:[ \t]*\([0-9]*\).*/\1/p'
}
reads() {
    [ "$(get "$1" "$2")" = "$3" ]
}
start_daemon otwd.yaml
start send.log "$OTWD" send flight.csv --to "udp://127.0.0.1:$port" --rate 30
wait_for 8 near lat_deg 46.51 1e-5 || fail "latitude $(field lat_deg)"

put 0 0 1 || fail "freeze is refused"
kill "$started"
wait_for 3 reads 0 0 1 || fail "freeze does not read back"
sed 's/46\.51/46.58/' flight.csv >other.csv
wait_for 5 is code 102 || fail "the host does not fall silent"
start send.log "$OTWD" send other.csv --to "udp://127.0.0.1:$port" --rate 30
wait_for 5 is source 1 || fail "the new host is not heard"
frames=$(field frames_rendered)
wait_for 5 at_least frames_rendered $((frames + 50)) || fail "frames stop while frozen"
near lat_deg 46.51 1e-5 || fail "the frozen picture moves to $(field lat_deg)"
put 0 0 0 || fail "thaw is refused"
wait_for 5 near lat_deg 46.58 1e-5 || fail "the picture stays frozen: $(field lat_deg)"

put 4 0 500 || fail "visibility is refused"
wait_for 3 reads 4 0 500 || fail "visibility does not read back"
put 4 1 720 || fail "the minutes of the day are refused"
wait_for 3 reads 4 1 720 || fail "the minutes of the day do not read back"
put 4 1 1440 && fail "minute 1440 of a day is taken"

put 0 1 1 || fail "snapshot is refused"
wait_for 5 has_picture || fail "there is no picture in the record directory"

frames=$(field frames_rendered)
put 0 2 1 || fail "reset is refused"
after=$(field frames_rendered)
[ "$after" -lt "$frames" ] || fail "frames go from $frames to $after over a reset"

stop_daemon
[ "$stopped" -eq 0 ] || fail "the daemon ended with $stopped"
sed -i 's/, allow_control: true//' otwd.yaml
start_daemon otwd.yaml
put 0 0 1 && fail "a control is taken that is not allowed"
finish
