/* Reading and writing numbers in byte buffers, either byte order, any alignment.
 *
 * A reader never runs past its end: a read that would sets `overrun` and returns zero, so a decoder
 * reads a whole packet and checks once. */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

struct byte_reader {
    const uint8_t *data;
    size_t size, offset;
    bool overrun;
};

static inline struct byte_reader byte_reader_over(const void *data, size_t size)
{
    return (struct byte_reader){.data = (const uint8_t *)data, .size = size};
}

static inline void byte_reader_seek(struct byte_reader *reader, size_t offset)
{
    if (offset > reader->size)
        reader->overrun = true;
    else
        reader->offset = offset;
}

static inline uint64_t byte_reader_take(struct byte_reader *reader, unsigned bytes, bool big)
{
    if (reader->overrun || reader->size - reader->offset < bytes) {
        reader->overrun = true;
        return 0;
    }
    uint64_t value = 0;
    for (unsigned i = 0; i < bytes; i++) {
        unsigned at = big ? i : bytes - 1 - i;
        value = value << 8 | reader->data[reader->offset + at];
    }
    reader->offset += bytes;
    return value;
}

static inline float float_from_bits(uint32_t bits)
{
    float value;
    memcpy(&value, &bits, sizeof(value));
    return value;
}

static inline double double_from_bits(uint64_t bits)
{
    double value;
    memcpy(&value, &bits, sizeof(value));
    return value;
}

static inline uint32_t bits_from_float(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof(bits));
    return bits;
}

static inline uint64_t bits_from_double(double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof(bits));
    return bits;
}

static inline uint8_t read_u8(struct byte_reader *r)
{
    return (uint8_t)byte_reader_take(r, 1, true);
}

static inline uint16_t read_u16be(struct byte_reader *r)
{
    return (uint16_t)byte_reader_take(r, 2, true);
}

static inline uint32_t read_u32be(struct byte_reader *r)
{
    return (uint32_t)byte_reader_take(r, 4, true);
}

static inline uint64_t read_u64be(struct byte_reader *r)
{
    return byte_reader_take(r, 8, true);
}

static inline float read_f32be(struct byte_reader *r)
{
    return float_from_bits(read_u32be(r));
}

static inline double read_f64be(struct byte_reader *r)
{
    return double_from_bits(read_u64be(r));
}

static inline uint16_t read_u16le(struct byte_reader *r)
{
    return (uint16_t)byte_reader_take(r, 2, false);
}

static inline uint32_t read_u32le(struct byte_reader *r)
{
    return (uint32_t)byte_reader_take(r, 4, false);
}

static inline uint64_t read_u64le(struct byte_reader *r)
{
    return byte_reader_take(r, 8, false);
}

static inline float read_f32le(struct byte_reader *r)
{
    return float_from_bits(read_u32le(r));
}

static inline double read_f64le(struct byte_reader *r)
{
    return double_from_bits(read_u64le(r));
}

/* A writer into a buffer whose size the caller chose to be enough; writing past it is our bug. */
struct byte_writer {
    uint8_t *data;
    size_t size, offset;
};

static inline void byte_writer_put(struct byte_writer *writer, uint64_t value, unsigned bytes,
                                   bool big)
{
    for (unsigned i = 0; i < bytes && writer->offset < writer->size; i++) {
        unsigned shift = 8 * (big ? bytes - 1 - i : i);
        writer->data[writer->offset++] = (uint8_t)(value >> shift);
    }
}
