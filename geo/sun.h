/* Where the sun stands. */
#pragma once

#include "base/clock.h"

/* Unit vector towards the sun's centre in local east, north, up at a geodetic place, without
 * refraction; its third component is the sine of the elevation. Any thread.
 * Low-precision formulae of the Astronomical Almanac (section C, "Low precision formulas for the
 * Sun"): within 0.01 degree from 1950 to 2050. UTC stands in for UT1 and for TT, which costs at
 * most 0.004 and 0.001 degree. */
void sun_direction_enu(nsec_t utc_realtime_ns, double lat_deg, double lon_deg, double ret_enu[3]);
