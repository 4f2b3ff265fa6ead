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
#include "daemon/cli.h"
#include "daemon/import_report.h"
#include "daemon/import_stamp.h"
#include "daemon/stop.h"
#include "daemon/version.h"
#include "terrain/image_encode.h"

struct display {
    bool terminal;
    nsec_t shown_ns, began_ns;
    uint64_t began_done; /* what an earlier run had done of the phase */
    bool finished;       /* its end was shown */
    enum import_phase phase;
    char name[256];
    json_t *beyond; /* sources with heights beyond the Earth's */
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
    if (!cli_quiet() && (done >= total || now_ns - display->shown_ns > 100 * NSEC_PER_MSEC)) {
        show(display, name, done, total);
        display->shown_ns = now_ns;
        display->finished = done >= total;
    }
    return stop_asked();
}

static void on_beyond(void *user, const char *source, const struct raster_beyond *beyond)
{
    struct display *display = user;
    import_report_beyond(display->beyond, source, beyond);
}

static int import_and_report(const struct arguments *arguments, json_t *beyond, struct diag *diag)
{
    struct import_result result;
    int r = import_run(&arguments->import, &result, diag);
    return r == 0 ? import_report(arguments, &result, beyond, diag) : r;
}

int main(int argc, char **argv)
{
    argp_program_version = "otwd " OTWD_VERSION " (" OTWD_COMMIT ")";
    if (argc > 1 && strcmp(argv[1], "--bench-codec") == 0)
        return cli_conclude(bench_codec_main(argc - 1, argv + 1));
    if (argc > 1 && strcmp(argv[1], "--stamp") == 0)
        return cli_conclude(stamp_main(argc - 1, argv + 1));
    struct arguments arguments = {.import = {.fill_posts = IMPORT_FILL_DEFAULT},
                                  .imagery = {.quality = IMAGE_QUALITY_DEFAULT}};
    struct diag diag = {.text = ""};
    int r = import_parse_arguments(argc, argv, &arguments);
    if (r != 0 || arguments.done) {
        import_finish_arguments(&arguments);
        return cli_conclude(r);
    }
    struct display display = {.terminal = isatty(STDERR_FILENO),
                              .began_ns = clock_monotonic_ns(),
                              .beyond = json_array()};
    arguments.import.progress = on_progress;
    arguments.import.beyond = on_beyond;
    arguments.import.user = &display;
    stop_on_signals();
    signal(SIGXFSZ, SIG_IGN); /* a file that may not grow is an error like a full disk */
    struct verification verification = {.arguments = &arguments};
    r = arguments.verified
            ? import_compare(arguments.verified, arguments.inputs, arguments.import.input_count,
                             import_report_comparison, &verification, &diag)
            : import_and_report(&arguments, display.beyond, &diag);
    json_decref(display.beyond);
    import_finish_arguments(&arguments);
    if (r == 0)
        return cli_conclude(verification.beyond ? EX_DATAERR : EX_OK);
    if (display.terminal && !cli_quiet())
        fputc('\n', stderr);
    fprintf(stderr, "otwd-import: %s\n", diag.text[0] ? diag.text : strerror(-r));
    return cli_conclude(cli_exit_status(r));
}
