# shellcheck shell=sh disable=SC2154,SC2016 # bench/papers.sh has the variables
# What the parts of `clipmap` bring: how far its levels reach, n = 2 radius - 1 posts, with blocks split
# where their error is seen (1 px) and nearly everywhere (0.05 px). What is no more in the program
# (tessellated, indexed) docs/papers.md quotes.

echo '## Ablation of `clipmap`'
echo
for radius in 32 64 128 256 512; do
    [ ! "$SMALL" ] || [ $radius -le 256 ] || continue
    measure ablation-$radius 1920x1080 4097 sharp.csv 60 clipmap@1,clipmap@0.05 --rounds 2 \
        --every 50 --radius $radius
    echo "### n = $((2 * radius - 1))"
    echo
    join ablation-$radius gpu_ms_p50 draw_ms_p50 frame_ms_p50 frame_ms_p999 triangles_p50 \
        error_px_p99 error_px_p999 psnr_db_mean mib:gpu_bytes <<'EOF'
clipmap@1;adaptive: blocks split at 1 px;
clipmap@0.05;not: at 0.05 px;
EOF
done
