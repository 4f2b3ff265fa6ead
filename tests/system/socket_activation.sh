#!/bin/sh
# The Modbus socket that a service manager opened takes the place of health.modbus.listen.
. "$(dirname "$0")/common.sh"
need systemd-socket-activate

inherited=$(free_port)
modbus=$inherited
other=$(free_port)
cat >otwd.yaml <<YAML
display: {width: 160, height: 90, rate_hz: 20}
health: {modbus: {listen: "127.0.0.1:$other"}}
YAML
# activate NAME: the daemon, with a socket of that name at $inherited. The tool hands on little of its
# environment.
activate() {
    start otwd.log systemd-socket-activate -l "127.0.0.1:$inherited" --fdname="$1" \
        env LD_PRELOAD="${LD_PRELOAD:-}" ASAN_OPTIONS="${ASAN_OPTIONS:-}" \
        TSAN_OPTIONS="${TSAN_OPTIONS:-}" XDG_CACHE_HOME="$scratch" "$OTWD" run -c otwd.yaml
    daemon=$started
    wait_for 60 logged "Listening on" || fatal "the tool opens no socket"
}

activate modbus
wait_for 60 is_drawing || fatal "no answer at the inherited socket"
logged "Modbus listens at 127.0.0.1:$inherited" || fail "the log does not say where it listens"
"$OTWD" status --modbus "127.0.0.1:$other" --timeout-ms 500 >other.log 2>&1 &&
    fail "it listens at health.modbus.listen, too"
stop_daemon
[ "$stopped" -eq 0 ] || fail "SIGTERM: status $stopped"

# A socket of another name is not for Modbus: somebody who comes there starts the daemon, and is not answered.
modbus=$other
activate other
"$OTWD" status --modbus "127.0.0.1:$inherited" --timeout-ms 100 >poke.log 2>&1
wait_for 60 is_drawing || fatal "no answer at health.modbus.listen"
"$OTWD" status --modbus "127.0.0.1:$inherited" --timeout-ms 500 >poke.log 2>&1 &&
    fail "a socket of another name was answered"
stop_daemon
finish
