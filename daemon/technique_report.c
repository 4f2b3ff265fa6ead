#include "daemon/technique_report.h"

#include <jansson.h>
#include <math.h>
#include <stdio.h>

#include "daemon/cli.h"
#include "daemon/version.h"

#define MIB 1048576.0

static struct distribution distribution_of(const struct samples *samples)
{
    struct distribution distribution = {0};
    samples_distribution(samples, &distribution);
    return distribution;
}

static double mean_of(const struct samples *samples)
{
    double sum = 0.0;
    for (size_t i = 0; i < samples->count; i++)
        sum += samples->values[i];
    return sum / fmax((double)samples->count, 1.0);
}

static double per_million(uint64_t part, uint64_t whole)
{
    return 1e6 * (double)part / fmax((double)whole, 1.0);
}

static void print_heading(const struct technique_report *report)
{
    const struct stage *stage = report->stage;
    int side = stage->field->cells + 1;
    printf("%d x %d on %s; %d frames, %d rounds in turn, every %dth frame judged\n",
           report->channel->width, report->channel->height, stage->gl.renderer,
           report->params.frames, report->params.rounds, report->params.every);
    printf("the ground: %d x %d posts, %.2f m apart (%.1f km a side), read in %.0f ms\n", side,
           side, stage_spacing_m(stage), 1e-3 * stage_spacing_m(stage) * stage->field->cells,
           stage->field_ms);
}

static void print_flown(const struct technique_report *report, const struct flown *flown)
{
    struct spread frame = flights_spread(&report->params, flown->frame_ms);
    struct spread terrain = flights_spread(&report->params, flown->terrain_ms);
    struct spread gpu = flights_spread(&report->params, flown->gpu_ms);
    struct spread cpu = flights_spread(&report->params, flown->cpu_ms);
    struct distribution error = distribution_of(&flown->error_px);
    const struct quality_difference *strangers = &flown->strangers;
    char motion[16] = "-";
    if (flown->motion_px.count > 0)
        snprintf(motion, sizeof(motion), "%.4f", distribution_of(&flown->motion_px).p999);
    printf(
        "  %-18s %8.3g%c %8.3f %8.3f %5.2f %8.3f %8.3f %8.3f %10.0f %9.0f %9.0f %7.3f %7.3f %8.2f "
        "%6.2f %7s %7.0f %7.0f\n",
        flown->entry->name, flown->setting, flown->met ? ' ' : '!', frame.p50, frame.p999,
        frame.p999 / fmax(frame.p50, 1e-9), terrain.p50, gpu.p50, cpu.p50,
        distribution_of(&flown->triangles).p50, distribution_of(&flown->bytes_sent).p50,
        (double)flown->facts.gpu_bytes / MIB, error.p99, error.p999, mean_of(&flown->psnr_db),
        flown->worst_db, motion, per_million(strangers->holes, strangers->pixels),
        per_million(strangers->walls, strangers->pixels));
    printf("  %-18s           %8s %8s       (rounds: p50 %.3f to %.3f, p99.9 %.3f to %.3f)\n", "",
           "", "", frame.p50_least, frame.p50_most, frame.p999_least, frame.p999_most);
}

static void print_comparison(const struct technique_report *report, enum comparison which)
{
    if (report->flown_count[which] == 0)
        return;
    if (which == EQUAL_ERROR)
        printf("\nequal error: the 99th percentile is to be %g px\n", report->error_px);
    else if (which == AS_ASKED)
        puts("\nas asked for");
    else
        printf("\nequal time: the terrain of the median frame is to take the clipmap's %.3f ms\n",
               report->time_ms);
    printf("  %-18s %9s %8s %8s %5s %8s %8s %8s %10s %9s %9s %7s %7s %8s %6s %7s %7s %7s\n", "",
           "setting", "frame ms", "p99.9", "/p50", "terrain", "GPU ms", "CPU ms", "triangles",
           "bytes", "GPU MiB", "p99 px", "p99.9", "PSNR dB", "worst", "motion", "holes", "walls");
    for (int i = 0; i < report->flown_count[which]; i++)
        print_flown(report, &report->flown[which][i]);
}

void technique_report_print(const struct technique_report *report)
{
    print_heading(report);
    for (int which = 0; which < COMPARISONS; which++)
        print_comparison(report, (enum comparison)which);
    puts("\n  ! what was asked for is not reached by any setting; motion: p99.9, px a frame; "
         "holes and walls in a million pixels");
    enum comparison first = report->flown_count[AS_ASKED] > 0 ? AS_ASKED : EQUAL_ERROR;
    for (int i = 0; i < report->flown_count[first]; i++) {
        const struct flown *flown = &report->flown[first][i];
        double shown = (double)(flown->strangers.pixels + flown->strangers.beyond);
        if (!flown->entry->ops)
            printf("  the clipmap alone draws what lies beyond the ground that is compared: %.1f "
                   "%% of "
                   "its pixels with ground\n",
                   100.0 * (double)flown->strangers.beyond / fmax(shown, 1.0));
    }
    for (int i = 0; i < report->count; i++) {
        const struct entry *entry = &report->entries[i];
        if (!entry_is_available(entry))
            printf("  %-18s not available: %s\n", entry->name, entry->unavailable.text);
        else
            printf("  %-18s %s; setting: %s; start %.0f ms\n", entry->name, entry_title(entry),
                   entry->knob.name, entry->start_ms);
    }
}

static json_t *json_spread(const struct technique_report *report, const double *values_ms)
{
    struct spread s = flights_spread(&report->params, values_ms);
    return json_pack("{s:f,s:f,s:[f,f],s:[f,f]}", "p50", s.p50, "p999", s.p999, "p50_of_rounds",
                     s.p50_least, s.p50_most, "p999_of_rounds", s.p999_least, s.p999_most);
}

