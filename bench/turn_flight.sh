#!/bin/sh
# turn_flight.sh LAT LON ALT_M: all around a place, a degree a second, level (after Schmiade 2008,
# section 5.2), as a flight for otwd; the altitude is above mean sea level.
set -eu
awk -v lat="$1" -v lon="$2" -v alt="$3" 'BEGIN {
    print "# Once around a place: bench/turn_flight.sh"
    print "# altitude: egm96"
    print "time_s,lat_deg,lon_deg,alt_m,roll_deg,pitch_deg,heading_deg"
    for (i = 0; i < 360; i++)
        printf "%d,%.7f,%.7f,%.2f,0,0,%d\n", i, lat, lon, alt, i
}'
