/* FlightGear's native flight dynamics packet (FGNetFDM), versions 24 (408 bytes; 2020.1 to 2020.3,
 * JSBSim) and 25 (552 bytes; 2020.4 and later). Big-endian; radians, feet per second; altitude
 * above mean sea level. Layout: docs/wire.md. Pure; any thread. */
#pragma once

#include "io/decode.h"

#define FLIGHTGEAR_SIZE_V24 408
#define FLIGHTGEAR_SIZE_V25 552
#define FLIGHTGEAR_ENGINES  4
#define FLIGHTGEAR_TANKS    4
#define FLIGHTGEAR_WHEELS   3

struct flightgear_fdm {
    struct pose_sample sample; /* datum EGM96; no sequence, no sender time */
    unsigned version;
    double agl_m;                    /* height above FlightGear's own ground; NAN where unknown */
    unsigned engines, tanks, wheels; /* as sent, but never more than the packet has room for */
    unsigned wheels_on_ground;
};

/* Returns 0 or -EBADMSG. */
int flightgear_decode(const void *data, size_t size, struct flightgear_fdm *ret_fdm,
                      struct rejection *ret_rejection);

/* Writes version 24. `fdm->sample.pose` must have its altitude above EGM96; what its valid bits do
 * not claim is sent as zero. */
void flightgear_encode(const struct flightgear_fdm *fdm, uint8_t ret_data[FLIGHTGEAR_SIZE_V24]);

/* True where the packet has a version and a length that FGNetFDM has. */
bool flightgear_recognises(const void *data, size_t size);