static json_t *json_samples(const struct samples *samples)
{
    struct distribution d = distribution_of(samples);
    return json_pack("{s:f,s:f,s:f,s:f}", "p50", d.p50, "p99", d.p99, "p999", d.p999, "max", d.max);
}

static json_t *json_flown(const struct technique_report *report, const struct flown *flown)
{
    const struct quality_difference *strangers = &flown->strangers;
    json_t *json = json_pack(
        "{s:s,s:f,s:b,s:o,s:o,s:o,s:o,s:o,s:o,s:o,s:o}", "technique", flown->entry->name, "setting",
        flown->setting, "met", flown->met, "frame_ms", json_spread(report, flown->frame_ms),
        "terrain_ms", json_spread(report, flown->terrain_ms), "gpu_ms",
        json_spread(report, flown->gpu_ms), "cpu_ms", json_spread(report, flown->cpu_ms),
        "triangles", json_samples(&flown->triangles), "vertices_sent",
        json_samples(&flown->vertices_sent), "bytes_sent", json_samples(&flown->bytes_sent),
        "error_px", json_samples(&flown->error_px));
    json_object_set_new(json, "psnr_db",
                        json_pack("{s:f,s:f,s:f}", "mean", mean_of(&flown->psnr_db), "worst",
                                  flown->worst_db, "worst_at_s", seconds_from_ns(flown->worst_ns)));
    json_object_set_new(json, "pixels",
                        json_pack("{s:I,s:I,s:I,s:I}", "judged", (json_int_t)strangers->pixels,
                                  "holes", (json_int_t)strangers->holes, "walls",
                                  (json_int_t)strangers->walls, "beyond",
                                  (json_int_t)strangers->beyond));
    if (flown->motion_px.count > 0)
        json_object_set_new(json, "motion_px", json_samples(&flown->motion_px));
    json_object_set_new(json, "memory_mib",
                        json_pack("{s:f,s:f}", "gpu", (double)flown->facts.gpu_bytes / MIB, "cpu",
                                  (double)flown->facts.cpu_bytes / MIB));
    if (flown->facts.note)
        json_object_set_new(json, "note", json_string(flown->facts.note));
    return json;
}

static json_t *json_comparison(const struct technique_report *report, enum comparison which)
{
    json_t *rows = json_array();
    for (int i = 0; i < report->flown_count[which]; i++)
        json_array_append_new(rows, json_flown(report, &report->flown[which][i]));
    return rows;
}

static json_t *json_curve(const struct curve *curve)
{
    json_t *points = json_array();
    for (int i = 0; i < curve->count; i++) {
        const struct point *p = &curve->points[i];
        json_array_append_new(
            points,
            json_pack("{s:f,s:f,s:f,s:f,s:f,s:f,s:f,s:f,s:f,s:f}", "setting", p->setting, "p50_px",
                      p->p50_px, "p99_px", p->p99_px, "p999_px", p->p999_px, "max_px", p->max_px,
                      "psnr_db", p->psnr_db, "frame_ms", p->frame_ms, "terrain_ms", p->terrain_ms,
                      "gpu_ms", p->gpu_ms, "triangles", p->triangles));
    }
    return points;
}

static json_t *json_entry(const struct entry *entry, const struct curve *curve)
{
    if (!entry_is_available(entry))
        return json_pack("{s:s,s:b,s:s}", "technique", entry->name, "available", false, "reason",
                         entry->unavailable.text);
    return json_pack("{s:s,s:s,s:b,s:s,s:f,s:o}", "technique", entry->name, "title",
                     entry_title(entry), "available", true, "knob", entry->knob.name, "start_ms",
                     entry->start_ms, "points", json_curve(curve));
}

void technique_report_print_json(const struct technique_report *report, FILE *file)
{
    const struct stage *stage = report->stage;
    const struct gl_facts *gl = &stage->gl;
    json_t *root =
        json_pack("{s:i,s:{s:s,s:s},s:o,s:o,s:{s:s,s:s,s:s},s:[i,i],s:i,s:f,s:i,s:i}", "schema", 1,
                  "program", "version", OTWD_VERSION, "commit", OTWD_COMMIT, "flight",
                  cli_json_text(report->flight), "terrain", cli_json_text(report->terrain), "gl",
                  "vendor", gl->vendor, "renderer", gl->renderer, "version", gl->version, "size_px",
                  report->channel->width, report->channel->height, "frames", report->params.frames,
                  "rate_hz", 1e9 / (double)report->params.step_ns, "rounds", report->params.rounds,
                  "every", report->params.every);
    json_object_set_new(root, "field",
                        json_pack("{s:i,s:f,s:f}", "posts", stage->field->cells + 1, "spacing_m",
                                  stage_spacing_m(stage), "read_ms", stage->field_ms));
    json_t *entries = json_array();
    for (int i = 0; i < report->count; i++)
        json_array_append_new(entries, json_entry(&report->entries[i], &report->curves[i]));
    json_object_set_new(root, "techniques", entries);
    json_object_set_new(root, "as_asked", json_comparison(report, AS_ASKED));
    json_object_set_new(root, "equal_error_px", json_real(report->error_px));
    json_object_set_new(root, "equal_error", json_comparison(report, EQUAL_ERROR));
    json_object_set_new(root, "equal_time_ms", json_real(report->time_ms));
    json_object_set_new(root, "equal_time", json_comparison(report, EQUAL_TIME));
    json_dumpf(root, file, JSON_INDENT(2) | JSON_REAL_PRECISION(7));
    putc('\n', file);
    json_decref(root);
}
