#!/bin/sh
# Messages of X-Plane, DIS and CANaerospace that cannot be, in the running daemon: each is counted by its
# reason and told of, what is sound is used, and the picture goes on.
. "$(dirname "$0")/common.sh"

modbus=$(free_port)
xplane=$(free_port)
dis=$(free_port)
cat >otwd.yaml <<YAML
display: {width: 64, height: 36, rate_hz: 20}
sources:
  - {name: xplane, type: xplane, listen: "127.0.0.1:$xplane", subscribe: ""}
  - {name: dis, type: dis, listen: "127.0.0.1:$dis", timeout_ms: 1000}
  - {name: can, type: canaerospace, interface: "sim:$scratch/can"}
health: {modbus: {listen: "127.0.0.1:$modbus"}}
YAML
start_daemon otwd.yaml

# send PROTOCOL KIND
send() {
    case $1 in
    xplane) to=$xplane ;;
    dis) to=$dis ;;
    can) to=$scratch/can ;;
    esac
    "$WIRE_TOOL" "$1" "$to" "$2" || fail "$1 $2: not sent"
}

# refused PROTOCOL KIND SENTENCE: the log says it with the source's name; it tells of one a second.
refused() {
    send "$1" "$2"
    wait_for 3 logged "source $1: packet refused ($3" || fail "$1 $2: the log does not say ($3"
}

frames=$(field frames_rendered)
send dis other
wait_for 3 logged "source dis: what comes is sound, but not about own-ship" ||
    fail "that all is about others is not told"
refused xplane short 'short): RPOS is 69 bytes, this has 68'
refused dis short 'short): '
refused can short 'short): GPS latitude (id 1036) has 4 bytes'
sleep 1.1
refused xplane long 'length): RPOS is 69 bytes, this has 70'
refused dis length-0 'length): its header says 0 bytes'
refused can type 'field): GPS latitude (id 1036) has data type 7'
sleep 1.1
refused xplane magic 'magic): XXXX seen'
refused dis past-end 'short): its header says 200 bytes'
refused can nan 'not-finite): GPS latitude'
sleep 1.1
refused xplane nan 'not-finite): longitude at byte 5'
refused dis version 'version): DIS version 9'
refused can range 'range): GPS latitude (id 1036) is 91'
sleep 1.1
refused xplane range 'range): latitude at byte 13'
refused dis nan 'not-finite): location at byte 48'
sleep 1.1
refused xplane nan-pitch 'not-finite): pitch at byte 33'
refused dis range 'range): its location is 0 m from'
sleep 1.1
refused xplane nan-velocity 'not-finite): '
refused dis nan-velocity 'not-finite): velocity at byte 36'
wait_for 3 is rejected 18 || fail "rejected $(field rejected), not 18"
is accepted 0 || fail "accepted $(field accepted)"
is source 0 || fail "source $(field source) drives"

# what is passed over; the sound part of a datagram; a sound one of each
send xplane other
send dis fire
send can remote
send xplane good
wait_for 3 is accepted 1 || fail "a good message of X-Plane after bad ones is not accepted"
sleep 1.1
refused dis garbage 'short): '
wait_for 3 is source 2 || fail "the sound PDU before garbage does not drive: $(field source)"
near lat_deg 46.5 1e-6 || fail "latitude $(field lat_deg)"
send can good
wait_for 3 is rejected 19 || fail "rejected $(field rejected), not 19"
wait_for 10 at_least frames_rendered $((frames + 60)) || fail "the picture did not go on"
stop_daemon
[ "$stopped" -eq 0 ] || fail "status $stopped"
for counters in \
    "source xplane closes: 9 received, 1 poses, 1 about others, 0 lost; refused: " \
    "source dis closes: 10 received, 1 poses, 2 about others, 0 lost; refused: " \
    "source can closes: 15 received, 3 poses, 0 about others, "; do
    logged "$counters" || fail "the log does not end with: $counters"
done
logged "short 1, length 1, magic 1, not-finite 3, range 1" || fail "X-Plane's refusals are not told by reason"
logged "short 3, length 1, version 1, not-finite 2, range 1" || fail "DIS's refusals are not told by reason"
logged "short 1, field 1, not-finite 1, range 1" || fail "CAN's refusals are not told by reason"
finish
