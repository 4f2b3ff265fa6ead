# shellcheck shell=sh disable=SC2154,SC2016 # bench/papers.sh has the variables
# Schmiade 2008: figures 26 to 28, whose curves have no numbers in the text. bench_rag looks all around
# from one place, the middle of the data, and says what each picture took.

echo '## Schmiade 2008 (Athlon 64 X2 4200+, GeForce 8800 GTX)'
echo
if [ -x "$BENCH/bench_rag" ]; then
    size=1024x768 posts=4097
    [ ! "$SMALL" ] || size=320x180 posts=1025
    # 30 m above the ground, which is 198 m above the sea there
    "$here/turn_flight.sh" 46.88 -122.37 228 >"$out/around.csv"
    [ ! "$SMALL" ] || awk -F, '!/^[0-9]/ || $1 < 36' "$out/around.csv" >"$out/some.csv"
    [ ! "$SMALL" ] || mv "$out/some.csv" "$out/around.csv"
    "$BENCH/bench_rag" "$out/around.csv" "$data/puget-4097.otwt" $size $posts \
        >"$out/rag.csv" 2>"$out/rag.txt" || { cat "$out/rag.txt" >&2; exit 1; }
    cat "$out/rag.txt" >&2
    echo "$size, $posts posts, all around in steps of a degree; means:"
    echo
    # a line of the errors for each setting, in the order of the rows
    sed -n 's/.*error p50 \([0-9.]*\), p99 \([0-9.]*\) px.*/\1 | \2/p' "$out/rag.txt" >"$out/rag.px"
    awk -F, '
        FNR == NR { error[FNR] = $0; next }
        $1 !~ /^[0-9]+$/ { next }
        {
            key = $1 "|" $2 " x " $2 "|" $3 "|" $4
            if (!(key in count)) order[++keys] = key
            count[key]++; gpu[key] += $6; terrain[key] += $7; triangles[key] += $8
            if ($7 > most[key]) most[key] = $7
        }
        END {
            printf "| figure | mesh | passes | error, px | GPU ms | of it terrain | greatest |"
            print " triangles | error p50, px | p99 |"
            print "|---|---|---|---|---|---|---|---|---|---|"
            for (i = 1; i <= keys; i++) {
                k = order[i]; row = k; gsub(/\|/, " | ", row)
                printf "| %s | %.3f | %.3f | %.3f | %.0f | %s |\n", row, gpu[k] / count[k],
                    terrain[k] / count[k], most[k], triangles[k] / count[k], error[i]
            }
            print ""
        }' "$out/rag.px" "$out/rag.csv"
else
    echo "bench_rag is not in $BENCH: not available."
    echo
fi
