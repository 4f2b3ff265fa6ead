#!/bin/sh
# puget.sh RASTER DIR: the terrain that bench/papers.sh measures on, from the heights of Puget Sound
# of the classic benchmark (ps_height_1k.png of the Large Geometric Models Archive, Georgia Institute
# of Technology: 1025 x 1025 posts 160 m apart, tenths of a metre above the sea; of the same data with
# a place of its own, as a GeoTIFF, only the heights are taken).
#
# Writes into DIR puget-4097.otwt and puget-16385.otwt: four and sixteen times as many posts along a
# side, those between made up (bench/amplify_posts.h says how): amplified, not measured. Needs
# gdal_translate, and otwd and amplify of a build: OTWD and AMPLIFY in the environment, or those of
# build/ beside this folder. Some ten minutes, and 1.6 GB of memory.
set -eu
if [ $# != 2 ]; then
    echo "usage: $0 RASTER DIR" >&2
    exit 64
fi
here=$(cd "$(dirname "$0")" && pwd)
: "${OTWD=$here/../build/daemon/otwd}" "${AMPLIFY=$here/../build/bench/amplify}"
mkdir -p "$2"
cd "$2" && dir=$PWD && cd - >/dev/null

# The file has no place; fitted to SRTM its first post is at E466041 N5274049 of UTM zone 10
# (correlation 0.9995), and a post stands for the square around it.
gdal_translate -q -ot UInt16 -a_srs EPSG:32610 -a_ullr 465961 5274129 629961 5110129 -a_scale 0.1 \
    -a_offset 0 "$1" "$dir/puget-1025.tif"
for times in 4 16; do
    posts=$((1024 * times + 1))
    [ ! -e "$dir/puget-$posts.otwt" ] || continue
    "$AMPLIFY" "$dir/puget-1025.tif" $times "$dir/puget-$posts.tif"
    rm -f "$dir/part.otwt"
    "$OTWD" import --max-error 1 "$dir/puget-$posts.tif" -o "$dir/part.otwt"
    mv "$dir/part.otwt" "$dir/puget-$posts.otwt"
    rm "$dir/puget-$posts.tif"
done
