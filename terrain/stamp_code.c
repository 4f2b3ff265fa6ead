/* The bytes of a stamp: little-endian; one byte of version, one of kind, six of nought; latitude
 * and longitude; then what its kind has, as docs/terrain-database.md lists it. */
#include <assert.h>
#include <errno.h>
#include <stdlib.h>

#include "base/bytes.h"
#include "terrain/stamp.h"

#define VERSION     1
#define NUMBERS_MAX 6

/* The numbers that every stamp of a kind has, in the order of the bytes. */
static unsigned numbers_of(struct stamp *stamp, double *ret_numbers[NUMBERS_MAX])
{
    struct stamp_crater *crater = &stamp->crater;
    struct stamp_berm *berm = &stamp->berm;
    struct stamp_flatten *strip = &stamp->flatten;
    unsigned count = 0;
    switch (stamp->kind) {
    case STAMP_CRATER:
        ret_numbers[count++] = &crater->radius_m;
        ret_numbers[count++] = &crater->depth_m;
        ret_numbers[count++] = &crater->rim_height_m;
        ret_numbers[count++] = &crater->rim_width_m;
        break;
    case STAMP_BERM:
        ret_numbers[count++] = &berm->crest_width_m;
        ret_numbers[count++] = &berm->height_m;
        ret_numbers[count++] = &berm->side_slope;
        break;
    case STAMP_FLATTEN:
        ret_numbers[count++] = &strip->heading_deg;
        ret_numbers[count++] = &strip->length_m;
        ret_numbers[count++] = &strip->width_m;
        ret_numbers[count++] = &strip->start_height_m;
        ret_numbers[count++] = &strip->end_height_m;
        ret_numbers[count++] = &strip->blend_m;
        break;
    case STAMP_RASTER:
        ret_numbers[count++] = &stamp->raster.spacing_m;
        break;
    }
    return count;
}

static void put_f64(struct byte_writer *writer, double value)
{
    byte_writer_put(writer, bits_from_double(value), 8, false);
}

size_t stamp_encode(const struct stamp *stamp, uint8_t *ret_bytes)
{
    struct byte_writer writer = {.data = ret_bytes, .size = STAMP_BYTES_MAX};
    struct stamp copy = *stamp; /* its numbers are only read */
    double *numbers[NUMBERS_MAX];
    unsigned count = numbers_of(&copy, numbers);
    byte_writer_put(&writer, VERSION, 1, false);
    byte_writer_put(&writer, stamp->kind, 1, false);
    byte_writer_put(&writer, 0, 6, false);
    put_f64(&writer, stamp->lat_deg);
    put_f64(&writer, stamp->lon_deg);
    for (unsigned i = 0; i < count; i++)
        put_f64(&writer, *numbers[i]);
    if (stamp->kind == STAMP_BERM) {
        byte_writer_put(&writer, stamp->berm.count, 4, false);
        byte_writer_put(&writer, 0, 4, false);
        for (unsigned i = 0; i < stamp->berm.count; i++) {
            put_f64(&writer, stamp->berm.points[i].east_m);
            put_f64(&writer, stamp->berm.points[i].north_m);
        }
    } else if (stamp->kind == STAMP_RASTER) {
        byte_writer_put(&writer, stamp->raster.rows, 4, false);
        byte_writer_put(&writer, stamp->raster.cols, 4, false);
        for (uint32_t i = 0; i < stamp->raster.rows * stamp->raster.cols; i++)
            byte_writer_put(&writer, bits_from_float(stamp->raster.change_m[i]), 4, false);
    }
    assert(writer.offset < STAMP_BYTES_MAX);
    return writer.offset;
}

static int take_points(struct byte_reader *reader, struct stamp_berm *berm, struct diag *diag)
{
    berm->count = read_u32le(reader);
    read_u32le(reader);
    if (berm->count > STAMP_POINTS_MAX)
        return diag_set(diag, -EBADMSG, "berm: %u points, and at most %d may be", berm->count,
                        STAMP_POINTS_MAX);
    for (unsigned i = 0; i < berm->count; i++) {
        berm->points[i].east_m = read_f64le(reader);
        berm->points[i].north_m = read_f64le(reader);
    }
    return 0;
}

static int take_raster(struct byte_reader *reader, struct stamp_raster *raster, struct diag *diag)
{
    raster->rows = read_u32le(reader);
    raster->cols = read_u32le(reader);
    if (raster->rows > STAMP_SIDE_MAX || raster->cols > STAMP_SIDE_MAX)
        return diag_set(diag, -EBADMSG, "raster: %u x %u posts, and at most %d a side may be",
                        raster->cols, raster->rows, STAMP_SIDE_MAX);
    size_t count = (size_t)raster->rows * raster->cols;
    raster->change_m = malloc((count + 1) * sizeof(float));
    if (!raster->change_m)
        return -ENOMEM;
    for (size_t i = 0; i < count; i++)
        raster->change_m[i] = read_f32le(reader);
    return 0;
}

static int take(struct byte_reader *reader, struct stamp *stamp, struct diag *diag)
{
    double *numbers[NUMBERS_MAX];
    unsigned version = read_u8(reader), kind = read_u8(reader);
    if (!reader->overrun && version != VERSION)
        return diag_set(diag, -EPROTONOSUPPORT, "the stamp is of version %u, not %d", version,
                        VERSION);
    if (kind < STAMP_CRATER || kind > STAMP_RASTER)
        return diag_set(diag, -EBADMSG, "%u is no kind of stamp", kind);
    stamp->kind = (enum stamp_kind)kind;
    byte_reader_take(reader, 6, false);
    stamp->lat_deg = read_f64le(reader);
    stamp->lon_deg = read_f64le(reader);
    unsigned count = numbers_of(stamp, numbers);
    for (unsigned i = 0; i < count; i++)
        *numbers[i] = read_f64le(reader);
    if (stamp->kind == STAMP_BERM)
        return take_points(reader, &stamp->berm, diag);
    return stamp->kind == STAMP_RASTER ? take_raster(reader, &stamp->raster, diag) : 0;
}

int stamp_decode(const void *bytes, size_t size, struct stamp *ret_stamp, struct diag *diag)
{
    struct byte_reader reader = byte_reader_over(bytes, size);
    struct stamp stamp = {.lat_deg = 0.0};
    int r = take(&reader, &stamp, diag);
    if (r == 0 && reader.overrun)
        r = diag_set(diag, -EBADMSG, "the stamp is cut short at %zu bytes", size);
    if (r == 0 && reader.offset != size)
        r = diag_set(diag, -EBADMSG, "the stamp has %zu bytes too many", size - reader.offset);
    if (r == 0)
        r = stamp_prepare(&stamp, diag);
    if (r == 0)
        *ret_stamp = stamp;
    else
        stamp_finish(&stamp);
    return r;
}
