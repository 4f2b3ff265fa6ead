#!/bin/sh
# SocketCAN in a kernel that has it: a daemon on vcan0, driven by can-utils and by `otwd send`.
# shellcheck disable=SC2154,SC2317 # variables of common.sh; functions that wait_for calls
. "$(dirname "$0")/../system/common.sh"
. "$(dirname "$0")/steps.sh"

link() {
    busybox ip link "$@"
}

# bus_is STATE: that of the daemon's CAN controller.
bus_is() {
    status 2>/dev/null | sed -n '/"can": {/,/}/s/^ *"state": "\([^"]*\)".*/\1/p' | grep -qx "$1"
}

# frame FRAME: puts one on the bus, in cansend's notation.
frame() {
    cansend vcan0 "$1" || fail "cansend $1"
}

# still FILE LATITUDE LONGITUDE HEADING: a flight that stays where it is.
still() {
    cat >"$1" <<FLIGHT
# altitude: ellipsoid
time_s,lat_deg,lon_deg,alt_m,roll_deg,pitch_deg,heading_deg
0,$2,$3,4000,1,2,$4
120,$2,$3,4000,1,2,$4
FLIGHT
}

# send FLIGHT [RATE]: as a host, until stop_sending.
send() {
    start send.log "$OTWD" send "$1" --to can:vcan0 --rate "${2:-10}"
    sender=$started
}

stop_sending() {
    kill "$sender" 2>/dev/null
    wait "$sender" 2>/dev/null
}

modbus=1502
cat >otwd.yaml <<YAML
display: {width: 64, height: 64, rate_hz: 2}
sources:
  - name: bus
    type: canaerospace
    interface: vcan0
    altitude: ellipsoid
    timeout_ms: 1000
    allow_transmit: true
health: {modbus: {listen: "127.0.0.1:$modbus"}}
YAML
still first.csv 46.51 7.91 90
still second.csv 47.25 11.35 -45

step "an interface that comes after the start is taken up"
start otwd.log "$OTWD" run -c otwd.yaml
daemon=$started
wait_for 60 logged "the first frame is out" || fatal "the daemon does not draw"
logged "can:vcan0: there is no such interface" || fail "the log does not say that vcan0 is missing"
bus_is none || fail "a missing interface has a state"
link add vcan0 type vcan
sleep 3
bus_is none || fail "an interface that is down has a state"
"$OTWD" send first.csv --to can:vcan0 >down.log 2>&1
[ "$?" -eq 69 ] || fail "send to an interface that is down does not end with 69"
grep -q "can:vcan0: the interface is down" down.log || fail "send does not say what is wrong"
link set vcan0 up
wait_for 5 bus_is active || fail "vcan0 does not become active"

step "otwd send drives it"
candump -L vcan0 >flight.candump &
dump=$!
send first.csv
wait_for 5 near lat_deg 46.51 1e-6 || fail "latitude $(field lat_deg)"
near lon_deg 7.91 1e-6 || fail "longitude $(field lon_deg)"
near height_m 4000 0.1 || fail "height $(field height_m)"
wait_for 5 near heading_deg 90 0.02 || fail "heading $(field heading_deg)"
wait_for 5 is rejected 0 || fail "rejected $(field rejected)"
is lost 0 || fail "lost $(field lost)"
stop_sending
kill "$dump"
wait "$dump" 2>/dev/null

step "canplayer drives it, from a candump log of another flight"
send second.csv
wait_for 5 near lat_deg 47.25 1e-6 || fail "latitude $(field lat_deg)"
stop_sending
[ -s flight.candump ] || fail "candump heard nothing"
start canplayer.log canplayer -I flight.candump -l i vcan0=vcan0
player=$started
wait_for 5 near lat_deg 46.51 1e-6 || fail "latitude $(field lat_deg) from canplayer"
wait_for 5 near heading_deg 90 0.02 || fail "heading $(field heading_deg) from canplayer"
is rejected 0 || fail "rejected $(field rejected) from canplayer"
kill "$player"
wait "$player" 2>/dev/null

