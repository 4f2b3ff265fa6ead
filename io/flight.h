/* Recorded flights: CSV, pcap of a UDP protocol, candump logs, our own recordings (.otwlog), IGC.
 * A flight is read whole, checked, and then sampled at any instant. Reading allocates; sampling
 * does not. A loaded flight may be sampled from any thread. */
#pragma once

#include "base/diag.h"
#include "io/intake.h"

/* A flight of more than this many poses is refused: four days at 60 Hz. */
#define FLIGHT_POSES_MAX 20000000

struct flight_params {
    struct geoid_function geoid; /* for heights above EGM96; required */
    bool force_protocol;         /* of a pcap; else found out packet by packet */
    enum pose_protocol protocol;
    struct dis_filter dis; /* whom to follow in a pcap of DIS; zeroed: the first that is heard */
    const struct can_table *table; /* of a candump log; NULL: it is CANaerospace */
};

struct flight {
    const char *format; /* "csv", "pcap", "candump", "otwlog", "igc"; static */
    struct pose *poses; /* owned; time_ns = receive_ns from 0, strictly rising; ellipsoidal */
    float *agl_m;       /* owned; what FlightGear said of its own ground, NAN else */
    size_t count, capacity;
    nsec_t start_ns; /* the first pose's time in the file's own clock */
    struct intake_counters counters;
    struct diag note; /* what was passed over, or where the file was cut off; empty: nothing */
};

/* Reads the file at `path`; what it is follows from its content. Returns 0; -errno where it cannot
 * be read; -EBADMSG where it is no flight or a broken one, with file and line:column or byte. */
int flight_load(const char *path, const struct flight_params *params, struct flight **ret_flight,
                struct diag *diag);

/* The same over bytes in memory; `name` stands for the file in sentences. */
int flight_load_memory(const char *name, const void *data, size_t size,
                       const struct flight_params *params, struct flight **ret_flight,
                       struct diag *diag);

/* Legal on NULL. */
void flight_destroy(struct flight *flight);

nsec_t flight_duration_ns(const struct flight *flight);

/* The pose at `time_ns` from the start, between the two that enclose it; before the first and after
 * the last, those. ret_pose->time_ns = time_ns, bounded likewise. */
void flight_sample(const struct flight *flight, nsec_t time_ns, struct pose *ret_pose);
