#!/bin/sh
# Frames that cannot be drawn in time at the accuracy asked are drawn coarser, and it is told; not
# where that is not allowed, nor where there is time.
. "$(dirname "$0")/common.sh"

# config RATE SIZE TERRAIN
config() {
    modbus=$(free_port)
    cat >otwd.yaml <<YAML
display: {$2, rate_hz: $1}
terrain: {$3}
sources:
  - {name: host, type: native, listen: "127.0.0.1:$(free_port)"}
health: {modbus: {listen: "127.0.0.1:$modbus"}}
YAML
}

config 240 "width: 1280, height: 720" "pixel_error: 4.0"
start_daemon otwd.yaml
wait_for 20 logged "pixels, for want of time" ||
    fail "frames are late and the terrain is not drawn coarser"
logged "fault=307" || fail "the fault has no code"
stop_daemon

config 240 "width: 1280, height: 720" "pixel_error: 4.0, pixel_error_most: 4.0"
start_daemon otwd.yaml
wait_for 20 at_least missed_deadlines 40 || fail "no frame is late"
logged "fault=307" && fail "the terrain is drawn coarser than is allowed"
stop_daemon

config 4 "width: 64, height: 36" "pixel_error: 4.0"
start_daemon otwd.yaml
wait_for 20 at_least frames_rendered 8 || fail "nothing is drawn"
logged "fault=307" && fail "there is time and the terrain is drawn coarser"
stop_daemon
finish
