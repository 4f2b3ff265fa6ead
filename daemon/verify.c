/* `otwd verify DB`: every tile decoded and checked. */
#include <errno.h>
#include <jansson.h>
#include <stdio.h>
#include <sysexits.h>
#include <unistd.h>

#include "daemon/cli.h"
#include "daemon/commands.h"
#include "daemon/import_exec.h"
#include "terrain/database.h"

#define AGAINST_ARGUMENTS 16

enum { OPT_AGAINST = 256, OPT_CRS, OPT_NODATA, OPT_GEOID };

struct verify_options {
    const char *database, *against, *crs, *nodata, *geoid;
    bool json, progress;
    json_t *faults;
};

static const struct argp_option known[] = {
    {"json", 'j', NULL, 0, "as JSON", 0},
    {"against", OPT_AGAINST, "SOURCE", 0,
     "also compare every post that came from this source with it", 0},
    {"crs", OPT_CRS, "CRS", 0, "of the source, as in its import", 0},
    {"nodata", OPT_NODATA, "VALUE", 0, "of the source, as in its import", 0},
    {"geoid", OPT_GEOID, "FILE", 0, "of the source, as in its import", 0},
    {0},
};

static error_t parse_option(int key, char *argument, struct argp_state *state)
{
    struct verify_options *options = state->input;
    switch (key) {
    case 'j':
        options->json = true;
        return 0;
    case OPT_AGAINST:
        options->against = argument;
        return 0;
    case OPT_CRS:
        options->crs = argument;
        return 0;
    case OPT_NODATA:
        options->nodata = argument;
        return 0;
    case OPT_GEOID:
        options->geoid = argument;
        return 0;
    default:
        return cli_argument(key, argument, state, "DB", &options->database);
    }
}

static const struct argp parser = {
    .options = known,
    .parser = parse_option,
    .args_doc = "DB",
    .doc = "Decode and check every tile of a terrain database: checksums, bounds, shared borders, "
           "agreement and stated error of the levels. Each fault is named."
           "\vExit status: 0 sound, 64 bad usage, 65 faults or not a terrain database, 66 no such "
           "file.",
};

static bool tell(void *user, const struct database_fault *fault, uint64_t done, uint64_t total)
{
    struct verify_options *options = user;
    if (fault && options->json)
        json_array_append_new(options->faults, cli_json_text(fault->text));
    else if (fault && !cli_quiet())
        printf("%s\n", fault->text);
    else if (!fault && options->progress)
        fprintf(stderr, "\r%llu of %llu tiles", (unsigned long long)done,
                (unsigned long long)total);
    return false;
}

/* The source is GDAL's to read: the import program compares. */
static int verify_against(const struct verify_options *options)
{
    const char *arguments[AGAINST_ARGUMENTS] = {"otwd-import", "--verify", options->database};
    const char *const given[][2] = {
        {"--crs", options->crs}, {"--nodata", options->nodata}, {"--geoid", options->geoid}};
    int count = 3;
    for (int i = 0; i < 3; i++)
        if (given[i][1]) {
            arguments[count++] = given[i][0];
            arguments[count++] = given[i][1];
        }
    if (options->json)
        arguments[count++] = "--json";
    if (cli_quiet())
        arguments[count++] = "--quiet";
    if (cli_verbose())
        arguments[count++] = "--verbose";
    arguments[count++] = options->against;
    fflush(stdout);
    return import_exec((char **)arguments);
}

int verify_main(int argc, char **argv)
{
    struct verify_options options = {0};
    cli_parse(&parser, "verify", argc, argv, &options);
    options.progress = isatty(STDERR_FILENO) && !cli_quiet() && !options.json;
    options.faults = options.json ? json_array() : NULL;
    struct diag diag = {0};
    struct database *database = NULL;
    struct database_verify_report report = {0};
    int r = database_open(options.database, &database, &diag);
    if (r == 0)
        r = database_verify(database, tell, &options, &report, &diag);
    database_close(database);
    if (options.progress)
        fputc('\n', stderr);
    if (r < 0) {
        json_decref(options.faults);
        return cli_fail(r, &diag);
    }
    if (options.json) {
        json_t *root = json_pack("{s:I,s:I,s:o}", "tiles", (json_int_t)report.tiles, "faults",
                                 (json_int_t)report.faults, "found", options.faults);
        json_dumpf(root, stdout, JSON_INDENT(2));
        putchar('\n');
        json_decref(root);
    } else if (!cli_quiet()) {
        printf("%s: %llu tiles, %llu faults\n", options.database, (unsigned long long)report.tiles,
               (unsigned long long)report.faults);
    }
    if (report.faults)
        return EX_DATAERR;
    return options.against ? verify_against(&options) : EX_OK;
}
