/* otwd-import: the program behind `otwd import`, and the only one that links GDAL. */
#include <argp.h>
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>
#include <unistd.h>

#include "base/clock.h"
#include "daemon/bench_codec.h"
#include "daemon/import_options.h"
#include "daemon/import_stamp.h"
#include "terrain/image_encode.h"
#include "terrain/imagery.h"

static volatile sig_atomic_t stop_asked;

struct display {
    bool quiet, terminal;
    nsec_t shown_ns, began_ns;
    uint64_t began_done; /* what an earlier run had done of the phase */
    bool finished;       /* its end was shown */
    enum import_phase phase;
    char name[256];
};

/* A bar that is redrawn on a terminal; elsewhere a line for each thing done. */
static void show(struct display *display, const char *name, uint64_t done, uint64_t total)
{
    static const char *const verbs[] = {"reading", "storing", "levels of"};
    const char *base = strrchr(name, '/') ? strrchr(name, '/') + 1 : name;
    double share = total ? (double)done / (double)total : 1.0;
    double spent_s = seconds_from_ns(clock_monotonic_ns() - display->began_ns);
    double rate = spent_s > 0.0 ? (double)(done - display->began_done) / spent_s : 0.0;
    const char *verb = verbs[display->phase];
    if (!display->terminal) {
        if (done >= total && !display->finished)
            fprintf(stderr, "%s %s: done in %.1f s\n", verb, base, spent_s);
        return;
    }
    char bar[31] = "";
    for (int i = 0; i < 30; i++)
        bar[i] = i < (int)(share * 30.0) ? '#' : '.';
    fprintf(stderr, "\r\033[K%-9s %-28.28s [%s] %3.0f %%  %.1f %s/s  %.0f s left%s", verb, base,
            bar, 100.0 * share, rate, display->phase == IMPORT_READING ? "lines" : "blocks",
            rate > 0.0 ? (double)(total - done) / rate : 0.0,
            done >= total && !display->finished ? "\n" : "");
}

static bool on_progress(void *user, enum import_phase phase, const char *name, uint64_t done,
                        uint64_t total)
{
    struct display *display = user;
    nsec_t now_ns = clock_monotonic_ns();
    if (phase != display->phase ||
        (display->name[0] && strncmp(name, display->name, sizeof(display->name) - 1) != 0)) {
        display->phase = phase;
        display->began_ns = now_ns;
        display->began_done = done;
        display->finished = false;
    }
    snprintf(display->name, sizeof(display->name), "%s", name);
    if (!display->quiet && (done >= total || now_ns - display->shown_ns > 100 * NSEC_PER_MSEC)) {
        show(display, name, done, total);
        display->shown_ns = now_ns;
        display->finished = done >= total;
    }
    return stop_asked;
}

static void on_signal(int number)
{
    stop_asked = 1;
}

static int exit_code(int error)
{
    switch (error) {
    case -ENOENT:
    case -EACCES:
        return EX_NOINPUT;
    case -EINVAL:
    case -E2BIG:
    case -ENAMETOOLONG:
    case -EEXIST:
        return EX_USAGE;
    case -EBADMSG:
    case -EPROTONOSUPPORT:
    case -EFBIG:
        return EX_DATAERR;
    case -EBUSY:
    case -ECANCELED:
        return EX_TEMPFAIL;
    case -ENOMEM:
        return EX_OSERR;
    default:
        return EX_IOERR;
    }
}

static void print_result(const struct arguments *arguments, const struct import_result *result,
                         const struct database_info *info)
{
    if (arguments->json) {
        printf(
            "{\"sources_imported\": %zu, \"sources_skipped\": %zu, \"resumed\": %s, "
            "\"posts_per_degree\": %.15g, \"levels\": %d, "
            "\"posts\": %llu, \"max_error_m\": %g, \"bytes\": %llu, \"bytes_per_post\": %.4f, "
            "\"south_deg\": %.9g, \"west_deg\": %.9g, \"north_deg\": %.9g, \"east_deg\": %.9g}\n",
            result->imported, result->skipped, result->resumed ? "true" : "false",
            info->grid.posts_per_degree, info->levels, (unsigned long long)info->posts,
            info->max_error_m, (unsigned long long)info->file_bytes, info->bytes_per_post,
            info->south_deg, info->west_deg, info->north_deg, info->east_deg);
    } else if (!arguments->quiet) {
        printf(
            "%zu imported, %zu were there already; %d levels, %llu posts, %llu bytes, %.3f bytes a "
            "post\n",
            result->imported, result->skipped, info->levels, (unsigned long long)info->posts,
            (unsigned long long)info->file_bytes, info->bytes_per_post);
    }
}

