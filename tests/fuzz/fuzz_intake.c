/* From packets to frames: a protocol's byte, then packets, each behind two bytes of the time that
 * passed (quarters of a millisecond) and two of its length (both big-endian; a CAN frame is 16
 * bytes long, as in fuzz_canaerospace). The length's highest bit makes it another source's, the
 * next one says that sources are silent. What is accepted is sane and so is every frame, whenever
 * the packets came. */
#include <stdlib.h>
#include <string.h>

#include "geo/motion.h"
#include "io/intake.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static double no_undulation_m(void *context, double lat_deg, double lon_deg)
{
    return 0.0;
}

static int take(struct intake *intake, const uint8_t *data, size_t size, nsec_t now_ns,
                struct pose *ret_pose)
{
    struct can_frame frame = {0};
    if (!pose_protocol_is_can(intake->params.protocol))
        return intake_packet(intake, data, size, now_ns, ret_pose, NULL);
    memcpy(&frame, data, size < sizeof(frame) ? size : sizeof(frame));
    return intake_frame(intake, &frame, now_ns, ret_pose, NULL);
}

static void check(bool known, const struct pose *pose)
{
    if (known && !pose_is_sane(pose))
        abort();
}

/* Latitude, longitude, height and heading, each in a frame of its own. */
static const struct can_table table = {
    .fields = {{.can_id = 1, .quantity = CAN_GPS_LATITUDE, .bits = 32, .scale = 1e-7},
               {.can_id = 2, .quantity = CAN_GPS_LONGITUDE, .bits = 32, .scale = 1e-7},
               {.can_id = 3, .quantity = CAN_TRUE_ALTITUDE, .bits = 32, .scale = 0.01},
               {.can_id = 4, .quantity = CAN_TRUE_HEADING, .bits = 16, .scale = 0.01}},
    .count = 4};

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static struct intake intake;
    static struct motion motion;
    nsec_t now_ns = 1000 * NSEC_PER_SEC;
    enum pose_protocol protocol = size > 0 ? data[0] % POSE_PROTOCOLS : POSE_PROTOCOL_CIGI;
    if (protocol == POSE_PROTOCOL_CIGI) /* fuzz_cigi_session */
        return 0;
    intake_init(&intake, &(struct intake_params){.protocol = protocol,
                                                 .smooth = true,
                                                 .table = table,
                                                 .geoid = {.undulation_m = no_undulation_m}});
    motion_init(&motion, &(struct motion_params){.delay_ns = 40 * NSEC_PER_MSEC,
                                                 .extrapolate_ns = 250 * NSEC_PER_MSEC});
    for (data++, size--; size >= 4;) {
        size_t length = (size_t)(data[2] & 0x3f) << 8 | data[3];
        int source = data[2] >> 7;
        struct pose pose;
        now_ns += (nsec_t)(data[0] << 8 | data[1]) * 250 * NSEC_PER_USEC;
        motion_set_live(&motion, !(data[2] & 0x40));
        data += 4;
        size -= 4;
        length = length < size ? length : size;
        int r = take(&intake, data, length, now_ns, &pose);
        check(r > 0, &pose);
        if (r > 0)
            motion_put(&motion, source, &pose);
        check(intake_carry(&intake, now_ns, &pose), &pose);
        check(motion_show(&motion, now_ns, &pose), &pose);
        data += length;
        size -= length;
    }
    char reasons[256];
    reject_list(intake.counters.rejected, reasons, sizeof(reasons));
    if ((intake_rejected_total(&intake.counters) == 0) != (strcmp(reasons, "nothing") == 0))
        abort();
    return 0;
}
