/* What a comparison of techniques found, as tables for other programs. */
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "daemon/technique_report.h"

static const char *const comparison_names[COMPARISONS] = {"equal error", "equal time", "as asked"};

static struct distribution distribution_of(const struct samples *samples)
{
    struct distribution distribution = {0};
    samples_distribution(samples, &distribution);
    return distribution;
}

static double mean_of(const double *values, size_t count)
{
    double sum = 0.0;
    for (size_t i = 0; i < count; i++)
        sum += values[i];
    return count ? sum / (double)count : 0.0;
}

static void write_times(FILE *file, const struct technique_report *report, const double *values_ms)
{
    size_t count = (size_t)report->params.frames * (size_t)report->params.rounds;
    const struct samples samples = {(double *)values_ms, count, count};
    struct distribution d = distribution_of(&samples);
    fprintf(file, ",%.4f,%.4f,%.4f,%.4f,%.4f", d.min, mean_of(values_ms, count), d.p50, d.p999,
            d.max);
}

static void write_flown(FILE *file, const struct technique_report *report, const char *comparison,
                        const struct flown *flown)
{
    const struct quality_difference *strangers = &flown->strangers;
    struct distribution error = distribution_of(&flown->error_px);
    struct distribution psnr = distribution_of(&flown->psnr_db);
    struct distribution vertices = distribution_of(&flown->vertices_sent);
    fprintf(file, "%s,%s,%g,%d", comparison, flown->entry->name, flown->setting, flown->met);
    write_times(file, report, flown->frame_ms);
    write_times(file, report, flown->terrain_ms);
    write_times(file, report, flown->gpu_ms);
    write_times(file, report, flown->cpu_ms);
    fprintf(file, ",%.4f,%.4f,%.0f,%.0f,%.0f,%.0f,%llu", distribution_of(&flown->update_ms).p50,
            distribution_of(&flown->draw_ms).p50, distribution_of(&flown->triangles).p50,
            vertices.p50, vertices.max, distribution_of(&flown->bytes_sent).p50,
            (unsigned long long)flown->facts.gpu_bytes);
    fprintf(file, ",%.4f,%.4f,%.4f,%.2f,%.2f,%.2f,%llu,%llu,%llu\n", error.p99, error.p999,
            error.max, psnr.min, mean_of(flown->psnr_db.values, flown->psnr_db.count), psnr.max,
            (unsigned long long)strangers->holes, (unsigned long long)strangers->walls,
            (unsigned long long)strangers->pixels);
}

static void write_all_flown(FILE *file, const struct technique_report *report)
{
    static const char *const times[] = {"frame", "terrain", "gpu", "cpu"};
    fputs("comparison,technique,setting,met", file);
    for (int i = 0; i < 4; i++)
        fprintf(file, ",%s_ms_min,%s_ms_mean,%s_ms_p50,%s_ms_p999,%s_ms_max", times[i], times[i],
                times[i], times[i], times[i]);
    fputs(",update_ms_p50,draw_ms_p50,triangles_p50,vertices_sent_p50,vertices_sent_max,"
          "bytes_sent_p50,gpu_bytes,error_px_p99,error_px_p999,error_px_max,psnr_db_min,"
          "psnr_db_mean,psnr_db_max,holes,walls,pixels\n",
          file);
    for (int which = 0; which < COMPARISONS; which++)
        for (int i = 0; i < report->flown_count[which]; i++)
            write_flown(file, report, comparison_names[which], &report->flown[which][i]);
}

static void write_frames(FILE *file, const struct technique_report *report)
{
    enum comparison which = report->flown_count[AS_ASKED] > 0 ? AS_ASKED : EQUAL_ERROR;
    fputs("time_s", file);
    for (int i = 0; i < report->flown_count[which]; i++)
        fprintf(file, ",%s@%g", report->flown[which][i].entry->name,
                report->flown[which][i].setting);
    for (int frame = 0; frame < report->params.frames; frame++) {
        fprintf(file, "\n%.4f", seconds_from_ns(frame * report->params.step_ns));
        for (int i = 0; i < report->flown_count[which]; i++)
            fprintf(file, ",%.4f",
                    flights_frame_ms(&report->params, &report->flown[which][i], frame));
    }
    putc('\n', file);
}

static int write_file(const struct technique_report *report, const char *directory,
                      const char *name,
                      void (*write)(FILE *file, const struct technique_report *report),
                      struct diag *diag)
{
    char path[4096];
    snprintf(path, sizeof(path), "%s/%s", directory, name);
    FILE *file = fopen(path, "w");
    if (!file)
        return diag_set(diag, -EIO, "%s: %s", path, strerror(errno));
    write(file, report);
    bool failed = ferror(file);
    return fclose(file) != 0 || failed ? diag_set(diag, -EIO, "%s: cannot write", path) : 0;
}

int technique_report_write_csv(const struct technique_report *report, const char *directory,
                               struct diag *diag)
{
    int r = write_file(report, directory, "flown.csv", write_all_flown, diag);
    return r < 0 ? r : write_file(report, directory, "frames.csv", write_frames, diag);
}
