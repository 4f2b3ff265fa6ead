/* GTX (NOAA VDatum, "GTX file format"): big-endian f64 south, west, row step, column step in
 * degrees, i32 rows, columns, then f32 undulations in metres, rows from the south.
 * PGM (GeographicLib manual, "The format of the geoid data files"): comments with offset and scale,
 * then 16-bit big-endian samples, rows from the north pole, columns eastwards from Greenwich. */
#include "geo/egm96.h"

#include "base/bytes.h"
#include "base/cache.h"
#include "geo/geographic.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

#define ROWS         721
#define COLS         1440
#define STEP_DEG     0.25
#define GTX_HEADER   40
#define GTX_SIZE     (GTX_HEADER + 4L * ROWS * COLS)
#define PGM_OFFSET_M -108.0
#define PGM_SCALE_M  0.003
#define GRID_NAME    "egm96_15.gtx"
#define CACHE_NAME   "egm96-15.pgm"
#define SYSTEM_PROJ  "/usr/share/proj"

/* The error figures are those that GeographicLib's manual publishes for this grid (table "Geoid
 * height", egm96-15). */
static const char pgm_header[] = "P5\n"
                                 "# Geoid file in PGM format for the GeographicLib::Geoid class\n"
                                 "# Description WGS84 EGM96, 15-minute grid, from egm96_15.gtx\n"
                                 "# DateTime 1998-07-01 00:00:00\n"
                                 "# MaxBilinearError 1.152\n"
                                 "# RMSBilinearError 0.040\n"
                                 "# MaxCubicError 0.169\n"
                                 "# RMSCubicError 0.007\n"
                                 "# Offset -108\n"
                                 "# Scale 0.003\n"
                                 "# Origin 90N 0E\n"
                                 "# AREA_OR_POINT Point\n"
                                 "# Vertical_Datum WGS84\n"
                                 "1440  721\n"
                                 "65535\n";
#define PGM_HEADER (sizeof(pgm_header) - 1)
#define PGM_SIZE   (PGM_HEADER + 2L * ROWS * COLS)

static int read_gtx(const char *path, uint8_t *ret_bytes, struct diag *diag)
{
    FILE *file = fopen(path, "rbe");
    if (!file)
        return diag_set(diag, -errno, "geoid grid %s: %s", path, strerror(errno));
    size_t got = fread(ret_bytes, 1, GTX_SIZE, file);
    fclose(file);
    if (got != GTX_SIZE)
        return diag_set(diag, -EBADMSG, "geoid grid %s: ends after %zu of %ld bytes", path, got,
                        GTX_SIZE);
    struct byte_reader r = byte_reader_over(ret_bytes, GTX_SIZE);
    double south = read_f64be(&r), west = read_f64be(&r);
    double row_step = read_f64be(&r), col_step = read_f64be(&r);
    int rows = (int)read_u32be(&r), cols = (int)read_u32be(&r);
    if (south != -90.0 || west != -180.0 || row_step != STEP_DEG || col_step != STEP_DEG ||
        rows != ROWS || cols != COLS)
        return diag_set(diag, -EBADMSG,
                        "geoid grid %s: %d x %d posts from %g, %g by %g, %g degrees are not the "
                        "15-minute grid of EGM96",
                        path, cols, rows, south, west, row_step, col_step);
    return 0;
}

static int pgm_from_gtx(const char *path, const uint8_t *gtx, uint8_t *ret_pgm, struct diag *diag)
{
    struct byte_writer w = {.data = ret_pgm, .size = PGM_SIZE, .offset = PGM_HEADER};
    memcpy(ret_pgm, pgm_header, PGM_HEADER);
    for (int row = 0; row < ROWS; row++) {
        for (int col = 0; col < COLS; col++) {
            size_t at = (size_t)(ROWS - 1 - row) * COLS + (size_t)((col + COLS / 2) % COLS);
            struct byte_reader r = byte_reader_over(gtx, GTX_SIZE);
            byte_reader_seek(&r, GTX_HEADER + 4 * at);
            double undulation_m = (double)read_f32be(&r);
            double code = rint((undulation_m - PGM_OFFSET_M) / PGM_SCALE_M);
            if (!(code >= 0.0 && code <= 65535.0))
                return diag_set(diag, -EBADMSG, "geoid grid %s: undulation %g m at byte %zu", path,
                                undulation_m, GTX_HEADER + 4 * at);
            byte_writer_put(&w, (uint64_t)code, 2, true);
        }
    }
    return 0;
}

