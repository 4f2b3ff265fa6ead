#!/bin/sh
# clang-format of Debian 12 is the arbiter; another version formats differently.
. "$(dirname "$0")/common.sh"

command -v clang-format >/dev/null || skip "clang-format is not installed"
case $(clang-format --version) in
*"version 14."*) ;;
*) skip "$(clang-format --version) is not version 14" ;;
esac
files="$(sources '*.[ch]') $(sources '*.cc')"
# shellcheck disable=SC2086
clang-format --dry-run -Werror $files 2>/dev/null && finish
for file in $files; do
    clang-format --dry-run -Werror "$file" 2>/dev/null || complain "$file: run clang-format -i on it"
done
finish
