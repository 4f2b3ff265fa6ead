#!/bin/sh
# Left, front and right, each in a network namespace of its own, without a host that leads: they draw
# the ticks of the shared clock, from poses that all three hear, and none shows a tick before all are
# ready for it. Some 10 s.
# shellcheck disable=SC2317 # functions that wait_for calls
. "$(dirname "$0")/common.sh"

base=tick
rate=20
. "$(dirname "$0")/three_spaces.sh"

for i in 1 2 3; do
    cat >"$i.yaml" <<YAML
channel: {name: channel$i, offset: {yaw_deg: $((60 * (i - 2)))}}
display: {width: 64, height: 36, rate_hz: $rate}
terrain: {pixel_error: 8}
swap_lock: {group: "$group", interface: "10.77.0.1$i", channel: $i, channels: 3, timeout_ms: 500}
sources:
  - {name: host, type: native, listen: "239.192.0.2:5600", allow: [$host], timeout_ms: 2000}
YAML
done
write_flight flight.csv

driven() {
    for channel in 1 2 3; do
        in_space "$channel" "$OTWD" status | grep -q "46.51" || return 1
    done
}

# ticks FROM LINES: of what was shown from line FROM on, whether no tick was shown before all channels
# had done with those before it, nearly all by all three, and each at its own time. A channel that is
# short of time leaves a tick out.
ticks() {
    tail -n "+$1" swaps | head -n "$2" | awk -v rate="$rate" -v epoch="$epoch" '
        $3 != "tick" { print "shown by", $3; bad = 1; next }
        { count[$1]++
          if (!($1 in first) || $4 < first[$1]) first[$1] = $4
          if ($4 > last[$1]) last[$1] = $4
          if (!number || $1 < number) number = $1
          if ($1 > end) end = $1
          due = epoch * rate + $4 * rate / 1000 - $1
          due -= 4294967296 * int(due / 4294967296 + 0.5) # tick numbers wrap
          if (due < 0) due = -due
          if (due > worst) worst = due }
        END {
            for (n = number + 1; n < end; n++) { # the first and the last are cut off
                if (!(n in first)) continue
                ticks++; whole += count[n] == 3
                if (count[n] > 3) { print "tick", n, "was shown", count[n], "times"; bad = 1 }
                if (before && first[n] <= last[before]) {
                    print "tick", n, "was shown before all had shown", before; bad = 1 }
                before = n
                skew = last[n] - first[n]; if (skew > most) most = skew }
            printf "%d ticks, %d by all three, skew %.3f ms worst, %.2f ticks off its time at the most\n",
                ticks, whole, most, worst
            exit bad || !ticks || whole < 0.9 * ticks || worst > 6 }'
}

start_all
start send.log ip netns exec "$space.host" "$OTWD" send flight.csv --protocol native --rate 50 \
    --to udp://239.192.0.2:5600
wait_for 20 driven || fatal "the poses do not drive all three"
wait_for 20 steady || fatal "the channels are not in step"
lines=$(wc -l <swaps)
wait_for 20 shown $((lines + 240)) || fatal "$(($(wc -l <swaps) - lines)) frames were shown, too few"
ticks $((lines + 1)) 240 || fail "the channels are out of step"
for i in 1 2 3; do
    in_space $i "$OTWD" status >status.txt
    grep "^swap lock  *3 of 3 in step, [1-9][0-9]* frames" status.txt || fail "no lock in: $(cat status.txt)"
done
finish
