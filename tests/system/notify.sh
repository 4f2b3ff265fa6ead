#!/bin/sh
# What systemd hears: READY after the first frame, the watchdog's food, STOPPING; SIGTERM ends with 0,
# SIGHUP reads the configuration again.
# shellcheck disable=SC2317 # functions that wait_for calls
. "$(dirname "$0")/common.sh"

modbus=$(free_port)
cat >otwd.yaml <<YAML
display: {width: 160, height: 90, rate_hz: 20}
health: {modbus: {listen: "127.0.0.1:$modbus"}}
YAML
start manager.log "$SYSTEM_TOOL" notify "$scratch/notify" heard.log
wait_for 3 test -S notify || fatal "nobody listens"
export NOTIFY_SOCKET="$scratch/notify" WATCHDOG_USEC=400000
start_daemon otwd.yaml
wait_for 5 grep -qx READY=1 heard.log || fail "no READY=1"
grep -q 'STATUS=' heard.log || fail "no STATUS="
beats() {
    [ "$(grep -cx WATCHDOG=1 heard.log)" -ge "$1" ]
}
wait_for 5 beats 5 || fail "no WATCHDOG=1"

port=$(free_port)
moved=$(free_port)
is config_generation 1 || fail "generation $(field config_generation)"
sed -i 's/width: 160/width: 320/' otwd.yaml
sed -i "s/127.0.0.1:$modbus/127.0.0.1:$moved/" otwd.yaml
printf 'environment: {visibility_m: 5000}\n' >>otwd.yaml
printf 'sources: [{name: new, type: native, listen: "127.0.0.1:%s"}]\n' "$port" >>otwd.yaml
modbus=$moved
kill -HUP "$daemon"
wait_for 5 is config_generation 2 || fail "generation $(field config_generation) after SIGHUP"
write_flight flight.csv
start send.log "$OTWD" send flight.csv --to "udp://127.0.0.1:$port" --rate 30
wait_for 5 is source 1 || fail "source $(field source): the new one does not drive"
logged "changes to display need a restart" || fail "the log does not say what waits for a restart"
printf 'colour: red\n' >>otwd.yaml
kill -HUP "$daemon"
wait_for 5 logged "otwd.yaml:5:1: " || fail "a bad configuration at SIGHUP is not told of"
is config_generation 2 || fail "a bad configuration was taken"

stop_daemon
[ "$stopped" -eq 0 ] || fail "SIGTERM: status $stopped"
wait_for 3 grep -qx STOPPING=1 heard.log || fail "no STOPPING=1"
logged "stopped" || fail "the log does not say that it stopped"
finish
