#include "base/stats.h"

#include <assert.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

int samples_init(struct samples *samples, size_t capacity)
{
    double *values = calloc(capacity ? capacity : 1, sizeof(*values));
    if (!values)
        return -ENOMEM;
    *samples = (struct samples){.values = values, .capacity = capacity};
    return 0;
}

void samples_finish(struct samples *samples)
{
    free(samples->values);
    *samples = (struct samples){0};
}

void samples_add(struct samples *samples, double value)
{
    if (samples->count < samples->capacity)
        samples->values[samples->count++] = value;
}

static int compare_doubles(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double nearest_rank(const double *sorted, size_t count, double fraction)
{
    size_t rank = (size_t)ceil(fraction * (double)count - 1e-9);
    return sorted[rank > 0 ? rank - 1 : 0];
}

void distribution_of_values(double *values, size_t count, struct distribution *ret_distribution)
{
    if (count == 0) {
        *ret_distribution = (struct distribution){0};
        return;
    }
    qsort(values, count, sizeof(*values), compare_doubles);
    *ret_distribution = (struct distribution){
        .min = values[0],
        .p50 = nearest_rank(values, count, 0.50),
        .p95 = nearest_rank(values, count, 0.95),
        .p99 = nearest_rank(values, count, 0.99),
        .p999 = nearest_rank(values, count, 0.999),
        .max = values[count - 1],
    };
}

int samples_distribution(const struct samples *samples, struct distribution *ret_distribution)
{
    if (samples->count == 0) {
        *ret_distribution = (struct distribution){0};
        return 0;
    }
    double *copy = malloc(samples->count * sizeof(*copy));
    if (!copy)
        return -ENOMEM;
    memcpy(copy, samples->values, samples->count * sizeof(*copy));
    distribution_of_values(copy, samples->count, ret_distribution);
    free(copy);
    return 0;
}
