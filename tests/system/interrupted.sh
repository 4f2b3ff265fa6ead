#!/bin/sh
# A replay that is interrupted, as by Ctrl-C, ends with 75 and has made of what was flown what it was asked
# for: the report, the video, and the summary.
. "$(dirname "$0")/common.sh"

cat >flight.csv <<'END'
# altitude: ellipsoid
time_s,lat_deg,lon_deg,alt_m,roll_deg,pitch_deg,heading_deg
0,46.7,8.1,3000,0,0,0
600,47.2,8.1,3000,0,0,0
END
set -- replay flight.csv --size 64x36 --rate 20 --json --report report --frames frames
if command -v ffmpeg >/dev/null; then
    set -- "$@" --video flight.mp4
fi
# timeout passes the signal on to the program and all that it has started.
start flown.json timeout --preserve-status 80 "$OTWD" "$@"
wait_for 60 test -s frames/frame-000010.png || fatal "no frames"
kill -INT "$started"
wait "$started"
status=$?
pids=
[ "$status" -eq 75 ] || fail "status $status"
grep -q 'interrupted after [0-9]* of 12001 frames' flown.json || fail "the interruption is not told"
frames=$(sed -n 's/^  "frames": \([0-9]*\),$/\1/p' report/report.json)
{ [ "${frames:-0}" -gt 10 ] && [ "$frames" -lt 12001 ]; } || fail "the report has ${frames:-no} frames"
[ "$(wc -l <report/frames.csv)" -eq $((frames + 1)) ] || fail "frames.csv has others than the report"
[ -s report/report.html ] || fail "no report.html"
grep -q "\"frames\": $frames," flown.json || fail "the report is not printed"
if [ -e flight.mp4 ]; then
    seen=$(ffprobe -v error -count_frames -select_streams v -show_entries stream=nb_read_frames \
        -of default=nokey=1:noprint_wrappers=1 flight.mp4) || fail "the video is not whole"
    [ "$seen" = "$frames" ] || fail "the video has $seen of $frames frames"
fi
# Options before -c are read, too.
printf 'display: {width: 80, height: 44}\n' >small.yaml
{
    head -n 3 flight.csv
    echo '0.2,46.7001,8.1,3000,0,0,0'
} >short.csv
"$OTWD" replay -q -c small.yaml --json --speed max short.csv >short.json || fail "replay -q -c: status $?"
tr -d '\n ' <short.json | grep -q '"size_px":\[80,44\]' || fail "-c after -q is not read"
finish
