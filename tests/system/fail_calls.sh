#!/bin/sh
# Calls that fail (tests/fail_call.c) while the daemon starts: it ends with a status of its own and a
# sentence, or draws; it never crashes, hangs, or is silent. A sample of the places that call (44 s on a busy
# machine); `FAIL_CALLS=all meson test fail_calls -t 40` takes every place, both when it fails once and
# from then on, and of SQLite the first 400 calls and each 20th (FAIL_STEP) after them, from FAIL_FROM on;
# FAIL_CALLS='gl socket' those classes only.
# shellcheck disable=SC2013,SC2317 # words are meant; functions that wait_for calls
. "$(dirname "$0")/common.sh"
preload="$FAIL_CALL${LD_PRELOAD:+:$LD_PRELOAD}"
all=${FAIL_CALLS:-}

port=$(free_port)
modbus=$(free_port)
cat >otwd.yaml <<YAML
display: {width: 64, height: 36, rate_hz: 20}
sources:
  - {name: host, type: native, listen: "127.0.0.1:$port"}
  - {name: ig, type: cigi, version: 4.0, listen: "127.0.0.1:$(free_port)", reply: "127.0.0.1:9"}
health: {modbus: {listen: "127.0.0.1:$modbus"}}
record: {directory: $scratch/record}
YAML
# One that can be dug, where rasters can be imported.
{
    printf 'ncols 61\nnrows 61\nxllcorner 7.75\nyllcorner 46.35\ncellsize 0.0055555555556\n'
    awk 'BEGIN { for (i = 0; i < 61; i++) { for (j = 0; j < 61; j++) printf "1000 "; print "" } }'
} >flat.asc
if "$OTWD" import flat.asc --crs EPSG:4326 -o flat.db -q 2>import.log; then
    echo "terrain: {database: flat.db, allow_dig: true}" >>otwd.yaml
fi

is_gone() {
    ! kill -0 "$started" 2>/dev/null
}
draws_or_is_gone() {
    is_gone || grep -q 'drawing with OpenGL' otwd.log
}

# run_failing CLASS SITE AT ONWARD: $status is 0 where it draws and stops in order.
run_failing() {
    rm -f failed otwd.log # of the run before, which drew
    start otwd.log env ${4:+FAIL_ONWARD=1} FAIL_CLASS="$1" FAIL_SITE="$2" FAIL_AT="$3" \
        FAIL_DONE="$scratch/failed" FAIL_LIST="$scratch/$1.sites" LD_PRELOAD="$preload" \
        "$OTWD" run -c otwd.yaml
    what="$1: call $3 at $2${4:+, and from then on}"
    wait_for 60 draws_or_is_gone || fail "$what: neither draws nor ends"
    kill -TERM "$started" 2>/dev/null
    wait_for 10 is_gone || {
        fail "$what: does not stop"
        kill -KILL "$started"
    }
    wait "$started"
    status=$?
}

judge() {
    [ -e failed ] || return
    failed=$((failed + 1))
    case $status in
    0) drew=$((drew + 1)) ;;
    66 | 69 | 71 | 74 | 78)
        grep -q ' \(warning\|error\|critical\) \|: ' otwd.log || fail "$what: status $status, silent"
        ;;
    *) fail "$what: status $status: $(tail -n 5 otwd.log)" ;;
    esac
    case $status in
    66) grep -q 'fault=108\|otwd.yaml' otwd.log || fail "$what: 66 without a fault" ;;
    69) grep -q 'fault=30[34]' otwd.log || fail "$what: 69 without a fault" ;;
    esac
    [ -z "$all" ] || echo "$what: status $status $(grep -o 'fault=[0-9]*' otwd.log | tr '\n' ' ')"
}

# A renderer that cannot be made, and cannot tell so.
export FAIL_NAME=write __EGL_VENDOR_LIBRARY_FILENAMES=/dev/null
run_failing file 0 1 onward
unset FAIL_NAME __EGL_VENDOR_LIBRARY_FILENAMES
[ -e failed ] || fail "$what: write() was not called"
[ "$status" -eq 69 ] || fail "$what: status $status without OpenGL"
grep -q 'fault=303' otwd.log || fail "$what: no fault 303"

failed=0
drew=0
classes=${all:-memory file socket gl}
[ "$classes" != all ] || classes='memory file socket gl sqlite-memory sqlite-file'
for class in $classes; do
    case $class in sqlite-*) continue ;; esac
    run_failing "$class" 0 0 ''
    [ "$status" -eq 0 ] || fatal "$class: without a failure the status is $status"
    sort "$class.sites" >"$class.all"
    count=$(wc -l <"$class.all")
    [ "$count" -ge 10 ] || fail "$class: only $count places call"
    echo "$class: $count places"
    for site in $(awk -v all="$all" -v n="$count" \
        'all || NR % int(n / 2) == 1 {print $1}' "$class.all"); do
        run_failing "$class" "$site" 1 ''
        judge
        [ -n "$all" ] || continue
        run_failing "$class" "$site" 1 onward
        judge
    done
done
for class in $classes; do
    case $class in sqlite-*) ;; *) continue ;; esac
    at=${FAIL_FROM:-1}
    while :; do
        run_failing "$class" 0 "$at" ''
        [ -e failed ] || break
        judge
        at=$((at + (at < 400 ? 1 : ${FAIL_STEP:-20})))
    done
    echo "$class: call $at is not made any more"
done
echo "$failed calls failed; after $drew of them it drew"
[ "$failed" -ge 6 ] || fail "hardly a call has failed: $failed"
finish
