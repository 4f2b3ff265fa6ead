# shellcheck shell=sh disable=SC2154,SC2016 # bench/papers.sh has the variables
# Song, Yang, Ji 2016: table 1 and figure 8.

echo '## Song, Yang, Ji 2016 (Core i7-2600K at 3.4 GHz, GTX 590)'
echo
echo '### Table 1: vertices that the CPU sends, and in parentheses the paper'\''s own technique'
echo
list=clipmap@1,clipmap-classic@255
for n in 63 127 255 511; do
    list=$list,clipmap-classic-sent@$n
done
measure song-1 640x360 4097 straight.csv 2 $list \
    --rounds 1 --every 1000
join song-1 vertices_sent_max bytes_sent_p50 cpu_ms_p50 <<'EOF'
clipmap-classic-sent@63;all sent, n = 63, seven levels;27 783 (301)
clipmap-classic-sent@127;all sent, n = 127;112 903 (301)
clipmap-classic-sent@255;all sent, n = 255;455 175 (301)
clipmap-classic-sent@511;all sent, n = 511;1 827 847 (301)
clipmap-classic@255;as published in 2005, n = 255 (pieces of footprints);
clipmap@1;`clipmap`;
EOF

echo '### Figure 8: ten minutes with two sharp turns, at 180 and at 350 s'
echo
measure song-8 1920x1080 8193 song.csv 5 \
    clipmap@1,clipmap-classic@255,quadtree@1,cdlod@2.5 --rounds 2 --every 100
join song-8 fps:frame_ms_mean frame_ms_p50 frame_ms_p999 frame_ms_max error_px_p99 <<'EOF'
clipmap@1;`clipmap`;"much higher than [3] and [4]", steady
clipmap-classic@255;`clipmap-classic`, the paper's [3];lower
quadtree@1;`quadtree`, by the author of [7];the same on average, "a significant decrease" in the turns
cdlod@2.5;`cdlod`, which the paper has not;
EOF
echo 'Frame times in the turns (178 to 192 s, 348 to 360 s) over those of the rest, medians and greatest:'
echo
awk -F, '
    function middle(list, n,    i, j, v) { # of a small list, sorted in place
        for (i = 2; i <= n; i++) {
            v = list[i]
            for (j = i - 1; j > 0 && list[j] > v; j--) list[j + 1] = list[j]
            list[j + 1] = v
        }
        return list[int((n + 1) / 2)]
    }
    NR == 1 { split($0, name, ","); columns = NF; next }
    {
        turns = ($1 >= 178 && $1 <= 192) || ($1 >= 348 && $1 <= 360)
        for (c = 2; c <= columns; c++) {
            if (turns) { in_turn[c, ++ins[c]] = $c; if ($c > in_most[c]) in_most[c] = $c }
            else { rest[c, ++outs[c]] = $c; if ($c > out_most[c]) out_most[c] = $c }
        }
    }
    END {
        print "| | median ms in turns | elsewhere | ratio | greatest in turns | elsewhere |"
        print "|---|---|---|---|---|---|"
        for (c = 2; c <= columns; c++) {
            for (i = 1; i <= ins[c]; i++) a[i] = in_turn[c, i] + 0
            for (i = 1; i <= outs[c]; i++) b[i] = rest[c, i] + 0
            x = middle(a, ins[c]); y = middle(b, outs[c])
            printf "| %s | %.3f | %.3f | %.2f | %.3f | %.3f |\n", name[c], x, y, x / y, \
                in_most[c], out_most[c]
        }
        print ""
    }' "$out/song-8/frames.csv"
