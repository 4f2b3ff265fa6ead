# Shared by the suites in the guest.
# shellcheck shell=sh

# step TITLE: says what comes, and how long after the boot.
step() {
    echo "$(cut -d ' ' -f 1 /proc/uptime) s: $*"
}
