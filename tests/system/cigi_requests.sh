#!/bin/sh
# A CIGI host asks 1000 heights in a message, 600 times at 60 Hz: all are answered, in the next message, and
# the frames take no longer for it than those before. The same with lines of sight among them, for the record.
. "$(dirname "$0")/common.sh"

port=$(free_port)
reply=$(free_port)
modbus=$(free_port)
cat >otwd.yaml <<YAML
display: {width: 64, height: 36, rate_hz: 60}
terrain: {pixel_error: 8}
sources:
  - {name: host, type: cigi, listen: "127.0.0.1:$port", reply: "127.0.0.1:$reply", timeout_ms: 2000}
health: {modbus: {listen: "127.0.0.1:$modbus"}}
YAML
start_daemon otwd.yaml

# ask HEIGHTS LINES TIMES: $missed is how many deadlines were missed meanwhile.
ask() {
    before=$(field missed_deadlines)
    "$SYSTEM_TOOL" cigi-ask "$port" "$reply" "$@" >ask.log || fail "the host fails"
    missed=$(($(field missed_deadlines) - before))
    echo "$1 heights, $2 lines of sight: $(cat ask.log); $missed deadlines missed"
    awk -v all="$((($1 + $2) * $3))" '{ exit !($1 == all && $3 == all) }' ask.log ||
        fail "not all are answered"
}
frames=$(rounds 600 100)
ask 1 0 200 # shaders are compiled, terrain comes
ask 1 0 "$frames"
quiet=$missed
ask 1000 0 "$frames"
if [ -z "${OTWD_TESTS_ARE_SLOW:-}" ]; then
    awk '{ exit !($5 >= 0.8 * $1) }' ask.log || fail "less than 80 % in the next message"
    # a machine that is busy misses some without any request
    [ "$missed" -le $((2 * quiet + 30)) ] ||
        fail "$missed deadlines missed with requests, $quiet without"
fi
ask 900 100 100
ask 0 300 100
ask 0 1000 100
is rejected 0 || fail "rejected $(field rejected)"
finish
