#include "daemon/bench_codec.h"

#include <jansson.h>
#include <stdio.h>
#include <sysexits.h>

#include "daemon/cli.h"
#include "daemon/stop.h"
#include "terrain/import_bench.h"

enum { OPT_MAX_ERROR = 256, OPT_SCALE };

struct bench_options {
    struct import_bench_params params;
    char **rasters;
    int raster_count;
    bool json;
    json_t *results; /* an array */
};

static const struct argp_option known[] = {
    {"max-error", OPT_MAX_ERROR, "M", 0, "largest error in metres (0.5)", 0},
    {"scale", OPT_SCALE, "S", 0,
     "what a sample of 1 is worth in metres, whatever the raster says of that", 0},
    {"json", 'j', NULL, 0, "as JSON", 0},
    {0},
};

static error_t parse_option(int key, char *argument, struct argp_state *state)
{
    struct bench_options *options = state->input;
    switch (key) {
    case OPT_MAX_ERROR:
        options->params.max_error_m = cli_number(state, "max-error", argument, 0.0, 1000.0);
        return 0;
    case OPT_SCALE:
        options->params.scale_m = cli_number(state, "scale", argument, 1e-6, 1e6);
        return 0;
    case 'j':
        options->json = true;
        return 0;
    case ARGP_KEY_ARGS:
        options->rasters = state->argv + state->next;
        options->raster_count = state->argc - state->next;
        return 0;
    case ARGP_KEY_NO_ARGS:
        argp_error(state, "RASTER is missing");
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp parser = {
    .options = known,
    .parser = parse_option,
    .args_doc = "RASTER...",
    .doc = "Measure the height codec on rasters beside what else keeps heights: a GeoTIFF with "
           "LERC and zstd at the same largest error, zstd of the samples as they are, and PNG. "
           "Bits a sample, and millions of samples encoded and decoded a second by one thread."
           "\vThe first row is the whole file of an import with all levels, borders and indexes; "
           "its encoding includes reading the raster, its decoding reading the file. The second "
           "row is the codec alone. Those of the others have one level. A raster that an import "
           "would resample, or that says not where it lies, is measured as if its samples lay at "
           "the equator, 1 arc-second apart.",
};

static const char *const keys[BENCH_CODECS] = {"database", "payloads", "lerc_zstd", "zstd", "png"};

static double bits_a_sample(const struct import_bench_result *result, int codec)
{
    return 8.0 * result->rows[codec].bytes / ((double)result->width * result->height);
}

static double rate_mhz(const struct import_bench_result *result, double seconds)
{
    return 1e-6 * (double)result->width * result->height / seconds;
}

static void print_row(const struct import_bench_result *result, int codec, const char *name)
{
    const struct import_bench_row *row = &result->rows[codec];
    if (row->bytes > 0.0)
        printf("  %-26s %11.3f %9.1f %9.1f %11.4g\n", name, bits_a_sample(result, codec),
               rate_mhz(result, row->encode_s), rate_mhz(result, row->decode_s), row->worst_m);
    else
        printf("  %-26s %11s %9s %9s %11s\n", name, "-", "-", "-", "-");
}

static void print_table(const struct import_bench_result *result, double max_error_m)
{
    const char *png[] = {"PNG (no room in 16 bits)", "PNG, 8 bits", "PNG, 16 bits"};
    printf("%s: %d x %d %s in units of %g m, largest error %g m%s\n", result->raster, result->width,
           result->height, result->type, result->scale_m, max_error_m,
           result->placed ? ", as if at the equator" : "");
    printf("  %-26s %11s %9s %9s %11s\n", "", "bits/sample", "enc. M/s", "dec. M/s", "error, m");
    print_row(result, BENCH_DATABASE, "otwd, the whole database");
    print_row(result, BENCH_PAYLOADS, "otwd, the payloads alone");
    print_row(result, BENCH_LERC, "LERC and zstd-19, GeoTIFF");
    print_row(result, BENCH_ZSTD, "zstd-19 of the samples");
    print_row(result, BENCH_PNG, png[result->rows[BENCH_PNG].bits / 8]);
    fflush(stdout);
}

/* Null stands for a codec that cannot hold the raster. */
static json_t *json_from_row(const struct import_bench_result *result, int codec)
{
    const struct import_bench_row *row = &result->rows[codec];
    if (row->bytes == 0.0)
        return json_null();
    return json_pack("{s:I,s:f,s:f,s:f,s:f}", "bytes", (json_int_t)row->bytes, "bits_per_sample",
                     bits_a_sample(result, codec), "encode_msamples_per_s",
                     rate_mhz(result, row->encode_s), "decode_msamples_per_s",
                     rate_mhz(result, row->decode_s), "worst_m", row->worst_m);
}

static void on_done(void *user, const struct import_bench_result *result)
{
    struct bench_options *options = user;
    if (!options->json && !cli_quiet())
        print_table(result, options->params.max_error_m);
    if (!options->json)
        return;
    json_t *root = json_pack(
        "{s:o,s:s,s:i,s:i,s:f,s:f,s:b}", "raster", cli_json_text(result->raster), "type",
        result->type, "width", result->width, "height", result->height, "unit_m", result->scale_m,
        "max_error_m", options->params.max_error_m, "as_if_at_equator", result->placed);
    for (int codec = 0; codec < BENCH_CODECS; codec++)
        json_object_set_new(root, keys[codec], json_from_row(result, codec));
    json_array_append_new(options->results, root);
}

int bench_codec_main(int argc, char **argv)
{
    struct bench_options options = {
        .params = {.max_error_m = 0.5, .stop = stop_asked, .done = on_done}};
    struct diag diag = {.text = ""};
    cli_parse(&parser, "bench codec", argc, argv, &options);
    options.params.user = &options;
    options.results = json_array();
    stop_on_signals();
    int r = 0;
    for (int i = 0; r == 0 && i < options.raster_count; i++)
        r = import_bench(options.rasters[i], &options.params, &diag);
    if (r == 0 && options.json) {
        json_dumpf(options.results, stdout, JSON_INDENT(2));
        putchar('\n');
    }
    json_decref(options.results);
    return r == 0 ? EX_OK : cli_fail(r, &diag);
}
