/* The page that an engineer opens after a comparison, and the pictures that it shows. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/html.h"
#include "daemon/image_file.h"
#include "daemon/technique_report.h"

#define PLOT_WIDTH      1000
#define PLOT_HEIGHT     320
#define DIFFERENCE_GAIN 8.0 /* of the pictures of differences */
#define CURVE_PLACES    500 /* across the plot of frame times */

static const char *colour_of(int index)
{
    static const char *const colours[] = {"#0969da", "#57606a", "#cf222e", "#1a7f37", "#9a6700",
                                          "#8250df", "#bf3989", "#1b7c83", "#bc4c00", "#24292f"};
    return colours[index % (int)(sizeof(colours) / sizeof(colours[0]))];
}

static int index_of(const struct technique_report *report, const struct entry *entry)
{
    return (int)(entry - report->entries);
}

static void write_legend(FILE *file, const struct technique_report *report)
{
    fputs("<p>", file);
    for (int i = 0; i < report->count; i++)
        if (entry_is_available(&report->entries[i]))
            fprintf(file, "<span style=\"color:%s\">&#9632;</span> %s &nbsp; ", colour_of(i),
                    report->entries[i].name);
    fputs("</p>\n", file);
}

static void write_line(FILE *file, double x1, double y1, double x2, double y2)
{
    fprintf(file, "<line x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\" stroke=\"#d8dee4\"/>", x1,
            y1, x2, y2);
}

static void write_label(FILE *file, double x, double y, double value, const char *unit)
{
    fprintf(file, "<text x=\"%.1f\" y=\"%.1f\">%.4g %s</text>\n", x, y, value, unit);
}

/* Of each column of the plot the least and greatest time. */
static void write_times(FILE *file, const struct technique_report *report,
                        const struct flown *flown, double top_ms)
{
    int frames = report->params.frames, columns = frames < CURVE_PLACES ? frames : CURVE_PLACES;
    fprintf(file, "<path fill=\"none\" stroke=\"%s\" stroke-width=\"1.2\" d=\"",
            colour_of(index_of(report, flown->entry)));
    for (int c = 0; c < columns; c++) {
        double low = INFINITY, high = 0.0, x = (double)PLOT_WIDTH * c / columns;
        for (int i = c * frames / columns; i < (c + 1) * frames / columns; i++) {
            low = fmin(low, flights_frame_ms(&report->params, flown, i));
            high = fmax(high, flights_frame_ms(&report->params, flown, i));
        }
        fprintf(file, "%c%.1f %.1fL%.1f %.1f", c ? 'L' : 'M', x, PLOT_HEIGHT * (1.0 - low / top_ms),
                x, PLOT_HEIGHT * (1.0 - high / top_ms));
    }
    fputs("\"/>\n", file);
}

/* As figure 8 of Song et al. What takes more than ten times as long as the fastest is cut off. */
static void write_time_plot(FILE *file, const struct technique_report *report,
                            enum comparison which)
{
    double most_ms = 0.0, fastest_ms = INFINITY;
    double last_s = seconds_from_ns(report->params.step_ns) * report->params.frames;
    for (int i = 0; i < report->flown_count[which]; i++) {
        struct spread spread = flights_spread(&report->params, report->flown[which][i].frame_ms);
        most_ms = fmax(most_ms, spread.p999);
        fastest_ms = fmin(fastest_ms, spread.p50);
    }
    double top_ms = html_nice_above(fmin(most_ms, 10.0 * fastest_ms));
    html_plot_begin(file, PLOT_WIDTH, PLOT_HEIGHT);
    for (int i = 0; i <= 4; i++) {
        double y = PLOT_HEIGHT * (1.0 - i / 4.0);
        write_line(file, 0.0, y, PLOT_WIDTH, y);
        write_label(file, 4.0, y - 3.0, top_ms * i / 4.0, "ms");
        write_label(file, PLOT_WIDTH * i / 4.4, PLOT_HEIGHT + 16.0, last_s * i / 4.4, "s");
    }
    fputs("<svg viewBox=\"0 0 1000 320\" width=\"1000\" height=\"320\">", file);
    for (int i = 0; i < report->flown_count[which]; i++)
        write_times(file, report, &report->flown[which][i], top_ms);
    fputs("</svg></svg>\n", file);
}

struct range {
    double from, to; /* decades */
};

static void widen(struct range *range, double value)
{
    if (!(value > 0.0))
        return;
    range->from = fmin(range->from, floor(log10(value)));
    range->to = fmax(range->to, ceil(log10(value) + 1e-9));
}

static double along(const struct range *range, double value)
{
    double decade = value > 0.0 ? log10(value) : range->from;
    return fmin(fmax((decade - range->from) / (range->to - range->from), 0.0), 1.0);
}

/* The 99th percentile of the error against the time for terrain, both logarithmic: what lies lower
 * left is better. */
