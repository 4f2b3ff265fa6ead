#include "daemon/dig_options.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "daemon/cli.h"
#include "geo/geographic.h"

enum {
    OPT_AT = 256,
    OPT_POINT,
    OPT_RADIUS,
    OPT_DEPTH,
    OPT_RIM_HEIGHT,
    OPT_RIM_WIDTH,
    OPT_HEIGHT,
    OPT_CREST_WIDTH,
    OPT_SIDE_SLOPE,
    OPT_HEADING,
    OPT_LENGTH,
    OPT_WIDTH,
    OPT_START_HEIGHT,
    OPT_END_HEIGHT,
    OPT_BLEND,
    OPT_CRS,
    OPT_NODATA,
    OPT_SCALE,
    OPT_LIST,
    OPT_UNDO,
    OPT_LAST
};

static const struct argp_option known[] = {
    {"at", OPT_AT, "LAT,LON", 0, "the middle of the stamp, degrees", 1},
    {NULL, 0, NULL, 0, "crater:", 2},
    {"radius-m", OPT_RADIUS, "M", 0, "to the crest of the rim", 2},
    {"depth-m", OPT_DEPTH, "M", 0, "in the middle, below the ground before", 2},
    {"rim-height-m", OPT_RIM_HEIGHT, "M", 0, "(default: a tenth of the depth)", 2},
    {"rim-width-m", OPT_RIM_WIDTH, "M", 0, "of its outside (default: half the radius)", 2},
    {NULL, 0, NULL, 0, "berm:", 3},
    {"point", OPT_POINT, "LAT,LON", 0, "of its line; twice or more", 3},
    {"height-m", OPT_HEIGHT, "M", 0, "above the ground before; below 0: a ditch", 3},
    {"crest-width-m", OPT_CREST_WIDTH, "M", 0, "(default 4)", 3},
    {"side-slope", OPT_SIDE_SLOPE, "S", 0, "rise over run, where steepest (default 0.5)", 3},
    {NULL, 0, NULL, 0, "flatten:", 4},
    {"heading-deg", OPT_HEADING, "DEG", 0, "true, of the strip (default 0)", 4},
    {"length-m", OPT_LENGTH, "M", 0, "along the heading", 4},
    {"width-m", OPT_WIDTH, "M", 0, "across it", 4},
    {"start-height-m", OPT_START_HEIGHT, "M", 0, "above EGM96", 4},
    {"end-height-m", OPT_END_HEIGHT, "M", 0, "(default: as at the start)", 4},
    {"blend-m", OPT_BLEND, "M", 0, "around it, back to the ground (default 30)", 4},
    {NULL, 0, NULL, 0, "raster FILE, of displacements; any that GDAL reads:", 5},
    {"crs", OPT_CRS, "CRS", 0, "where it has none of its own", 5},
    {"nodata", OPT_NODATA, "VALUE", 0, "no displacement", 5},
    {"scale", OPT_SCALE, "M", 0, "metres of one of its units (default 1)", 5},
    {NULL, 0, NULL, 0, "Instead of a stamp:", 6},
    {"list", OPT_LIST, NULL, 0, "what was dug, oldest first", 6},
    {"undo", OPT_UNDO, "N", 0, "take the last N stamps away", 6},
    {NULL, 0, NULL, 0, "In any case:", 7},
    {"json", 'j', NULL, 0, "as JSON", 7},
    {0},
};

struct parsing {
    struct dig_options *options;
    bool given[OPT_LAST - OPT_AT];
    double number[OPT_LAST - OPT_AT];
    double lat_deg[STAMP_POINTS_MAX], lon_deg[STAMP_POINTS_MAX]; /* of --point */
    unsigned points;
    double at_lat_deg, at_lon_deg;
    const char *kind;
};

static void take_place(struct argp_state *state, const char *option, const char *text,
                       double *ret_lat_deg, double *ret_lon_deg)
{
    char rest;
    if (sscanf(text, "%lf,%lf%c", ret_lat_deg, ret_lon_deg, &rest) != 2 ||
        !(fabs(*ret_lat_deg) <= 90.0 && fabs(*ret_lon_deg) <= 360.0))
        argp_error(state, "--%s takes LAT,LON in degrees, not \"%s\"", option, text);
}

