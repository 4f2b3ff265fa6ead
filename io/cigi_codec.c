#include "io/cigi_codec.h"

#include <errno.h>
#include <math.h>
#include <string.h>

#include "base/bytes.h"

#define ALIGNMENT     8
#define BYTE_SWAP     0x8000u /* in the sender's own byte order */
#define HEAD_3_1      16      /* bytes of IG Control and Start of Frame before 3.2 */
#define HEAD          24      /* and since */
#define PLACE_MOST    1e9     /* of what is a double: degrees or metres */
#define WHOLE_SECONDS 60      /* Celestial Sphere of 4.0: see take_seconds() */

static int generation(const struct cigi_format *format)
{
    return format->major >= 4;
}

static uint64_t take(const uint8_t *data, size_t bytes, bool big)
{
    struct byte_reader reader = byte_reader_over(data, bytes);
    return byte_reader_take(&reader, (unsigned)bytes, big);
}

/* 3.x: id and size are a byte each. */
static int begin_3(const uint8_t *data, size_t size, struct cigi_format *ret_format,
                   struct rejection *ret_rejection)
{
    if (data[2] != 3)
        return reject(ret_rejection, REJECT_VERSION, 2,
                      "CIGI %u is spoken: 3.0 to 3.3 and 4.0 are known", data[2]);
    if (size < data[1] || (data[1] != HEAD_3_1 && data[1] != HEAD))
        return reject(ret_rejection, REJECT_SHORT, 1,
                      "the first packet has %u bytes in a datagram of %zu", data[1], size);
    if (take(data + 6, 2, true) != BYTE_SWAP && take(data + 6, 2, false) != BYTE_SWAP)
        return reject(ret_rejection, REJECT_FIELD, 6,
                      "the byte order cannot be told: the mark at byte 6 is %02x %02x", data[6],
                      data[7]);
    uint8_t told = data[data[0] == (uint8_t)cigi_layouts[CIGI_IG_CONTROL].id[0] ? 4 : 5] >> 4;
    ret_format->major = 3;
    ret_format->big = data[6] != 0;
    ret_format->minor = data[1] == HEAD_3_1 ? (told == 1) : told == 3 ? 3 : 2;
    return 0;
}

/* 4.0: size and id are two bytes each, and the first size, which is 24, shows the byte order. */
static int begin_4(const uint8_t *data, size_t size, struct cigi_format *ret_format,
                   struct rejection *ret_rejection)
{
    if (data[4] != 4)
        return reject(ret_rejection, REJECT_VERSION, 4,
                      "CIGI %u is spoken: 3.0 to 3.3 and 4.0 are known", data[4]);
    if (size < HEAD)
        return reject(ret_rejection, REJECT_SHORT, size,
                      "it ends at byte %zu, within the first packet", size);
    *ret_format = (struct cigi_format){.major = 4, .big = data[0] == 0};
    return 0;
}

int cigi_read_begin(const void *data, size_t size, struct cigi_reader *ret_reader,
                    struct rejection *ret_rejection)
{
    const uint8_t *bytes = data;
    if (size < ALIGNMENT)
        return reject(ret_rejection, REJECT_SHORT, size, "%zu bytes are no CIGI message", size);
    struct cigi_format format;
    unsigned id = (unsigned)take(bytes + 2, 2, true);
    int r;
    if (bytes[0] == cigi_layouts[CIGI_IG_CONTROL].id[0] ||
        bytes[0] == cigi_layouts[CIGI_START_OF_FRAME].id[0])
        r = begin_3(bytes, size, &format, ret_rejection);
    else if (bytes[0] + bytes[1] == HEAD && bytes[0] * bytes[1] == 0 && (id == 0 || id == 0xffff))
        r = begin_4(bytes, size, &format, ret_rejection);
    else
        r = reject(ret_rejection, REJECT_MAGIC, 0,
                   "it begins with %02x %02x %02x %02x, which is no IG Control", bytes[0], bytes[1],
                   bytes[2], bytes[3]);
    if (r == 0)
        *ret_reader = (struct cigi_reader){.data = bytes, .size = size, .format = format};
    return r;
}

/* 4.0's seconds are a float in one of the tools that speak it and a whole number in another: as a
 * float, a whole number below 60 would be less than 1e-43. */
static void take_seconds(float *seconds)
{
    uint32_t bits = bits_from_float(*seconds);
    if (bits < WHOLE_SECONDS)
        *seconds = (float)bits;
}

static uint8_t lowest_bit(uint8_t mask)
{
    return (uint8_t)(mask & -mask);
}

