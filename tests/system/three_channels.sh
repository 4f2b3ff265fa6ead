#!/bin/sh
# Left, front and right, each in a network namespace of its own, in step with one CIGI host: none shows
# a frame of the host before all have shown the one before it. The one that answers the host is killed: the
# others go on; it comes back and joins. 1000 frames, or $OTWD_STEP_FRAMES of them.
# shellcheck disable=SC2317 # wait_for calls functions by their names
. "$(dirname "$0")/common.sh"

frames=${OTWD_STEP_FRAMES:-$(rounds 1000 200)}
timeout_ms=500
base=host
. "$(dirname "$0")/three_spaces.sh"

for i in 1 2 3; do
    cat >"$i.yaml" <<YAML
channel: {name: channel$i, offset: {yaw_deg: $((60 * (i - 2)))}}
display: {width: 64, height: 36, rate_hz: 1000}
terrain: {pixel_error: 8}
swap_lock: {group: "$group", interface: "10.77.0.1$i", channel: $i, channels: 3, timeout_ms: $timeout_ms}
sources:
  - {name: host, type: cigi, listen: "239.192.0.2:8004", reply: "$host:8005", allow: [$host],
     sync_wait_ms: 200, timeout_ms: 5000}
YAML
done
cat >flight.csv <<'FLIGHT'
# altitude: ellipsoid
time_s,lat_deg,lon_deg,alt_m,roll_deg,pitch_deg,heading_deg
0,46.50,7.90,3900,0,0,90
6000,46.50,9.90,4000,0,0,90
FLIGHT

start_all
start send.log ip netns exec "$space.host" "$OTWD" send flight.csv --protocol cigi3 --sync --database 1 \
    --to udp://239.192.0.2:8004 --listen "$host:8005"
wait_for 40 steady || fatal "the channels are not in step"
first=$(($(last_number) + 5))
wait_for 250 shown $((3 * frames + $(wc -l <swaps) + 30)) ||
    fatal "$(wc -l <swaps) frames were shown, too few"
last=$(last_number)
[ $((last - first)) -ge "$frames" ] || fail "frames $first to $last, less than $frames"
together "$first" "$last" || fail "the channels are out of step"

in_space 2 "$OTWD" status >status.txt
grep "^swap lock  *3 of 3 in step, [1-9][0-9]* frames" status.txt || fail "no lock in: $(cat status.txt)"

# the channel that answers the host dies: so do its frames, alone
kill -KILL "$first_pid"
for i in 2 3; do
    wait_for 10 logged_by $i "2 of 3 channels are in step fault=601" ||
        fail "channel $i does not miss channel 1"
done
lines=$(wc -l <swaps)
wait_for 20 shown $((lines + 100)) || fatal "the others stand still without channel 1"
awk -v limit="$((2 * timeout_ms + 400))" '
    $2 == 2 { if (before && $4 - before > worst) worst = $4 - before; before = $4 }
    END { printf "longest pause of channel 2: %.1f ms\n", worst; exit !(worst <= limit) }' swaps ||
    fail "channel 2 stood still for longer than the time-out"
start_channel 1
wait_for 40 steady || fatal "channel 1 does not join again"
wait_for 10 logged_by 2 "CHANNEL_ABSENT is over" || fail "channel 2 still misses channel 1"
first=$(last_number)
lines=$(wc -l <swaps)
wait_for 20 shown $((lines + 300)) || fail "the channels stand still with channel 1"
together "$first" "$(last_number)" || fail "the channels are out of step after channel 1 came back"
# one that ends says so
kill -TERM "$third_pid"
wait_for 5 logged_by 3 "channel 3 of 3: .* frames in the swap lock" ||
    fail "what channel 3 counted is not told"
lines=$(wc -l <swaps)
wait_for 20 shown $((lines + 100)) || fail "the others stand still without channel 3"
finish