static const char *option_name(int key)
{
    for (const struct argp_option *option = known; option->name || option->doc; option++)
        if (option->key == key)
            return option->name;
    return "";
}

static void take_argument(struct argp_state *state, struct parsing *parsing, const char *argument)
{
    struct dig_options *options = parsing->options;
    if (!options->target)
        options->target = argument;
    else if (!parsing->kind)
        parsing->kind = argument;
    else if (strcmp(parsing->kind, "raster") == 0 && !options->raster)
        options->raster = argument;
    else
        argp_error(state, "unexpected argument \"%s\"", argument);
}

static double needed(struct argp_state *state, const struct parsing *parsing, int key)
{
    if (!parsing->given[key - OPT_AT])
        argp_error(state, "a %s needs --%s", parsing->kind, option_name(key));
    return parsing->number[key - OPT_AT];
}

static double given_or(const struct parsing *parsing, int key, double otherwise)
{
    return parsing->given[key - OPT_AT] ? parsing->number[key - OPT_AT] : otherwise;
}

static void fill_crater(struct argp_state *state, const struct parsing *parsing,
                        struct stamp *stamp)
{
    stamp->kind = STAMP_CRATER;
    struct stamp_crater *crater = &stamp->crater;
    crater->radius_m = needed(state, parsing, OPT_RADIUS);
    crater->depth_m = needed(state, parsing, OPT_DEPTH);
    crater->rim_height_m = given_or(parsing, OPT_RIM_HEIGHT, 0.1 * fmax(crater->depth_m, 0.0));
    crater->rim_width_m = given_or(parsing, OPT_RIM_WIDTH, 0.5 * crater->radius_m);
}

/* The line's points about the middle of all. */
static void fill_berm(struct argp_state *state, const struct parsing *parsing, struct stamp *stamp)
{
    struct stamp_berm *berm = &stamp->berm;
    struct geodetic origin = {parsing->lat_deg[0], parsing->lon_deg[0], 0.0};
    double low[2] = {0.0, 0.0}, high[2] = {0.0, 0.0}, enu_m[3];
    if (parsing->points < 2)
        argp_error(state, "a berm needs --point twice or more");
    stamp->kind = STAMP_BERM;
    berm->height_m = needed(state, parsing, OPT_HEIGHT);
    berm->crest_width_m = given_or(parsing, OPT_CREST_WIDTH, 4.0);
    berm->side_slope = given_or(parsing, OPT_SIDE_SLOPE, 0.5);
    berm->count = parsing->points;
    for (int pass = 0; pass < 2; pass++) {
        for (unsigned i = 0; i < parsing->points; i++) {
            struct geodetic point = {parsing->lat_deg[i], parsing->lon_deg[i], 0.0};
            enu_from_geodetic(&origin, &point, enu_m);
            berm->points[i].east_m = enu_m[0];
            berm->points[i].north_m = enu_m[1];
            for (int k = 0; k < 2; k++) {
                low[k] = fmin(low[k], enu_m[k]);
                high[k] = fmax(high[k], enu_m[k]);
            }
        }
        double middle_m[3] = {0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.0};
        if (pass == 0)
            geodetic_from_enu(&origin, middle_m, &origin);
    }
    stamp->lat_deg = origin.lat_deg;
    stamp->lon_deg = origin.lon_deg;
}

static void fill_flatten(struct argp_state *state, const struct parsing *parsing,
                         struct stamp *stamp)
{
    struct stamp_flatten *strip = &stamp->flatten;
    stamp->kind = STAMP_FLATTEN;
    strip->heading_deg = given_or(parsing, OPT_HEADING, 0.0);
    strip->length_m = needed(state, parsing, OPT_LENGTH);
    strip->width_m = needed(state, parsing, OPT_WIDTH);
    strip->start_height_m = needed(state, parsing, OPT_START_HEIGHT);
    strip->end_height_m = given_or(parsing, OPT_END_HEIGHT, strip->start_height_m);
    strip->blend_m = given_or(parsing, OPT_BLEND, 30.0);
}

