#!/bin/sh
# Packets that cannot be: each is refused, counted and told of, and the picture goes on.
. "$(dirname "$0")/common.sh"

port=$(free_port)
modbus=$(free_port)
cat >otwd.yaml <<YAML
display: {width: 160, height: 90, rate_hz: 20}
sources:
  - {name: host, type: native, listen: "127.0.0.1:$port"}
health: {modbus: {listen: "127.0.0.1:$modbus"}}
YAML
start_daemon otwd.yaml

# refused KIND SENTENCE: sends one; the log says it with the source's name.
refused() {
    "$SYSTEM_TOOL" bad-input "$port" "$1"
    wait_for 3 logged "source host: packet refused ($2" || fail "$1: the log does not say ($2"
    sleep 1.1 # a source tells of one refusal a second
}
frames=$(field frames_rendered)
refused malformed 'magic): it begins with 5a5a5a5a'
refused length 'short): it ends at byte 127'
refused nan 'not-finite): longitude at byte'
refused latitude 'range): latitude at byte'
refused version 'version): version 9.0 seen, version 1 expected'
is rejected 5 || fail "rejected $(field rejected), not 5"
is accepted 0 || fail "accepted $(field accepted)"
grep -c 'packet refused' otwd.log | grep -qx 5 || fail "not one message each"
at_least frames_rendered $((frames + 60)) || fail "the picture did not go on"

"$SYSTEM_TOOL" bad-input "$port" good
wait_for 3 is accepted 1 || fail "a good packet after bad ones is not accepted"
wait_for 3 near lat_deg 46.5 1e-6 || fail "a good packet after bad ones is not drawn"
is rejected 5 || fail "rejected $(field rejected) after a good packet"
finish
