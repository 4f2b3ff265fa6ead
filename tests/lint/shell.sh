#!/bin/sh
# Every shell script, and the bash completion.
. "$(dirname "$0")/common.sh"

bash -n docs/completion/otwd.bash || complain "docs/completion/otwd.bash: bash does not parse it"
command -v shellcheck >/dev/null || skip "shellcheck is not installed"
for file in $(sources '*.sh') run .ci/run docs/completion/otwd.bash; do
    [ ! -e "$file" ] || shellcheck -x -P SCRIPTDIR "$file" || complain "$file: shellcheck objects"
done
finish