static int decode_number(const struct cigi_field *field, uint64_t bits, void *member, size_t offset,
                         struct rejection *ret_rejection)
{
    float single = float_from_bits((uint32_t)bits);
    double value = field->type == CIGI_F32 ? (double)single : double_from_bits(bits);
    if (!isfinite(value))
        return reject(ret_rejection, REJECT_NOT_FINITE, offset,
                      "%s at byte %zu is not a finite number", field->name, offset);
    if (field->type == CIGI_F64 && fabs(value) > PLACE_MOST)
        return reject(ret_rejection, REJECT_RANGE, offset, "%s at byte %zu is %g, beyond %g",
                      field->name, offset, value, PLACE_MOST);
    if (field->type == CIGI_F32)
        memcpy(member, &single, sizeof(single));
    else
        memcpy(member, &value, sizeof(value));
    return 0;
}

static size_t type_size(enum cigi_type type)
{
    static const uint8_t sizes[] = {1, 1, 1, 2, 4, 4, 8};
    return sizes[type];
}

/* One field of the packet that begins at `start` of the message. */
static int decode_field(const struct cigi_reader *reader, size_t start,
                        const struct cigi_field *field, struct cigi_packet *packet,
                        struct rejection *ret_rejection)
{
    int g = generation(&reader->format);
    size_t offset = start + field->at[g];
    uint64_t bits = take(reader->data + offset, type_size(field->type), reader->format.big);
    void *member = (char *)packet + field->member;
    uint8_t mask = field->mask[g];
    switch ((enum cigi_type)field->type) {
    case CIGI_F32:
    case CIGI_F64:
        return decode_number(field, bits, member, offset, ret_rejection);
    case CIGI_BITS:
        *(uint8_t *)member = (uint8_t)((bits & mask) / lowest_bit(mask));
        return 0;
    case CIGI_U8:
    case CIGI_I8:
        *(uint8_t *)member = (uint8_t)bits;
        return 0;
    case CIGI_U16:
        memcpy(member, &(uint16_t){(uint16_t)bits}, 2);
        return 0;
    case CIGI_U32:
        memcpy(member, &(uint32_t){(uint32_t)bits}, 4);
        return 0;
    }
    return 0;
}

/* What the size of a kind must be at the least. */
static size_t least_size(enum cigi_kind kind, const struct cigi_format *format)
{
    bool head = kind == CIGI_IG_CONTROL || kind == CIGI_START_OF_FRAME;
    return head && format->major == 3 && format->minor < 2
               ? HEAD_3_1
               : cigi_layouts[kind].size[generation(format)];
}

/* Of what a packet itself says is not used hosts do not take care. `number`: which of its floats.
 */
static bool is_unused(const struct cigi_packet *packet, unsigned number)
{
    switch (packet->kind) {
    case CIGI_ENTITY_CONTROL:
        return packet->entity_control.state == CIGI_DESTROYED;
    case CIGI_ARTICULATED_PART:
        return !(packet->articulated_part.use & 1u << number);
    case CIGI_VIEW_CONTROL:
        return !(packet->view_control.use & 1u << number);
    case CIGI_VIEW_DEFINITION:
        return !(packet->view_definition.use & 1u << number);
    case CIGI_HEIGHT_REQUEST: /* the altitude */
        return number == 2 && packet->height_request.type == CIGI_HOT &&
               !packet->height_request.of_entity;
    default:
        return false;
    }
}

static int decode_packet(const struct cigi_reader *reader, size_t start, size_t size,
                         enum cigi_kind kind, struct cigi_packet *ret_packet,
                         struct rejection *ret_rejection)
{
    const struct cigi_layout *layout = &cigi_layouts[kind];
    int g = generation(&reader->format);
    size_t least = least_size(kind, &reader->format);
    if (size < least)
        return reject(ret_rejection, REJECT_SHORT, start, "%s of %zu bytes at byte %zu, not %zu",
                      layout->name, size, start, least);
    struct cigi_packet packet = {.kind = kind};
    unsigned number = 0;
    for (size_t i = 0; i < layout->count; i++) {
        const struct cigi_field *field = &layout->fields[i];
        if (!field->at[g] || field->at[g] >= least)
            continue;
        bool is_number = field->type == CIGI_F32 || field->type == CIGI_F64;
        bool unused = is_number && is_unused(&packet, number);
        int r = decode_field(reader, start, field, &packet, unused ? NULL : ret_rejection);
        if (r < 0 && !unused)
            return r;
        number += is_number;
    }
    if (kind == CIGI_MESSAGE) {
        size_t length = size - layout->size[g];
        length = length < CIGI_TEXT_MAX ? length : CIGI_TEXT_MAX - 1;
        memcpy(packet.message.text, reader->data + start + layout->size[g], length);
    }
    if (kind == CIGI_CELESTIAL && g == 1)
        take_seconds(&packet.celestial.seconds);
    *ret_packet = packet;
    return CIGI_PACKET;
}

