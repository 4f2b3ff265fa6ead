/* What every decoder of a pose shares: the sample it makes and the reasons for which it refuses.
 *
 * A decoder is a pure function from bytes to a `struct pose_sample`. It returns 0, or -EBADMSG with
 * a `struct rejection` that says why, at which byte, and in one sentence. */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "geo/pose.h"

/* Why a packet was not used. Each reason has a counter of its own at the source (docs/wire.md). */
enum reject_reason {
    REJECT_NONE,
    REJECT_SHORT,      /* it ends before the format says it may */
    REJECT_LENGTH,     /* it is not as long as its own header or version says */
    REJECT_MAGIC,      /* it is another protocol's, or its byte order is wrong */
    REJECT_VERSION,    /* a version that this program does not know */
    REJECT_FIELD,      /* a type or a flag that cannot be */
    REJECT_NOT_FINITE, /* NaN or infinity where a number was promised */
    REJECT_RANGE,      /* a finite number that cannot be, such as latitude 91 */
    REJECT_SENDER,     /* its sender is not on the allow-list */
    REJECT_LATE,       /* a duplicate, or older than what came before */
    REJECT_REFERENCE,  /* it speaks of something that is not there */
    REJECT_LIMIT,      /* more of something than there may be */
    REJECT_REASONS
};

/* The counter's name, such as "not-finite". Static. */
const char *reject_reason_name(enum reject_reason reason);

/* How often each: "magic 3, length 1"; "nothing". */
void reject_list(const uint64_t rejected[REJECT_REASONS], char *ret_text, size_t size);

struct rejection {
    enum reject_reason reason;
    size_t offset; /* byte of the packet at which it went wrong */
    char text[192];
};

/* One pose as a wire gave it. Until the source converts it, position.height_m is above `datum`.
 * The decoder leaves time_ns and receive_ns zero: it knows no clock. */
struct pose_sample {
    struct pose pose;
    enum altitude_datum datum;
    bool has_sequence;
    uint32_t session;  /* another value means that the sender began anew */
    uint32_t sequence; /* one more with each packet; wraps */
    int64_t sender_ns; /* the sender's clock, 0 where it gave none */
};

/* Fills `ret_rejection` (may be NULL) and returns -EBADMSG. */
int reject(struct rejection *ret_rejection, enum reject_reason reason, size_t offset,
           const char *format, ...) __attribute__((format(printf, 4, 5)));

/* Which number of a pose lies where in a packet, and how large it may be. */
struct decode_field {
    const char *name, *unit;
    uint32_t valid; /* checked where the pose has this enum pose_valid bit */
    size_t member;  /* offsetof in struct pose, of a double */
    size_t offset;  /* byte in the packet */
};

#define DECODE_FIELD(bit, member_, offset_, name_, unit_)                                          \
    {                                                                                              \
        .name = name_, .unit = unit_, .valid = bit, .member = offsetof(struct pose, member_),      \
        .offset = offset_                                                                          \
    }

/* The widest that each kind of number may be; beyond it the sender is mistaken. */
#define DECODE_LON_MAX_DEG   360.0
#define DECODE_HEIGHT_MAX_M  1e8
#define DECODE_ANGLE_MAX_DEG 720.0
#define DECODE_SPEED_MAX_MPS 2e4
#define DECODE_RATE_MAX_DPS  1e5

/* Checks every number that `pose->valid` claims, in the order of `fields`; the limits follow from
 * the valid bit. Returns 0, or -EBADMSG (REJECT_NOT_FINITE, REJECT_RANGE). */
int decode_check_fields(const struct pose *pose, const struct decode_field *fields, size_t count,
                        struct rejection *ret_rejection);

/* Longitude into -180..180, roll likewise, heading into 0..360. */
void decode_normalise(struct pose *pose);
