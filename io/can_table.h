/* Any CAN bus whose messages a table describes: which bits of which identifier are what, in which
 * unit. ARINC 825 and vendors' buses. Pure; one thread at a time. docs/can-table.md. */
#pragma once

#include <linux/can.h>

#include "io/can_assembly.h"

#define CAN_TABLE_MAX 64

enum can_number {
    CAN_NUMBER_SIGNED, /* two's complement */
    CAN_NUMBER_UNSIGNED,
    CAN_NUMBER_FLOAT, /* IEEE 754, 32 or 64 bits */
};

enum can_order {
    CAN_ORDER_BIG,    /* bit 0 is the most significant of byte 0; a field begins with its highest */
    CAN_ORDER_LITTLE, /* bit 0 is the least significant of byte 0; a field begins with its lowest */
};

enum can_unit {
    CAN_UNIT_DEFAULT, /* degrees, metres, metres per second, degrees per second */
    CAN_UNIT_DEG,
    CAN_UNIT_RAD,
    CAN_UNIT_M,
    CAN_UNIT_KM,
    CAN_UNIT_FT,
    CAN_UNIT_MPS,
    CAN_UNIT_KMPH,
    CAN_UNIT_KT,
    CAN_UNIT_FTPS,
    CAN_UNIT_FTPMIN,
    CAN_UNIT_DPS,
    CAN_UNIT_RADPS,
    CAN_UNITS
};

struct can_table_field {
    uint32_t can_id; /* with CAN_EFF_FLAG where it has 29 bits */
    enum can_quantity quantity;
    unsigned bit, bits; /* the first, and how many; within the 64 of a frame */
    enum can_number number;
    enum can_order order;
    double scale, offset; /* the value in `unit` is number * scale + offset */
    enum can_unit unit;
};

struct can_table {
    struct can_table_field fields[CAN_TABLE_MAX];
    unsigned count;
};

/* An identifier as candump writes it: 3 hexadecimal digits, or 8 of a 29-bit one. Returns 0 or
 * -EINVAL. */
int can_id_parse(const char *text, uint32_t *ret_can_id);

/* What turns a number in `unit` into the quantity's own. Returns 0, or -EINVAL where the unit is of
 * something else. */
int can_unit_factor(enum can_quantity quantity, enum can_unit unit, double *ret_factor);

/* Takes one frame. Returns 1 with a new pose (can_assembly_take()), 0 where there is none yet, or
 * -EBADMSG for the first field that cannot be; the others of the frame do not count either.
 * `ret_ours`: whether the table knows its identifier. */
int can_table_take(const struct can_table *table, struct can_assembly *assembly,
                   const struct can_frame *frame, nsec_t now_ns, bool *ret_ours,
                   struct pose_sample *ret_sample, struct rejection *ret_rejection);
