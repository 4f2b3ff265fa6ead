# shellcheck shell=sh disable=SC2154,SC2016 # bench/papers.sh has the variables
# Wagner 2004: table 1. His minimum scene is our frame without its shading pass, his full scene the
# whole frame.

echo '## Wagner 2004 (Athlon 1300, GeForce 3)'
echo
measure wagner 1024x768 1025 sharp.csv 60 geomipmap-static@1,geomipmap-sent@1,geomipmap@1,clipmap@1 \
    --rounds 2 --every 100
echo '### Table 1: frames a second, minimum scene and full scene'
echo
join wagner fps:terrain_ms_mean fps:frame_ms_mean bytes_sent_p50 triangles_p50 error_px_p99 <<'EOF'
geomipmap-static@1;static;504, 231
geomipmap-sent@1;morphing in software;312, 205
geomipmap@1;morphing in hardware;501, 230
clipmap@1;`clipmap`;
EOF
