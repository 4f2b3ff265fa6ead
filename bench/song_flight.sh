#!/bin/sh
# song_flight.sh [LAT LON HEADING]: ten minutes at 150 m/s with two sharp turns, at 180 and at 350 s
# (after Song, Yang and Ji 2016, section 4, whose path is a picture only), as a flight for otwd. It
# begins over the Pyrenees, or at the place that is given.
set -eu
awk -v lat="${1-42.35}" -v lon="${2-1.15}" -v heading="${3-35}" 'BEGIN {
    print "# Ten minutes, two sharp turns: bench/song_flight.sh"
    print "# altitude: egm96"
    print "time_s,lat_deg,lon_deg,alt_m,roll_deg,pitch_deg,heading_deg"
    step = 0.2; radian = 3.14159265358979 / 180
    for (i = 0; i <= 3000; i++) {
        t = i * step
        rate = 0
        if (t >= 180 && t < 190) rate = 15 # deg/s: half of a circle, nearly
        if (t >= 350 && t < 358) rate = -20
        printf "%.1f,%.7f,%.7f,3000,%.1f,-6,%.3f\n", t, lat, lon, rate * 3, heading
        heading += rate * step
        if (heading >= 360) heading -= 360
        if (heading < 0) heading += 360
        lat += 150 * step * cos(heading * radian) / 111132
        lon += 150 * step * sin(heading * radian) / (111320 * cos(lat * radian))
    }
}'
