/* What `otwd dig` is asked to do. */
#pragma once

#include <stdbool.h>

#include "terrain/stamp.h"

struct dig_options {
    const char *target; /* a database, or udp://HOST:PORT */
    struct stamp stamp; /* where `kind` is one; prepared, but for a raster's heights */
    const char *raster; /* the file that a raster's heights are in */
    const char *crs, *nodata;
    double scale;  /* metres that one of its units stands for */
    uint32_t undo; /* 0: nothing is undone */
    bool list, json;
};

/* Exits where the arguments are wrong. */
void dig_parse_options(int argc, char **argv, struct dig_options *ret_options);
