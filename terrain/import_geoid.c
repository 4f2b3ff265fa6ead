#include "terrain/import_geoid.h"

#include <cpl_error.h>
#include <cpl_vsi.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/grid.h"
#include "terrain/import_raster_internal.h"

#define CHUNK          64
#define CHUNK_SIDE     (CHUNK + 3) /* a cubic reaches one post before and two beyond */
#define CHUNKS_KEPT    128         /* a row of a block at 5' over a grid of 1' takes 81 */
#define STEPS          1048576.0   /* positions between two posts: a turn keeps every bit */
#define UNDULATION_MAX 200.0       /* metres; the Earth has -107 to 87 */
#define PGM_HEADER     1024

struct geoid_chunk {
    int row, column; /* of chunks */
    float posts_m[CHUNK_SIDE][CHUNK_SIDE];
};

struct geoid_grid {
    GDALDatasetH dataset;
    GDALRasterBandH band;
    int width, height;
    int around; /* columns once round the globe; 0 where it does not go round */
    double west_deg, north_deg, dx_deg, dy_deg; /* of the first post; dy < 0: from the north */
    double scale, offset, nodata;
    bool has_nodata;
    struct geoid_chunk *chunks[CHUNKS_KEPT];
    char path[512];
};

void geoid_grid_close(struct geoid_grid *grid)
{
    if (!grid)
        return;
    if (grid->dataset)
        GDALClose(grid->dataset);
    for (int i = 0; i < CHUNKS_KEPT; i++)
        free(grid->chunks[i]);
    free(grid);
}

static bool is_pgm(const struct geoid_grid *grid)
{
    return strcmp(GDALGetDriverShortName(GDALGetDatasetDriver(grid->dataset)), "PNM") == 0;
}

static int read_pgm_meaning(struct geoid_grid *grid, struct diag *diag)
{
    char header[PGM_HEADER + 1] = "";
    VSILFILE *file = VSIFOpenL(grid->path, "rb");
    size_t size = file ? VSIFReadL(header, 1, PGM_HEADER, file) : 0;
    if (file)
        VSIFCloseL(file);
    header[size] = '\0';
    const char *offset = strstr(header, "# Offset "), *scale = strstr(header, "# Scale ");
    if (!offset || !scale)
        return diag_set(diag, -EBADMSG,
                        "geoid %s: a PGM file without the Offset and Scale of GeographicLib",
                        grid->path);
    grid->offset = strtod(offset + strlen("# Offset "), NULL);
    grid->scale = strtod(scale + strlen("# Scale "), NULL);
    grid->north_deg = 90.0;
    grid->dx_deg = 360.0 / grid->width;
    grid->dy_deg = -180.0 / (grid->height - 1);
    return 0;
}

/* What GDAL knows of the place and the numbers of any other raster. */
static int read_meaning(struct geoid_grid *grid, struct diag *diag)
{
    double gt[6];
    int has = 0;
    OGRSpatialReferenceH crs = GDALGetSpatialRef(grid->dataset);
    if ((crs && !OSRIsGeographic(crs)) || GDALGetGeoTransform(grid->dataset, gt) != CE_None ||
        gt[2] != 0.0 || gt[4] != 0.0 || !(gt[1] > 0.0) || !(fabs(gt[5]) > 0.0) ||
        !(fabs(gt[0]) < 541.0) || !(fabs(gt[3]) < 91.0))
        return diag_set(diag, -EBADMSG,
                        "geoid %s: its rows and columns are not latitudes and longitudes",
                        grid->path);
    grid->dx_deg = gt[1];
    grid->dy_deg = gt[5];
    grid->west_deg = gt[0] + 0.5 * gt[1];
    grid->north_deg = gt[3] + 0.5 * gt[5];
    grid->scale = GDALGetRasterScale(grid->band, &has);
    grid->scale = has && grid->scale != 0.0 ? grid->scale : 1.0;
    grid->offset = GDALGetRasterOffset(grid->band, &has);
    grid->offset = has ? grid->offset : 0.0;
    grid->nodata = GDALGetRasterNoDataValue(grid->band, &has);
    grid->has_nodata = has;
    return 0;
}

int geoid_grid_open(const char *path, struct geoid_grid **ret_grid, struct diag *diag)
{
    struct geoid_grid *grid = calloc(1, sizeof(*grid));
    if (!grid)
        return -ENOMEM;
    snprintf(grid->path, sizeof(grid->path), "%s", path);
    int r = raster_open_dataset(path, &grid->dataset, diag);
    if (r == 0) {
        grid->band = GDALGetRasterBand(grid->dataset, 1);
        grid->width = GDALGetRasterXSize(grid->dataset);
        grid->height = GDALGetRasterYSize(grid->dataset);
        if (!grid->band || grid->width < 2 || grid->height < 2)
            r = diag_set(diag, -EBADMSG, "geoid %s: a raster of less than 2 x 2 posts", path);
        else
            r = is_pgm(grid) ? read_pgm_meaning(grid, diag) : read_meaning(grid, diag);
    }
    if (r == 0) {
        double around = 360.0 / grid->dx_deg;
        if (fabs(around - nearbyint(around)) < ALIGNED_PIXELS && grid->width >= nearbyint(around))
            grid->around = (int)nearbyint(around);
        *ret_grid = grid;
    } else {
        geoid_grid_close(grid);
    }
    return r;
}

/* A row beyond a pole is one on its other side, half round the globe; one beyond a grid that ends
 * elsewhere repeats its edge. Returns by how many columns it is shifted. */
