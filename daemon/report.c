#include "daemon/report.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>

#include "daemon/version.h"

int report_init(struct report *report, size_t capacity)
{
    struct report_frame *frames = calloc(capacity ? capacity : 1, sizeof(*frames));
    if (!frames)
        return -ENOMEM;
    *report = (struct report){.frames = frames, .capacity = capacity};
    return 0;
}

void report_finish(struct report *report)
{
    free(report->frames);
    *report = (struct report){0};
}

void report_add(struct report *report, const struct report_frame *frame)
{
    if (report->count < report->capacity)
        report->frames[report->count++] = *frame;
}

typedef double (*metric_fn)(const struct report_frame *frame);

static double frame_ms(const struct report_frame *f)
{
    return f->frame_ms;
}
static double gpu_ms(const struct report_frame *f)
{
    return f->gpu_ms;
}
static double cpu_ms(const struct report_frame *f)
{
    return f->cpu_ms;
}

static double draw_cpu_ms(const struct report_frame *f)
{
    return f->draw_cpu_ms;
}
static double latency_ms(const struct report_frame *f)
{
    return f->latency_ms;
}
static double pose_age_ms(const struct report_frame *f)
{
    return f->pose_age_ms;
}
static double triangles(const struct report_frame *f)
{
    return f->triangles;
}
static double control_points(const struct report_frame *f)
{
    return f->control_points;
}
static double pixel_error(const struct report_frame *f)
{
    return (double)f->pixel_error;
}
static double upload_bytes(const struct report_frame *f)
{
    return f->upload_bytes;
}

/* NaN samples (not measured in that frame) are left out; all of `ret_distribution` is NaN where
 * nothing was measured. */
static int distribution_of(const struct report *report, metric_fn metric,
                           struct distribution *ret_distribution)
{
    double *values = malloc((report->count + 1) * sizeof(*values));
    if (!values)
        return -ENOMEM;
    size_t count = 0;
    for (size_t i = 0; i < report->count; i++) {
        double value = metric(&report->frames[i]);
        if (!isnan(value))
            values[count++] = value;
    }
    distribution_of_values(values, count, ret_distribution);
    if (count == 0)
        *ret_distribution = (struct distribution){NAN, NAN, NAN, NAN, NAN, NAN};
    free(values);
    return 0;
}

int report_distribution(const struct report *report, enum report_metric metric,
                        struct distribution *ret_distribution)
{
    static const metric_fn metrics[] = {frame_ms, gpu_ms, cpu_ms};
    return distribution_of(report, metrics[metric], ret_distribution);
}

/* What was not measured is null, not zero. */
static json_t *json_measure(double value)
{
    return isnan(value) ? json_null() : json_real(value);
}

static json_t *json_distribution(const struct report *report, metric_fn metric)
{
    struct distribution d = {0};
    if (distribution_of(report, metric, &d) < 0)
        return NULL;
    return json_pack("{s:o,s:o,s:o,s:o,s:o,s:o}", "min", json_measure(d.min), "p50",
                     json_measure(d.p50), "p95", json_measure(d.p95), "p99", json_measure(d.p99),
                     "p999", json_measure(d.p999), "max", json_measure(d.max));
}

/* {p50, `high`: the maximum or the 99th percentile}. */
static json_t *json_pair(const struct report *report, metric_fn metric, const char *high)
{
    struct distribution d = {0};
    if (distribution_of(report, metric, &d) < 0)
        return NULL;
    return json_pack("{s:o,s:o}", "p50", json_measure(d.p50), high,
                     json_measure(strcmp(high, "max") == 0 ? d.max : d.p99));
}

static long resident_peak_mib(void)
{
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    return usage.ru_maxrss / 1024;
}

/* How many incomplete frames came one after the other, at most. */
static uint64_t longest_incomplete(const struct report *report)
{
    uint64_t longest = 0, run = 0;
    for (size_t i = 0; i < report->count; i++) {
        run = report->frames[i].complete ? 0 : run + 1;
        longest = run > longest ? run : longest;
    }
    return longest;
}

