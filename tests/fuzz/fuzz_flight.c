/* Every format that flight_load() knows, by content. Whatever loads must be sane and in order. */
#include <stdlib.h>

#include "io/flight.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static double no_undulation_m(void *context, double lat_deg, double lon_deg)
{
    return 0.0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct flight_params params = {.geoid = {.undulation_m = no_undulation_m}};
    struct flight *flight;
    struct diag diag = {""};
    if (flight_load_memory("fuzz", data, size, &params, &flight, &diag) < 0)
        return diag.text[0] ? 0 : (abort(), 0); /* never without a sentence */
    for (size_t i = 0; i < flight->count; i++)
        if (!pose_is_sane(&flight->poses[i]) ||
            (i > 0 && flight->poses[i].time_ns <= flight->poses[i - 1].time_ns))
            abort();
    struct pose pose;
    flight_sample(flight, flight_duration_ns(flight) / 3, &pose);
    if (!pose_is_sane(&pose))
        abort();
    flight_destroy(flight);
    return 0;
}
