/* What a run measured: collected frame by frame, written as report.json, frames.csv, report.html.
 */
#pragma once

#include <jansson.h>
#include <stdint.h>

#include "base/diag.h"
#include "base/stats.h"
#include "daemon/channel.h"

struct report_frame {
    double time_s; /* of the flight */
    float frame_ms, gpu_ms, cpu_ms, draw_cpu_ms;
    float upload_ms, terrain_ms, shade_ms; /* of gpu_ms */
    float latency_ms;  /* arrival of the newest pose to the first finished frame that reaches it,
                          else NaN */
    float pose_age_ms; /* NaN without a pose */
    uint32_t triangles, control_points, upload_bytes;
    float pixel_error; /* that levels reached far enough for */
    bool complete, missed_deadline;
};

/* Counts of the poses behind the frames. */
struct report_poses {
    uint64_t received, rejected, others, lost, reordered;
};

struct report {
    struct report_frame *frames; /* owned */
    size_t count, capacity;
    struct report_poses poses;
    uint64_t pending_max; /* tiles that were missing at once, at worst */
};

/* Room for `capacity` frames; later ones are not kept. */
int report_init(struct report *report, size_t capacity);
void report_finish(struct report *report);

/* No allocation. */
void report_add(struct report *report, const struct report_frame *frame);

struct report_facts {
    int width, height;
    double rate_hz;
    const char *technique, *flight;
    const struct gl_facts *gl;
    int gpu_memory_mib;
    struct loader_counts loader;
    struct image_loader_counts images;
    unsigned report_every; /* pictures frame-%06d.png that lie in the directory */
};

/* The report as JSON (docs: report.json). The caller owns the reference; NULL without memory. */
json_t *report_json(const struct report *report, const struct report_facts *facts);

/* Writes the three files into an existing directory. */
int report_write(const struct report *report, const struct report_facts *facts,
                 const char *directory, struct diag *diag);

/* The page alone (report_html.c). */
int report_write_html(const struct report *report, const struct report_facts *facts,
                      const char *path, struct diag *diag);

enum report_metric { REPORT_FRAME_MS, REPORT_GPU_MS, REPORT_CPU_MS };

/* The distribution of one metric over all frames. */
int report_distribution(const struct report *report, enum report_metric metric,
                        struct distribution *ret_distribution);