static void write_error_plot(FILE *file, const struct technique_report *report)
{
    struct range ms = {INFINITY, -INFINITY}, px = {INFINITY, -INFINITY};
    widen(&px, report->error_px);
    for (int i = 0; i < report->count; i++)
        for (int k = 0; k < report->curves[i].count; k++) {
            widen(&ms, report->curves[i].points[k].terrain_ms);
            widen(&px, fmax(report->curves[i].points[k].p99_px, 0.01 * report->error_px));
        }
    html_plot_begin(file, PLOT_WIDTH, PLOT_HEIGHT);
    for (int d = 0; d <= px.to - px.from; d++) {
        double error_px = pow(10.0, px.from + d), y = PLOT_HEIGHT * (1.0 - along(&px, error_px));
        write_line(file, 0.0, y, PLOT_WIDTH, y);
        write_label(file, 4.0, y - 3.0, error_px, "px");
    }
    for (int d = 0; d <= ms.to - ms.from; d++) {
        double time_ms = pow(10.0, ms.from + d), x = PLOT_WIDTH * along(&ms, time_ms);
        write_line(file, x, 0.0, x, PLOT_HEIGHT);
        write_label(file, fmin(x + 2.0, PLOT_WIDTH - 60.0), PLOT_HEIGHT + 16.0, time_ms, "ms");
    }
    for (int i = 0; i < report->count; i++) {
        const struct curve *curve = &report->curves[i];
        for (int line = 0; line < 2; line++) {
            if (line == 0 && curve->count > 0)
                fprintf(file, "<path fill=\"none\" stroke=\"%s\" d=\"", colour_of(i));
            for (int k = 0; k < curve->count; k++) {
                const struct point *p = &curve->points[k];
                double x = PLOT_WIDTH * along(&ms, p->terrain_ms);
                double y = PLOT_HEIGHT * (1.0 - along(&px, p->p99_px));
                if (line == 0)
                    fprintf(file, "%c%.1f %.1f", k ? 'L' : 'M', x, y);
                else
                    fprintf(file,
                            "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"4\" fill=\"%s\"><title>%s at %g: "
                            "p99 %.3f px, %.3f ms, %.2f dB</title></circle>\n",
                            x, y, colour_of(i), curve->entry->name, p->setting, p->p99_px,
                            p->terrain_ms, p->psnr_db);
            }
            if (line == 0 && curve->count > 0)
                fputs("\"/>\n", file);
        }
    }
    fputs("</svg>\n", file);
}

static void write_row(FILE *file, const struct technique_report *report, const struct flown *flown)
{
    struct spread frame = flights_spread(&report->params, flown->frame_ms);
    struct spread terrain = flights_spread(&report->params, flown->terrain_ms);
    struct spread gpu = flights_spread(&report->params, flown->gpu_ms);
    struct distribution error = {0}, triangles = {0};
    samples_distribution(&flown->error_px, &error);
    samples_distribution(&flown->triangles, &triangles);
    fprintf(file,
            "<tr><td>%s</td><td>%.3g%s</td><td>%.3f</td><td>%.3f</td><td>%.2f</td><td>%.3f</"
            "td><td>%.3f</td>"
            "<td>%.0f</td><td>%.3f</td><td>%.3f</td><td>%.2f</td><td>%llu</td><td>%llu</td></tr>\n",
            flown->entry->name, flown->setting, flown->met ? "" : " (not met)", frame.p50,
            frame.p999, frame.p999 / fmax(frame.p50, 1e-9), terrain.p50, gpu.p50, triangles.p50,
            error.p99, error.p999, flown->worst_db, (unsigned long long)flown->strangers.holes,
            (unsigned long long)flown->strangers.walls);
}

static void write_table(FILE *file, const struct technique_report *report, enum comparison which)
{
    fputs("<table><tr><th></th><th>setting</th><th>frame ms</th><th>p99.9</th><th>/p50</th>"
          "<th>terrain</th><th>GPU ms</th><th>triangles</th><th>p99 px</th><th>p99.9 "
          "px</th><th>worst dB</th>"
          "<th>holes</th><th>walls</th></tr>\n",
          file);
    for (int i = 0; i < report->flown_count[which]; i++)
        write_row(file, report, &report->flown[which][i]);
    fputs("</table>\n", file);
}

static void write_comparison(FILE *file, const struct technique_report *report,
                             enum comparison which, const char *title)
{
    fprintf(file, "<h2>%s</h2>\n", title);
    write_table(file, report, which);
    write_time_plot(file, report, which);
}

/* Whether its picture is made of triangles of that frame alone. */
static bool has_edges(const struct flown *flown)
{
    const struct technique_ops *ops = flown->entry->ops;
    return !ops || ops->claim.from_anywhere;
}

