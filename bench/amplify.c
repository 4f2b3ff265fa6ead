/* amplify RASTER TIMES OUT.tif: TIMES (a power of two) as many posts along each side of a raster of
 * 16-bit heights, made up between its own (bench/amplify_posts.h), as a GeoTIFF in the same place.
 * Says how rough the ground is from octave to octave, what was measured and what was made. */
#include <cpl_conv.h>
#include <errno.h>
#include <gdal.h>
#include <stdio.h>
#include <stdlib.h>

#include "bench/amplify_posts.h"

static int read_raster(GDALDatasetH source, uint16_t **ret_heights)
{
    int cols = GDALGetRasterXSize(source), rows = GDALGetRasterYSize(source);
    GDALRasterBandH band = GDALGetRasterBand(source, 1);
    uint16_t *heights = malloc((size_t)cols * (size_t)rows * sizeof(*heights));
    if (!heights || GDALGetRasterDataType(band) != GDT_UInt16 ||
        GDALRasterIO(band, GF_Read, 0, 0, cols, rows, heights, cols, rows, GDT_UInt16, 0, 0) !=
            CE_None) {
        free(heights);
        return -EINVAL;
    }
    *ret_heights = heights;
    return 0;
}

/* The first post stays where it is: in the middle of its pixel. */
static void place(GDALDatasetH source, GDALDatasetH out, int times)
{
    double transform[6];
    GDALRasterBandH from = GDALGetRasterBand(source, 1), to = GDALGetRasterBand(out, 1);
    if (GDALGetGeoTransform(source, transform) == CE_None) {
        for (int i = 0; i < 6; i += 3) {
            transform[i] += 0.5 * (transform[i + 1] + transform[i + 2]) * (1.0 - 1.0 / times);
            transform[i + 1] /= times;
            transform[i + 2] /= times;
        }
        GDALSetGeoTransform(out, transform);
    }
    GDALSetProjection(out, GDALGetProjectionRef(source));
    GDALSetRasterScale(to, GDALGetRasterScale(from, NULL));
    GDALSetRasterOffset(to, GDALGetRasterOffset(from, NULL));
    GDALSetRasterUnitType(to, GDALGetRasterUnitType(from));
}

static int write_rows(const struct amplify_posts *posts, GDALDatasetH out)
{
    uint16_t *heights = malloc((size_t)posts->cols * sizeof(*heights));
    int r = heights ? 0 : -ENOMEM;
    for (int row = 0; r == 0 && row < posts->rows; row++) {
        amplify_posts_row(posts, row, heights);
        if (GDALRasterIO(GDALGetRasterBand(out, 1), GF_Write, 0, row, posts->cols, 1, heights,
                         posts->cols, 1, GDT_UInt16, 0, 0) != CE_None)
            r = -EIO;
    }
    free(heights);
    return r;
}

static int write_raster(GDALDatasetH source, const struct amplify_posts *posts, int times,
                        const char *path)
{
    GDALDatasetH out = GDALCreate(GDALGetDriverByName("GTiff"), path, posts->cols, posts->rows, 1,
                                  GDT_UInt16, NULL);
    if (!out)
        return -EIO;
    place(source, out, times);
    int r = write_rows(posts, out);
    CPLErrorReset();
    GDALClose(out);
    return r < 0 || CPLGetLastErrorType() >= CE_Failure ? -EIO : 0;
}

static void tell(const struct amplify_posts *posts, int times)
{
    printf("%d x %d posts; what every second post misses of those between, by the raster's step:\n",
           posts->cols, posts->rows);
    for (int step = 8 * times; step > 0; step /= 2)
        printf("  %8.4f  %10.3f units%s\n", (double)step / times,
               (double)amplify_posts_missed(posts, step) / AMPLIFY_UNIT,
               step < times ? "  made" : "");
}

static int amplify(GDALDatasetH source, int times, int doublings, const char *path)
{
    uint16_t *heights;
    struct amplify_posts posts;
    int r = read_raster(source, &heights);
    if (r < 0)
        return r;
    r = amplify_posts_create(heights, GDALGetRasterXSize(source), GDALGetRasterYSize(source),
                             doublings, &posts);
    free(heights);
    if (r < 0)
        return r;
    tell(&posts, times);
    r = write_raster(source, &posts, times, path);
    amplify_posts_destroy(&posts);
    return r;
}

int main(int argc, char **argv)
{
    int times = argc == 4 ? atoi(argv[2]) : 0, doublings = 0;
    if (times < 1 || (times & (times - 1))) {
        fprintf(stderr, "usage: %s RASTER TIMES OUT.tif; TIMES is a power of two\n", argv[0]);
        return 64;
    }
    while (1 << doublings < times)
        doublings++;
    GDALAllRegister();
    GDALDatasetH source = GDALOpen(argv[1], GA_ReadOnly);
    if (!source)
        return 66;
    int r = amplify(source, times, doublings, argv[3]);
    GDALClose(source);
    if (r == -EINVAL)
        fprintf(stderr,
                "%s: no raster of 16-bit heights, at least %d posts a side, to be made at most "
                "%d times as fine\n",
                argv[1], AMPLIFY_LEAST, 1 << AMPLIFY_DOUBLINGS_MAX);
    else if (r < 0)
        fprintf(stderr, "%s cannot be written\n", argv[3]);
    return r == -EINVAL ? 65 : r < 0 ? 74 : 0;
}