/* The layer that was added to. */
static int report_imagery(const struct arguments *arguments, const struct import_result *result,
                          struct database *database, struct diag *diag)
{
    struct database_layers layers;
    struct imagery_level_info levels[IMAGERY_LEVELS_MAX], all = {0};
    int r = database_list_layers(database, &layers, diag);
    for (size_t i = 0; r == 0 && i < layers.count; i++) {
        if (strcmp(layers.layers[i].name, result->layer) != 0)
            continue;
        r = imagery_count_tiles(database, &layers.layers[i], levels, diag);
        for (int level = 0; r == 0 && level < IMAGERY_LEVELS_MAX; level++) {
            all.tiles += levels[level].tiles;
            all.bytes += levels[level].bytes;
        }
    }
    if (r == 0)
        database_layers_finish(&layers);
    if (r == 0 && arguments->json)
        printf("{\"sources_imported\": %zu, \"sources_skipped\": %zu, \"resumed\": %s, "
               "\"layer\": \"%s\", \"tiles\": %llu, \"bytes\": %llu}\n",
               result->imported, result->skipped, result->resumed ? "true" : "false", result->layer,
               (unsigned long long)all.tiles, (unsigned long long)all.bytes);
    else if (r == 0 && !arguments->quiet)
        printf("%zu imported, %zu were there already; layer %s: %llu tiles, %llu bytes\n",
               result->imported, result->skipped, result->layer, (unsigned long long)all.tiles,
               (unsigned long long)all.bytes);
    return r;
}

static int import_and_report(struct arguments *arguments, struct diag *diag)
{
    struct import_result result;
    struct database *database = NULL;
    struct database_info info;
    int r = import_run(&arguments->import, &result, diag);
    if (r == 0 && arguments->import.shard_count) {
        if (!arguments->quiet)
            printf("shard %u/%u: %s\n", arguments->import.shard + 1, arguments->import.shard_count,
                   arguments->import.database);
        return 0;
    }
    if (r == 0)
        r = database_open(arguments->import.database, &database, diag);
    if (r == 0 && arguments->import.imagery) {
        r = report_imagery(arguments, &result, database, diag);
        database_close(database);
        return r;
    }
    if (r == 0)
        r = database_info(database, &info, diag);
    if (r == 0) {
        print_result(arguments, &result, &info);
        database_info_finish(&info);
    }
    database_close(database);
    return r;
}

struct verification {
    const struct arguments *arguments;
    uint64_t beyond;
};

static int print_comparison(void *user, const char *source,
                            const struct import_comparison *comparison)
{
    struct verification *verification = user;
    verification->beyond += comparison->beyond;
    if (verification->arguments->json)
        printf("{\"source\": \"%s\", \"exact\": %s, \"posts\": %llu, \"elsewhere\": %llu, "
               "\"beyond\": %llu, \"worst_m\": %.9g, \"max_error_m\": %.9g}\n",
               source, comparison->exact ? "true" : "false", (unsigned long long)comparison->posts,
               (unsigned long long)comparison->elsewhere, (unsigned long long)comparison->beyond,
               comparison->worst_m, comparison->max_error_m);
    else if (!verification->arguments->quiet)
        printf("%s: %llu posts (%s), worst difference %.9g m, at most %g m allowed: %llu beyond; "
               "%llu posts have other heights there\n",
               source, (unsigned long long)comparison->posts,
               comparison->exact ? "its own" : "resampled", comparison->worst_m,
               comparison->max_error_m, (unsigned long long)comparison->beyond,
               (unsigned long long)comparison->elsewhere);
    if (comparison->beyond && !verification->arguments->quiet)
        fprintf(stderr, "otwd-import: %s: %s\n", source, comparison->first.text);
    return 0;
}

/* Output that was lost is a failure. */
static int close_output(int status)
{
    if (status != EX_OK || (fflush(stdout) == 0 && !ferror(stdout)))
        return status;
    fprintf(stderr, "otwd-import: standard output: %s\n", strerror(errno));
    return EX_IOERR;
}

int main(int argc, char **argv)
{
    argp_program_version = "otwd-import " OTWD_VERSION;
    if (argc > 1 && strcmp(argv[1], "--bench-codec") == 0)
        return close_output(bench_codec_main(argc - 1, argv + 1));
    if (argc > 1 && strcmp(argv[1], "--stamp") == 0)
        return close_output(stamp_main(argc - 1, argv + 1));
    struct arguments arguments = {.import = {.fill_posts = IMPORT_FILL_DEFAULT},
                                  .imagery = {.quality = IMAGE_QUALITY_DEFAULT}};
    struct diag diag = {.text = ""};
    int r = import_parse_arguments(argc, argv, &arguments);
    if (r != 0 || arguments.done) {
        import_finish_arguments(&arguments);
        return close_output(r);
    }
    struct display display = {.quiet = arguments.quiet,
                              .terminal = isatty(STDERR_FILENO),
                              .began_ns = clock_monotonic_ns()};
    arguments.import.progress = on_progress;
    arguments.import.user = &display;
    signal(SIGINT, on_signal);
    signal(SIGTERM, on_signal);
    struct verification verification = {.arguments = &arguments};
    r = arguments.verified
            ? import_compare(arguments.verified, arguments.inputs, arguments.import.input_count,
                             print_comparison, &verification, &diag)
            : import_and_report(&arguments, &diag);
    import_finish_arguments(&arguments);
    if (r == 0)
        return close_output(verification.beyond ? EX_DATAERR : EX_OK);
    if (display.terminal && !arguments.quiet)
        fputc('\n', stderr);
    fprintf(stderr, "otwd-import: %s\n", diag.text[0] ? diag.text : strerror(-r));
    return exit_code(r);
}
