# shellcheck shell=sh disable=SC2154,SC2016 # bench/papers.sh has the variables
# Houska 2019: tables 4.3 to 4.6. HOUSKA_NAMES in the environment: what the rows PGM, PGM_TE, PGM_TWE,
# PGM_TWEB, PGM_TWEBU and Frostbite are called here (for the last, what engines ship).
#
# At ten frames a second the flight moves half a kilometre from one to the next, too far for frames that
# are made of others: what these show is told at sixty, too, over two of its seconds.

: "${HOUSKA_NAMES=persistent-grid-plain persistent-grid-te persistent-grid persistent-grid-tweb
    persistent-grid-twebu cdlod}"
# shellcheck disable=SC2086 # six names
set -- $HOUSKA_NAMES
pgm=$1 te=$2 twe=$3 tweb=$4 twebu=$5 frostbite=$6
columns=240
echo '## Houska 2019 (Core 2 Duo E8400 at 3.0 GHz, GeForce GTS 450)'
echo
list=$frostbite@2.5,clipmap@1
for row in $pgm $te $twe $tweb $twebu; do
    list=$list,$row@$columns
done
measure houska 1600x900 8193 puget.csv 10 "$list" --rounds 1 --every 30
echo '### Table 4.3: memory beside the terrain, MiB, at 1600x900 (the grid itself left out in the paper)'
echo
join houska mib:gpu_bytes <<EOF
$twe@$columns;without temporal coherence;0.12
$tweb@$columns;B;53.6
$twebu@$columns;B and U;72.9
EOF
echo '### Table 4.4: least, mean and greatest frame time, ms, 500 000 triangles, 1600x900'
echo
join houska frame_ms_min frame_ms_mean frame_ms_max terrain_ms_mean triangles_p50 <<EOF
$pgm@$columns;PGM;1.130, 1.430, 2.297
$te@$columns;PGM_TE;1.207, 1.449, 2.245
$twe@$columns;PGM_TWE;1.214, 1.427, 2.293
$tweb@$columns;PGM_TWEB;5.854, 5.997, 6.198
$twebu@$columns;PGM_TWEBU;7.127, 7.321, 7.491
$frostbite@2.5;Frostbite, here \`$frostbite\`;1.687, 1.911, 2.150
clipmap@1;\`clipmap\`;
EOF
echo '### Table 4.5: of the frame, at 1024x768: laying out the grid (T 0.5 %, W 2.5 %), drawing it (40 %)'
echo
join houska update_ms_p50 draw_ms_p50 gpu_ms_p50 <<EOF
$twe@$columns;PGM_TWE, ms; the first has what the paper places in its vertex shader;
$twebu@$columns;PGM_TWEBU: B 37.6 %, U 19.4 % besides;
EOF
echo '### Table 4.6: least, mean and greatest PSNR, dB'
echo
join houska psnr_db_min psnr_db_mean psnr_db_max error_px_p99 holes <<EOF
$pgm@$columns;PGM;25.453, 27.689, 31.647
$te@$columns;PGM_TE;28.146, 29.723, 31.992
$twe@$columns;PGM_TWE;29.220, 31.246, 34.745
$tweb@$columns;PGM_TWEB;26.326, 36.407, 41.008
$twebu@$columns;PGM_TWEBU;26.326, 36.407, 41.008
$frostbite@2.5;Frostbite, here \`$frostbite\`;31.371, 34.042, 37.441
clipmap@1;\`clipmap\`;
EOF
measure houska-60 1600x900 8193 mountains.csv 60 "$twe@$columns,$tweb@$columns,$twebu@$columns" \
    --rounds 1 --every 10
echo '### Table 4.6 at 60 frames a second: two seconds between the mountains'
echo
join houska-60 psnr_db_min psnr_db_mean psnr_db_max error_px_p99 holes walls <<EOF
$twe@$columns;PGM_TWE;
$tweb@$columns;PGM_TWEB;
$twebu@$columns;PGM_TWEBU;
EOF
