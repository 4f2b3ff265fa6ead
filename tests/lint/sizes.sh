#!/bin/sh
# A file of more than 600 lines holds more than one idea; tables of data are exempt by their names.
. "$(dirname "$0")/common.sh"

for file in $(sources '*.[ch]') $(sources '*.cc') $(sources '*.glsl') $(sources '*.sh'); do
    lines=$(wc -l <"$file")
    [ "$lines" -le 600 ] || complain "$file: $lines lines; split it"
    longest=$(awk '{ n = length($0) } n > m { m = n } END { print m + 0 }' "$file")
    [ "$longest" -le 110 ] || complain "$file: a line of $longest columns"
done
finish
