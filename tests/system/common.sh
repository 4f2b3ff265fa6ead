# Shared by the system tests, which drive the real program. From the environment: OTWD (the program),
# SYSTEM_TOOL (tests/system_tool.c). A test runs in a directory of its own, $scratch, and sets $modbus,
# the port of the daemon's Modbus server.
# shellcheck shell=sh disable=SC2034,SC2154 # variables that pass between this file and the tests

set -u
scratch=$(mktemp -d)
cd "$scratch" || exit 1
pids=
failures=0

end() {
    for pid in $pids; do
        kill "$pid" 2>/dev/null && wait "$pid" 2>/dev/null
    done
    if [ "$failures" -ne 0 ]; then
        for log in "$scratch"/*.log; do
            [ ! -e "$log" ] || sed "s|^|${log##*/}: |" "$log" >&2
        done
    fi
    rm -rf "$scratch"
}
trap end EXIT
trap 'exit 1' INT TERM

need() {
    command -v "$1" >/dev/null || {
        echo "skip: $1 is not installed"
        exit 77
    }
}

fail() {
    echo "FAIL $*" >&2
    failures=$((failures + 1))
}

finish() {
    [ "$failures" -eq 0 ]
    exit
}

# fatal TEXT: what follows would make no sense.
fatal() {
    fail "$*"
    exit 1
}

# wait_for SECONDS COMMAND...: until it succeeds; fails where it does not within that time, six times as much
# in a build with sanitizers.
wait_for() {
    tries=$(($1 * 10))
    [ -z "${OTWD_TESTS_ARE_SLOW:-}" ] || tries=$((6 * tries))
    shift
    while ! "$@" >/dev/null 2>&1; do
        tries=$((tries - 1))
        [ "$tries" -gt 0 ] || return 1
        sleep 0.1
    done
}

# rounds USUALLY SHORT: how often something is repeated: SHORT times in a short run, as in the builds with
# sanitizers of `./run test`.
rounds() {
    [ -n "${OTWD_SHORT_RUN:-}" ] && echo "$2" || echo "$1"
}

free_port() {
    "$SYSTEM_TOOL" free-port
}

# start LOG COMMAND...: in the background; its process is $started.
start() {
    start_log=$1
    shift
    "$@" >"$start_log" 2>&1 &
    started=$!
    pids="$pids $started"
}

# start_daemon CONFIG: and waits until it answers over Modbus at $modbus, drawing. Needs a small size.
start_daemon() {
    start otwd.log "$OTWD" run -c "$1"
    daemon=$started
    wait_for 15 is_drawing || fatal "the daemon does not draw"
}

is_drawing() {
    state=$(field state) && [ -n "$state" ] && [ "$state" != starting ]
}

status() {
    "$OTWD" status --modbus "127.0.0.1:$modbus" --json
}

# field NAME: of the daemon's health; the first of that name.
field() {
    status 2>/dev/null | sed -n "s/^ *\"$1\": \"\{0,1\}\([^\",]*\)\"\{0,1\},\{0,1\}\$/\1/p" | head -n 1
}

# is NAME VALUE; at_least NAME VALUE; near NAME VALUE TOLERANCE
is() {
    [ "$(field "$1")" = "$2" ]
}

at_least() {
    value=$(field "$1") && [ -n "$value" ] && [ "$value" -ge "$2" ]
}

near() {
    awk -v a="$(field "$1")" -v b="$2" -v t="$3" \
        'BEGIN { d = a - b; exit !(a != "" && d <= t && -d <= t) }'
}

# logged TEXT: the daemon has said so.
logged() {
    grep -qF -- "$1" otwd.log
}

# stop_daemon: by SIGTERM; $stopped is its exit status.
stop_daemon() {
    kill -TERM "$daemon"
    wait "$daemon"
    stopped=$?
}

# A flight that moves for two seconds and then stays at 46.51 N 7.91 E, 4000 m, heading 90.
write_flight() {
    cat >"$1" <<'FLIGHT'
# altitude: ellipsoid
time_s,lat_deg,lon_deg,alt_m,roll_deg,pitch_deg,heading_deg
0,46.50,7.90,3900,0,0,90
2,46.51,7.91,4000,0,0,90
2.1,46.51,7.91,4000,0,0,90
60,46.51,7.91,4000,0,0,90
FLIGHT
}

# A snapshot has been written.
has_picture() {
    ls record/frame-*.png
}
