/* A stream of datagrams, each behind two bytes of its length (big-endian). Whatever is accepted
 * must be sane, now and dead-reckoned over as long as an entity is believed. */
#include <stdlib.h>

#include "io/dis_tracker.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* An entity is written as it was read. */
static void write_again(const uint8_t *data, size_t size)
{
    static const struct dis_filter any;
    struct dis_entity entity, again;
    uint8_t bytes[DIS_ENTITY_STATE_SIZE];
    size_t used;
    if (dis_decode(data, size, &any, &used, &entity, NULL) != 0)
        return;
    dis_encode(&entity, bytes);
    if (dis_decode(bytes, sizeof(bytes), &any, &used, &again, NULL) != 0 ||
        again.id.entity != entity.id.entity)
        abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct dis_tracker tracker;
    dis_tracker_init(&tracker, &(struct dis_filter){0});
    while (size >= 2) {
        size_t length = (size_t)data[0] << 8 | data[1];
        data += 2;
        size -= 2;
        length = length < size ? length : size;
        struct pose_sample sample;
        struct rejection rejection;
        struct pose later;
        write_again(data, length);
        int r = dis_tracker_take(&tracker, data, length, &sample, &rejection);
        if ((r < 0 && rejection.offset > length) || (r > 0 && !pose_is_sane(&sample.pose)))
            abort();
        if (dis_tracker_pose(&tracker, 12 * NSEC_PER_SEC, &later) && !pose_is_sane(&later))
            abort();
        data += length;
        size -= length;
    }
    return 0;
}
