#include "io/can_table.h"

#include <assert.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/bytes.h"

int can_id_parse(const char *text, uint32_t *ret_can_id)
{
    size_t digits = strspn(text, "0123456789abcdefABCDEF");
    unsigned long id = strtoul(text, NULL, 16);
    bool long_form = digits == 8;
    if (text[digits] || (digits != 3 && !long_form) ||
        id > (long_form ? CAN_EFF_MASK : CAN_SFF_MASK))
        return -EINVAL;
    *ret_can_id = (uint32_t)id | (long_form ? CAN_EFF_FLAG : 0);
    return 0;
}

enum dimension {
    ANGLE,
    LENGTH,
    SPEED,
    RATE,
};

static enum dimension dimension_of(enum can_quantity quantity)
{
    switch (quantity) {
    case CAN_PITCH_RATE:
    case CAN_ROLL_RATE:
    case CAN_YAW_RATE:
        return RATE;
    case CAN_GPS_HEIGHT:
    case CAN_INS_HEIGHT:
    case CAN_TRUE_ALTITUDE:
    case CAN_BARO_ALTITUDE:
        return LENGTH;
    case CAN_NORTH:
    case CAN_EAST:
    case CAN_UP:
    case CAN_ALTITUDE_RATE:
    case CAN_GPS_SPEED:
    case CAN_INS_SPEED:
    case CAN_BODY_FORWARD:
    case CAN_BODY_RIGHT:
    case CAN_BODY_UP:
        return SPEED;
    default:
        return ANGLE;
    }
}

static const struct {
    enum dimension dimension;
    double factor;
} units[CAN_UNITS] = {
    [CAN_UNIT_DEG] = {ANGLE, 1.0},        [CAN_UNIT_RAD] = {ANGLE, 180.0 / M_PI},
    [CAN_UNIT_M] = {LENGTH, 1.0},         [CAN_UNIT_KM] = {LENGTH, 1000.0},
    [CAN_UNIT_FT] = {LENGTH, 0.3048},     [CAN_UNIT_MPS] = {SPEED, 1.0},
    [CAN_UNIT_KMPH] = {SPEED, 1.0 / 3.6}, [CAN_UNIT_KT] = {SPEED, 1852.0 / 3600.0},
    [CAN_UNIT_FTPS] = {SPEED, 0.3048},    [CAN_UNIT_FTPMIN] = {SPEED, 0.3048 / 60.0},
    [CAN_UNIT_DPS] = {RATE, 1.0},         [CAN_UNIT_RADPS] = {RATE, 180.0 / M_PI},
};

int can_unit_factor(enum can_quantity quantity, enum can_unit unit, double *ret_factor)
{
    if (unit != CAN_UNIT_DEFAULT && units[unit].dimension != dimension_of(quantity))
        return -EINVAL;
    *ret_factor = unit == CAN_UNIT_DEFAULT ? 1.0 : units[unit].factor;
    return 0;
}

static uint64_t bits_of(const struct can_table_field *field, const struct can_frame *frame)
{
    struct byte_reader in = byte_reader_over(frame->data, sizeof(frame->data));
    if (field->order == CAN_ORDER_BIG)
        return read_u64be(&in) << field->bit >> (64 - field->bits);
    return read_u64le(&in) >> field->bit << (64 - field->bits) >> (64 - field->bits);
}

static double value_of(const struct can_table_field *field, uint64_t bits)
{
    unsigned unused = 64 - field->bits;
    double number = field->number == CAN_NUMBER_SIGNED
                        ? (double)((int64_t)(bits << unused) >> unused)
                    : field->number == CAN_NUMBER_UNSIGNED ? (double)bits
                    : field->bits == 64                    ? double_from_bits(bits)
                                        : (double)float_from_bits((uint32_t)bits);
    double factor = 1.0;
    can_unit_factor(field->quantity, field->unit, &factor);
    return (number * field->scale + field->offset) * factor;
}

static int read_field(const struct can_table_field *field, const struct can_frame *frame,
                      double *ret_value, struct rejection *ret_rejection)
{
    assert(field->bits >= 1 && field->bit + field->bits <= 64);
    uint32_t id = field->can_id & CAN_EFF_MASK;
    size_t bytes = (field->bit + field->bits + 7) / 8;
    if (frame->can_dlc < bytes)
        return reject(ret_rejection, REJECT_SHORT, frame->can_dlc,
                      "%s (id %X) needs %zu bytes, the frame has %u",
                      can_quantity_name(field->quantity), id, bytes, frame->can_dlc);
    double value = value_of(field, bits_of(field, frame));
    int r = can_quantity_check(field->quantity, value, id, field->bit / 8, ret_rejection);
    if (r == 0)
        *ret_value = value;
    return r;
}

int can_table_take(const struct can_table *table, struct can_assembly *assembly,
                   const struct can_frame *frame, nsec_t now_ns, bool *ret_ours,
                   struct pose_sample *ret_sample, struct rejection *ret_rejection)
{
    double values[CAN_TABLE_MAX];
    unsigned mine[CAN_TABLE_MAX], count = 0;
    *ret_ours = false;
    for (unsigned i = 0; i < table->count; i++) {
        if (table->fields[i].can_id != frame->can_id)
            continue;
        *ret_ours = true;
        int r = read_field(&table->fields[i], frame, &values[count], ret_rejection);
        if (r != 0)
            return r;
        mine[count++] = i;
    }
    int made = 0;
    for (unsigned k = 0; k < count; k++)
        if (can_assembly_take(assembly, table->fields[mine[k]].quantity, values[k], now_ns,
                              ret_sample) > 0)
            made = 1;
    return made;
}