int cigi_read(struct cigi_reader *reader, struct cigi_packet *ret_packet,
              struct rejection *ret_rejection)
{
    size_t start = reader->offset, rest = reader->size - start;
    if (rest == 0)
        return CIGI_END;
    const uint8_t *at = reader->data + start;
    int g = generation(&reader->format);
    size_t size = 0;
    unsigned id = 0;
    if (rest >= ALIGNMENT) {
        size = g ? take(at, 2, reader->format.big) : at[1];
        id = g ? (unsigned)take(at + 2, 2, reader->format.big) : at[0];
    }
    if (size < ALIGNMENT || size % ALIGNMENT || size > rest) {
        reader->offset = reader->size;
        return reject(ret_rejection, REJECT_LENGTH, start,
                      "packet %u at byte %zu says that it has %zu bytes, with %zu left", id, start,
                      size, rest);
    }
    reader->offset += size;
    enum cigi_kind kind = cigi_kind_from_id(g, id);
    if (kind < CIGI_KINDS)
        return decode_packet(reader, start, size, kind, ret_packet, ret_rejection);
    const char *name = cigi_other_name(g, id);
    reject(ret_rejection, REJECT_NONE, start, "packet %u, %s", id, name ? name : "unknown");
    return name ? CIGI_SKIPPED : CIGI_UNKNOWN;
}

static void put(uint8_t *at, uint64_t bits, size_t bytes, bool big)
{
    struct byte_writer writer = {.data = at, .size = bytes};
    byte_writer_put(&writer, bits, (unsigned)bytes, big);
}

static void encode_field(const struct cigi_format *format, const struct cigi_field *field,
                         const struct cigi_packet *packet, uint8_t *start)
{
    const void *member = (const char *)packet + field->member;
    int g = generation(format);
    uint8_t *at = start + field->at[g], mask = field->mask[g];
    uint16_t half;
    uint32_t word;
    uint64_t whole;
    switch ((enum cigi_type)field->type) {
    case CIGI_BITS:
        *at |= (uint8_t)(*(const uint8_t *)member * lowest_bit(mask)) & mask;
        return;
    case CIGI_U8:
    case CIGI_I8:
        *at = *(const uint8_t *)member;
        return;
    case CIGI_U16:
        memcpy(&half, member, sizeof(half));
        put(at, half, sizeof(half), format->big);
        return;
    case CIGI_U32:
    case CIGI_F32:
        memcpy(&word, member, sizeof(word));
        put(at, word, sizeof(word), format->big);
        return;
    case CIGI_F64:
        memcpy(&whole, member, sizeof(whole));
        put(at, whole, sizeof(whole), format->big);
        return;
    }
}

/* IG Control and Start of Frame say who speaks what. */
static struct cigi_packet with_version(const struct cigi_packet *packet,
                                       const struct cigi_format *format)
{
    struct cigi_packet head = *packet;
    if (head.kind == CIGI_IG_CONTROL) {
        head.ig_control.major = format->major;
        head.ig_control.minor = format->minor;
        head.ig_control.byte_swap = BYTE_SWAP;
    } else if (head.kind == CIGI_START_OF_FRAME) {
        head.start_of_frame.major = format->major;
        head.start_of_frame.minor = format->minor;
        head.start_of_frame.byte_swap = BYTE_SWAP;
    }
    return head;
}

/* As strnlen(), of which gcc 12 with -fsanitize=thread believes that it reads another packet. */
static size_t text_length(const struct cigi_message *message)
{
    size_t length = 0;
    while (length < CIGI_TEXT_MAX - 1 && message->text[length])
        length++;
    return length;
}

/* The bytes of an IG Message's text, with a NUL, in whole eights together with its head. */
static size_t text_size(const struct cigi_message *message, size_t head)
{
    size_t size = head + text_length(message) + 1;
    return (size + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT - head;
}

bool cigi_write(struct cigi_writer *writer, const struct cigi_packet *packet)
{
    const struct cigi_format *format = &writer->format;
    const struct cigi_layout *layout = &cigi_layouts[packet->kind];
    int g = generation(format);
    size_t size = least_size(packet->kind, format), text = 0;
    if (layout->id[g] < 0)
        return false;
    if (packet->kind == CIGI_MESSAGE)
        text = text_size(&packet->message, size);
    if (size + text > writer->capacity - writer->size)
        return false;
    uint8_t *start = writer->data + writer->size;
    memset(start, 0, size + text);
    put(start, g ? size + text : (unsigned)layout->id[g], g ? 2 : 1, format->big);
    put(start + (g ? 2 : 1), g ? (unsigned)layout->id[g] : size + text, g ? 2 : 1, format->big);
    struct cigi_packet whole = with_version(packet, format);
    for (size_t i = 0; i < layout->count; i++) {
        if (layout->fields[i].at[g] && layout->fields[i].at[g] < size)
            encode_field(format, &layout->fields[i], &whole, start);
    }
    if (text)
        memcpy(start + size, packet->message.text, text_length(&packet->message));
    writer->size += size + text;
    return true;
}
