#include "geo/sun.h"

#include <math.h>

#define RAD_PER_DEG     (M_PI / 180.0)
#define SECONDS_PER_DAY 86400.0

/* 2000-01-01T12:00:00Z, seconds since 1970. */
#define J2000_S INT64_C(946728000)

struct equatorial {
    double right_ascension_rad, declination_rad;
};

static struct equatorial sun_equatorial(double days)
{
    double mean_longitude_deg = 280.460 + 0.9856474 * days;
    double anomaly_rad = RAD_PER_DEG * (357.528 + 0.9856003 * days);
    double longitude_rad = RAD_PER_DEG * (mean_longitude_deg + 1.915 * sin(anomaly_rad) +
                                          0.020 * sin(2 * anomaly_rad));
    double obliquity_rad = RAD_PER_DEG * (23.439 - 0.0000004 * days);
    double sine = sin(longitude_rad);
    return (struct equatorial){atan2(cos(obliquity_rad) * sine, cos(longitude_rad)),
                               asin(sin(obliquity_rad) * sine)};
}

void sun_direction_enu(nsec_t utc_realtime_ns, double lat_deg, double lon_deg, double ret_enu[3])
{
    double days = seconds_from_ns(utc_realtime_ns - J2000_S * NSEC_PER_SEC) / SECONDS_PER_DAY;
    struct equatorial sun = sun_equatorial(days);
    double sidereal_deg = 280.46062 + 360.98564737 * days;
    double hour_rad = RAD_PER_DEG * fmod(sidereal_deg + lon_deg, 360.0) - sun.right_ascension_rad;
    double sd = sin(sun.declination_rad), cd = cos(sun.declination_rad);
    double sp = sin(lat_deg * RAD_PER_DEG), cp = cos(lat_deg * RAD_PER_DEG);
    ret_enu[0] = -cd * sin(hour_rad);
    ret_enu[1] = sd * cp - cd * cos(hour_rad) * sp;
    ret_enu[2] = sd * sp + cd * cos(hour_rad) * cp;
}
