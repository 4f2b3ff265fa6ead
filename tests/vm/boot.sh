#!/bin/sh
# Boots Debian's kernel in QEMU over this machine's own root, which stays as it is, and runs a suite
# in the guest: boot.sh SUITE. From the environment: VM_KERNEL (where fetch_kernel.sh unpacked it),
# VM_WORK (a folder for what is made here), VM_BUILD (the build), and what the suite itself reads.
# The emulation is in software: /dev/kvm may be there and hang where virtualisation is nested.
set -eu
suite=$1
here=$(cd "$(dirname "$0")" && pwd)

skip() {
    echo "skip: $*"
    exit 77
}

for tool in qemu-system-x86_64 busybox; do
    command -v "$tool" >/dev/null || skip "$tool is not installed"
done
kernel=$(find "$VM_KERNEL/boot" -name 'vmlinuz-*' 2>/dev/null | head -n 1)
[ -n "$kernel" ] || skip "there is no kernel in $VM_KERNEL; tests/vm/fetch_kernel.sh gets it"

rm -rf "${VM_WORK:?}/$suite"
mkdir -p "$VM_WORK/$suite/tree/bin" "$VM_WORK/$suite/tree/modules"
cd "$VM_WORK/$suite"

# A module after those that it names itself; one that this kernel has built in has no file.
add_module() {
    [ ! -e "tree/modules/$1.ko" ] || return 0
    find "$VM_KERNEL/lib/modules" -name "$1.ko" -exec cp {} tree/modules/ \;
    [ -e "tree/modules/$1.ko" ] || return 0
    for needed in $(tr '\0' '\n' <"tree/modules/$1.ko" | sed -n 's/^depends=//p' | tr , ' '); do
        add_module "$needed"
    done
    echo "$1.ko" >>tree/modules/order
}
for name in virtio_pci 9pnet_virtio 9p overlay can-raw can-dev vcan; do
    add_module "$name"
done

cp "$(command -v busybox)" tree/bin/busybox
cp "$here/init.sh" tree/init
# What the guest reads as /run/suite.
{
    echo "suite='$suite' here='$here' work='$PWD'"
    for name in OTWD SYSTEM_TOOL OTWD_CONFIG_EXAMPLES XDG_CACHE_HOME; do
        eval "echo \"export $name='\${$name:-}'\""
    done
} >tree/suite
options=
if [ "$suite" = systemd ]; then
    DESTDIR=$PWD/installed meson install -C "$VM_BUILD" --no-rebuild --quiet
    # It would clear /tmp, where much of the host may lie.
    options="systemd.unit=otwd-suite.target systemd.mask=systemd-tmpfiles-setup.service"
fi
(cd tree && find . | busybox cpio -o -H newc 2>/dev/null | gzip -1) >initramfs

# The first serial line is the kernel's console, the second the suite's report.
: >report
timeout "${VM_LIMIT_S:-900}" qemu-system-x86_64 -accel tcg,thread=multi -machine q35 -cpu max \
    -smp 2 -m 3072 -nodefaults -no-reboot -display none -serial file:console -serial file:report \
    -kernel "$kernel" -initrd initramfs -append "console=ttyS0 quiet panic=-1 $options" \
    -fsdev local,id=host,path=/,security_model=none,readonly=on,multidevs=remap \
    -device virtio-9p-pci,fsdev=host,mount_tag=host </dev/null >qemu.log 2>&1 || {
    echo "FAIL the guest did not end by itself"
    cat qemu.log
}
cat report
if ! grep -q '^suite: passed' report; then
    tail -n 60 console
    exit 1
fi
