# Three machines on one switch, a host and three channels of a swap lock, as network namespaces: what
# the tests of channels in step share. $base is whose numbers frames go by: host or tick. $i.yaml is a
# channel's configuration.
# shellcheck shell=sh disable=SC2034,SC2154 # variables that pass between this file and the tests

group=239.192.0.1:8010
host=10.77.0.1
space=otwd$$
spaces="$space.host $space.1 $space.2 $space.3"

need ip
for name in $spaces; do
    ip netns add "$name" 2>/dev/null || {
        echo "skip: network namespaces cannot be made here"
        exit 77
    }
done

end_spaces() {
    end
    for name in $spaces; do
        ip netns pids "$name" | xargs -r kill -KILL
        ip netns delete "$name"
    done
}
trap end_spaces EXIT

in_space() {
    where=$1
    shift
    ip netns exec "$space.$where" "$@"
}

# The way that a host and the channels go on a real network: one switch.
connect() {
    in_space host ip link add bridge type bridge mcast_snooping 0 &&
        in_space host ip address add "$host/24" dev bridge &&
        in_space host ip link set bridge up &&
        in_space host ip link set lo up &&
        in_space host ip route add 239.0.0.0/8 dev bridge &&
        for i in 1 2 3; do
            in_space host ip link add "to$i" type veth peer name eth0 netns "$space.$i" &&
                in_space host ip link set "to$i" master bridge up &&
                in_space "$i" ip address add "10.77.0.1$i/24" dev eth0 &&
                in_space "$i" ip link set eth0 up &&
                in_space "$i" ip link set lo up &&
                in_space "$i" ip route add 239.0.0.0/8 dev eth0 || return 1
        done
}
connect || fatal "the namespaces are not connected"

start_channel() {
    start "channel$1.log" ip netns exec "$space.$1" "$OTWD" run -c "$1.yaml"
    case $1 in
    1) first_pid=$started ;;
    3) third_pid=$started ;;
    esac
}

logged_by() {
    channel=$1
    grep -q "$2" "channel$channel.log"
}

all_drawing() {
    for channel in 1 2 3; do
        logged_by "$channel" "the first frame is out" || return 1
    done
}

# Each of the last 40 frames was shown by all three.
steady() {
    tail -n 126 swaps | awk -v base="$base" '$3 == base { count[$1]++ }
        END { for (n in count) { all += count[n] == 3 }; exit !(all >= 40) }'
}

shown() {
    [ "$(wc -l <swaps)" -ge "$1" ]
}

last_number() {
    tail -n 4 swaps | head -n 1 | cut -d ' ' -f 1
}

# together FROM TO: what the channels said that they showed of the frames FROM to TO: each by all three, and
# none before all had shown the one before.
together() {
    awk -v from="$1" -v to="$2" -v base="$base" '
        $3 != base || $1 < from || $1 > to { next }
        { count[$1]++; sum[$1] += $2
          if (!($1 in first) || $4 < first[$1]) first[$1] = $4
          if ($4 > last[$1]) last[$1] = $4 }
        END {
            for (n = from; n <= to; n++) {
                if (count[n] != 3 || sum[n] != 6) {
                    print "frame", n, "was shown", count[n] + 0, "times"; bad = 1 }
                if (n > from && first[n] <= last[n - 1]) {
                    print "frame", n, "was shown before all had shown", n - 1; bad = 1 }
                skew = last[n] - first[n]; if (skew > worst) worst = skew
                total += skew }
            printf "frames %d to %d: skew %.3f ms mean, %.3f ms worst, %.1f a second\n", from, to,
                total / (to - from + 1), worst, 1000 * (to - from) / (last[to] - first[from])
            exit bad + 0 }' swaps
}

# start_all: the channels, and what writes down in `swaps` what they show.
start_all() {
    epoch=$(date +%s)
    start swaps ip netns exec "$space.host" "$SYSTEM_TOOL" swaps "$group" "$host" "$epoch"
    for i in 1 2 3; do
        start_channel "$i"
    done
    wait_for 60 all_drawing || fatal "the channels do not draw"
}
