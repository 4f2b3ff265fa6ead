#include "terrain/tile_record.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>
#include <zstd.h>

#include "base/bytes.h"
#include "terrain/height_step.h"

#define ROW_BIAS     (1 << 23)
#define ORIGIN_BYTES (2 * TILE_POST_COUNT)

int64_t tile_key(struct tile_id id)
{
    int64_t row = (int64_t)id.row + ROW_BIAS, col = id.col;
    int64_t level = id.level * (INT64_C(1) << 48); /* of a key that rotted it may be below 0 */
    return level | row >> 3 << 27 | col >> 3 << 6 | (row & 7) << 3 | (col & 7);
}

struct tile_id tile_id_from_key(int64_t key)
{
    int64_t row = (key >> 27 & 0x1fffff) << 3 | (key >> 3 & 7);
    int64_t col = (key >> 6 & 0x1fffff) << 3 | (key & 7);
    return (struct tile_id){(int32_t)(key >> 48), (int32_t)(row - ROW_BIAS), (int32_t)col};
}

struct tile_parent tile_place_in_parent(const struct grid *grid, struct tile_id id,
                                        const int32_t *symbols)
{
    struct tile_id up = grid_parent(grid, id);
    bool same_factor =
        grid_lon_shift(grid, id.level, id.row) == grid_lon_shift(grid, up.level, up.row);
    return (struct tile_parent){.symbols = symbols,
                                .row_half = (int)(id.row - 2 * (int64_t)up.row),
                                .col_half = same_factor ? id.col % 2 : 0,
                                .same_columns = !same_factor};
}

unsigned tile_child_bit(const struct grid *grid, struct tile_id id)
{
    struct tile_parent place = tile_place_in_parent(grid, id, NULL);
    return 1u << (2 * place.row_half + place.col_half);
}

void tile_record_finish(struct tile_record *record)
{
    free(record->payload);
    free(record->origin);
    *record = (struct tile_record){.payload_size = 0};
}

double tile_error_m(double error_m)
{
    return ceil(error_m * 1000.0 * (1.0 - 1e-12)) / 1000.0;
}

void tile_record_measure(struct tile_record *record, const struct grid *grid,
                         const int32_t *symbols, double step_m)
{
    int first_row, last_row, last_col;
    int32_t low = INT32_MAX, high = SYMBOL_NONE;
    grid_tile_extent(grid, record->id, &first_row, &last_row, &last_col);
    for (int i = 0; i < TILE_POST_COUNT; i++) {
        low = symbols[i] != SYMBOL_NONE && symbols[i] < low ? symbols[i] : low;
        high = symbols[i] > high ? symbols[i] : high;
    }
    record->min_m = high == SYMBOL_NONE ? NAN : height_from_symbol(low, step_m);
    record->max_m = height_from_symbol(high, step_m);
    record->posts = 0;
    for (int row = first_row; row <= last_row && row < TILE_CELLS; row++)
        for (int col = 0; col < last_col; col++)
            record->posts += symbols[row * TILE_POSTS + col] != SYMBOL_NONE;
}

static int take_bytes(uint8_t **ret_bytes, size_t *ret_size, const void *bytes, size_t size)
{
    uint8_t *copy = malloc(size ? size : 1);
    if (!copy)
        return -ENOMEM;
    memcpy(copy, bytes, size);
    free(*ret_bytes);
    *ret_bytes = copy;
    *ret_size = size;
    return 0;
}

int tile_record_encode(struct tile_record *record, const struct grid *grid, const int32_t *symbols,
                       const int32_t *parent_symbols)
{
    uint8_t payload[SYMBOL_PAYLOAD_MAX];
    struct tile_parent parent;
    if (parent_symbols)
        parent = tile_place_in_parent(grid, record->id, parent_symbols);
    size_t size = symbols_encode(symbols, parent_symbols ? &parent : NULL, payload);
    return take_bytes(&record->payload, &record->payload_size, payload, size);
}

int tile_record_decode(const struct tile_record *record, const struct grid *grid,
                       const int32_t *parent_symbols, int32_t *ret_symbols, struct diag *diag)
{
    struct tile_parent parent;
    if (parent_symbols)
        parent = tile_place_in_parent(grid, record->id, parent_symbols);
    return symbols_decode(record->payload, record->payload_size, parent_symbols ? &parent : NULL,
                          ret_symbols, diag);
}

int tile_record_set_origins(struct tile_record *record, const uint16_t *origins)
{
    uint8_t bytes[ORIGIN_BYTES], packed[ZSTD_COMPRESSBOUND(ORIGIN_BYTES)];
    uint16_t one = 0;
    bool mixed = false;
    for (int i = 0; i < TILE_POST_COUNT; i++) {
        one = one ? one : origins[i];
        mixed |= origins[i] != 0 && origins[i] != one;
        bytes[2 * i] = (uint8_t)origins[i];
        bytes[2 * i + 1] = (uint8_t)(origins[i] >> 8);
    }
    if (!mixed) {
        uint8_t single[2] = {(uint8_t)one, (uint8_t)(one >> 8)};
        return take_bytes(&record->origin, &record->origin_size, single, one ? 2 : 0);
    }
    size_t size = ZSTD_compress(packed, sizeof(packed), bytes, sizeof(bytes), 6);
    if (ZSTD_isError(size))
        return -ENOMEM;
    return take_bytes(&record->origin, &record->origin_size, packed, size);
}

int tile_record_origins(const struct tile_record *record, const int32_t *symbols,
                        uint16_t *ret_origins)
{
    uint8_t bytes[ORIGIN_BYTES];
    size_t size = record->origin_size;
    if (size > 2 && ZSTD_decompress(bytes, sizeof(bytes), record->origin, size) != sizeof(bytes))
        return -EBADMSG;
    uint16_t one = size == 2 ? (uint16_t)(record->origin[0] | record->origin[1] << 8) : 0;
    for (int i = 0; i < TILE_POST_COUNT; i++) {
        uint16_t own = size > 2 ? (uint16_t)(bytes[2 * i] | bytes[2 * i + 1] << 8) : one;
        ret_origins[i] = symbols[i] == SYMBOL_NONE ? 0 : own;
    }
    return 0;
}

static uint32_t height_bits(float height_m)
{
    return isnan(height_m) ? 0x7fc00000u : bits_from_float(height_m);
}

uint32_t tile_record_checksum(const struct tile_record *record)
{
    uint8_t head[32];
    struct byte_writer writer = {.data = head, .size = sizeof(head)};
    byte_writer_put(&writer, (uint64_t)tile_key(record->id), 8, false);
    byte_writer_put(&writer, height_bits(record->min_m), 4, false);
    byte_writer_put(&writer, height_bits(record->max_m), 4, false);
    byte_writer_put(&writer, (uint64_t)llrint(record->error_m * 1000.0), 4, false);
    byte_writer_put(&writer, record->posts, 4, false);
    byte_writer_put(&writer, record->children, 4, false);
    byte_writer_put(&writer, record->payload_size, 4, false);
    uLong crc = crc32(crc32(0, NULL, 0), head, sizeof(head));
    if (record->payload_size)
        crc = crc32(crc, record->payload, (uInt)record->payload_size);
    if (record->origin_size)
        crc = crc32(crc, record->origin, (uInt)record->origin_size);
    return (uint32_t)crc;
}
