#!/bin/sh
# The demo at its smallest: pictures each five seconds, a report, the same report as JSON; and `otwd send`,
# which tells what it sent in the same way.
. "$(dirname "$0")/common.sh"

"$OTWD" demo --no-video --size 64x36 --rate 1 --out out --json >told.json 2>error.txt ||
    fatal "the demo ends with $?: $(cat error.txt)"
printf "%s\n" "$(cat out/report/report.json)" | cmp - told.json || fail "what is printed is not the report"
grep -q '"frames": 61,' told.json || fail "there are other than 61 frames"
set -- out/frames/frame-*.png
[ $# -eq 13 ] || fail "$# pictures, not 13"
grep -q '<html' out/report/report.html || fail "no page"
[ "$(wc -l <out/report/frames.csv)" -eq 62 ] || fail "not a line for each frame"

write_flight flight.csv
port=$(free_port)
start hold.log "$SYSTEM_TOOL" hold-port "$port"
sleep 0.2
"$OTWD" send flight.csv --to "udp://127.0.0.1:$port" --speed 100 --rate 60 --loss 0.5 --json >sent.json ||
    fail "send ends with $?"
tr -d ' \n' <sent.json >flat.json
grep -qE '^\{"sent":[1-9][0-9]*,"left_out":[1-9][0-9]*,"refused":0\}$' flat.json || fail "$(cat sent.json)"
finish
