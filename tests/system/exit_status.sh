#!/bin/sh
# Exit statuses of what cannot be read, written or reached: those of sysexits.h, with one sentence.
. "$(dirname "$0")/common.sh"

write_flight flight.csv
printf '# altitude: egm96\ntime_s,lat_deg,lon_deg,alt_m,roll_deg,pitch_deg,heading_deg\n0,46,x,1,0,0,0\n' \
    >wrong.csv
fly="$OTWD replay -q --speed max --rate 0.1 --size 64x36"

# expect STATUS TEXT COMMAND...: the last line of what it says holds TEXT.
expect() {
    expected=$1 text=$2
    shift 2
    "$@" >out.txt 2>error.txt
    status=$?
    [ "$status" -eq "$expected" ] || fail "$*: status $status, not $expected"
    tail -n 1 error.txt | grep -qF -- "$text" || fail "$*: \"$(cat error.txt)\" has no \"$text\""
}
# shellcheck disable=SC2086 # $fly is a command line
{
    expect 66 'absent.csv: No such file' $fly absent.csv
    expect 66 '.: not a file' $fly .
    expect 65 '/dev/null: not a file' $fly /dev/null
    expect 65 'wrong.csv:3:6: lon_deg is not a number' $fly wrong.csv
    expect 66 'absent.db: No such file' $fly --terrain absent.db flight.csv
    expect 65 'flight.csv is not a terrain database' $fly --terrain flight.csv flight.csv
    expect 74 'absent/deep: cannot make the directory' $fly --frames absent/deep flight.csv
    expect 74 'flight.csv: cannot make the directory' $fly --frames flight.csv flight.csv
    expect 74 'flight.csv: cannot make the directory' $fly --report flight.csv flight.csv
    expect 69 'x.mp4: ffmpeg is not installed' env PATH=/absent $fly --video x.mp4 flight.csv
    expect 64 "only clipmap is flown" $fly --technique quadtree flight.csv
    expect 64 'H.264 needs an even width' $fly --size 65x36 --video x.mp4 flight.csv
    # With nowhere to keep the geoid it flies all the same.
    env -u HOME -u XDG_CACHE_HOME -u CACHE_DIRECTORY $fly flight.csv || fail "no cache: status $?"
    # Compiled shaders are kept from run to run, but not where that is not wanted.
    for wanted in false true; do
        echo "display: {program_cache: $wanted, width: 64, height: 36}" >programs.yaml
        XDG_CACHE_HOME="$scratch/kept" "$OTWD" replay -q -c programs.yaml --speed max --rate 0.1 flight.csv ||
            fail "program_cache: $wanted: status $?"
        [ -d kept/otwd/programs ] && kept=true || kept=false
        [ "$kept" = "$wanted" ] || fail "program_cache: $wanted, and shaders are kept: $kept"
    done
    [ -w /dev/full ] && {
        $fly --json flight.csv >/dev/full 2>error.txt
        [ $? -eq 74 ] || fail "lost output is not 74"
        grep -q 'standard output' error.txt || fail "lost output is not told"
    }
}
"$OTWD" --version >&- 2>error.txt
[ $? -eq 74 ] || fail "a closed standard output is not 74"

expect 66 'absent.csv: No such file' "$OTWD" send absent.csv --to udp://127.0.0.1:9
expect 64 'nowhere' "$OTWD" send flight.csv --to nowhere
expect 64 'a port from 0 to 65535' "$OTWD" send flight.csv --to udp://localhost:70000
expect 69 'nobody serves a bus there' "$OTWD" send flight.csv --to "sim:$scratch/absent"
expect 69 'nobody takes the packets there' \
    "$OTWD" send flight.csv --to "udp://127.0.0.1:$(free_port)" --speed 60
"$OTWD" status --modbus "localhost:$(free_port)" 2>error.txt # a name, not a number
[ $? -eq 69 ] || fail "status by name: $(cat error.txt)"
expect 69 'Connection refused' "$OTWD" status --modbus "127.0.0.1:$(free_port)"
expect 66 'absent.db' "$OTWD" info absent.db
expect 65 'is not a terrain database' "$OTWD" verify flight.csv
expect 64 'there is no command "fly"' "$OTWD" fly
finish
