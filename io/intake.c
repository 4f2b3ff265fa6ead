#include "io/intake.h"

#include <assert.h>
#include <errno.h>
#include <math.h>
#include <string.h>

#include "io/flightgear.h"
#include "io/native.h"

/* A sequence number that jumps further than this either way is a new start. */
#define SEQUENCE_JUMP 4096

static const char *const protocol_names[POSE_PROTOCOLS] = {
    [POSE_PROTOCOL_NATIVE] = "native",
    [POSE_PROTOCOL_FLIGHTGEAR] = "flightgear",
    [POSE_PROTOCOL_CANAEROSPACE] = "canaerospace",
    [POSE_PROTOCOL_CIGI] = "cigi",
};

const char *pose_protocol_name(enum pose_protocol protocol)
{
    assert(protocol < POSE_PROTOCOLS);
    return protocol_names[protocol];
}

int pose_protocol_from_name(const char *name, enum pose_protocol *ret_protocol)
{
    for (int i = 0; i < POSE_PROTOCOLS; i++)
        if (strcmp(name, protocol_names[i]) == 0) {
            *ret_protocol = (enum pose_protocol)i;
            return 0;
        }
    return -EINVAL;
}

void sample_to_ellipsoid(struct pose_sample *sample, const struct geoid_function *geoid)
{
    if (sample->datum == ALTITUDE_EGM96 && sample->pose.valid & POSE_POSITION)
        sample->pose.position.height_m += geoid->undulation_m(
            geoid->context, sample->pose.position.lat_deg, sample->pose.position.lon_deg);
    sample->datum = ALTITUDE_ELLIPSOID;
}

void intake_init(struct intake *intake, const struct intake_params *params)
{
    assert(params->geoid.undulation_m);
    *intake = (struct intake){.params = *params, .agl_m = NAN};
    canaerospace_init(&intake->can);
}

static void start_sequence(struct intake *intake, const struct pose_sample *sample)
{
    intake->started = true;
    intake->session = sample->session;
    intake->sequence = sample->sequence;
    intake->seen = 1;
    intake->clock.sender.known = false;
}

/* Only ever forward: what is late is counted and refused. One that fills a gap was not lost. */
static int check_sequence(struct intake *intake, const struct pose_sample *sample,
                          struct rejection *ret_rejection)
{
    int64_t step = (int32_t)(sample->sequence - intake->sequence);
    if (!intake->started || sample->session != intake->session || step > SEQUENCE_JUMP ||
        step < -SEQUENCE_JUMP) {
        start_sequence(intake, sample);
        return 0;
    }
    if (step > 0) {
        intake->counters.lost += (uint64_t)step - 1;
        intake->seen = step < 64 ? intake->seen << step | 1 : 1;
        intake->sequence = sample->sequence;
        return 0;
    }
    uint64_t bit = -step < 64 ? UINT64_C(1) << -step : 0;
    if (intake->seen & bit) {
        intake->counters.duplicates++;
    } else {
        intake->seen |= bit;
        intake->counters.reordered++;
        if (intake->counters.lost)
            intake->counters.lost--;
    }
    return reject(ret_rejection, REJECT_LATE, 8, "sequence %u after %u", sample->sequence,
                  intake->sequence);
}

static int accept(struct intake *intake, struct pose_sample *sample, nsec_t receive_ns,
                  struct pose *ret_pose, struct rejection *ret_rejection)
{
    if (sample->has_sequence) {
        int r = check_sequence(intake, sample, ret_rejection);
        if (r < 0)
            return r;
    }
    if (intake->params.force_datum)
        sample->datum = intake->params.datum;
    sample_to_ellipsoid(sample, &intake->params.geoid);
    sample->pose.receive_ns = receive_ns;
    if (!pose_is_sane(&sample->pose))
        return reject(ret_rejection, REJECT_RANGE, 0, "its height has no sense on the ellipsoid");
    pose_clock_set(&intake->clock, sample, receive_ns, intake->params.smooth);
    intake->counters.accepted++;
    *ret_pose = sample->pose;
    return 1;
}

static int decode(struct intake *intake, const void *data, size_t size,
                  struct pose_sample *ret_sample, struct rejection *ret_rejection)
{
    if (intake->params.protocol == POSE_PROTOCOL_NATIVE)
        return native_decode(data, size, ret_sample, ret_rejection);
    struct flightgear_fdm fdm;
    int r = flightgear_decode(data, size, &fdm, ret_rejection);
    if (r < 0)
        return r;
    intake->agl_m = fdm.agl_m;
    *ret_sample = fdm.sample;
    return 0;
}

/* Counts a refusal; other results pass through. */
static int counted(struct intake *intake, int r, const struct rejection *rejection,
                   struct rejection *ret_rejection)
{
    if (r >= 0)
        return r;
    intake->counters.rejected[rejection->reason]++;
    if (ret_rejection)
        *ret_rejection = *rejection;
    return r;
}

int intake_packet(struct intake *intake, const void *data, size_t size, nsec_t receive_ns,
                  struct pose *ret_pose, struct rejection *ret_rejection)
{
    assert(intake->params.protocol != POSE_PROTOCOL_CANAEROSPACE);
    intake->counters.received++;
    struct pose_sample sample;
    struct rejection rejection;
    int r = decode(intake, data, size, &sample, &rejection);
    if (r == 0)
        r = accept(intake, &sample, receive_ns, ret_pose, &rejection);
    return counted(intake, r, &rejection, ret_rejection);
}

int intake_frame(struct intake *intake, const struct can_frame *frame, nsec_t receive_ns,
                 struct pose *ret_pose, struct rejection *ret_rejection)
{
    assert(intake->params.protocol == POSE_PROTOCOL_CANAEROSPACE);
    struct pose_sample sample;
    struct rejection rejection;
    int r = canaerospace_take(&intake->can, frame, receive_ns, &sample, &rejection);
    intake->counters.received = intake->can.frames;
    intake->counters.lost = intake->can.lost;
    if (r > 0)
        r = accept(intake, &sample, receive_ns, ret_pose, &rejection);
    return counted(intake, r, &rejection, ret_rejection);
}

uint64_t intake_rejected_total(const struct intake_counters *counters)
{
    uint64_t total = 0;
    for (int i = 0; i < REJECT_REASONS; i++)
        total += counters->rejected[i];
    return total;
}
