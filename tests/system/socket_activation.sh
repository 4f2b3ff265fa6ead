#!/bin/sh
# The Modbus socket that a service manager opened takes the place of health.modbus.listen.
. "$(dirname "$0")/common.sh"
need systemd-socket-activate

modbus=$(free_port)
other=$(free_port)
cat >otwd.yaml <<YAML
display: {width: 160, height: 90, rate_hz: 20}
health: {modbus: {listen: "127.0.0.1:$other"}}
YAML
# activate NAME: the daemon, with a socket of that name at $modbus. The tool hands on little of its
# environment.
activate() {
    start otwd.log systemd-socket-activate -l "127.0.0.1:$modbus" --fdname="$1" \
        env LD_PRELOAD="${LD_PRELOAD:-}" ASAN_OPTIONS="${ASAN_OPTIONS:-}" \
        TSAN_OPTIONS="${TSAN_OPTIONS:-}" XDG_CACHE_HOME="$scratch" "$OTWD" run -c otwd.yaml
    daemon=$started
}

activate modbus
wait_for 15 is_drawing || fatal "no answer at the inherited socket"
logged "Modbus listens at 127.0.0.1:$modbus" || fail "the log does not say where it listens"
"$OTWD" status --modbus "127.0.0.1:$other" --timeout-ms 500 >other.log 2>&1 &&
    fail "it listens at health.modbus.listen, too"
stop_daemon
[ "$stopped" -eq 0 ] || fail "SIGTERM: status $stopped"

# A socket of another name is not for Modbus.
activate other
start poke.log "$OTWD" status --modbus "127.0.0.1:$modbus" --timeout-ms 500
wait "$started" && fail "a socket of another name was answered"
modbus=$other
wait_for 15 is_drawing || fail "no answer at health.modbus.listen"
stop_daemon
finish
