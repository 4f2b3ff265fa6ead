#!/bin/sh
# Calls that fail (tests/fail_call.c) while the daemon draws, and then succeed again: all those of a class
# fail for a while. It goes on, or ends with a status of its own; the fault is raised, and over afterwards.
# `FAIL_CALLS=all meson test fail_running -t 40` has each place that calls in the running loop fail by itself,
# too, while it is asked for its state, dug, told to read its configuration again and to take a picture.
# shellcheck disable=SC2013,SC2317 # words are meant; functions that wait_for calls
. "$(dirname "$0")/common.sh"
preload="$FAIL_CALL${LD_PRELOAD:+:$LD_PRELOAD}"
all=${FAIL_CALLS:-}

port=$(free_port)
modbus=$(free_port)
write_flight short.csv
sed "s/^60,/3600,/" short.csv >flight.csv
cat >otwd.yaml <<YAML
display: {width: 64, height: 36, rate_hz: 20}
sources:
  - {name: host, type: native, listen: "127.0.0.1:$port", timeout_ms: 500}
health: {modbus: {listen: "127.0.0.1:$modbus", allow_control: true}}
record: {directory: $scratch/record}
YAML
start send.log "$OTWD" send flight.csv --to "udp://127.0.0.1:$port" --rate 20

# start_failing CLASS [NAME]: nothing fails until there is a file `failing`; NAME is that of the only
# function that does.
start_failing() {
    rm -f failing failed
    FAIL_CLASS=$1 FAIL_NAME=${2:-} FAIL_AT=1 FAIL_ONWARD=1 FAIL_WHILE="$scratch/failing" \
        FAIL_LIST="$scratch/$1.sites" FAIL_DONE="$scratch/failed" LD_PRELOAD="$preload" start_daemon otwd.yaml
    wait_for 10 at_least accepted 5 || fail "$1: no poses before"
}
# goes_on WHAT FRAMES: so many more come, and poses are taken.
goes_on() {
    wait_for 20 at_least frames_rendered 1 || fatal "$1: does not answer afterwards"
    frames=$(field frames_rendered)
    accepted=$(field accepted)
    wait_for 20 at_least frames_rendered $((frames + $2)) || fail "$1: no frames afterwards"
    wait_for 20 at_least accepted $((accepted + $2)) || fail "$1: no poses afterwards"
}
told_faults() {
    grep -o 'fault=[0-9]*' otwd.log | sort -u | tr '\n' ' '
}

# run_failing CLASS FAULT NAME: the fault that the class has to raise, if any.
run_failing() {
    class=$1
    start_failing "$class"
    : >failing
    [ -z "$2" ] || wait_for 20 logged "fault=$2" || fail "$class: no fault $2"
    [ "$class" != memory ] || kill -HUP "$daemon" # while it only draws it may do without
    sleep 1
    [ "$class" != memory ] || wait_for 20 test -e failed
    rm failing
    [ -z "$2" ] || [ -e failed ] || fail "$class: nothing has failed"
    goes_on "$class" 20
    [ -z "$2" ] || wait_for 20 logged "$3 is over" || fail "$class: fault $2 does not end"
    echo "$class: $([ -e failed ] && echo calls failed || echo no call was made): $(told_faults)"
    stop_daemon
    [ "$stopped" -eq 0 ] || fail "$class: the daemon ended with $stopped"
}

run_failing socket 105 SOURCE_FAILED

# A socket that fails at each read stays readable: it is left alone, but for a try each second.
start_failing socket recvmsg
: >failing
wait_for 20 logged "fault=105" || fail "a socket that cannot be read: no fault 105"
sleep 1.5
rm failing
goes_on "a socket that cannot be read" 20
wait_for 20 logged "SOURCE_FAILED is over" || fail "a socket that cannot be read: 105 does not end"
told=$(grep -c 'fault=105' otwd.log)
[ "$told" -le 2 ] || fail "a socket that cannot be read: told $told times"
stop_daemon
reads=$(awk '{ n += $2 } END { print n + 0 }' socket.sites)
echo "a socket that cannot be read: $reads reads in 2 s"
[ "$reads" -ge 4 ] || fail "a socket that cannot be read was not tried again"
[ "$reads" -le 100 ] || fail "a socket that cannot be read was read $reads times"

