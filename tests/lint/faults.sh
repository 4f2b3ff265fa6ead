#!/bin/sh
# docs/faults.md is what the table of faults prints. $2 is the program that prints it.
. "$(dirname "$0")/common.sh"

"$2" | diff -u docs/faults.md - >&2 || complain "docs/faults.md is stale: ninja -C build faults-doc"
finish
