/* The bytes of a recording, shared by reader and writer. Little-endian; records are padded to 8.
 *
 * File head: "OTWLOG\r\n", u32 version, u32 zero.
 * Record head: u32 payload size, u16 type, u16 source, i64 time, u32 CRC-32 of the head's first 16
 * bytes and the payload, u32 zero; then the payload. */
#pragma once

#include "io/otwlog.h"

#define OTWLOG_MAGIC     "OTWLOG\r\n"
#define OTWLOG_POSE_SIZE 112

static inline size_t otwlog_padded(size_t size)
{
    return (size + 7) & ~(size_t)7;
}

/* Writes a pose's payload: i64 receive_ns, u32 valid, u32 zero, then twelve f64: latitude,
 * longitude, height; roll, pitch, heading; velocity n, e, d; rates p, q, r. */
void otwlog_pose_encode(const struct pose *pose, uint8_t ret_payload[OTWLOG_POSE_SIZE]);
