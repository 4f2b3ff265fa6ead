/* Distributions of measured values. */
#pragma once

#include <stddef.h>

/* All samples of a run, kept so that percentiles are exact. Grown outside the frame path: reserve
 * what the run needs, then add. */
struct samples {
    double *values; /* owned */
    size_t count, capacity;
};

struct distribution {
    double min, p50, p95, p99, p999, max;
};

/* Room for `capacity` samples. Returns 0 or -ENOMEM. */
int samples_init(struct samples *samples, size_t capacity);
void samples_finish(struct samples *samples);

/* Adds one sample; where the room is used up the sample is dropped. No allocation. */
void samples_add(struct samples *samples, double value);

/* Percentiles by the nearest-rank method: the smallest sample that at least p per cent of all
 * samples do not exceed. All zero where there are no samples. Sorts a copy; -ENOMEM. */
int samples_distribution(const struct samples *samples, struct distribution *ret_distribution);

/* The same over `values` (count of them), which it sorts in place. No allocation. */
void distribution_of_values(double *values, size_t count, struct distribution *ret_distribution);