static void fill_stamp(struct argp_state *state, struct parsing *parsing)
{
    struct stamp *stamp = &parsing->options->stamp;
    struct diag diag;
    if (strcmp(parsing->kind, "raster") == 0) {
        if (!parsing->options->raster)
            argp_error(state, "a raster needs its FILE");
        return; /* made by otwd-import */
    }
    if (strcmp(parsing->kind, "berm") == 0) {
        fill_berm(state, parsing, stamp);
    } else {
        if (!parsing->given[0])
            argp_error(state, "a %s needs --at LAT,LON", parsing->kind);
        stamp->lat_deg = parsing->at_lat_deg;
        stamp->lon_deg = parsing->at_lon_deg;
        if (strcmp(parsing->kind, "crater") == 0)
            fill_crater(state, parsing, stamp);
        else if (strcmp(parsing->kind, "flatten") == 0)
            fill_flatten(state, parsing, stamp);
        else
            argp_error(state, "\"%s\" is no stamp: crater, berm, flatten, raster", parsing->kind);
    }
    if (stamp_prepare(stamp, &diag) < 0)
        argp_error(state, "%s", diag.text);
}

static void finish(struct argp_state *state, struct parsing *parsing)
{
    struct dig_options *options = parsing->options;
    int wishes = (parsing->kind != NULL) + options->list + (options->undo > 0);
    if (!options->target)
        argp_error(state, "DB is missing");
    if (wishes != 1)
        argp_error(state, "a stamp (crater, berm, flatten or raster), or --list, or --undo");
    if (parsing->kind)
        fill_stamp(state, parsing);
}

static error_t parse_option(int key, char *argument, struct argp_state *state)
{
    struct parsing *parsing = state->input;
    struct dig_options *options = parsing->options;
    switch (key) {
    case ARGP_KEY_ARG:
        take_argument(state, parsing, argument);
        return 0;
    case ARGP_KEY_END:
        finish(state, parsing);
        return 0;
    case 'j':
        options->json = true;
        return 0;
    case OPT_AT:
        take_place(state, "at", argument, &parsing->at_lat_deg, &parsing->at_lon_deg);
        parsing->given[0] = true;
        return 0;
    case OPT_POINT:
        if (parsing->points == STAMP_POINTS_MAX)
            argp_error(state, "a berm has at most %d points", STAMP_POINTS_MAX);
        take_place(state, "point", argument, &parsing->lat_deg[parsing->points],
                   &parsing->lon_deg[parsing->points]);
        parsing->points++;
        return 0;
    case OPT_CRS:
        options->crs = argument;
        return 0;
    case OPT_NODATA:
        options->nodata = argument;
        return 0;
    case OPT_LIST:
        options->list = true;
        return 0;
    case OPT_UNDO:
        options->undo = (uint32_t)cli_number(state, "undo", argument, 1, 65536);
        return 0;
    case OPT_SCALE:
        options->scale = cli_number(state, "scale", argument, -1e6, 1e6);
        return 0;
    default:
        if (key < OPT_RADIUS || key > OPT_BLEND)
            return ARGP_ERR_UNKNOWN;
        parsing->number[key - OPT_AT] =
            cli_number(state, option_name(key), argument, -20000.0, 20000.0);
        parsing->given[key - OPT_AT] = true;
        return 0;
    }
}

static const struct argp parser = {
    .options = known,
    .parser = parse_option,
    .args_doc = "DB crater|berm|flatten [OPTION...]\nDB raster FILE\nDB --list\nDB --undo N",
    .doc = "Change the ground of a terrain database for good. In place of DB, udp://HOST:PORT asks "
           "a running otwd to do so, which shows it in its next frame."
           "\vLater stamps lie on earlier ones. Nothing of the database's own is rewritten; what "
           "was dug is seen by pictures, heights and lines of sight, and --undo takes it back."
           "\n\nExit status: 0 done and on the disk, 64 bad usage, 65 a bad database or raster, 66 "
           "no such file, 69 nobody answers or what is asked is refused, 74 it cannot be written.",
};

void dig_parse_options(int argc, char **argv, struct dig_options *ret_options)
{
    struct parsing parsing = {.options = ret_options};
    *ret_options = (struct dig_options){.scale = 1.0};
    cli_parse(&parser, "dig", argc, argv, &parsing);
}
