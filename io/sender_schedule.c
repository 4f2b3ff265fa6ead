#include <assert.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "io/flightgear.h"
#include "io/native.h"
#include "io/sender.h"

#define RATE_DEFAULT_HZ 60.0
#define RATE_MAX_HZ     10000.0
#define PACKETS_MAX     20000000.0

struct scheduler {
    const struct send_params *params;
    struct send_schedule *schedule;
    uint64_t random; /* state of the generator */
    nsec_t late_ns;  /* of the pose at hand */
    uint32_t sequence;
    struct canaerospace_encoder can;
};

/* splitmix64 (Steele, Lea and Flood 2014), to 53 bits: 0 <= value < 1. */
static double next_random(struct scheduler *s)
{
    uint64_t z = s->random += UINT64_C(0x9e3779b97f4a7c15);
    z = (z ^ z >> 30) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ z >> 27) * UINT64_C(0x94d049bb133111eb);
    return (double)((z ^ z >> 31) >> 11) * 0x1p-53;
}

static int make_room(struct send_schedule *schedule, size_t size)
{
    if (schedule->count == schedule->capacity) {
        size_t capacity = schedule->capacity ? schedule->capacity * 2 : 1024;
        struct send_item *items = realloc(schedule->items, capacity * sizeof(*items));
        if (!items)
            return -ENOMEM;
        schedule->items = items;
        schedule->capacity = capacity;
    }
    if (schedule->bytes_used + size > schedule->bytes_capacity) {
        size_t capacity = schedule->bytes_capacity ? schedule->bytes_capacity * 2 : 1 << 17;
        uint8_t *bytes = realloc(schedule->bytes, capacity);
        if (!bytes)
            return -ENOMEM;
        schedule->bytes = bytes;
        schedule->bytes_capacity = capacity;
    }
    return 0;
}

/* One packet, unless it is left out. A pose draws a number, and each of its packets, whatever the
 * chances, so that the same seed hits the same packets. */
static int put_packet(struct scheduler *s, nsec_t time_ns, const void *data, size_t size)
{
    struct send_schedule *schedule = s->schedule;
    bool left_out = next_random(s) < s->params->loss;
    time_ns += s->late_ns;
    if (left_out) {
        schedule->left_out++;
        return 0;
    }
    int r = make_room(schedule, size);
    if (r < 0)
        return r;
    if (schedule->count > 0 && time_ns < schedule->items[schedule->count - 1].time_ns)
        time_ns = schedule->items[schedule->count - 1].time_ns;
    memcpy(schedule->bytes + schedule->bytes_used, data, size);
    schedule->items[schedule->count++] =
        (struct send_item){.time_ns = time_ns, .offset = schedule->bytes_used, .size = size};
    schedule->bytes_used += size;
    return 0;
}

static int put_native(struct scheduler *s, nsec_t time_ns, const struct pose *pose)
{
    uint8_t data[NATIVE_SIZE];
    struct pose_sample sample = {.pose = *pose,
                                 .datum = ALTITUDE_ELLIPSOID,
                                 .session = s->params->session,
                                 .sequence = s->sequence++,
                                 .sender_ns = NSEC_PER_SEC + time_ns};
    native_encode(&sample, data);
    return put_packet(s, time_ns, data, sizeof(data));
}

static struct pose_sample above_the_sea(const struct scheduler *s, const struct pose *pose)
{
    const struct geoid_function *geoid = &s->params->geoid;
    struct pose_sample sample = {.pose = *pose, .datum = ALTITUDE_EGM96};
    sample.pose.position.height_m -=
        geoid->undulation_m(geoid->context, pose->position.lat_deg, pose->position.lon_deg);
    return sample;
}

static int put_flightgear(struct scheduler *s, nsec_t time_ns, const struct pose *pose)
{
    uint8_t data[FLIGHTGEAR_SIZE_V24];
    struct flightgear_fdm fdm = {.sample = above_the_sea(s, pose), .agl_m = NAN, .wheels = 3};
    flightgear_encode(&fdm, data);
    return put_packet(s, time_ns, data, sizeof(data));
}

/* As X-Plane sends it to who asked. */
static int put_xplane(struct scheduler *s, nsec_t time_ns, const struct pose *pose)
{
    uint8_t data[XPLANE_RPOS_SIZE];
    struct xplane_pose sent = {.sample = above_the_sea(s, pose), .agl_m = NAN};
    xplane_encode_rpos(&sent, data);
    return put_packet(s, time_ns, data, sizeof(data));
}

static int put_dis(struct scheduler *s, nsec_t time_ns, const struct pose *pose)
{
    uint8_t data[DIS_ENTITY_STATE_SIZE];
    double hours = seconds_from_ns(time_ns) / 3600.0;
    struct dis_entity entity = {.version = 7,
                                .exercise = 1,
                                .timestamp = (uint32_t)((hours - floor(hours)) * DIS_HOUR)
                                             << 1, /* since the start */
                                .id = {1, 1, 1},
                                .kind = DIS_PLATFORM,
                                .domain = DIS_AIR,
                                .marking = "OTWD"};
    dis_motion_from_pose(pose, &entity.motion);
    dis_encode(&entity, data);
    return put_packet(s, time_ns, data, sizeof(data));
}

