#include "daemon/dig_list.h"

#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>

#include "geo/geographic.h"
#include "terrain/dig.h"

/* The lowest and the highest displacement of a raster. */
static void range_of(const struct stamp_raster *raster, double *ret_low_m, double *ret_high_m)
{
    float low_m = raster->change_m[0], high_m = low_m;
    for (uint32_t i = 1; i < raster->rows * raster->cols; i++) {
        low_m = fminf(low_m, raster->change_m[i]);
        high_m = fmaxf(high_m, raster->change_m[i]);
    }
    *ret_low_m = (double)low_m;
    *ret_high_m = (double)high_m;
}

static double line_length_m(const struct stamp_berm *berm)
{
    double length_m = 0.0;
    for (unsigned i = 1; i < berm->count; i++)
        length_m += hypot(berm->points[i].east_m - berm->points[i - 1].east_m,
                          berm->points[i].north_m - berm->points[i - 1].north_m);
    return length_m;
}

/* What it is made of, under the names of the options. */

static json_t *points_json(const struct stamp *stamp)
{
    json_t *points = json_array();
    const struct geodetic centre = {stamp->lat_deg, stamp->lon_deg, 0.0};
    for (unsigned i = 0; i < stamp->berm.count; i++) {
        double enu_m[3] = {stamp->berm.points[i].east_m, stamp->berm.points[i].north_m, 0.0};
        struct geodetic at;
        geodetic_from_enu(&centre, enu_m, &at);
        json_array_append_new(points,
                              json_pack("{s:f,s:f}", "lat_deg", at.lat_deg, "lon_deg", at.lon_deg));
    }
    return points;
}

static json_t *parameters_json(const struct stamp *stamp)
{
    const struct stamp_crater *crater = &stamp->crater;
    const struct stamp_berm *berm = &stamp->berm;
    const struct stamp_flatten *strip = &stamp->flatten;
    const struct stamp_raster *raster = &stamp->raster;
    double low_m, high_m;
    switch (stamp->kind) {
    case STAMP_CRATER:
        return json_pack("{s:f,s:f,s:f,s:f}", "radius_m", crater->radius_m, "depth_m",
                         crater->depth_m, "rim_height_m", crater->rim_height_m, "rim_width_m",
                         crater->rim_width_m);
    case STAMP_BERM:
        return json_pack("{s:f,s:f,s:f,s:f,s:o}", "length_m", line_length_m(berm), "height_m",
                         berm->height_m, "crest_width_m", berm->crest_width_m, "side_slope",
                         berm->side_slope, "points", points_json(stamp));
    case STAMP_FLATTEN:
        return json_pack("{s:f,s:f,s:f,s:f,s:f,s:f}", "heading_deg", strip->heading_deg, "length_m",
                         strip->length_m, "width_m", strip->width_m, "start_height_m",
                         strip->start_height_m, "end_height_m", strip->end_height_m, "blend_m",
                         strip->blend_m);
    case STAMP_RASTER:
        range_of(raster, &low_m, &high_m);
        return json_pack("{s:i,s:i,s:f,s:f,s:f}", "rows", (int)raster->rows, "columns",
                         (int)raster->cols, "spacing_m", raster->spacing_m, "lowest_m", low_m,
                         "highest_m", high_m);
    }
    return NULL;
}

static json_t *json_of(const struct dig_stamp *dug)
{
    const struct stamp_extent *extent = &dug->extent;
    json_t *parameters = parameters_json(&dug->stamp);
    json_t *json =
        json_pack("{s:I,s:s,s:f,s:f,s:{s:f,s:f,s:f,s:f}}", "stamp", (json_int_t)dug->id, "kind",
                  stamp_kind_name(dug->stamp.kind), "lat_deg", dug->stamp.lat_deg, "lon_deg",
                  dug->stamp.lon_deg, "extent_deg", "south", extent->south_deg, "west",
                  extent->west_deg, "north", extent->north_deg, "east", extent->east_deg);
    json_object_update(json, parameters);
    json_decref(parameters);
    return json;
}

static void describe(const struct stamp *stamp, char *ret_size, char *ret_height, size_t length)
{
    double low_m, high_m;
    switch (stamp->kind) {
    case STAMP_CRATER:
        snprintf(ret_size, length, "radius %g m, rim %g m wide", stamp->crater.radius_m,
                 stamp->crater.rim_width_m);
        snprintf(ret_height, length, "%g m deep, rim %g m high", stamp->crater.depth_m,
                 stamp->crater.rim_height_m);
        return;
    case STAMP_BERM:
        snprintf(ret_size, length, "%.1f m by %u points, crest %g m, slope %g",
                 line_length_m(&stamp->berm), stamp->berm.count, stamp->berm.crest_width_m,
                 stamp->berm.side_slope);
        snprintf(ret_height, length, "%+g m", stamp->berm.height_m);
        return;
    case STAMP_FLATTEN:
        snprintf(ret_size, length, "%g x %g m, heading %g, blend %g m", stamp->flatten.length_m,
                 stamp->flatten.width_m, stamp->flatten.heading_deg, stamp->flatten.blend_m);
        snprintf(ret_height, length, "to %g .. %g m", stamp->flatten.start_height_m,
                 stamp->flatten.end_height_m);
        return;
    case STAMP_RASTER:
        range_of(&stamp->raster, &low_m, &high_m);
        snprintf(ret_size, length, "%u x %u posts of %.3g m", stamp->raster.cols,
                 stamp->raster.rows, stamp->raster.spacing_m);
        snprintf(ret_height, length, "%+.3g .. %+.3g m", low_m, high_m);
    }
}

static void print_row(const struct dig_stamp *dug)
{
    char size[96], height[96];
    describe(&dug->stamp, size, height, sizeof(size));
    printf("%5lld  %-7s  %11.7f  %12.7f  %-42s  %s\n", (long long)dug->id,
           stamp_kind_name(dug->stamp.kind), dug->stamp.lat_deg, dug->stamp.lon_deg, size, height);
}

int dig_list(const char *path, bool json, struct diag *diag)
{
    struct dig *dig = NULL;
    int r = dig_open(path, &dig, diag);
    if (r < 0)
        return r;
    const struct dig_index *index = dig_index_of(dig);
    json_t *stamps = json_array();
    if (!json && index->stamp_count)
        printf("%5s  %-7s  %11s  %12s  %-42s  %s\n", "stamp", "kind", "latitude", "longitude",
               "size", "height");
    for (uint32_t i = 0; i < index->stamp_count; i++)
        if (json)
            json_array_append_new(stamps, json_of(&index->stamps[i]));
        else
            print_row(&index->stamps[i]);
    if (json) {
        json_dumpf(stamps, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(12));
        putchar('\n');
    }
    json_decref(stamps);
    if (dig_errors(dig))
        r = diag_set(diag, -EBADMSG, "%s: %llu stamps are damaged", path,
                     (unsigned long long)dig_errors(dig));
    dig_close(dig);
    return r;
}
