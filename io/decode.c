#include "io/decode.h"

#include <assert.h>
#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

const char *reject_reason_name(enum reject_reason reason)
{
    static const char *const names[REJECT_REASONS] = {
        [REJECT_NONE] = "none",   [REJECT_SHORT] = "short",           [REJECT_LENGTH] = "length",
        [REJECT_MAGIC] = "magic", [REJECT_VERSION] = "version",       [REJECT_FIELD] = "field",
        [REJECT_RANGE] = "range", [REJECT_NOT_FINITE] = "not-finite", [REJECT_SENDER] = "sender",
        [REJECT_LATE] = "late",   [REJECT_REFERENCE] = "reference",   [REJECT_LIMIT] = "limit",
    };
    assert(reason < REJECT_REASONS);
    return names[reason];
}

void reject_list(const uint64_t rejected[REJECT_REASONS], char *ret_text, size_t size)
{
    size_t used = 0;
    snprintf(ret_text, size, "nothing");
    for (int i = 0; i < REJECT_REASONS && used < size; i++)
        if (rejected[i])
            used += (size_t)snprintf(ret_text + used, size - used, "%s%s %llu", used ? ", " : "",
                                     reject_reason_name((enum reject_reason)i),
                                     (unsigned long long)rejected[i]);
}

/* In brackets, for tests/sanitize/model.h has a macro of the name. */
int(reject)(struct rejection *ret_rejection, enum reject_reason reason, size_t offset,
            const char *format, ...)
{
    if (ret_rejection) {
        ret_rejection->reason = reason;
        ret_rejection->offset = offset;
        va_list args;
        va_start(args, format);
        vsnprintf(ret_rejection->text, sizeof(ret_rejection->text), format, args);
        va_end(args);
    }
    return -EBADMSG;
}

static double field_limit(const struct decode_field *field)
{
    switch (field->valid) {
    case POSE_POSITION:
        if (field->member == offsetof(struct pose, position.lat_deg))
            return 90.0;
        if (field->member == offsetof(struct pose, position.lon_deg))
            return DECODE_LON_MAX_DEG;
        return DECODE_HEIGHT_MAX_M;
    case POSE_ATTITUDE:
        return DECODE_ANGLE_MAX_DEG;
    case POSE_VELOCITY:
        return DECODE_SPEED_MAX_MPS;
    default:
        return DECODE_RATE_MAX_DPS;
    }
}

int decode_check_fields(const struct pose *pose, const struct decode_field *fields, size_t count,
                        struct rejection *ret_rejection)
{
    for (size_t i = 0; i < count; i++) {
        const struct decode_field *field = &fields[i];
        if (!(pose->valid & field->valid))
            continue;
        double value;
        memcpy(&value, (const char *)pose + field->member, sizeof(value));
        if (!isfinite(value))
            return reject(ret_rejection, REJECT_NOT_FINITE, field->offset,
                          "%s at byte %zu is not a finite number", field->name, field->offset);
        double limit = field_limit(field);
        if (fabs(value) > limit)
            return reject(ret_rejection, REJECT_RANGE, field->offset,
                          "%s at byte %zu is %g %s, beyond %g", field->name, field->offset, value,
                          field->unit, limit);
    }
    return 0;
}

void decode_normalise(struct pose *pose)
{
    if (pose->valid & POSE_POSITION)
        pose->position.lon_deg = longitude_normalised_deg(pose->position.lon_deg);
    if (pose->valid & POSE_ATTITUDE) {
        pose->attitude.roll_deg = longitude_normalised_deg(pose->attitude.roll_deg);
        pose->attitude.heading_deg = heading_normalised_deg(pose->attitude.heading_deg);
    }
}