static void write_pictures(FILE *file, const struct technique_report *report)
{
    for (int i = 0; i < report->flown_count[EQUAL_ERROR]; i++) {
        const struct flown *flown = &report->flown[EQUAL_ERROR][i];
        const char *name = flown->entry->name;
        fprintf(file,
                "<h2>%s at its worst: %.2f dB, at %.2f s</h2>\n"
                "<figure><img src=\"%s.png\"><figcaption>the picture</figcaption></figure>\n"
                "<figure><img src=\"%s-difference.png\"><figcaption>its difference from full "
                "detail, times %g</figcaption></figure>\n",
                name, flown->worst_db, seconds_from_ns(flown->worst_ns), name, name,
                DIFFERENCE_GAIN);
        if (has_edges(flown))
            fprintf(file,
                    "<figure><img src=\"%s-edges.png\"><figcaption>its "
                    "triangles</figcaption></figure>\n",
                    name);
    }
}

static int write_page(const struct technique_report *report, const char *path, struct diag *diag)
{
    FILE *file = fopen(path, "w");
    if (!file)
        return diag_set(diag, -EIO, "%s: %s", path, strerror(errno));
    const struct stage *stage = report->stage;
    html_begin(file, "otwd: techniques side by side");
    fputs("<p>Flight ", file);
    html_text(file, report->flight);
    fprintf(file, ", %d frames of %d x %d, %d rounds, on ", report->params.frames,
            report->channel->width, report->channel->height, report->params.rounds);
    html_text(file, stage->gl.renderer);
    fprintf(file, ". The ground: %d posts a side, %.2f m apart.</p>\n", stage->field->cells + 1,
            stage_spacing_m(stage));
    write_legend(file, report);
    if (report->flown_count[AS_ASKED] > 0)
        write_comparison(file, report, AS_ASKED, "At the settings that were asked for");
    else {
        char title[80];
        snprintf(title, sizeof(title), "Equal error: %g px at the 99th percentile",
                 report->error_px);
        write_comparison(file, report, EQUAL_ERROR, title);
        snprintf(title, sizeof(title), "Equal time for terrain: %.3f ms", report->time_ms);
        if (report->flown_count[EQUAL_TIME] > 0)
            write_comparison(file, report, EQUAL_TIME, title);
        fputs("<h2>Error (99th percentile) against time for terrain (the frame without shading), "
              "by setting</h2>\n",
              file);
        write_error_plot(file, report);
    }
    for (int i = 0; i < report->count; i++)
        if (!entry_is_available(&report->entries[i])) {
            fprintf(file, "<p>%s is not available: ", report->entries[i].name);
            html_text(file, report->entries[i].unavailable.text);
            fputs("</p>\n", file);
        }
    write_pictures(file, report);
    return html_end(file) < 0 ? diag_set(diag, -EIO, "%s: cannot write", path) : 0;
}

static int write_picture(const struct technique_report *report, const char *directory,
                         const char *name, const char *kind, const uint8_t *rgba, struct diag *diag)
{
    char path[4096];
    snprintf(path, sizeof(path), "%s/%s%s.png", directory, name, kind);
    int r = image_write_png(path, report->channel->width, report->channel->height, rgba, diag);
    return r < 0 ? -EIO : 0;
}

/* The worst frame of each, once more. */
static int write_worst(struct technique_report *report, struct stage *stage, const char *directory,
                       struct flown *flown, struct diag *diag)
{
    struct quality_difference difference;
    struct view view;
    const char *name = flown->entry->name;
    if (flights_show(stage, &report->params, flown, flown->worst_ns, &view, &difference) < 0)
        return diag_set(diag, -EIO, "the GPU was lost");
    struct quality_pictures pictures = quality_pictures(stage->quality, DIFFERENCE_GAIN);
    int r = write_picture(report, directory, name, "", pictures.ours, diag);
    if (r == 0)
        r = write_picture(report, directory, name, "-difference", pictures.difference, diag);
    if (r < 0 || !has_edges(flown))
        return r;
    technique_show_edges(flown->entry->technique, &stage->params, stage->renderer, &view);
    if (quality_against_kept(stage->quality, stage->renderer, &difference) < 0)
        return diag_set(diag, -EIO, "the GPU was lost");
    return write_picture(report, directory, name, "-edges",
                         quality_pictures(stage->quality, 1.0).ours, diag);
}

static int write_json(const struct technique_report *report, const char *path, struct diag *diag)
{
    FILE *file = fopen(path, "w");
    if (!file)
        return diag_set(diag, -EIO, "%s: %s", path, strerror(errno));
    technique_report_print_json(report, file);
    bool failed = ferror(file);
    return fclose(file) != 0 || failed ? diag_set(diag, -EIO, "%s: cannot write", path) : 0;
}

int technique_report_write(struct technique_report *report, struct stage *stage,
                           const char *directory, struct diag *diag)
{
    char path[4096];
    snprintf(path, sizeof(path), "%s/report.json", directory);
    int r = write_json(report, path, diag);
    if (r == 0)
        r = technique_report_write_csv(report, directory, diag);
    for (int i = 0; r == 0 && i < report->flown_count[EQUAL_ERROR]; i++)
        r = write_worst(report, stage, directory, &report->flown[EQUAL_ERROR][i], diag);
    snprintf(path, sizeof(path), "%s/report.html", directory);
    return r < 0 ? r : write_page(report, path, diag);
}