run_failing file 501 RECORDER_FAILED
run_failing memory ''
[ -e failed ] || fail "memory: nothing has failed"
# What the GPU holds is made at the start: there is nothing to fail while it draws.
run_failing gl ''
[ ! -e failed ] || fail "gl: something was made while it drew"
[ -n "$all" ] || finish

# The same, place by place.
{
    printf 'ncols 61\nnrows 61\nxllcorner 7.75\nyllcorner 46.35\ncellsize 0.0055555555556\n'
    awk 'BEGIN { for (i = 0; i < 61; i++) { for (j = 0; j < 61; j++) printf "1000 "; print "" } }'
} >flat.asc
if "$OTWD" import flat.asc --crs EPSG:4326 -o flat.db -q 2>import.log; then
    echo "terrain: {database: flat.db, allow_dig: true}" >>otwd.yaml
    cp flat.db undug.db
fi
is_gone() {
    ! kill -0 "$daemon" 2>/dev/null
}
answers() {
    [ -n "$(field state)" ]
}
is_well() {
    is code 302 || is code 301 || is code 0
}
can_dig() {
    ! grep -q allow_dig otwd.yaml ||
        "$OTWD" dig "udp://127.0.0.1:$port" crater --at 46.51,7.91 --radius-m 300 --depth-m 30
}
provoke() {
    status >/dev/null 2>&1
    can_dig >dig.log 2>&1
    sed -i "s/^display: .*/display: {width: $((128 - width)), height: 36, rate_hz: 20}/" otwd.yaml
    width=$((128 - width))
    kill -HUP "$daemon"
    sleep 1
    mbpoll -m tcp -p "$modbus" -a 1 -0 -1 -t 0 -r 1 127.0.0.1 0 >/dev/null 2>&1
    mbpoll -m tcp -p "$modbus" -a 1 -0 -1 -t 0 -r 1 127.0.0.1 1 >/dev/null 2>&1
    sleep 0.5
}
# As the first of them started: a database that nobody has dug in.
start_afresh() {
    stop_daemon
    [ "$stopped" -eq 0 ] || fail "$what: the daemon ended with $stopped"
    rm -f flat.db-wal flat.db-shm
    [ ! -e undug.db ] || cp undug.db flat.db
    start_failing "$class"
    before=0
}
width=60
failed=0
for class in ${all#all} $([ "$all" != all ] || echo socket file memory gl sqlite-memory sqlite-file); do
    start_failing "$class"
    echo 1 >failing # a place that nobody calls from
    provoke
    rm failing
    stop_daemon
    sort "$class.sites" >"$class.all"
    echo "$class: $(wc -l <"$class.all") places in the running loop"
    start_failing "$class"
    for site in $(awk '{print $1}' "$class.all"); do
        what="$class: all calls at $site"
        rm -f failed
        before=$(wc -l <otwd.log)
        echo "$site" >failing
        provoke
        rm failing
        if [ ! -e failed ] && ! is_gone; then # it was called once, and then no more
            start_afresh
            echo "$site" >failing
            provoke
            rm failing
        fi
        wait_for 20 answers || is_gone || fatal "$what: does not answer afterwards"
        [ ! -e failed ] || failed=$((failed + 1))
        if is_gone; then
            wait "$daemon"
            stopped=$?
            echo "$what: status $stopped: $(tail -n 2 otwd.log)"
            case $stopped in
            66 | 69 | 71 | 74 | 78) ;;
            *) fail "$what: status $stopped" ;;
            esac
            start_failing "$class"
            continue
        fi
        goes_on "$what" 5
        wait_for 20 can_dig || fail "$what: cannot be dug afterwards" # which ends fault 204
        wait_for 30 is_well || fail "$what: fault $(field code) stays"
        echo "$what: $([ -e failed ] && echo failed || echo not called):" \
            "$(tail -n "+$before" otwd.log | grep -o 'fault=[0-9]*' | sort -u | tr '\n' ' ')"
    done
    stop_daemon
    [ "$stopped" -eq 0 ] || fail "$class: the daemon ended with $stopped"
done
echo "$failed places failed while it ran"
finish
