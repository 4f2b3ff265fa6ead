/* Makes daemon/demo_flight.csv: a minute low over the embedded planet's Alps with two sharp turns.
 *
 * Usage: make_demo_flight > daemon/demo_flight.csv
 *
 * The track is flown first (constant speed, bank follows the turn rate), then the height is laid
 * over it: the highest ground within two seconds either side, smoothed, plus a margin. */
#include <math.h>
#include <stdio.h>

#include "geo/geographic.h"
#include "terrain/planet.h"

#define RATE_HZ   10
#define SECONDS   60
#define COUNT     (SECONDS * RATE_HZ + 1)
#define SPEED_MPS 105.0
#define MARGIN_M  140.0
#define DEGREE    (M_PI / 180.0)
#define GRAVITY   9.81

/* Degrees a second: straight, a hard right, straight, a harder left, straight. */
static double turn_rate_dps(double t)
{
    double right = 14.0 * exp(-pow((t - 19.0) / 3.6, 4.0));
    double left = -16.0 * exp(-pow((t - 40.0) / 3.8, 4.0));
    return right + left;
}

static double smooth_at(const double *values, int at, int reach)
{
    double sum = 0.0, weights = 0.0;
    for (int i = at - reach; i <= at + reach; i++) {
        int k = i < 0 ? 0 : i >= COUNT ? COUNT - 1 : i;
        double weight = 0.5 + 0.5 * cos(M_PI * (i - at) / (reach + 1.0));
        sum += weight * values[k];
        weights += weight;
    }
    return sum / weights;
}

static double highest_about(const double *values, int at, int reach)
{
    double highest = -1e9;
    for (int i = at - reach; i <= at + reach; i++)
        highest = fmax(highest, values[i < 0 ? 0 : i >= COUNT ? COUNT - 1 : i]);
    return highest;
}

int main(void)
{
    static struct geodetic track[COUNT];
    static double heading_deg[COUNT], roll_deg[COUNT], ground_m[COUNT], high_m[COUNT], alt_m[COUNT];
    struct terrain_source *planet;
    struct diag diag;
    if (planet_open(&planet, &diag) < 0) {
        fprintf(stderr, "%s\n", diag.text);
        return 1;
    }
    track[0] = (struct geodetic){46.30, 9.20, 0.0};
    heading_deg[0] = 60.0;
    for (int i = 0; i < COUNT; i++) {
        double rate = turn_rate_dps((double)i / RATE_HZ);
        roll_deg[i] = atan(rate * DEGREE * SPEED_MPS / GRAVITY) / DEGREE;
        planet->ops->sample_point(planet, track[i].lat_deg, track[i].lon_deg, &ground_m[i]);
        if (i + 1 == COUNT)
            break;
        double heading = heading_deg[i] * DEGREE, step = SPEED_MPS / RATE_HZ;
        const double enu_m[3] = {step * sin(heading), step * cos(heading), 0.0};
        geodetic_from_enu(&track[i], enu_m, &track[i + 1]);
        track[i + 1].height_m = 0.0;
        heading_deg[i + 1] = heading_deg[i] + rate / RATE_HZ;
    }
    for (int i = 0; i < COUNT; i++)
        high_m[i] = highest_about(ground_m, i, 2 * RATE_HZ);
    for (int i = 0; i < COUNT; i++)
        alt_m[i] = smooth_at(high_m, i, 4 * RATE_HZ) + MARGIN_M;
    printf("# altitude: egm96\ntime_s,lat_deg,lon_deg,alt_m,roll_deg,pitch_deg,heading_deg\n");
    for (int i = 0; i < COUNT; i++) {
        double climb =
            (alt_m[i + 1 < COUNT ? i + 1 : i] - alt_m[i > 0 ? i - 1 : i]) * RATE_HZ / 2.0;
        double heading = fmod(heading_deg[i] + 720.0, 360.0);
        printf("%.1f,%.7f,%.7f,%.2f,%.3f,%.3f,%.3f\n", (double)i / RATE_HZ, track[i].lat_deg,
               track[i].lon_deg, alt_m[i], roll_deg[i], atan(climb / SPEED_MPS) / DEGREE - 3.0,
               heading);
    }
    terrain_source_destroy(planet);
    return 0;
}
