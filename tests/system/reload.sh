#!/bin/sh
# SIGHUP: sources that the new configuration leaves as they are stay open and go on driving; whatever else
# of a source has changed is taken.
. "$(dirname "$0")/common.sh"

kept=$(free_port)
other=$(free_port)
dis=$(free_port)
modbus=$(free_port)
write_flight flight.csv
# configure PORT-OF-OTHER ENTITY-OF-DIS
configure() {
    cat >otwd.yaml <<YAML
display: {width: 160, height: 90, rate_hz: 20}
sources:
  - {name: kept, type: native, listen: "127.0.0.1:$kept"}
  - {name: other, type: native, listen: "127.0.0.1:$1"}
  - {name: dis, type: dis, listen: "127.0.0.1:$dis", entity: "$2"}
health: {modbus: {listen: "127.0.0.1:$modbus"}}
YAML
}
# reload GENERATION
reload() {
    kill -HUP "$daemon"
    wait_for 10 is config_generation "$1" || fatal "no configuration $1"
}
# opened NAME TIMES
opened() {
    [ "$(grep -c "source $1 listens at" otwd.log)" -eq "$2" ]
}

configure "$other" 1:1:1
start_daemon otwd.yaml
start send.log "$OTWD" send flight.csv --to "udp://127.0.0.1:$kept" --rate 30
wait_for 8 is source 1 || fail "nobody drives"
for name in kept other dis; do
    wait_for 5 opened "$name" 1 || fail "$name is not open"
done

other=$(free_port)
configure "$other" 1:1:1
reload 2
wait_for 5 opened other 2 || fail "other is not opened anew"
opened kept 1 || fail "kept is opened anew, unchanged"
opened dis 1 || fail "dis is opened anew, unchanged"
is source 1 || fail "kept drives no more: $(field source)"
[ "$(grep -c "kept drives" otwd.log)" -eq 1 ] || fail "kept was interrupted"

configure "$other" 1:1:2
reload 3
wait_for 5 opened dis 2 || fail "another entity is not taken"
opened kept 1 || fail "kept is opened anew, unchanged"

# The one that drives goes; the one after it takes its place.
sed -i '/name: kept/d' otwd.yaml
reload 4
wait_for 5 is source 0 || fail "kept is gone, and source $(field source) drives"
wait_for 5 opened other 3 || fail "other is not opened in its new place"
start more.log "$OTWD" send flight.csv --to "udp://127.0.0.1:$other" --rate 30
wait_for 8 is source 1 || fail "other does not drive, but $(field source)"
stop_daemon
[ "$stopped" -eq 0 ] || fail "status $stopped"
finish
