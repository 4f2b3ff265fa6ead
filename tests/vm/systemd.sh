#!/bin/sh
# The installed units under systemd as the first process.
# shellcheck disable=SC2154,SC2317 # variables of common.sh; functions that wait_for calls
. "$(dirname "$0")/../system/common.sh"
. "$(dirname "$0")/steps.sh"

OTWD=/usr/local/bin/otwd

# property NAME [UNIT]
property() {
    systemctl show -p "$1" --value "${2:-otwd.service}"
}

# shows NAME VALUE [UNIT]
shows() {
    [ "$(property "$1" "${3:-}")" = "$2" ]
}

# configuration FILE PORT
configuration() {
    cat >"/etc/otwd/$1" <<YAML
channel: {name: ${1%.yaml}}
display: {width: 64, height: 64, rate_hz: 2}
health: {modbus: {listen: "127.0.0.1:$2"}}
record: {directory: /var/lib/otwd${3:-}}
YAML
}

tell_journal() {
    journalctl --no-pager -o short-monotonic -b -u 'otwd*' | tail -n 150
}

# give_up TEXT: as fatal does, with the journal.
give_up() {
    tell_journal
    fatal "$*"
}

# A new process draws: runs_anew OLD-PROCESS
runs_anew() {
    [ "$(property MainPID)" != "$1" ] && [ "$(property MainPID)" != 0 ] && shows ActiveState active
}

# process_status NAME: a line of what the kernel says of the service's process.
process_status() {
    sed -n "s/^$1:[ \t]*//p" "/proc/$(property MainPID)/status"
}

step "sysusers and tmpfiles"
sed -i '/^render:/d' /etc/group /etc/gshadow 2>/dev/null
systemd-sysusers || fail "systemd-sysusers: $?"
grep -q '^render:' /etc/group || fail "the group render was not made"
rm -rf /etc/otwd
systemd-tmpfiles --create otwd.conf || fail "systemd-tmpfiles: $?"
"$OTWD" check-config /etc/otwd/otwd.yaml || fail "the first configuration is no good"

step "exposure of the units"
systemctl daemon-reload
for unit in otwd.service otwd@left.service; do
    level=$(systemd-analyze security --no-pager "$unit" |
        sed -n 's/.*exposure level for [^:]*: \([0-9.]*\).*/\1/p')
    echo "$unit: exposure $level"
    awk -v level="${level:-10}" 'BEGIN { exit !(level <= 2.5) }' || fail "$unit: exposure $level"
done

step "the service starts: active means that the first frame is out"
modbus=1502
configuration otwd.yaml $modbus
systemctl start otwd.service || give_up "start: $?"
shows ActiveState active || fail "after the start: $(property ActiveState)"
at_least frames_rendered 1 || fail "active without a frame"
wait_for 10 eval 'property StatusText | grep -q "frames a second"' ||
    fail "status text: $(property StatusText)"

step "it is nobody in particular and may do little"
user=$(process_status Uid | cut -f 1)
{ [ "$user" -ge 61184 ] && [ "$user" -le 65519 ]; } || fail "it runs as $user"
[ "$(process_status CapEff)" = 0000000000000000 ] || fail "capabilities $(process_status CapEff)"
[ "$(process_status NoNewPrivs)" = 1 ] || fail "it may gain privileges"
[ "$(process_status Seccomp)" = 2 ] || fail "its system calls are not filtered"
has_recording() {
    ls /var/lib/private/otwd/*.otwlog
}
wait_for 5 has_recording || fail "no recording below its state directory"

step "the journal has the fields"
journalctl --sync
journalctl --no-pager -o export -u otwd.service >journal.log
for field in CHANNEL=otwd FAULT=101 PRIORITY=3 _SYSTEMD_UNIT=otwd.service \
    SYSLOG_IDENTIFIER=otwd; do
    grep -q "^$field" journal.log || fail "the journal has no $field"
done
[ "$(journalctl --no-pager -o cat _SYSTEMD_UNIT=otwd.service FAULT=101 | wc -l)" -ge 1 ] ||
    fail "the journal does not find a fault by its code"

step "reload"
process=$(property MainPID)
sed -i 's/^display:.*/&\nenvironment: {visibility_m: 5000}/' /etc/otwd/otwd.yaml
systemctl reload otwd.service || fail "reload: $?"
wait_for 5 is config_generation 2 || fail "generation $(field config_generation) after a reload"
shows MainPID "$process" || fail "a reload started another process"

step "killed: started again"
systemctl reset-failed otwd.service
systemctl kill -s KILL otwd.service
wait_for 60 runs_anew "$process" || give_up "after SIGKILL: $(property ActiveState)"
shows NRestarts 1 || fail "restarts: $(property NRestarts)"

step "hung: the watchdog starts it again"
process=$(property MainPID)
kill -STOP "$process"
wait_for 60 runs_anew "$process" || give_up "after a hang: $(property ActiveState)"
shows NRestarts 2 || fail "restarts: $(property NRestarts)"
journalctl --no-pager -o cat -u otwd.service | grep -q 'Watchdog timeout' ||
    fail "the journal does not tell of the watchdog"

step "it stops within its time, and well"
before=$(cut -d . -f 1 /proc/uptime)
systemctl stop otwd.service || fail "stop: $?"
took=$(($(cut -d . -f 1 /proc/uptime) - before))
[ "$took" -le 10 ] || fail "it took $took s to stop"
shows Result success || fail "result of the stop: $(property Result)"
shows ExecMainStatus 0 || fail "status of the stop: $(property ExecMainStatus)"
[ ! -e "/proc/$process" ] || fail "its process is still there"

step "a configuration that cannot be is not tried again"
echo "colour: red" >/etc/otwd/bad.yaml
systemctl start otwd@bad.service && fail "a bad configuration starts"
shows ExecMainStatus 78 otwd@bad.service || give_up "status $(property ExecMainStatus otwd@bad.service)"
shows NRestarts 0 otwd@bad.service || fail "a bad configuration was tried again"

step "socket activation: who connects to port 502 starts it, beside another channel"
configuration left.yaml 1503 -left
systemctl start otwd.socket || fail "start of the socket: $?"
shows ActiveState inactive || fail "the socket alone starts the service"
systemctl start --no-block otwd@left.service
modbus=502
"$OTWD" status --modbus 127.0.0.1:502 --timeout-ms 1000 >first.log 2>&1
wait_for 60 shows ActiveState active || give_up "a connection does not start it"
wait_for 10 is_drawing || fail "no answer at port 502"
modbus=1503
wait_for 60 shows ActiveState active otwd@left.service || give_up "the channel left does not start"
wait_for 10 is_drawing || fail "the channel left does not answer"
journalctl --no-pager -o cat CHANNEL=left | grep -q 'the first frame is out' ||
    fail "the journal does not tell the channels apart"
ls /var/lib/private/otwd-left/*.otwlog >recordings.log || fail "the channel left records nothing"
systemctl stop otwd.socket otwd.service otwd@left.service || fail "stop: $?"

[ "$failures" -eq 0 ] || tell_journal
finish