static int put_canaerospace(struct scheduler *s, nsec_t time_ns, const struct pose *pose)
{
    struct can_frame frames[CANAEROSPACE_FRAMES_MAX];
    size_t count = canaerospace_encode(&s->can, pose, frames);
    int r = 0;
    for (size_t i = 0; r == 0 && i < count; i++)
        r = put_packet(s, time_ns, &frames[i], sizeof(frames[i]));
    return r;
}

/* At another speed than its own, the flight moves and turns faster too. */
static void scale_motion(struct pose *pose, double speed)
{
    for (int i = 0; i < 3; i++) {
        pose->velocity_ned_mps[i] *= speed;
        pose->rates_body_dps[i] *= speed;
    }
}

/* What belongs to one pose leaves together: the frames of a bus are queued by one task. */
static int put_pose(struct scheduler *s, nsec_t time_ns, const struct pose *pose)
{
    static int (*const put[POSE_PROTOCOLS])(struct scheduler *, nsec_t, const struct pose *) = {
        [POSE_PROTOCOL_NATIVE] = put_native,
        [POSE_PROTOCOL_FLIGHTGEAR] = put_flightgear,
        [POSE_PROTOCOL_CANAEROSPACE] = put_canaerospace,
        [POSE_PROTOCOL_XPLANE] = put_xplane,
        [POSE_PROTOCOL_DIS] = put_dis,
    };
    s->late_ns = (nsec_t)(next_random(s) * s->params->jitter_ms * 1e6);
    return put[s->params->protocol](s, time_ns, pose);
}

/* The first of two waits for the second and goes out behind it: nothing is sent before its time. */
static void reorder(struct scheduler *s)
{
    struct send_item *items = s->schedule->items;
    for (size_t i = 0; i + 1 < s->schedule->count; i++) {
        if (next_random(s) >= s->params->reorder)
            continue;
        struct send_item first = items[i], second = items[i + 1];
        items[i].time_ns = second.time_ns;
        items[i].offset = second.offset;
        items[i].size = second.size;
        items[i + 1].offset = first.offset;
        items[i + 1].size = first.size;
        i++; /* one change of places a packet */
    }
}

static int check_params(const struct send_params *p, double rate_hz, double speed,
                        double duration_s, struct diag *diag)
{
    assert(p->geoid.undulation_m);
    if (p->protocol == POSE_PROTOCOL_CAN_TABLE)
        return diag_set(diag, -EINVAL, "can-table is not a protocol to send");
    if (p->protocol == POSE_PROTOCOL_CIGI)
        return diag_set(diag, -EINVAL, "what a CIGI host sends depends on what it hears");
    if (!(rate_hz > 0.0 && rate_hz <= RATE_MAX_HZ))
        return diag_set(diag, -EINVAL, "a rate of %g Hz is not within 0 to %g", rate_hz,
                        RATE_MAX_HZ);
    if (!(speed > 0.0 && speed <= 1000.0))
        return diag_set(diag, -EINVAL, "a speed of %g is not within 0 to 1000", speed);
    if (!(p->jitter_ms >= 0.0 && p->jitter_ms <= 10000.0))
        return diag_set(diag, -EINVAL, "a jitter of %g ms is not within 0 to 10000", p->jitter_ms);
    if (!(p->loss >= 0.0 && p->loss <= 1.0) || !(p->reorder >= 0.0 && p->reorder <= 1.0))
        return diag_set(diag, -EINVAL, "loss %g or reorder %g is not within 0 to 1", p->loss,
                        p->reorder);
    if (duration_s / speed * rate_hz > PACKETS_MAX)
        return diag_set(diag, -EINVAL, "%g s at %g Hz is more than %g poses", duration_s / speed,
                        rate_hz, PACKETS_MAX);
    return 0;
}

int send_schedule_create(const struct flight *flight, const struct send_params *params,
                         struct send_schedule **ret_schedule, struct diag *diag)
{
    double rate_hz = params->rate_hz != 0.0 ? params->rate_hz : RATE_DEFAULT_HZ;
    double speed = params->speed != 0.0 ? params->speed : 1.0;
    double duration_s = seconds_from_ns(flight_duration_ns(flight));
    int r = check_params(params, rate_hz, speed, duration_s, diag);
    if (r < 0)
        return r;
    struct scheduler s = {.params = params,
                          .random = params->seed,
                          .can = {.node = 1, .position_every = params->position_every},
                          .schedule = calloc(1, sizeof(struct send_schedule))};
    r = s.schedule ? 0 : -ENOMEM;
    size_t poses = (size_t)(duration_s / speed * rate_hz) + 1;
    for (size_t i = 0; r == 0 && i < poses; i++) {
        double time_s = (double)i / rate_hz;
        struct pose pose;
        flight_sample(flight, ns_from_seconds(time_s * speed), &pose);
        scale_motion(&pose, speed);
        r = put_pose(&s, ns_from_seconds(time_s), &pose);
    }
    if (r < 0) {
        send_schedule_destroy(s.schedule);
        return diag_set(diag, r, "no memory for %zu packets", poses);
    }
    reorder(&s);
    *ret_schedule = s.schedule;
    return 0;
}

void send_schedule_destroy(struct send_schedule *schedule)
{
    if (!schedule)
        return;
    free(schedule->items);
    free(schedule->bytes);
    free(schedule);
}
