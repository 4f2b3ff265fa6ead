#!/bin/sh
# `otwd bench motion`: a row for every protocol, rate and delay, the same for the same seed, and what is
# asked wrongly is told.
. "$(dirname "$0")/common.sh"

"$OTWD" bench motion --duration 20 --json >first.json 2>bench.log || fatal "$(cat bench.log)"
"$OTWD" bench motion --duration 20 --json >second.json 2>>bench.log || fatal "$(cat bench.log)"
cmp first.json second.json || fail "the same seed gives other figures"
"$OTWD" bench motion --duration 20 --seed 2 --json >other.json 2>>bench.log || fatal "$(cat bench.log)"
! cmp -s first.json other.json || fail "another seed gives the same figures"
[ "$(grep -c '"protocol": "native"' first.json)" -eq 12 ] || fail "not 12 rows of native"
grep -q '"protocol": "canaerospace"' first.json || fail "no row of canaerospace"
grep -q '"frames": 899' first.json || fail "the frames are not those of 15 s"

"$OTWD" bench motion --duration 20 --protocol native \
    --loss 0 --jitter-ms 0 --reorder 0 >table.txt 2>>bench.log ||
    fail "no table"
grep -q '^| 60 | 40 | 0\.00[0-5] | 0\.0[0-9]*' table.txt || fail "a perfect network: $(cat table.txt)"

# expect STATUS TEXT ARGUMENT...
expect() {
    expected=$1 text=$2
    shift 2
    "$OTWD" bench motion "$@" >out.txt 2>error.txt
    status=$?
    [ "$status" -eq "$expected" ] || fail "$*: status $status, not $expected"
    grep -qF -- "$text" error.txt || fail "$*: \"$(cat error.txt)\" has no \"$text\""
}
expect 64 'no protocol "smoke"' --protocol smoke
expect 64 'duration' --duration 1
expect 64 'unexpected argument' flight.csv
finish
