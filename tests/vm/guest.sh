#!/bin/sh
# The suite in the guest: the kernel's first process itself, or for the suite systemd what systemd,
# the first process, starts. Says how it went and switches the machine off.
export PATH=/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin HOME=/root
# shellcheck disable=SC1091 # written by boot.sh
. /run/suite
# shellcheck disable=SC2154 # from there

if [ "$suite" = systemd ] && [ $$ -eq 1 ]; then
    rm -f /.dockerenv # where the host is a container the guest is none
    # QEMU reads the host's files with the rights of whoever started it, so what is root's alone there
    # is made anew here.
    rm -f /etc/shadow /etc/gshadow
    for place in lib cache log; do
        busybox mount -t tmpfs -o mode=755 "$place" "/var/$place"
    done
    cp -dR --preserve=mode "$work/installed/." /
    mkdir -p /run/systemd/system
    cp "$here/otwd-suite.service" "$here/otwd-suite.target" /run/systemd/system/
    sed -i "s|@guest@|$here/guest.sh|" /run/systemd/system/otwd-suite.service
    exec /lib/systemd/systemd
fi
exec >/dev/ttyS1 2>&1 </dev/null
if "$here/$suite.sh"; then
    echo "suite: passed"
else
    echo "suite: failed"
fi
busybox poweroff -f
