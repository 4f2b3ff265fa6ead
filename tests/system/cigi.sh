#!/bin/sh
# A CIGI host that runs at a rate of its own; and messages that cannot be, or that others send: each is
# counted by its reason, the rest of it is used, and the picture goes on.
. "$(dirname "$0")/common.sh"
need mbpoll

port=$(free_port)
reply=$(free_port)
modbus=$(free_port)
write_flight flight.csv
cat >otwd.yaml <<YAML
display: {width: 64, height: 36, rate_hz: 20}
sources:
  - {name: host, type: cigi, listen: "127.0.0.1:$port", reply: "127.0.0.1:$reply",
     allow: [127.0.0.1], timeout_ms: 1000}
environment: {visibility_m: 40000, time_utc: "2024-06-21T12:00:00Z"}
health: {modbus: {listen: "127.0.0.1:$modbus", allow_control: true}}
YAML
start_daemon otwd.yaml

# send KIND [COUNT]
send() {
    "$SYSTEM_TOOL" cigi "$port" "$@" || fail "$1: not sent"
}

# told SENTENCE TIMES: of the host's packets that were refused.
# shellcheck disable=SC2317 # wait_for calls it
told() {
    [ "$(grep -cF "source host: packet refused ($1" otwd.log)" -eq "$2" ]
}

# refused KIND SENTENCE: the log says it, once more, with the source's name.
refused() {
    before=$(field rejected)
    lines=$(grep -cF "source host: packet refused ($2" otwd.log)
    send "$1"
    wait_for 3 told "$2" $((lines + 1)) || fail "$1: the log does not say ($2"
    wait_for 3 is rejected $((before + 1)) || fail "$1: rejected $(field rejected), not $before and 1"
    sleep 1.1 # a source tells of one refusal a second
}
# holds REGISTER VALUE: of the controls.
# shellcheck disable=SC2317 # wait_for calls it
holds() {
    [ "$(mbpoll -m tcp -p "$modbus" -a 1 -0 -1 -t 4 -r "$1" 127.0.0.1 2>/dev/null |
        sed -n 's/^\[[0-9]*\]:[ \t]*\([0-9]*\).*/\1/p')" = "$2" ]
}
send operate
wait_for 3 logged "source host: Operate, by a host of CIGI 3.3" || fail "it does not operate"
wait_for 3 near lat_deg 46.5 1e-6 || fail "own-ship is at latitude $(field lat_deg)"
frames=$(field frames_rendered)
refused size-0 'length): '
refused odd-size 'length): '
refused past-end 'length): '
refused garbage 'length): '
near lat_deg 46.65 1e-6 || fail "what stands before garbage is not used: $(field lat_deg)"
refused nan 'not-finite): '
near lat_deg 46.6 1e-6 || fail "what follows a packet that is refused is not used: $(field lat_deg)"
refused no-entity 'reference): '
refused no-view 'reference): '
# a request is looked at when its frame begins: its refusal is counted with the next message
for kind in no-request-entity far-request; do
    before=$(field rejected)
    frames=$(field frames_rendered)
    send $kind
    wait_for 5 at_least frames_rendered $((frames + 3)) || fail "$kind: no frame"
    send place
    wait_for 3 is rejected $((before + 1)) || fail "$kind: rejected $(field rejected), not $before and 1"
done
refused magic 'magic): '
before=$(field rejected)
send unknown
wait_for 3 near lat_deg 46.7 1e-6 || fail "what follows an unknown packet is not used"
is rejected "$before" || fail "an unknown packet is refused, not passed over"
wait_for 10 at_least frames_rendered $((frames + 20)) || fail "the picture did not go on"

# own-ship clamped 2000 m above the ground; the host's air and sky, which go when it stands by
send clamped
wait_for 3 near height_above_terrain_m 2000 30 || fail "above terrain: $(field height_above_terrain_m)"
near lat_deg 46.6 1e-6 || fail "the clamped own-ship is at latitude $(field lat_deg)"
send air
wait_for 3 holds 0 1234 || fail "the host's visibility of 12340 m is not drawn"
send sky
wait_for 3 holds 1 390 || fail "the host's time of 6:30 is not drawn"
send view
wait_for 3 logged "view 0: a field of view from -89 to 30" || fail "a view that cannot be drawn is not told"
send place # as before
# the eye is put on another entity, near by: at once, by no way between
wait_for 3 near lat_deg 46.7 1e-6 || fail "own-ship is not back: $(field lat_deg)"
send wingman
for entity in ride back; do
    send $entity
    for _ in 1 2 3 4 5 6 7 8; do
        field lat_deg
    done >seen.txt
    awk '!($1 > 46.699999 && $1 < 46.700001 || $1 > 46.700499 && $1 < 46.700501) { exit 1 }' seen.txt ||
        fail "$entity: the eye glides: $(tr '\n' ' ' <seen.txt)"
    [ $entity = back ] || wait_for 3 near lat_deg 46.7005 1e-6 ||
        fail "the eye does not ride: $(field lat_deg)"
done
send debug
wait_for 3 logged "source host: Debug" || fail "it does not go to Debug"
wait_for 3 logged "source host: CIGI 3.3, " || fail "Debug does not tell the counters"

# noise from an address that is not allowed, 20 000 datagrams
before=$(field rejected)
frames=$(field frames_rendered)
noisy=$(date +%s)
send noise 20000
wait_for 5 at_least rejected $((before + 1000)) || fail "noise is not counted: $(field rejected)"
logged "packet refused (sender): 127.0.0.9" || fail "the log does not name who makes noise"
wait_for 5 at_least frames_rendered $((frames + 20)) || fail "noise stops the picture"
near lat_deg 46.7 1e-6 || fail "noise moves own-ship"
[ "$(grep -c 'packet refused (sender)' otwd.log)" -le $(($(date +%s) - noisy + 2)) ] ||
    fail "more than one line a second"

# Standby forgets own-ship; then a host that flies
send standby
wait_for 3 logged "source host: Standby" || fail "it does not stand by"
wait_for 3 holds 0 4000 || fail "the host's visibility stays in Standby"
wait_for 3 holds 1 720 || wait_for 3 holds 1 721 || fail "the host's time stays in Standby"
wait_for 5 is code 102 || fail "in Standby the fault is $(field code), not 102"
start send.log "$OTWD" send flight.csv --protocol cigi4 --rate 30 --to "udp://127.0.0.1:$port" \
    --listen "127.0.0.1:$reply"
wait_for 5 logged "source host: Operate, by a host of CIGI 4.0" || fail "4.0 does not operate"
wait_for 8 near lat_deg 46.51 1e-6 || fail "latitude $(field lat_deg)"
near height_m 4000 0.02 || fail "height $(field height_m)"
near heading_deg 90 0.02 || fail "heading $(field heading_deg)"
is source 1 || fail "active source $(field source)"
kill "$started"
wait_for 5 is code 102 || fail "after the host has gone the fault is $(field code), not 102"
stop_daemon
[ "$stopped" -eq 0 ] || fail "status $stopped"
logged "1 unknown" || fail "the unknown packet is not counted"
logged "length 4, magic 1, not-finite 1, range 1, reference 3" || fail "refusals are not told by reason"
finish