static int reflect(const struct geoid_grid *grid, int *row)
{
    double lat_deg = grid->north_deg + *row * grid->dy_deg;
    long other = lrint((copysign(180.0, lat_deg) - lat_deg - grid->north_deg) / grid->dy_deg);
    bool beyond = grid->around && fabs(lat_deg) > 90.0 && other >= 0 && other < grid->height;
    if (*row >= 0 && *row < grid->height)
        return 0;
    *row = beyond ? (int)other : *row < 0 ? 0 : grid->height - 1;
    return beyond ? grid->around / 2 : 0;
}

static int read_posts(struct geoid_grid *grid, int row, int column, int count, float *ret_posts,
                      struct diag *diag)
{
    CPLErrorReset();
    if (GDALRasterIO(grid->band, GF_Read, column, row, count, 1, ret_posts, count, 1, GDT_Float32,
                     0, 0) != CE_None)
        return diag_set(diag, -EBADMSG, "geoid %s cannot be read at row %d: %s", grid->path, row,
                        CPLGetLastErrorMsg());
    for (int i = 0; i < count; i++) {
        bool none = grid->has_nodata && ret_posts[i] == (float)grid->nodata;
        double value_m = none ? NAN : (double)ret_posts[i] * grid->scale + grid->offset;
        if (fabs(value_m) > UNDULATION_MAX)
            return diag_set(diag, -EBADMSG,
                            "geoid %s: %g at row %d column %d is no undulation in metres",
                            grid->path, value_m, row, column + i);
        ret_posts[i] = (float)value_m;
    }
    return 0;
}

/* CHUNK_SIDE posts of a row, of which some may lie beyond its ends. */
static int read_row(struct geoid_grid *grid, int row, int column, float *ret_posts,
                    struct diag *diag)
{
    int r = 0, done = 0;
    while (grid->around && r == 0 && done < CHUNK_SIDE) {
        int x = (int)(column + done - grid_floor_div(column + done, grid->around) * grid->around);
        int run = CHUNK_SIDE - done < grid->around - x ? CHUNK_SIDE - done : grid->around - x;
        r = read_posts(grid, row, x, run, ret_posts + done, diag);
        done += run;
    }
    if (grid->around)
        return r;
    int west = column < 0 ? 0 : column;
    int count = CHUNK_SIDE - (west - column);
    count = count < grid->width - west ? count : grid->width - west;
    r = read_posts(grid, row, west, count, ret_posts + (west - column), diag);
    for (int i = 0; i < west - column; i++)
        ret_posts[i] = ret_posts[west - column];
    for (int i = west - column + count; i < CHUNK_SIDE; i++)
        ret_posts[i] = ret_posts[i - 1];
    return r;
}

static int get_chunk(struct geoid_grid *grid, int row, int column,
                     const struct geoid_chunk **ret_chunk, struct diag *diag)
{
    struct geoid_chunk **slot = &grid->chunks[column % CHUNKS_KEPT], *chunk = *slot;
    if (chunk && chunk->row == row && chunk->column == column) {
        *ret_chunk = chunk;
        return 0;
    }
    *slot = NULL;
    chunk = chunk ? chunk : malloc(sizeof(*chunk));
    int r = chunk ? 0 : -ENOMEM;
    for (int i = 0; r == 0 && i < CHUNK_SIDE; i++) {
        int line = row * CHUNK - 1 + i, shift = reflect(grid, &line);
        r = read_row(grid, line, column * CHUNK - 1 + shift, chunk->posts_m[i], diag);
    }
    if (r < 0) {
        free(chunk);
        return r;
    }
    chunk->row = row;
    chunk->column = column;
    *ret_chunk = *slot = chunk;
    return 0;
}

/* The place in posts from the first one; false where the grid does not reach. */
static bool place(const struct geoid_grid *grid, double lat_deg, double lon_deg, double *ret_x,
                  double *ret_y)
{
    double margin = grid->around ? 0.5 : 0.0; /* posts may lie around the pole, not on it */
    double turn = grid->around ? grid->around : 360.0 / grid->dx_deg;
    double x = remainder(lon_deg - grid->west_deg, 360.0) / grid->dx_deg;
    x = nearbyint(x * STEPS) / STEPS;
    x = x < 0.0 ? x + turn : x;
    double y = nearbyint((lat_deg - grid->north_deg) / grid->dy_deg * STEPS) / STEPS;
    *ret_x = x < turn ? x : x - turn;
    *ret_y = y;
    return y >= -margin && y <= grid->height - 1 + margin &&
           (grid->around || *ret_x <= grid->width - 1);
}

int geoid_grid_undulation_m(struct geoid_grid *grid, double lat_deg, double lon_deg, double *ret_m,
                            struct diag *diag)
{
    double x, y, wx[4], wy[4], sum_m = 0.0;
    const struct geoid_chunk *chunk = NULL;
    bool reached = place(grid, lat_deg, lon_deg, &x, &y);
    if (reached) {
        int column = (int)floor(x), row = (int)floor(y);
        int chunk_row = (int)grid_floor_div(row, CHUNK), chunk_column = column / CHUNK;
        int r = get_chunk(grid, chunk_row, chunk_column, &chunk, diag);
        if (r < 0)
            return r;
        raster_cubic_weights(x - column, wx);
        raster_cubic_weights(y - row, wy);
        row -= chunk_row * CHUNK;
        column -= chunk_column * CHUNK;
        for (int j = 0; j < 4; j++)
            for (int i = 0; i < 4; i++)
                sum_m += wy[j] * wx[i] * (double)chunk->posts_m[row + j][column + i];
    }
    if (!reached || isnan(sum_m))
        return diag_set(diag, -EBADMSG, "geoid %s has no undulation at %.6f N %.6f E", grid->path,
                        lat_deg, lon_deg);
    *ret_m = sum_m;
    return 0;
}
