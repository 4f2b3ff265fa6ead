#!/bin/sh
# The -shm beside a database is cut short under the daemon that digs: SQLite maps it, so the daemon dies of
# SIGBUS, as docs/security.md says. Started again, as its unit does, it has what it had acknowledged.
. "$(dirname "$0")/common.sh"

port=$(free_port)
modbus=$(free_port)
{
    printf 'ncols 61\nnrows 61\nxllcorner 7.75\nyllcorner 46.35\ncellsize 0.0055555555556\n'
    awk 'BEGIN { for (i = 0; i < 61; i++) { for (j = 0; j < 61; j++) printf "1000 "; print "" } }'
} >flat.asc
"$OTWD" import flat.asc --crs EPSG:4326 -o flat.db -q 2>import.log
case $? in
0) ;;
69)
    echo "skip: no otwd-import"
    exit 77
    ;;
*) fatal "import: $(cat import.log)" ;;
esac
cat >otwd.yaml <<YAML
display: {width: 64, height: 36, rate_hz: 20}
terrain: {database: flat.db, allow_dig: true}
sources:
  - {name: host, type: native, listen: "127.0.0.1:$port"}
health: {modbus: {listen: "127.0.0.1:$modbus"}}
YAML
crater() {
    "$OTWD" dig "udp://127.0.0.1:$port" crater --at 46.51,7.91 --radius-m 300 --depth-m 30 >dig.log 2>&1
}
# has_stamps COUNT: that many, or more: one may last that was not acknowledged any more.
has_stamps() {
    "$OTWD" info flat.db >info.txt &&
        awk -v n="$1" '$1 == "dug" { found = $2 >= n } END { exit !found }' info.txt
}

for size in 0 4096; do
    cp flat.db undug.db
    start_daemon otwd.yaml
    crater || fatal "a stamp is not acknowledged: $(cat dig.log)"
    [ -s flat.db-shm ] || fatal "no -shm: is it mapped no more?"
    truncate -s "$size" flat.db-shm
    crater && fail "$size bytes of the -shm do: is it mapped no more?"
    wait "$daemon"
    stopped=$?
    # a sanitizer ends it in a way of its own
    [ "$stopped" -eq 135 ] || [ -n "${OTWD_TESTS_ARE_SLOW:-}" ] ||
        fail "$size bytes of the -shm: status $stopped"
    start_daemon otwd.yaml
    has_stamps 1 || fail "$size bytes of the -shm: $(grep ^dug info.txt)"
    crater || fail "$size bytes of the -shm: no stamp after the restart: $(cat dig.log)"
    stop_daemon
    [ "$stopped" -eq 0 ] || fail "$size bytes of the -shm: status $stopped after the restart"
    has_stamps 2 || fail "$size bytes of the -shm: $(grep ^dug info.txt) at the end"
    "$OTWD" verify flat.db >verify.log 2>&1 || fail "$size bytes of the -shm: $(tail -n 3 verify.log)"
    cp undug.db flat.db
done
finish
