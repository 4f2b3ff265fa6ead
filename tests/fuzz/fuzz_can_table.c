/* A table and a stream of frames for it. The table: a byte with the number of fields, then eight
 * bytes each: identifier, quantity, bit, bits, number and order, unit, scale. The frames as in
 * fuzz_canaerospace. */
#include <stdlib.h>
#include <string.h>

#include "io/can_table.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#define FIELD_BYTES 8

/* A field such as the configuration lets through. */
static struct can_table_field field_of(const uint8_t bytes[FIELD_BYTES])
{
    double factor;
    struct can_table_field field = {.can_id = bytes[0] | (bytes[0] & 1 ? CAN_EFF_FLAG : 0),
                                    .quantity = (enum can_quantity)(bytes[1] % CAN_QUANTITIES),
                                    .bit = bytes[2] % 64,
                                    .number = (enum can_number)(bytes[4] % 3),
                                    .order = (enum can_order)(bytes[4] / 3 % 2),
                                    .unit = (enum can_unit)(bytes[5] % CAN_UNITS),
                                    .scale = bytes[6] ? bytes[6] / 100.0 : 1e-7,
                                    .offset = (int8_t)bytes[7]};
    field.bits = 1 + bytes[3] % (64 - field.bit);
    if (field.number == CAN_NUMBER_FLOAT) {
        field.bits = bytes[3] & 1 ? 64 : 32;
        field.bit = field.bits == 64 ? 0 : field.bit % 33;
    }
    if (can_unit_factor(field.quantity, field.unit, &factor) < 0)
        field.unit = CAN_UNIT_DEFAULT;
    return field;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct can_table table = {0};
    struct can_assembly assembly = {0};
    nsec_t now_ns = NSEC_PER_SEC;
    if (size == 0)
        return 0;
    unsigned count = *data % (CAN_TABLE_MAX + 1);
    for (data++, size--; table.count < count && size >= FIELD_BYTES; size -= FIELD_BYTES) {
        table.fields[table.count++] = field_of(data);
        data += FIELD_BYTES;
    }
    for (; size >= sizeof(struct can_frame); size -= sizeof(struct can_frame)) {
        struct can_frame frame;
        struct pose_sample sample;
        bool ours;
        memcpy(&frame, data, sizeof(frame));
        data += sizeof(frame);
        now_ns += frame.__pad * NSEC_PER_MSEC;
        if (can_table_take(&table, &assembly, &frame, now_ns, &ours, &sample, NULL) > 0 &&
            (!ours || !pose_is_sane(&sample.pose)))
            abort();
    }
    return 0;
}
