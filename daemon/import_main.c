/* otwd-import: the program behind `otwd import`, and the only one that links GDAL. */
#include <errno.h>
#include <getopt.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>
#include <unistd.h>

#include "base/clock.h"
#include "terrain/database.h"
#include "terrain/import.h"

static volatile sig_atomic_t stop_asked;

static const char usage[] =
    "usage: otwd import SRC... -o DB [options]\n"
    "\n"
    "Puts elevation rasters (any that GDAL reads, zipped ones too) into a terrain database.\n"
    "An existing database is added to; an interrupted import goes on when it is run again.\n"
    "\n"
    "  -o, --output DB        the database\n"
    "      --max-error M      largest error of a stored height, metres (0.5; 0 = lossless)\n"
    "      --vertical V       heights of the source are above egm96 (default), egm2008, egm84,\n"
    "                         ellipsoid\n"
    "      --geoid FILE       grid of that geoid (egm2008, egm84), a PGM file of GeographicLib\n"
    "      --crs CRS          for rasters that have no usable coordinate system of their own:\n"
    "                         EPSG:4326, ...\n"
    "      --nodata VALUE     this value means missing data, whatever the raster says\n"
    "      --priority N       covers sources of lower priority (0); later ones cover equal ones\n"
    "  -j, --jobs N           threads (one for each processor)\n"
    "      --shard I/N        only the I-th of N parts of the work; otwd merge puts the files "
    "together\n"
    "      --json             print the result as JSON\n"
    "  -q, --quiet            no progress\n"
    "  -h, --help  --version\n";

struct arguments {
    struct import_params import;
    struct import_options options; /* of all sources */
    struct import_input *inputs;   /* owned */
    double max_error_m;
    bool json, quiet, done; /* done: help or version was printed */
};

enum long_option {
    OPTION_MAX_ERROR = 1000,
    OPTION_VERTICAL,
    OPTION_GEOID,
    OPTION_CRS,
    OPTION_NODATA,
    OPTION_PRIORITY,
    OPTION_SHARD,
    OPTION_JSON,
    OPTION_VERSION,
};

static const struct option long_options[] = {
    {"output", required_argument, NULL, 'o'},
    {"max-error", required_argument, NULL, OPTION_MAX_ERROR},
    {"vertical", required_argument, NULL, OPTION_VERTICAL},
    {"geoid", required_argument, NULL, OPTION_GEOID},
    {"crs", required_argument, NULL, OPTION_CRS},
    {"nodata", required_argument, NULL, OPTION_NODATA},
    {"priority", required_argument, NULL, OPTION_PRIORITY},
    {"jobs", required_argument, NULL, 'j'},
    {"shard", required_argument, NULL, OPTION_SHARD},
    {"json", no_argument, NULL, OPTION_JSON},
    {"quiet", no_argument, NULL, 'q'},
    {"help", no_argument, NULL, 'h'},
    {"version", no_argument, NULL, OPTION_VERSION},
    {NULL, 0, NULL, 0},
};

static int bad_value(const char *option, const char *value, const char *expected)
{
    fprintf(stderr, "otwd-import: %s %s: expected %s\n", option, value, expected);
    return EX_USAGE;
}

static bool number_from_text(const char *text, double low, double high, double *ret_value)
{
    char *end = NULL;
    double value = strtod(text, &end);
    if (end == text || *end || !(value >= low && value <= high))
        return false;
    *ret_value = value;
    return true;
}

static bool whole_from_text(const char *text, long low, long high, long *ret_value)
{
    char *end = NULL;
    errno = 0;
    long value = strtol(text, &end, 10);
    if (end == text || *end || errno || value < low || value > high)
        return false;
    *ret_value = value;
    return true;
}

static bool shard_from_text(const char *text, unsigned *ret_shard, unsigned *ret_count)
{
    unsigned number, count;
    char end;
    if (sscanf(text, "%u/%u%c", &number, &count, &end) != 2 || number < 1 || number > count ||
        count > 65536)
        return false;
    *ret_shard = number - 1;
    *ret_count = count;
    return true;
}

