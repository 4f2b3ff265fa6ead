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
    [POSE_PROTOCOL_XPLANE] = "xplane",
    [POSE_PROTOCOL_DIS] = "dis",
    [POSE_PROTOCOL_CAN_TABLE] = "can-table",
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

bool pose_protocol_is_can(enum pose_protocol protocol)
{
    return protocol == POSE_PROTOCOL_CANAEROSPACE || protocol == POSE_PROTOCOL_CAN_TABLE;
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
    canaerospace_init(&intake->can, params->redundancy);
    dis_tracker_init(&intake->dis, &params->dis);
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

static int decode_native(struct intake *intake, const void *data, size_t size,
                         struct pose_sample *ret_sample, struct rejection *ret_rejection)
{
    int r = native_decode(data, size, ret_sample, ret_rejection);
    return r < 0 ? r : 1;
}

static int decode_flightgear(struct intake *intake, const void *data, size_t size,
                             struct pose_sample *ret_sample, struct rejection *ret_rejection)
{
    struct flightgear_fdm fdm;
    int r = flightgear_decode(data, size, &fdm, ret_rejection);
    if (r < 0)
        return r;
    intake->agl_m = fdm.agl_m;
    *ret_sample = fdm.sample;
    return 1;
}

static int decode_xplane(struct intake *intake, const void *data, size_t size,
                         struct pose_sample *ret_sample, struct rejection *ret_rejection)
{
    struct xplane_pose pose;
    int r = xplane_decode(data, size, &pose, ret_rejection);
    if (r < 0)
        return r;
    if (pose.aircraft != 0)
        return 0;
    intake->agl_m = pose.agl_m;
    *ret_sample = pose.sample;
    return 1;
}

static int decode_dis(struct intake *intake, const void *data, size_t size,
                      struct pose_sample *ret_sample, struct rejection *ret_rejection)
{
    int r = dis_tracker_take(&intake->dis, data, size, ret_sample, ret_rejection);
    if (ret_rejection->reason == REJECT_LATE)
        intake->counters.reordered++;
    return r;
}

/* Each returns 1 with a sample, 0 where the packet is not about own-ship, or -EBADMSG. */
static int (*const decoders[POSE_PROTOCOLS])(struct intake *intake, const void *data, size_t size,
                                             struct pose_sample *ret_sample,
                                             struct rejection *ret_rejection) = {
    [POSE_PROTOCOL_NATIVE] = decode_native,
    [POSE_PROTOCOL_FLIGHTGEAR] = decode_flightgear,
    [POSE_PROTOCOL_XPLANE] = decode_xplane,
    [POSE_PROTOCOL_DIS] = decode_dis,
};

/* What a protocol makes of a pose just accepted, beside handing it out. */
static void note_accepted(struct intake *intake, nsec_t receive_ns, struct pose *pose)
{
    if (intake->params.protocol == POSE_PROTOCOL_XPLANE)
        intake->xplane.heard_ns = receive_ns;
    if (intake->params.protocol == POSE_PROTOCOL_DIS) {
        intake->dis.state_ns = pose->time_ns;
        dis_tracker_pose(&intake->dis, receive_ns, pose); /* never older than one carried forward */
    }
}

/* Counts a refusal, of all or of a part; the result passes through. */
static int counted(struct intake *intake, int r, const struct rejection *rejection,
                   struct rejection *ret_rejection)
{
    if (rejection->reason == REJECT_NONE)
        return r;
    intake->counters.rejected[rejection->reason]++;
    if (ret_rejection)
        *ret_rejection = *rejection;
    return r;
}

int intake_packet(struct intake *intake, const void *data, size_t size, nsec_t receive_ns,
                  struct pose *ret_pose, struct rejection *ret_rejection)
{
    assert(!pose_protocol_is_can(intake->params.protocol));
    intake->counters.received++;
    struct pose_sample sample;
    struct rejection rejection = {.reason = REJECT_NONE};
    int r = decoders[intake->params.protocol](intake, data, size, &sample, &rejection);
    intake->counters.others += r == 0;
    if (r > 0)
        r = accept(intake, &sample, receive_ns, ret_pose, &rejection);
    if (r > 0)
        note_accepted(intake, receive_ns, ret_pose);
    return counted(intake, r, &rejection, ret_rejection);
}

int intake_frame(struct intake *intake, const struct can_frame *frame, nsec_t receive_ns,
                 struct pose *ret_pose, struct rejection *ret_rejection)
{
    assert(pose_protocol_is_can(intake->params.protocol));
    struct pose_sample sample;
    struct rejection rejection = {.reason = REJECT_NONE};
    int r;
    if (intake->params.protocol == POSE_PROTOCOL_CANAEROSPACE) {
        r = canaerospace_take(&intake->can, frame, receive_ns, &sample, &rejection);
        intake->counters.received = intake->can.frames;
        intake->counters.lost = intake->can.lost;
    } else {
        bool ours;
        r = can_table_take(&intake->params.table, &intake->assembly, frame, receive_ns, &ours,
                           &sample, &rejection);
        intake->counters.received += ours;
    }
    if (r > 0)
        r = accept(intake, &sample, receive_ns, ret_pose, &rejection);
    return counted(intake, r, &rejection, ret_rejection);
}

size_t intake_can_ids(const struct intake_params *params, uint32_t ret_ids[INTAKE_IDS_MAX])
{
    _Static_assert(2 * CAN_QUANTITIES <= INTAKE_IDS_MAX, "an identifier of each length");
    size_t count = 0;
    if (params->protocol == POSE_PROTOCOL_CANAEROSPACE) {
        for (int i = 0; i < CAN_QUANTITIES; i++) {
            uint32_t id = canaerospace_id((enum can_quantity)i, params->redundancy);
            ret_ids[count++] = id;
            if (params->redundancy == 0)
                ret_ids[count++] = id | CAN_EFF_FLAG;
        }
        return count;
    }
    for (unsigned i = 0; i < params->table.count; i++) {
        size_t k = 0;
        while (k < count && ret_ids[k] != params->table.fields[i].can_id)
            k++;
        if (k == count)
            ret_ids[count++] = params->table.fields[i].can_id;
    }
    return count;
}

bool intake_carry(const struct intake *intake, nsec_t now_ns, struct pose *ret_pose)
{
    return intake->params.protocol == POSE_PROTOCOL_DIS &&
           dis_tracker_pose(&intake->dis, now_ns, ret_pose);
}

uint64_t intake_rejected_total(const struct intake_counters *counters)
{
    uint64_t total = 0;
    for (int i = 0; i < REJECT_REASONS; i++)
        total += counters->rejected[i];
    return total;
}
