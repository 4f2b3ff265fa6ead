#include "daemon/import_stamp.h"

#include <argp.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "daemon/cli.h"
#include "terrain/import_stamp.h"

#define CACHE_MIB 64

enum { OPT_SCALE = 256, OPT_CRS, OPT_NODATA };

struct stamp_options {
    struct raster_options raster;
    const char *path;
    double nodata, scale_m;
};

static const struct argp_option known[] = {
    {"scale", OPT_SCALE, "M", 0, "metres of one of its units (default 1)", 0},
    {"crs", OPT_CRS, "CRS", 0, "where it has none of its own", 0},
    {"nodata", OPT_NODATA, "VALUE", 0, "no displacement", 0},
    {0},
};

static error_t parse_option(int key, char *argument, struct argp_state *state)
{
    struct stamp_options *options = state->input;
    switch (key) {
    case OPT_SCALE:
        options->scale_m = cli_number(state, "scale", argument, -1e6, 1e6);
        return 0;
    case OPT_CRS:
        options->raster.crs = argument;
        return 0;
    case OPT_NODATA:
        options->nodata = cli_number(state, "nodata", argument, -1e300, 1e300);
        options->raster.nodata = &options->nodata;
        return 0;
    default:
        return cli_argument(key, argument, state, "RASTER", &options->path);
    }
}

static const struct argp parser = {
    .options = known,
    .parser = parse_option,
    .args_doc = "RASTER",
    .doc = "For `otwd dig DB raster`: a raster of displacements as the bytes of a stamp.",
};

int stamp_main(int argc, char **argv)
{
    struct stamp_options options = {.scale_m = 1.0};
    struct diag diag = {.text = ""};
    struct stamp stamp;
    argp_parse(&parser, argc, argv, 0, NULL, &options);
    raster_start_up(CACHE_MIB);
    int r = import_stamp(options.path, &options.raster, options.scale_m, &stamp, &diag);
    if (r < 0)
        return cli_fail(r, &diag);
    uint8_t *bytes = malloc(STAMP_BYTES_MAX);
    size_t size = bytes ? stamp_encode(&stamp, bytes) : 0;
    bool written = bytes && fwrite(bytes, 1, size, stdout) == size;
    free(bytes);
    stamp_finish(&stamp);
    return written ? EX_OK : EX_IOERR;
}
