/* The page that a test engineer opens after a run: one file, no script, drawn as SVG. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/html.h"
#include "daemon/report.h"
#include "daemon/version.h"

#define PLOT_WIDTH  1000
#define PLOT_HEIGHT 240
#define BINS        60

static void write_row(FILE *file, const char *name, const struct report *report,
                      enum report_metric metric)
{
    struct distribution d = {0};
    report_distribution(report, metric, &d);
    fprintf(file,
            "<tr><td>%s</td><td>%.2f</td><td>%.2f</td><td>%.2f</td><td>%.2f</td><td>%.2f</td>"
            "<td>%.2f</td></tr>\n",
            name, d.min, d.p50, d.p95, d.p99, d.p999, d.max);
}

static void write_axis(FILE *file, double top, double last_s)
{
    for (int i = 0; i <= 4; i++) {
        double y = PLOT_HEIGHT - PLOT_HEIGHT * i / 4.0;
        fprintf(file,
                "<line x1=\"0\" x2=\"%d\" y1=\"%.1f\" y2=\"%.1f\" stroke=\"#d8dee4\"/>"
                "<text x=\"4\" y=\"%.1f\">%.4g ms</text>\n",
                PLOT_WIDTH, y, y, y - 3.0, top * i / 4.0);
    }
    for (int i = 1; i <= 5; i++)
        fprintf(file, "<text x=\"%.1f\" y=\"%d\" text-anchor=\"end\">%.4g s</text>\n",
                PLOT_WIDTH * i / 5.0 - 2.0, PLOT_HEIGHT + 16, last_s * i / 5.0);
}

/* The curve: for each column of the plot the least and greatest frame time that fall into it. */
static void write_curve(FILE *file, const struct report *report)
{
    double top = 1e-3, last_s = fmax(report->frames[report->count - 1].time_s, 1e-3);
    for (size_t i = 0; i < report->count; i++)
        top = fmax(top, report->frames[i].frame_ms);
    top = html_nice_above(top);
    html_plot_begin(file, PLOT_WIDTH, PLOT_HEIGHT);
    write_axis(file, top, last_s);
    fputs("<path fill=\"none\" stroke=\"#0969da\" stroke-width=\"1.2\" d=\"", file);
    size_t columns = report->count < PLOT_WIDTH ? report->count : PLOT_WIDTH;
    for (size_t c = 0; c < columns; c++) {
        size_t from = c * report->count / columns, to = (c + 1) * report->count / columns;
        double low = INFINITY, high = 0.0;
        for (size_t i = from; i < to; i++) {
            low = fmin(low, report->frames[i].frame_ms);
            high = fmax(high, report->frames[i].frame_ms);
        }
        double x = report->frames[from].time_s / last_s * PLOT_WIDTH;
        fprintf(file, "%c%.1f %.1fL%.1f %.1f", c ? 'L' : 'M', x,
                PLOT_HEIGHT - low / top * PLOT_HEIGHT, x, PLOT_HEIGHT - high / top * PLOT_HEIGHT);
    }
    fputs("\"/></svg>\n", file);
}

static void write_histogram(FILE *file, const struct report *report)
{
    struct distribution d = {0};
    report_distribution(report, REPORT_FRAME_MS, &d);
    double width = fmax(d.max * 1.0001, 1e-3) / BINS;
    unsigned bins[BINS] = {0}, most = 1;
    for (size_t i = 0; i < report->count; i++) {
        unsigned *bin = &bins[(int)(report->frames[i].frame_ms / width) % BINS];
        if (++*bin > most)
            most = *bin;
    }
    html_plot_begin(file, PLOT_WIDTH, PLOT_HEIGHT);
    for (int i = 0; i < BINS; i++) {
        /* Logarithmic, so that a single late frame is still seen. */
        double height = bins[i] ? PLOT_HEIGHT * (0.04 + 0.96 * log1p(bins[i]) / log1p(most)) : 0.0;
        fprintf(file,
                "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" fill=\"#0969da\">"
                "<title>%.2f to %.2f ms: %u frames</title></rect>\n",
                (double)PLOT_WIDTH * i / BINS + 1, PLOT_HEIGHT - height,
                (double)PLOT_WIDTH / BINS - 2, height, i * width, (i + 1) * width, bins[i]);
    }
    for (int i = 0; i <= 5; i++)
        fprintf(file, "<text x=\"%.1f\" y=\"%d\" text-anchor=\"%s\">%.3g ms</text>\n",
                PLOT_WIDTH * i / 5.0, PLOT_HEIGHT + 16, i == 0 ? "start" : "end",
                width * BINS * i / 5.0);
    fputs("</svg>\n", file);
}

static void write_pictures(FILE *file, const struct report *report,
                           const struct report_facts *facts)
{
    for (size_t i = 0; facts->report_every && i < report->count; i += facts->report_every)
        fprintf(file,
                "<figure><img src=\"frame-%06zu.png\" alt=\"frame %zu\" loading=\"lazy\">"
                "<figcaption>frame %zu, %.1f s</figcaption></figure>\n",
                i, i, i, report->frames[i].time_s);
}

static void write_facts(FILE *file, const struct report *report, const struct report_facts *facts)
{
    fputs("<p>Flight ", file);
    html_text(file, facts->flight);
    fprintf(file, ", %zu frames of %d x %d at %g Hz, technique %s, on ", report->count,
            facts->width, facts->height, facts->rate_hz, facts->technique);
    html_text(file, facts->gl->renderer);
    fputs(" (", file);
    html_text(file, facts->gl->version);
    fprintf(file, "). otwd %s, %s.</p>\n", OTWD_VERSION, OTWD_COMMIT);
}

int report_write_html(const struct report *report, const struct report_facts *facts,
                      const char *path, struct diag *diag)
{
    FILE *file = fopen(path, "w");
    if (!file)
        return diag_set(diag, -errno, "%s: %s", path, strerror(errno));
    html_begin(file, "otwd: a measured flight");
    write_facts(file, report, facts);
    fputs("<table><tr><th>ms</th><th>min</th><th>p50</th><th>p95</th><th>p99</th><th>p99.9</th>"
          "<th>max</th></tr>\n",
          file);
    write_row(file, "frame (pose taken to frame finished)", report, REPORT_FRAME_MS);
    write_row(file, "GPU (timer query)", report, REPORT_GPU_MS);
    write_row(file, "CPU (render thread)", report, REPORT_CPU_MS);
    fputs("</table>\n", file);
    if (report->count > 0) {
        fputs("<h2>Frame time over the flight</h2>\n", file);
        write_curve(file, report);
        fputs("<h2>Histogram of frame times (counts on a logarithmic scale)</h2>\n", file);
        write_histogram(file, report);
        fputs("<h2>Pictures</h2>\n", file);
        write_pictures(file, report, facts);
    }
    if (html_end(file) < 0)
        return diag_set(diag, -EIO, "%s: cannot write: %s", path, strerror(errno));
    return 0;
}
