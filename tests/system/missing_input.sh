#!/bin/sh
# A database that cannot be opened: the planet is drawn and the fault shown. A geoid that is missing:
# one sentence, and no start. The same without OpenGL.
. "$(dirname "$0")/common.sh"

port=$(free_port)
modbus=$(free_port)
cat >otwd.yaml <<YAML
display: {width: 160, height: 90, rate_hz: 20}
terrain: {database: $scratch/absent.otwt}
sources:
  - {name: host, type: native, listen: "127.0.0.1:$port"}
health: {modbus: {listen: "127.0.0.1:$modbus"}}
YAML
start_daemon otwd.yaml
grep -q "absent.otwt.* fault=203" otwd.log || fail "the log does not name the database"
is code 203 || is code 101 || fail "fault $(field code)"
is state fault || fail "state $(field state)"
at_least frames_rendered 1 || fail "nothing is drawn"
stop_daemon
[ "$stopped" -eq 0 ] || fail "the daemon ended with $stopped"

cat >geoid.yaml <<YAML
terrain: {geoid: $scratch/absent.pgm}
YAML
"$OTWD" run -c geoid.yaml >geoid.log 2>&1
status=$?
[ "$status" -eq 66 ] || fail "a missing geoid: status $status, not 66"
[ "$(grep -c 'absent.pgm' geoid.log)" -eq 1 ] || fail "a missing geoid: not one sentence"
grep -q 'fault=108' geoid.log || fail "a missing geoid: no fault code"
# No OpenGL: the reason, and a status at which systemd tries again.
__EGL_VENDOR_LIBRARY_FILENAMES=/dev/null "$OTWD" run -c otwd.yaml >gl.log 2>&1
status=$?
[ "$status" -eq 69 ] || fail "no OpenGL: status $status, not 69"
grep -q 'OpenGL 4.5.*fault=303' gl.log || fail "no OpenGL: the log does not say so"
finish
