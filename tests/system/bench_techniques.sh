#!/bin/sh
# `otwd bench --flight`: every technique has its rows, the reference is the ground itself, what has
# a setting meets the error that is asked for, the report is there, and what is asked wrongly is told.
. "$(dirname "$0")/common.sh"

cat >flight.csv <<END
# altitude: egm96
time_s,lat_deg,lon_deg,alt_m,roll_deg,pitch_deg,heading_deg
0,46.3,9.2,3000,0,-30,60
1,46.301,9.201,3000,0,-30,65
END

# measure NAME ARGUMENT...: into NAME.json.
measure() {
    name=$1
    shift
    "$OTWD" bench --flight flight.csv --size 160x90 --rate 4 --posts 513 --rounds 2 --pixels 1000 \
        --json "$@" >"$name.json" 2>bench.log
    case $? in
    0) ;;
    69)
        echo "skip: $(cat bench.log)"
        exit 77
        ;;
    *) fatal "$name: $(cat bench.log)" ;;
    esac
}

# value TABLE TECHNIQUE OBJECT KEY: of both.json; a number, of an object or (OBJECT "") of the row.
value() {
    tr -d ' \n' <both.json |
        sed -n "s/.*\"$1\":\[\(.*\)/\1/p" | sed 's/\],"equal_.*//' |
        sed -n "s/.*{\"technique\":\"$2\"\(.*\)/\1/p" | sed 's/{"technique":.*//' |
        sed -n "s/.*\"${3:+$3\":{[^\}]*\"}$4\":\([-0-9.e]*\).*/\1/p"
}

# within TABLE TECHNIQUE OBJECT KEY LEAST MOST
within() {
    awk -v a="$(value "$1" "$2" "$3" "$4")" -v least="$5" -v most="$6" \
        'BEGIN { exit !(a != "" && a >= least && a <= most) }' ||
        fail "$1, $2: $3 $4 is \"$(value "$1" "$2" "$3" "$4")\", not from $5 to $6"
}

measure both --techniques reference,clipmap --pixel-error 2 --report report
grep -q '"not available"' both.json && fail "something is not available: $(cat both.json)"
for table in equal_error equal_time; do
    for technique in clipmap reference; do
        within $table $technique frame_ms p50 0.01 60000
        within $table $technique terrain_ms p50 0.01 60000
        within $table $technique gpu_ms p50 0.01 60000
        within $table $technique triangles p50 100 1e7
        within $table $technique pixels judged 10000 72000
        within $table $technique memory_mib gpu 0.9 100000
    done
    within $table reference error_px p999 0 0.01
    within $table reference psnr_db worst 98.9 99
    within $table reference pixels holes 0 0
done
within equal_error reference motion_px p999 0 0.02
within equal_error clipmap motion_px p99 0 1
within equal_error clipmap error_px p99 1 2.6 # chosen by other frames than are flown
within equal_error clipmap psnr_db mean 15 60
within equal_error clipmap pixels holes 0 200
within equal_error reference pixels beyond 0 0
for name in clipmap clipmap-difference clipmap-edges reference; do
    [ "$(head -c 4 "report/$name.png" | od -An -tx1 | tr -d ' ')" = 89504e47 ] || fail "no $name.png"
done
cmp -s report/clipmap.png report/reference.png && fail "the clipmap is the reference"
cmp -s report/clipmap.png report/clipmap-edges.png && fail "edges are the picture"
cmp -s both.json report/report.json || fail "report.json is not what was printed"
grep -q '</html>' report/report.html || fail "report.html is cut short"
grep -q 'clipmap-edges.png' report/report.html || fail "report.html shows no edges"

# Settings that are given are flown as they are, a technique at several of them, with no search.
measure asked --techniques cdlod@4,cdlod@12,reference --report asked
[ "$(cut -d, -f2-3 asked/flown.csv | tr '\n' ' ')" = \
    'technique,setting cdlod,4 cdlod,12 reference,1 ' ] ||
    fail "flown.csv: $(cat asked/flown.csv)"
awk -F, 'NR == 1 { for (i = 1; i <= NF; i++) at[$i] = i; next }
    { t[NR] = $at["triangles_p50"]; ok = NF == length(at) && $at["frame_ms_min"] > 0 &&
        $at["frame_ms_mean"] >= $at["frame_ms_min"] && $at["frame_ms_max"] >= $at["frame_ms_mean"]
      if (!ok) exit 1 }
    END { exit !(t[3] > 1.2 * t[2]) }' asked/flown.csv || fail "flown.csv: $(cat asked/flown.csv)"
[ "$(head -n 1 asked/frames.csv)" = 'time_s,cdlod@4,cdlod@12,reference@1' ] ||
    fail "frames.csv: $(cat asked/frames.csv)"
[ "$(wc -l <asked/frames.csv)" = 6 ] || fail "frames.csv: $(cat asked/frames.csv)"
grep -q 'settings that were asked for' asked/report.html || fail "report.html has no table"

# Each is judged by the same picture of the truth, whatever was shown before it: over a descent, so that each
# frame needs finer levels than the one before.
cat >descent.csv <<END
# altitude: egm96
time_s,lat_deg,lon_deg,alt_m,roll_deg,pitch_deg,heading_deg
0,46.3,9.2,20000,0,-30,60
1,46.301,9.201,3500,0,-30,60
END
# judged TECHNIQUE TECHNIQUE: a line "TECHNIQUE PSNR PSNR" of each, least and mean, in the alphabet's order.
judged() {
    "$OTWD" bench --flight descent.csv --size 160x90 --rate 1 --posts 513 --rounds 1 --every 1 \
        --techniques "$1,$2" --report descent >/dev/null 2>&1 || fatal "the descent is not flown"
    awk -F, 'NR == 1 { for (i = 1; i <= NF; i++) at[$i] = i; next }
        { print $2, $at["psnr_db_min"], $at["psnr_db_mean"] }' descent/flown.csv | sort
}
one=$(judged cdlod@8 clipmap@1)
other=$(judged clipmap@1 cdlod@8)
[ "$one" = "$other" ] || fail "in one order $one, in the other $other"

# A flight that leaves the ground: the row says so.
printf '20,47,10,3000,0,-30,65\n' >>flight.csv
measure gone --techniques reference --spacing 4
grep -q '"reason": "the flight leaves the field' gone.json || fail "no reason: $(cat gone.json)"

# expect STATUS TEXT ARGUMENT...
expect() {
    expected=$1 text=$2
    shift 2
    "$OTWD" bench --size 160x90 "$@" >out.txt 2>error.txt
    status=$?
    [ "$status" -eq "$expected" ] || fail "$*: status $status, not $expected"
    grep -qF -- "$text" error.txt || fail "$*: \"$(cat error.txt)\" has no \"$text\""
}
expect 64 '--flight FLIGHT is missing'
expect 64 'there is no technique "quadtrees"; there are clipmap, reference' \
    --flight flight.csv --techniques clipmap,quadtrees
expect 64 'takes a number from' --flight flight.csv --techniques clipmap@100
expect 64 'takes a power of two' --flight flight.csv --radius 100
expect 64 'a power of two and one more' --flight flight.csv --posts 1000
expect 66 'absent.csv' --flight absent.csv
expect 66 'absent.db' --flight flight.csv --terrain absent.db
{ head -3 flight.csv; echo 9000,40,80,3000,0,-30,65; } >far.csv
expect 64 'too few for a clipmap' --flight far.csv --posts 513
printf 'no flight\n' >none.csv
expect 65 'none.csv' --flight none.csv
finish