step "the kernel filters: other identifiers do not reach the daemon"
filters=$(grep -c '^ *vcan0' /proc/net/can/rcvlist_sff)
long=$(grep -c '^ *vcan0' /proc/net/can/rcvlist_eff)
[ "$filters" -eq 29 ] || fail "$filters filters for 11-bit identifiers, 29 expected"
[ "$long" -eq 28 ] || fail "$long filters for 29-bit identifiers, 28 expected"
grep -q '^ *vcan0' /proc/net/can/rcvlist_all && fail "a receiver without a filter"
before=$(field frames)
sleep 1
frame 7FF#0102030405060708
frame 0001040C#0102030405060708
frame 40C#R
is frames "$before" || fail "a frame that is not ours was counted"

step "the identification service answers, as itself only"
start identity.log timeout 5 candump -L -n 1 vcan0,081:7FF
answer=$started
sleep 1
frame 080#07000009
frame 080#0000000A
wait "$answer"
grep -q '081#4010000A01010000' identity.log || fail "identification: $(cat identity.log)"
[ "$(wc -l <identity.log)" -eq 1 ] || fail "a request to node 7 was answered"

step "an interface that goes down and up"
send first.csv
wait_for 5 near lat_deg 46.51 1e-6 || fail "latitude $(field lat_deg)"
link set vcan0 down
wait_for 5 bus_is none || fail "an interface that went down has a state"
wait_for 3 logged "the bus vcan0 went down: Network is down" || fail "the log does not say so"
wait "$sender"
[ "$?" -eq 69 ] || fail "send over an interface that went down does not end with 69"
link set vcan0 up
wait_for 5 bus_is active || fail "vcan0 does not come back"
wait_for 3 logged "SOURCE_FAILED is over" || fail "the log does not say that it came back"
send second.csv
wait_for 5 near lat_deg 47.25 1e-6 || fail "latitude $(field lat_deg) after down and up"
stop_sending

step "an interface that is deleted and made again"
link delete vcan0
wait_for 5 bus_is none || fail "a deleted interface has a state"
link add vcan0 type vcan
link set vcan0 up
wait_for 5 bus_is active || fail "the new vcan0 is not taken up"
send first.csv
wait_for 5 near lat_deg 46.51 1e-6 || fail "latitude $(field lat_deg) on the new interface"
stop_sending

step "error frames tell the state of the controller"
# linux/can/error.h: class 0x4 with the controller's bits in the second byte, 0x40 bus-off, 0x100
# restarted.
for error in 20000004#0004000000000000=warning 20000004#0020000000000000=passive \
    20000040#0000000000000000=bus-off 20000100#0000000000000000=active; do
    frame "${error%=*}"
    wait_for 3 bus_is "${error#*=}" || fail "error frame ${error%=*}: not ${error#*=}"
done
for code in 106 107; do
    grep -q "fault=$code" otwd.log || fail "fault $code is not logged"
done
is rejected 0 || fail "an error frame was refused as a packet"

step "a receive queue that overflows is counted and told"
lost=$(field lost)
kill -STOP "$daemon"
cangen vcan0 -g 0 -I 137 -L 8 -D 0102000000000000 -n 4000 -i || fail "cangen"
kill -CONT "$daemon"
# The kernel tells of what it dropped with the next frame that finds room.
frame 137#0002000100000000
wait_for 5 logged "packets lost: its receive queue was full" || fail "the overflow is not told of"
[ "$(field lost)" -gt "$lost" ] || fail "lost $(field lost) after an overflow, $lost before"
grep -q 'fault=109' otwd.log || fail "fault 109 is not logged"
lost=$(field lost)
frame 20000004#0001000000000000
wait_for 3 is lost $((lost + 1)) || fail "an overflow of the controller is not counted"

step "it ends as it should"
stop_daemon
[ "$stopped" -eq 0 ] || fail "SIGTERM: status $stopped"
finish