int egm96_convert(const char *gtx_path, const char *pgm_path, struct diag *diag)
{
    uint8_t *gtx = calloc(1, GTX_SIZE), *pgm = malloc(PGM_SIZE);
    int r = gtx && pgm ? 0 : diag_set(diag, -ENOMEM, "geoid grid %s: out of memory", gtx_path);
    if (r == 0)
        r = read_gtx(gtx_path, gtx, diag);
    if (r == 0)
        r = pgm_from_gtx(gtx_path, gtx, pgm, diag);
    if (r == 0)
        r = cache_write(pgm_path, pgm, PGM_SIZE, diag);
    free(gtx);
    free(pgm);
    return r;
}

/* A file of ours, whole: written by rename, so that the header and the size suffice. */
static bool is_converted(const char *path)
{
    char header[PGM_HEADER];
    struct stat status;
    FILE *file = fopen(path, "rbe");
    if (!file)
        return false;
    bool whole = fstat(fileno(file), &status) == 0 && status.st_size == PGM_SIZE &&
                 fread(header, 1, PGM_HEADER, file) == PGM_HEADER &&
                 memcmp(header, pgm_header, PGM_HEADER) == 0;
    fclose(file);
    return whole;
}

static int path_fits(int written, size_t size, struct diag *diag)
{
    if (written < 0 || (size_t)written >= size)
        return diag_set(diag, -ENAMETOOLONG, "the cache's path has more than %zu bytes", size);
    return 0;
}

static bool readable_in(const char *directory, size_t length, char *ret_path, size_t size)
{
    int written = snprintf(ret_path, size, "%.*s/" GRID_NAME, (int)length, directory);
    return length > 0 && written > 0 && (size_t)written < size && access(ret_path, R_OK) == 0;
}

static int find_grid(char *ret_path, size_t size, struct diag *diag)
{
    const char *data = getenv("PROJ_DATA"), *lib = getenv("PROJ_LIB");
    const char *lists[] = {data ? data : "", lib ? lib : "", SYSTEM_PROJ};
    for (size_t i = 0; i < sizeof(lists) / sizeof(lists[0]); i++) {
        for (const char *at = lists[i]; *at; at += strspn(at, ":")) {
            size_t length = strcspn(at, ":");
            if (readable_in(at, length, ret_path, size))
                return 0;
            at += length;
        }
    }
    return diag_set(diag, -ENOENT,
                    "geoid grid " GRID_NAME " is not in %s%s%s%s" SYSTEM_PROJ
                    "; the Debian package proj-data holds it",
                    lists[0], *lists[0] ? ", " : "", lists[1], *lists[1] ? ", " : "");
}

int egm96_prepare(char *ret_path, size_t size, struct diag *diag)
{
    char directory[3072], pgm[4096], gtx[4096];
    int r = cache_directory(directory, sizeof(directory), diag);
    if (r < 0)
        return r;
    r = path_fits(snprintf(pgm, sizeof(pgm), "%s/" CACHE_NAME, directory), size, diag);
    if (r < 0)
        return r;
    if (!is_converted(pgm)) {
        r = find_grid(gtx, sizeof(gtx), diag);
        if (r == 0)
            r = cache_make_directories(directory, diag);
        if (r == 0)
            r = egm96_convert(gtx, pgm, diag);
        if (r < 0)
            return r;
    }
    memcpy(ret_path, pgm, strlen(pgm) + 1);
    return 0;
}

/* For this process alone: the file is gone once it is open. */
static int open_uncached(struct geoid **ret_geoid, struct diag *diag)
{
    const char *base = getenv("TMPDIR");
    char gtx[4096], directory[3072], pgm[4096];
    int r = find_grid(gtx, sizeof(gtx), diag);
    if (r == 0)
        r = path_fits(
            snprintf(directory, sizeof(directory), "%s/otwd-XXXXXX", base && *base ? base : "/tmp"),
            sizeof(directory), diag);
    if (r < 0)
        return r;
    if (!mkdtemp(directory))
        return diag_set(diag, -errno, "cache %s: %s", directory, strerror(errno));
    snprintf(pgm, sizeof(pgm), "%s/" CACHE_NAME, directory);
    r = egm96_convert(gtx, pgm, diag);
    if (r == 0)
        r = geoid_open(pgm, ret_geoid, diag);
    unlink(pgm);
    rmdir(directory);
    return r;
}

int egm96_open(struct geoid **ret_geoid, struct diag *diag)
{
    char path[4096];
    if (egm96_prepare(path, sizeof(path), diag) == 0)
        return geoid_open(path, ret_geoid, diag);
    return open_uncached(ret_geoid, diag);
}
