#!/bin/sh
# papers.sh DIR [song|yusov|houska|schmiade|wagner|ablation]...: the papers' tables once more, on this
# machine (docs/papers.md says what they are worth). DIR has puget-4097.otwt and puget-16385.otwt
# (bench/puget.sh); into DIR/papers go the tables, papers.md, and what each was made from.
#
# Nothing but otwd is needed. In the environment: OTWD, the program; BENCH, the folder of bench_rag
# and bench_dig, without which what they measure is left out; SMALL=1 for a trial in some minutes by
# software, 320x180 over fewer posts, of which times are noise; THIN=N for every N-th frame of what is
# not flown at 60 frames a second.
set -eu
if [ $# = 0 ]; then
    sed -n '2,10s/^# \{0,1\}//p' "$0" >&2
    exit 64
fi
here=$(cd "$(dirname "$0")" && pwd)
: "${OTWD=$here/../build/daemon/otwd}" "${BENCH=$here/../build/bench}" "${SMALL=}" "${THIN=1}"
data=$(cd "$1" && pwd)
out=$data/papers
shift
[ $# -gt 0 ] || set -- song yusov houska schmiade wagner ablation
mkdir -p "$out"

# What there is here; of rows with other techniques the table says that they are missing.
known=$("$OTWD" bench --flight none --techniques '?' 2>&1 | sed -n 's/.*there are //p' | tr -d ' ')

# Of a comma-separated list of NAME@SETTING what this program has.
available()
{
    list=
    for item in $(echo "$1" | tr ',' ' '); do
        case ,$known, in *,"${item%@*}",*) list=$list${list:+,}$item ;; esac
    done
    echo "$list"
}

# measure NAME SIZE POSTS FLIGHT RATE TECHNIQUES [OPTION...]: flies at given settings; the tables are
# $out/NAME/flown.csv and frames.csv. A rate of 60 is kept in a trial, too.
measure()
{
    name=$1 size=$2 posts=$3 flight=$4 rate=$5 techniques=$(available "$6")
    shift 6
    database=puget-16385.otwt
    if [ "$SMALL" ]; then
        size=320x180 posts=1025 database=puget-4097.otwt
        [ "$rate" = 60 ] || rate=$(awk -v rate="$rate" 'BEGIN { print (rate > 4 ? rate / 40 : 0.1) }')
        set -- --radius 64 "$@" --rounds 1 --every 8 # the radius is the daemon's by software
    fi
    if [ "$THIN" != 1 ] && [ "$rate" != 60 ]; then
        rate=$(awk -v rate="$rate" -v thin="$THIN" 'BEGIN { print rate / thin }')
        set -- "$@" --every 20
    fi
    echo "$name: $techniques" >&2
    "$OTWD" bench --terrain "$data/$database" --flight "$out/$flight" --size "$size" \
        --posts "$posts" --rate "$rate" --techniques "$techniques" --pixel-error 1 \
        --report "$out/$name" "$@" >"$out/$name.txt"
    sed -n '1,2p' "$out/$name.txt" >"$out/$name.on"
}

# join NAME COLUMN...: a table of Markdown from rows "TECHNIQUE@SETTING;LABEL;PRINTED" on stdin, our
# columns beside what is printed. fps:C is 1000 / C; mib:C is C bytes beside the field's own heights.
join()
{
    run=$1
    shift
    printf '%s\n\n' "Here: $(tr '\n' ' ' <"$out/$run.on")"
    awk -v columns="$*" -v posts="$(sed -n 's/.*ground: \([0-9]*\) x.*/\1/p' "$out/$run.on")" '
        function value(column, row,    v) {
            v = cell[row, substr(column, index(column, ":") + 1)]
            if (column ~ /^fps:/) return sprintf("%.0f", v > 0 ? 1000 / v : 0)
            if (column ~ /^mib:/ && row !~ /^clipmap@/) v -= 4 * posts * posts
            if (column ~ /^mib:/) return sprintf("%.1f", v / 1048576)
            return v
        }
        FNR == NR {
            n = split($0, field, ",")
            for (i = 1; i <= n; i++)
                if (FNR == 1) name[i] = field[i]
                else cell[field[2] "@" field[3], name[i]] = field[i]
            if (FNR > 1) there[field[2] "@" field[3]] = 1
            next
        }
        FNR == 1 {
            count = split(columns, ours, " ")
            line = "| | printed |"; rule = "|---|---|"
            for (i = 1; i <= count; i++) { line = line " " ours[i] " |"; rule = rule "---|" }
            print line; print rule
        }
        {
            split($0, part, ";")
            line = "| " part[2] " | " part[3] " |"
            for (i = 1; i <= count; i++)
                line = line " " (part[1] in there ? value(ours[i], part[1]) : "not available") " |"
            print line
        }' "$out/$run/flown.csv" -
    echo
}

# A part of a flight, from one second to another.
cut_flight()
{
    awk -F, -v OFS=, -v from="$1" -v to="$2" '
        !/^[0-9]/ { print; next }
        $1 >= from && $1 <= to { $1 = sprintf("%.1f", $1 - from); print }'
}

"$here/song_flight.sh" 46.75 -122.55 35 >"$out/song.csv"
# Into the turn, in frames that follow each other as they do where one flies: a GPU that waits for the
# terrain of places farther apart lowers its clock.
seconds=6
[ ! "$SMALL" ] || seconds=1
cut_flight 177 $((177 + seconds)) <"$out/song.csv" >"$out/sharp.csv"
cut_flight 60 70 <"$out/song.csv" >"$out/straight.csv"
cp "$here/puget_flight.csv" "$out/puget.csv"
cut_flight 40 42 <"$out/puget.csv" >"$out/mountains.csv"
failed=
for paper; do
    set +e
    # shellcheck source=/dev/null # papers/song.sh and so on
    (set -e && . "$here/papers/$paper.sh") >"$out/$paper.md"
    status=$?
    [ $status = 0 ] || failed="$failed $paper"
    set -e
    cat "$out/$paper.md"
done
cat "$out"/*.md >"$data/papers.md"
[ ! "$failed" ] || { echo "not finished:$failed" >&2; exit 1; }
