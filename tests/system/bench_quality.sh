#!/bin/sh
# `otwd bench quality`: the figures are there and sound, the worst frame is written, and what is asked
# wrongly is told.
. "$(dirname "$0")/common.sh"

cat >flight.csv <<END
# altitude: egm96
time_s,lat_deg,lon_deg,alt_m,roll_deg,pitch_deg,heading_deg
0,46.3,9.2,3000,0,-40,60
10,46.31,9.22,3000,0,-35,80
END

# measure NAME ARGUMENT...: into NAME.json.
measure() {
    name=$1
    shift
    "$OTWD" bench quality flight.csv --size 160x90 --json "$@" >"$name.json" 2>bench.log
    case $? in
    0) ;;
    69)
        echo "skip: $(cat bench.log)"
        exit 77
        ;;
    *) fatal "$name: $(cat bench.log)" ;;
    esac
}

# value NAME OBJECT KEY: a number, of an object or (OBJECT "") of the whole.
value() {
    tr -d ' \n' <"$1.json" | sed -n "s/.*\"${2:+$2\":{[^\}]*\"}$3\":\([-0-9.e]*\).*/\1/p"
}

# within NAME OBJECT KEY LEAST MOST
within() {
    awk -v a="$(value "$1" "$2" "$3")" -v least="$4" -v most="$5" \
        'BEGIN { exit !(a != "" && a >= least && a <= most) }' ||
        fail "$1: $2 $3 is \"$(value "$1" "$2" "$3")\", not from $4 to $5"
}

measure coarse --frames 2 --radius 32 --reference-step 40 --images pictures
within coarse "" pixels 40000 40000
within coarse "" pixels_judged 20000 40000
within coarse "" share_over_pixel_error 0.0001 1
within coarse error_px p999 0.5 50
within coarse depth_resolution_px max 0 0.01
within coarse psnr_db mean 15 60
within coarse psnr_db worst 10 60
within coarse reference step_m 10 40
within coarse ground level 0 0
for name in ours reference difference; do
    [ "$(head -c 4 "pictures/$name.png" | od -An -tx1 | tr -d ' ')" = 89504e47 ] || fail "no $name.png"
done
cmp -s pictures/ours.png pictures/reference.png && fail "the reference is our own picture"

measure fine --frames 2 --radius 256 --no-picture
within fine error_px p999 0 "$(awk -v a="$(value coarse error_px p999)" 'BEGIN { print 0.5 * a }')"
grep -q psnr_db fine.json && fail "a ratio without a picture: $(cat fine.json)"

"$OTWD" bench quality flight.csv --size 160x90 --frames 1 --pixels 500 --reference-step 80 \
    >table.txt 2>>bench.log || fail "no table"
grep -Eq "^  error +( +[0-9]+\.[0-9]+){4}\$" table.txt || fail "no error: $(cat table.txt)"
grep -Eq '^  PSNR [0-9.]+ dB on average' table.txt || fail "no ratio: $(cat table.txt)"

# expect STATUS TEXT ARGUMENT...
expect() {
    expected=$1 text=$2
    shift 2
    "$OTWD" bench quality --size 160x90 --frames 1 --pixels 100 --reference-step 80 "$@" \
        >out.txt 2>error.txt
    status=$?
    [ "$status" -eq "$expected" ] || fail "$*: status $status, not $expected"
    grep -qF -- "$text" error.txt || fail "$*: \"$(cat error.txt)\" has no \"$text\""
}
expect 64 'FLIGHT'
expect 64 'power of two' --radius 100 flight.csv
expect 64 'a number from 32 to 256' --radius 512 flight.csv
expect 64 '"quadtrees"' --technique quadtrees flight.csv
expect 66 'absent.csv' absent.csv
expect 66 'absent.db' --terrain absent.db flight.csv
printf 'no flight\n' >none.csv
expect 65 'none.csv' none.csv
expect 74 'ours.png' --images flight.csv flight.csv
finish
