#!/bin/sh
# The frame path allocates nothing and takes no lock after the first second of frames. Counted by
# COUNT_CALLS (tests/count_calls.c), preloaded into the real program under a moving pose, in a swap lock; once
# more where a CIGI host leads. Calls that the GL driver's own libraries make do not count.
. "$(dirname "$0")/common.sh"

export COUNT_THREAD=counted COUNT_AFTER_S=0.5 COUNT_FILE="$scratch/self.txt"
LD_PRELOAD="$COUNT_CALLS" "$COUNT_SELF" || fatal "the program that tests the counter fails"
cat >expected.txt <<TEXT
early_allocations 2
early_locks 0
late_allocations 12
late_locks 5
TEXT
grep -v late_caller self.txt | diff expected.txt - >&2 || fatal "the counter does not count"

port=$(free_port)
modbus=$(free_port)
awk 'BEGIN {
    print "# altitude: ellipsoid"
    print "time_s,lat_deg,lon_deg,alt_m,roll_deg,pitch_deg,heading_deg"
    for (t = 0; t <= 60; t++)
        printf "%d,%.6f,%.6f,%d,%d,0,%d\n", t, 46.5 + t * 8e-4, 7.9 + t * 8e-4, 4000 + 20 * t, t % 20, 45 + t
}' >flight.csv
# count NAME: in the counts.
count() {
    sed -n "s/^$1 //p" counts.txt
}

# look SOURCE OPTION...: the source's keys, and those of the host that sends.
look() {
    cat >otwd.yaml <<YAML
display: {width: 160, height: 90, rate_hz: 20}
swap_lock: {group: "239.192.0.1:$port", channels: 2}
sources:
  - {name: host, listen: "127.0.0.1:$port", $1}
health: {modbus: {listen: "127.0.0.1:$modbus"}}
record: {directory: $scratch/record}
YAML
    shift
    start send.log "$OTWD" send flight.csv --to "udp://127.0.0.1:$port" --rate 30 "$@"
    sender=$started
    export COUNT_THREAD=otwd-render COUNT_AFTER_S=5 COUNT_UNTIL_S=9 COUNT_FILE="$scratch/counts.txt"
    start otwd.log env LD_PRELOAD="$COUNT_CALLS" "$OTWD" run -c otwd.yaml
    daemon=$started
    unset COUNT_FILE
    wait_for 3 is source 1 || fatal "the daemon does not fly within 3 seconds"
    wait_for 3 is_drawing || fatal "the daemon does not draw"
    at_start=$(field frames_rendered)
    wait_for 10 at_least uptime_s 10 || fatal "the daemon's clock stands"
    height=$(field height_m)
    frames=$(($(field frames_rendered) - at_start))
    [ "$frames" -ge 60 ] || fail "only $frames frames while counting"
    stop_daemon
    [ "$stopped" -eq 0 ] || fail "the daemon ended with $stopped"
    kill "$sender"
    echo "counted within $frames frames, at $height m"
    cat counts.txt
    [ "$(count early_allocations)" -gt 0 ] || fail "not even the start allocates: the counter is blind"
    [ "$(count late_allocations)" = 0 ] || fail "allocations in the frame path (see late_caller)"
    [ "$(count late_locks)" = 0 ] || fail "locks in the frame path (see late_caller)"
}
reply=$(free_port)
look "type: native"
look "type: cigi, reply: \"127.0.0.1:$reply\", sync_wait_ms: 20" \
    --protocol cigi3 --sync --listen "127.0.0.1:$reply"
finish
