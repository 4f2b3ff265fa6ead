#!/bin/sh
# Calls that fail (tests/fail_call.c) while the daemon draws, and then succeed again: all those of a class
# fail for a while. It goes on, or ends with a status of its own; the fault is raised, and over afterwards.
# shellcheck disable=SC2317 # functions that wait_for calls
. "$(dirname "$0")/common.sh"
preload="$FAIL_CALL${LD_PRELOAD:+:$LD_PRELOAD}"

port=$(free_port)
modbus=$(free_port)
write_flight short.csv
sed "s/^60,/600,/" short.csv >flight.csv
cat >otwd.yaml <<YAML
display: {width: 64, height: 36, rate_hz: 20}
sources:
  - {name: host, type: native, listen: "127.0.0.1:$port", timeout_ms: 500}
health: {modbus: {listen: "127.0.0.1:$modbus"}}
record: {directory: $scratch/record}
YAML
start send.log "$OTWD" send flight.csv --to "udp://127.0.0.1:$port" --rate 20

# run_failing CLASS FAULT NAME: the fault that the class has to raise, if any.
run_failing() {
    class=$1
    rm -f failing failed
    FAIL_CLASS=$class FAIL_AT=1 FAIL_ONWARD=1 FAIL_WHILE="$scratch/failing" \
        FAIL_DONE="$scratch/failed" LD_PRELOAD="$preload" start_daemon otwd.yaml
    wait_for 10 at_least accepted 5 || fail "$class: no poses before"
    : >failing
    [ -z "$2" ] || wait_for 20 logged "fault=$2" || fail "$class: no fault $2"
    sleep 1
    rm failing
    [ -z "$2" ] || [ -e failed ] || fail "$class: nothing has failed"
    wait_for 20 at_least frames_rendered 1 || fatal "$class: does not answer afterwards"
    frames=$(field frames_rendered)
    accepted=$(field accepted)
    wait_for 20 at_least frames_rendered $((frames + 20)) || fail "$class: no frames afterwards"
    wait_for 20 at_least accepted $((accepted + 20)) || fail "$class: no poses afterwards"
    [ -z "$2" ] || wait_for 20 logged "$3 is over" || fail "$class: fault $2 does not end"
    echo "$class: $([ -e failed ] && echo calls failed || echo no call was made):" \
        "$(grep -o 'fault=[0-9]*' otwd.log | sort -u | tr '\n' ' ')"
    stop_daemon
    [ "$stopped" -eq 0 ] || fail "$class: the daemon ended with $stopped"
}
run_failing socket 105 SOURCE_FAILED
run_failing file 501 RECORDER_FAILED
run_failing memory ''
[ -e failed ] || fail "memory: nothing has failed"
# What the GPU holds is made at the start: there is nothing to fail while it draws.
run_failing gl ''
[ ! -e failed ] || fail "gl: something was made while it drew"
finish
