#include "io/dis_tracker.h"

#include <errno.h>

#define UNITS_PER_S (0x1p31 / 3600.0)
#define LATE_MOST   ((int64_t)(5 * UNITS_PER_S)) /* further back is a clock that was set */

void dis_tracker_init(struct dis_tracker *tracker, const struct dis_filter *filter)
{
    *tracker = (struct dis_tracker){.filter = *filter};
}

/* Timestamps count within the hour, so which of two is newer goes by the shorter way around. One
 * that stands still is a sender without a clock: its states count as they come. */
static int take_stamp(struct dis_tracker *tracker, uint32_t timestamp, int64_t *ret_sender_ns,
                      struct rejection *ret_rejection)
{
    uint32_t stamp = timestamp >> 1;
    int64_t step = (int32_t)((stamp - tracker->stamp) << 1) / 2;
    if (tracker->timed && step < 0 && step > -LATE_MOST)
        return reject(ret_rejection, REJECT_LATE, 4, "a state of %.3f s before the newest",
                      (double)-step / UNITS_PER_S);
    if (tracker->timed && step > 0)
        tracker->elapsed += (uint64_t)step;
    bool ticks = !tracker->timed || step != 0;
    tracker->timed = true;
    tracker->stamp = stamp;
    *ret_sender_ns =
        ticks ? NSEC_PER_SEC + ns_from_seconds((double)tracker->elapsed / UNITS_PER_S) : 0;
    return 0;
}

static int take_entity(struct dis_tracker *tracker, const struct dis_entity *entity,
                       int64_t *ret_sender_ns, struct rejection *ret_rejection)
{
    int r = take_stamp(tracker, entity->timestamp, ret_sender_ns, ret_rejection);
    if (r < 0)
        return r;
    tracker->known = !(entity->kind == DIS_PLATFORM && entity->appearance & DIS_DEACTIVATED);
    tracker->motion = entity->motion;
    tracker->filter = (struct dis_filter){.exercise = entity->exercise, .id = entity->id};
    return 0;
}

int dis_tracker_take(struct dis_tracker *tracker, const void *data, size_t size,
                     struct pose_sample *ret_sample, struct rejection *ret_rejection)
{
    struct pose_sample sample = {.datum = ALTITUDE_ELLIPSOID};
    struct rejection first = {.reason = REJECT_NONE};
    size_t offset = 0, pdu_size;
    bool heard = false;
    do {
        struct dis_entity entity;
        struct rejection rejection;
        pdu_size = 0;
        int r = dis_decode((const uint8_t *)data + offset, size - offset, &tracker->filter,
                           &pdu_size, &entity, &rejection);
        if (r == 0) {
            r = take_entity(tracker, &entity, &sample.sender_ns, &rejection);
            heard |= r == 0;
        }
        if (r < 0 && first.reason == REJECT_NONE) {
            first = rejection;
            first.offset += offset;
        }
        offset += pdu_size;
    } while (pdu_size > 0 && offset < size);
    if (first.reason != REJECT_NONE && ret_rejection)
        *ret_rejection = first;
    if (!heard)
        return first.reason != REJECT_NONE ? -EBADMSG : 0;
    if (!tracker->known)
        return 0;
    pose_from_dis_motion(&tracker->motion, &sample.pose);
    *ret_sample = sample;
    return 1;
}

bool dis_tracker_pose(const struct dis_tracker *tracker, nsec_t now_ns, struct pose *ret_pose)
{
    if (!tracker->known)
        return false;
    struct dis_motion now;
    dis_dead_reckon(&tracker->motion, seconds_from_ns(now_ns - tracker->state_ns), &now);
    struct pose pose;
    pose_from_dis_motion(&now, &pose);
    if (!pose_is_sane(&pose))
        return false;
    *ret_pose = pose;
    ret_pose->time_ns = ret_pose->receive_ns = now_ns;
    return true;
}
