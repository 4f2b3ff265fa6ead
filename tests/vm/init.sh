#!/bin/busybox sh
# shellcheck shell=dash
# The first program in the guest, from boot.sh's archive: the host's own root, read-only, with a file
# system in memory laid over it, becomes the root, and guest.sh its first program.
export PATH=/bin
/bin/busybox mkdir -p /proc /sys /dev /host /memory /merged
/bin/busybox --install -s /bin
mount -t proc proc /proc
mount -t sysfs sysfs /sys
mount -t devtmpfs dev /dev
while read -r module; do
    insmod "/modules/$module" || echo "init: $module cannot be loaded"
done </modules/order
mount -t 9p -o ro,trans=virtio,version=9p2000.L,msize=524288,cache=loose host /host
mount -t tmpfs -o size=75% memory /memory
mkdir /memory/upper /memory/work
mount -t overlay -o lowerdir=/host,upperdir=/memory/upper,workdir=/memory/work root /merged
for place in proc sys dev; do
    mount -o move "/$place" "/merged/$place"
done
mount -t tmpfs -o mode=755 run /merged/run
cp /suite /merged/run/suite
ifconfig lo up
# shellcheck disable=SC1091 # boot.sh writes it
. /suite
# shellcheck disable=SC2154 # from there
exec switch_root /merged "$here/guest.sh"
