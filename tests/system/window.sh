#!/bin/sh
# The window shows the pixels of the headless frame: the same pose, the same time of day.
. "$(dirname "$0")/common.sh"
need Xvfb
need mbpoll
[ -n "${WINDOW_PIXELS:-}" ] || {
    echo "skip: built without libx11"
    exit 77
}

modbus=$(free_port)
cat >headless.yaml <<YAML
channel: {name: otwd-test}
display: {width: 160, height: 90, rate_hz: 20}
terrain: {pixel_error_most: 1} # as fine however long it takes: coarser terrain would be another picture
environment: {time_utc: "2026-06-21T10:00:00Z"}
health: {modbus: {listen: "127.0.0.1:$modbus", allow_control: true}}
record: {directory: $scratch/record}
YAML
sed 's/rate_hz: 20/rate_hz: 20, backend: window/' headless.yaml >window.yaml

"$OTWD" run -c window.yaml >none.log 2>&1
[ $? -eq 69 ] || fail "without a display the status is not 69"
grep -q 'no display' none.log || fail "without a display the log does not say so"

start_daemon headless.yaml
mbpoll -m tcp -p "$modbus" -a 1 -0 -1 -t 0 -r 1 127.0.0.1 1 >mbpoll.log 2>&1 || fail "no snapshot"
wait_for 5 has_picture || fatal "there is no picture of the headless run"
stop_daemon

start xvfb.log Xvfb -displayfd 3 -screen 0 640x480x24 -nolisten tcp 3>display
server=$started
wait_for 10 test -s display || fatal "Xvfb does not start"
DISPLAY=:$(cat display)
export DISPLAY
start_daemon window.yaml
wait_for 5 at_least frames_rendered 10 || fail "no frames in the window"
"$WINDOW_PIXELS" otwd-test record/frame-*.png 2 difference.png || fail "the window differs"

# The window all but vanishes, and comes back: the frames go on, and are seen again.
"$WINDOW_PIXELS" otwd-test 1 1 || fail "the window cannot be made small"
frames=$(field frames_rendered)
wait_for 10 at_least frames_rendered $((frames + 20)) || fail "no frames while there is no window"
"$WINDOW_PIXELS" otwd-test 160 90 || fail "the window cannot be made large"
frames=$(field frames_rendered)
wait_for 10 at_least frames_rendered $((frames + 10)) || fail "no frames in the window again"
"$WINDOW_PIXELS" otwd-test record/frame-*.png 2 difference.png || fail "the window came back other"

# The display goes away: status 69, and the log says why.
kill "$server"
wait "$server"
wait "$daemon"
status=$?
[ "$status" -eq 69 ] || fail "the display went away: status $status, not 69"
logged "the display server went away" || fail "the log does not say that the display went away"
finish
