#!/bin/sh
# `otwd bench stability`: the noise is small, a slow flight is steady, and what is asked wrongly is told.
. "$(dirname "$0")/common.sh"

# measure FLIGHT: into $FLIGHT.json.
measure() {
    "$OTWD" bench stability --size 320x180 --frames 16 --flight "$1" --json >"$1.json" 2>bench.log
    case $? in
    0) ;;
    69)
        echo "skip: $(cat bench.log)"
        exit 77
        ;;
    *) fatal "$1: $(cat bench.log)" ;;
    esac
}

# value FLIGHT KEY: the first of that name.
value() {
    sed -n "s/^ *\"$2\": \([-0-9.e]*\),\{0,1\}\$/\1/p" "$1.json" | head -n 1
}

# within FLIGHT KEY LEAST MOST
within() {
    awk -v a="$(value "$1" "$2")" -v least="$3" -v most="$4" \
        'BEGIN { exit !(a != "" && a >= least && a <= most) }' ||
        fail "$1: $2 is $(value "$1" "$2"), not from $3 to $4"
}

measure creep
within creep p999 0 0.005
within creep max 0 0.05
measure low
within low pixels 200000 1000000
within low pixels_judged 180000 1000000
within low p50 0 0.01
within low p999 0.001 0.25
grep -q '"technique": "clipmap"' low.json || fail "no technique: $(cat low.json)"

"$OTWD" bench stability --size 320x180 --frames 8 --flight taxi >table.txt 2>>bench.log || fail "no table"
grep -Eq '^  taxi .* [0-9.]+ %( +[0-9]+\.[0-9]+){5}$' table.txt || fail "no row: $(cat table.txt)"

# expect STATUS TEXT ARGUMENT...
expect() {
    expected=$1 text=$2
    shift 2
    "$OTWD" bench stability --size 320x180 --frames 8 "$@" >out.txt 2>error.txt
    status=$?
    [ "$status" -eq "$expected" ] || fail "$*: status $status, not $expected"
    grep -qF -- "$text" error.txt || fail "$*: \"$(cat error.txt)\" has no \"$text\""
}
expect 64 'no flight "glide"' --flight glide
expect 64 'LAT,LON' --at 91,0
expect 64 'a number from 8' --frames 4
expect 66 'absent.db' --terrain absent.db
expect 64 '"quadtrees"' --technique quadtrees
expect 64 'unexpected argument' low
finish
