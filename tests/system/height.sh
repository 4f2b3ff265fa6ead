#!/bin/sh
# `otwd height` as a coprocess: each answer comes while the questions still stand open.
. "$(dirname "$0")/common.sh"

{
    printf 'ncols 60\nnrows 60\nxllcorner 7.9\nyllcorner 46.4\ncellsize 0.01\n'
    awk 'BEGIN { for (i = 0; i < 60; i++) { for (j = 0; j < 60; j++) printf "1234 "; print "" } }'
} >flat.asc
"$OTWD" import flat.asc --crs EPSG:4326 -o flat.db >import.log 2>&1
case $? in
0) ;;
69)
    echo "skip: no otwd-import"
    exit 77
    ;;
*) fatal "import" ;;
esac
# Options may stand anywhere, though places are negative numbers.
usual=$("$OTWD" height --normal flat.db 46.7 8.1)
for arguments in 'flat.db 46.7 8.1 --normal' 'flat.db --normal 46.7 8.1' '--normal flat.db -- 46.7 8.1' \
    'flat.db 46.7 -351.9 --normal' '--normal flat.db 46.7 -351.9'; do
    # shellcheck disable=SC2086
    [ "$("$OTWD" height $arguments)" = "$usual" ] || fail "height $arguments"
done
[ "$("$OTWD" height flat.db -46.7 -8.1 --datum ellipsoid)" = nan ] || fail "a place in the south-west"
"$OTWD" height flat.db -46.7 -8.1 -9 2>height.err
[ $? -eq 64 ] || fail "a third number is taken"
[ "$("$OTWD" height flat.db 46.7 8.1 --json)" = '{"lat_deg": 46.7, "lon_deg": 8.1, "height_m": 1234.0}' ] ||
    fail "as JSON: $("$OTWD" height flat.db 46.7 8.1 --json)"
"$OTWD" height flat.db -46.7 8.1 --json | grep -q '"height_m": null}$' || fail "no height as JSON"
mkfifo questions answers
start height.log sh -c "'$OTWD' height flat.db <questions >answers"
exec 3>questions 4<answers
for lon in 8.1 8.2; do
    echo "46.7 $lon" >&3
    answer=$(timeout 5 head -n 1 <&4) || fail "no answer while the questions stand open"
    awk -v h="$answer" 'BEGIN { exit !(h > 1233.9 && h < 1234.1) }' || fail "height \"$answer\""
done
exec 3>&-
wait "$started" || fail "status $?"
finish
