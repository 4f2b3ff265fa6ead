#include "daemon/geoid_function.h"

static double undulation_m(void *context, double lat_deg, double lon_deg)
{
    return context ? geoid_undulation_m(context, lat_deg, longitude_normalised_deg(lon_deg)) : 0.0;
}

struct geoid_function geoid_function_of(struct geoid *geoid)
{
    return (struct geoid_function){.undulation_m = undulation_m, .context = geoid};
}