static int take_option(struct arguments *arguments, int option)
{
    struct import_params *import = &arguments->import;
    struct import_options *options = &arguments->options;
    long whole = 0;
    switch (option) {
    case 'o':
        import->database = optarg;
        return 0;
    case OPTION_MAX_ERROR:
        import->max_error_m = &arguments->max_error_m;
        if (number_from_text(optarg, 0.0, 1000.0, &arguments->max_error_m))
            return 0;
        return bad_value("--max-error", optarg, "metres, 0 to 1000");
    case OPTION_VERTICAL:
        if (import_vertical_from_name(optarg, &options->vertical) == 0)
            return 0;
        return bad_value("--vertical", optarg, "egm96, egm2008, egm84 or ellipsoid");
    case OPTION_GEOID:
        options->geoid_path = optarg;
        return 0;
    case OPTION_CRS:
        options->crs = optarg;
        return 0;
    case OPTION_NODATA:
        options->has_nodata = true;
        if (number_from_text(optarg, -HUGE_VAL, HUGE_VAL, &options->nodata))
            return 0;
        return bad_value("--nodata", optarg, "a number");
    case OPTION_PRIORITY:
        if (!whole_from_text(optarg, -1000000, 1000000, &whole))
            return bad_value("--priority", optarg, "a whole number, -1000000 to 1000000");
        options->priority = (int)whole;
        return 0;
    case 'j':
        if (!whole_from_text(optarg, 1, 64, &whole))
            return bad_value("--jobs", optarg, "a whole number, 1 to 64");
        import->jobs = (unsigned)whole;
        return 0;
    case OPTION_SHARD:
        if (shard_from_text(optarg, &import->shard, &import->shard_count))
            return 0;
        return bad_value("--shard", optarg, "I/N, 1/N to N/N");
    case OPTION_JSON:
        arguments->json = true;
        return 0;
    case 'q':
        arguments->quiet = true;
        return 0;
    case 'h':
        fputs(usage, stdout);
        arguments->done = true;
        return 0;
    case OPTION_VERSION:
        puts("otwd-import " OTWD_VERSION);
        arguments->done = true;
        return 0;
    default: /* getopt has said what is wrong */
        return EX_USAGE;
    }
}

static int parse_arguments(int argc, char **argv, struct arguments *arguments)
{
    int option, r = 0;
    while (r == 0 && !arguments->done &&
           (option = getopt_long(argc, argv, "o:j:qh", long_options, NULL)) != -1)
        r = take_option(arguments, option);
    if (r != 0 || arguments->done)
        return r;
    size_t count = (size_t)(argc - optind);
    arguments->inputs = calloc(count + 1, sizeof(*arguments->inputs));
    for (size_t i = 0; arguments->inputs && i < count; i++)
        arguments->inputs[i] = (struct import_input){argv[optind + (int)i], arguments->options};
    arguments->import.inputs = arguments->inputs;
    arguments->import.input_count = count;
    if (!arguments->inputs)
        return EX_OSERR;
    if (arguments->import.input_count == 0 || !arguments->import.database) {
        fprintf(stderr, "otwd-import: %s (see --help)\n",
                arguments->import.database ? "no source was given" : "no -o DB was given");
        return EX_USAGE;
    }
    return 0;
}

struct display {
    bool quiet, terminal;
    nsec_t shown_ns, began_ns;
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
    const char *verb = verbs[display->phase];
    if (!display->terminal) {
        if (done >= total)
            fprintf(stderr, "%s %s: done in %.1f s\n", verb, base, spent_s);
        return;
    }
    char bar[31] = "";
    for (int i = 0; i < 30; i++)
        bar[i] = i < (int)(share * 30.0) ? '#' : '.';
    fprintf(stderr, "\r\033[K%-9s %-28.28s [%s] %3.0f %%  %.0f s left%s", verb, base, bar,
            100.0 * share, share > 0.0 ? spent_s * (1.0 - share) / share : 0.0,
            done >= total ? "\n" : "");
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
    }
    snprintf(display->name, sizeof(display->name), "%s", name);
    if (!display->quiet && (done >= total || now_ns - display->shown_ns > 100 * NSEC_PER_MSEC)) {
        show(display, name, done, total);
        display->shown_ns = now_ns;
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
    if (r == 0)
        r = database_info(database, &info, diag);
    if (r == 0) {
        print_result(arguments, &result, &info);
        database_info_finish(&info);
    }
    database_close(database);
    return r;
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
    struct arguments arguments = {.quiet = false};
    struct diag diag = {.text = ""};
    int r = parse_arguments(argc, argv, &arguments);
    if (r != 0 || arguments.done)
        return close_output(r);
    struct display display = {.quiet = arguments.quiet,
                              .terminal = isatty(STDERR_FILENO),
                              .began_ns = clock_monotonic_ns()};
    arguments.import.progress = on_progress;
    arguments.import.user = &display;
    signal(SIGINT, on_signal);
    signal(SIGTERM, on_signal);
    r = import_and_report(&arguments, &diag);
    if (r == 0)
        return close_output(EX_OK);
    if (display.terminal && !arguments.quiet)
        fputc('\n', stderr);
    fprintf(stderr, "otwd-import: %s\n", diag.text[0] ? diag.text : strerror(-r));
    return exit_code(r);
}
