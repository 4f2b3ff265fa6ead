#!/bin/sh
# What is wrong with a configuration: file, line and column, and status 78.
. "$(dirname "$0")/common.sh"

# expect STATUS TEXT COMMAND...
expect() {
    expected=$1 text=$2
    shift 2
    "$@" >out.log 2>&1
    status=$?
    [ "$status" -eq "$expected" ] || fail "$*: status $status, not $expected"
    grep -qF -- "$text" out.log || fail "$*: does not say \"$text\""
}
printf 'display:\n  width: 160\n  heigth: 90\n' >typo.yaml
printf 'sources:\n  - {name: a, listen: "127.0.0.1:70000"}\n' >port.yaml
printf 'display: {width: 160\n' >syntax.yaml
expect 78 'typo.yaml:3:3: ' "$OTWD" run -c typo.yaml
expect 78 'port.yaml:2:' "$OTWD" run -c port.yaml
expect 78 'syntax.yaml:' "$OTWD" run -c syntax.yaml
expect 66 'absent.yaml' "$OTWD" run -c absent.yaml
expect 64 'unexpected argument' "$OTWD" run otwd.yaml
expect 78 'typo.yaml:3:3: ' "$OTWD" check-config typo.yaml

# A sentence that cuts a long key within a letter is told all the same; so is a path that is no UTF-8.
{
    printf 'display: {x'
    for _ in 1 2 3 4 5 6; do printf 'äääää'; done
    echo ': 1}'
} >letters.yaml
expect 78 '"message": "letters.yaml:1:11: unknown key' "$OTWD" check-config --json letters.yaml
path=$(printf 'caf\351.yaml')
cp typo.yaml "$path"
expect 78 '.yaml:3:3: ' "$OTWD" check-config --json "$path"
expect 78 '"file": "caf' "$OTWD" check-config --json "$path"
finish