json_t *report_json(const struct report *report, const struct report_facts *facts)
{
    uint64_t incomplete = 0, missed = 0;
    for (size_t i = 0; i < report->count; i++) {
        incomplete += !report->frames[i].complete;
        missed += report->frames[i].missed_deadline;
    }
    json_t *root =
        json_pack("{s:i,s:{s:s,s:s},s:{s:s,s:s,s:s},s:[i,i],s:f,s:I,s:s}", "schema", 1, "program",
                  "version", OTWD_VERSION, "commit", OTWD_COMMIT, "gl", "vendor", facts->gl->vendor,
                  "renderer", facts->gl->renderer, "version", facts->gl->version, "size_px",
                  facts->width, facts->height, "rate_hz", facts->rate_hz, "frames",
                  (json_int_t)report->count, "technique", facts->technique);
    if (!root)
        return NULL;
    json_object_set_new(root, "frame_ms", json_distribution(report, frame_ms));
    json_object_set_new(root, "gpu_ms", json_distribution(report, gpu_ms));
    json_object_set_new(root, "cpu_ms", json_distribution(report, cpu_ms));
    json_object_set_new(root, "draw_cpu_ms", json_distribution(report, draw_cpu_ms));
    json_object_set_new(root, "latency_ms", json_pair(report, latency_ms, "p99"));
    json_object_set_new(root, "missed_deadlines", json_integer((json_int_t)missed));
    json_object_set_new(root, "triangles", json_pair(report, triangles, "max"));
    json_object_set_new(root, "control_points", json_pair(report, control_points, "max"));
    json_object_set_new(root, "upload_bytes", json_pair(report, upload_bytes, "max"));
    json_object_set_new(root, "pixel_error", json_pair(report, pixel_error, "max"));
    json_object_set_new(root, "memory_mib",
                        json_pack("{s:I,s:i}", "rss_peak", (json_int_t)resident_peak_mib(), "gpu",
                                  facts->gpu_memory_mib));
    json_object_set_new(
        root, "pose",
        json_pack("{s:I,s:I,s:I,s:I,s:I,s:o}", "received", (json_int_t)report->poses.received,
                  "rejected", (json_int_t)report->poses.rejected, "others",
                  (json_int_t)report->poses.others, "lost", (json_int_t)report->poses.lost,
                  "reordered", (json_int_t)report->poses.reordered, "age_ms",
                  json_pair(report, pose_age_ms, "p99")));
    const struct loader_counts *loader = &facts->loader;
    uint64_t asked = loader->tile_hits + loader->tile_misses;
    json_object_set_new(
        root, "terrain",
        json_pack("{s:I,s:I,s:I,s:I,s:o,s:I,s:o,s:I,s:I}", "tiles_loaded",
                  (json_int_t)loader->tiles_loaded, "pending_max", (json_int_t)report->pending_max,
                  "frames_incomplete", (json_int_t)incomplete, "frames_incomplete_longest",
                  (json_int_t)longest_incomplete(report), "hit_rate",
                  json_measure(asked ? (double)loader->tile_hits / (double)asked : NAN),
                  "tiles_prefetched", (json_int_t)loader->prefetched, "tile_late_ms_max",
                  json_measure(loader->longest_late_ms), "image_tiles_loaded",
                  (json_int_t)facts->images.tiles_loaded, "image_read_errors",
                  (json_int_t)facts->images.read_errors));
    return root;
}

static int write_csv(const struct report *report, const char *path, struct diag *diag)
{
    FILE *file = fopen(path, "w");
    if (!file)
        return diag_set(diag, -errno, "%s: %s", path, strerror(errno));
    fputs("frame,time_s,frame_ms,gpu_ms,upload_ms,terrain_ms,shade_ms,cpu_ms,latency_ms,"
          "pose_age_ms,triangles,control_points,upload_bytes,complete,missed_deadline,"
          "draw_cpu_ms\n",
          file);
    for (size_t i = 0; i < report->count; i++) {
        const struct report_frame *f = &report->frames[i];
        fprintf(file, "%zu,%.6f,%.3f,%.3f,%.3f,%.3f,%.3f,%.3f,", i, f->time_s, (double)f->frame_ms,
                (double)f->gpu_ms, (double)f->upload_ms, (double)f->terrain_ms, (double)f->shade_ms,
                (double)f->cpu_ms);
        if (!isnan(f->latency_ms))
            fprintf(file, "%.3f", (double)f->latency_ms);
        fputc(',', file);
        if (!isnan(f->pose_age_ms))
            fprintf(file, "%.3f", (double)f->pose_age_ms);
        fprintf(file, ",%u,%u,%u,%d,%d,%.3f\n", f->triangles, f->control_points, f->upload_bytes,
                f->complete, f->missed_deadline, (double)f->draw_cpu_ms);
    }
    bool failed = ferror(file);
    if (fclose(file) != 0 || failed)
        return diag_set(diag, -EIO, "%s: cannot write: %s", path, strerror(errno));
    return 0;
}

int report_write(const struct report *report, const struct report_facts *facts,
                 const char *directory, struct diag *diag)
{
    char path[4096];
    json_t *json = report_json(report, facts);
    snprintf(path, sizeof(path), "%s/report.json", directory);
    int r = 0;
    if (!json || json_dump_file(json, path, JSON_INDENT(2) | JSON_REAL_PRECISION(7)) < 0)
        r = diag_set(diag, -EIO, "%s: cannot write: %s", path, strerror(errno));
    json_decref(json);
    if (r == 0) {
        snprintf(path, sizeof(path), "%s/frames.csv", directory);
        r = write_csv(report, path, diag);
    }
    if (r == 0) {
        snprintf(path, sizeof(path), "%s/report.html", directory);
        r = report_write_html(report, facts, path, diag);
    }
    return r;
}
