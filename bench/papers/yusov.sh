# shellcheck shell=sh disable=SC2154,SC2016 # bench/papers.sh has the variables
# Yusov 2012: tables 2.1 to 2.4, and the price of deformation. Without procedural texturing is our
# frame without its shading pass ("terrain"), with it the whole frame.

all=quadtree@1,quadtree@2,quadtree@3,quadtree-apart@1,quadtree-apart@2,quadtree-dug@2
for size in 5 9 33; do
    all=$all,quadtree-$size@1,quadtree-$size@2,quadtree-$size@3
done
echo '## Yusov 2012 (Core i7 at 2.67 GHz, GTX 480)'
echo
measure yusov-1920 1920x1200 16385 sharp.csv 60 $all,clipmap@1,clipmap@2 --rounds 1 --every 100

echo '### Table 2.1: frames a second on average (least), 1920x1200, no procedural texturing'
echo
join yusov-1920 fps:terrain_ms_mean fps:terrain_ms_max triangles_p50 error_px_p99 <<'EOF'
quadtree@1;1 px;411 (244)
quadtree@2;2 px;818 (543)
quadtree@3;3 px;1130 (774)
clipmap@1;`clipmap`, 1 px;
clipmap@2;`clipmap`, 2 px;
EOF
echo '### Table 2.2: the same with procedural texturing: our shading pass'
echo
join yusov-1920 fps:frame_ms_mean fps:frame_ms_max <<'EOF'
quadtree@1;1 px;243 (177)
quadtree@2;2 px;375 (276)
quadtree@3;3 px;443 (313)
EOF
echo '### Table 2.3: texture arrays against textures and a call for each patch, 1920x1200'
echo
join yusov-1920 fps:terrain_ms_mean cpu_ms_p50 <<'EOF'
quadtree@1;arrays, 1 px;411
quadtree-apart@1;apart, 1 px;172
quadtree@2;arrays, 2 px;818
quadtree-apart@2;apart, 2 px;372
EOF
echo '### Table 2.4: sizes of tessellation blocks, 1920x1200, no procedural texturing'
echo
join yusov-1920 fps:terrain_ms_mean fps:terrain_ms_max triangles_p50 error_px_p99 <<'EOF'
quadtree-5@1;5 x 5, 1 px;200 (103)
quadtree-9@1;9 x 9, 1 px;415 (242)
quadtree@1;17 x 17, 1 px;411 (244)
quadtree-33@1;33 x 33, 1 px;256 (139)
quadtree-5@2;5 x 5, 2 px;376 (198)
quadtree-9@2;9 x 9, 2 px;748 (445)
quadtree@2;17 x 17, 2 px;818 (543)
quadtree-33@2;33 x 33, 2 px;575 (350)
quadtree-5@3;5 x 5, 3 px;529 (269)
quadtree-9@3;9 x 9, 3 px;969 (587)
quadtree@3;17 x 17, 3 px;1130 (774)
quadtree-33@3;33 x 33, 3 px;847 (558)
EOF
echo '### Section 2.8: the price of deformation, with procedural texturing, 2 px'
echo
join yusov-1920 fps:frame_ms_mean update_ms_p50 <<'EOF'
quadtree@2;still;375
quadtree-dug@2;changing in every frame;354
EOF
if [ ! "$SMALL" ]; then
    for size in 1600x1200 1280x1024; do
        echo "### Tables 2.1 to 2.3 at $size: without and (second) with procedural texturing"
        echo
        measure yusov-$size $size 16385 sharp.csv 60 \
            quadtree@1,quadtree@2,quadtree@3,quadtree-apart@1,quadtree-apart@2 --rounds 1 --every 1000
        if [ $size = 1600x1200 ]; then
            printed='quadtree@1;1 px;477 (275), 287 (208)
quadtree@2;2 px;944 (605), 444 (324)
quadtree@3;3 px;1261 (858), 524 (370)
quadtree-apart@1;apart, 1 px;201
quadtree-apart@2;apart, 2 px;425'
        else
            printed='quadtree@1;1 px;612 (349), 390 (270)
quadtree@2;2 px;1169 (776), 609 (449)
quadtree@3;3 px;1462 (1080), 721 (513)
quadtree-apart@1;apart, 1 px;248
quadtree-apart@2;apart, 2 px;506'
        fi
        echo "$printed" | join yusov-$size fps:terrain_ms_mean fps:terrain_ms_max \
            fps:frame_ms_mean fps:frame_ms_max
    done
fi
