/* Two ideas carry this file.
 *
 * Halves: a double comes as two frames of one identifier. The specification gives no order and no
 * rule for pairing. Senders that give both halves one message code are paired by it, in either
 * order. Senders that count every frame are paired by neighbouring codes within a few milliseconds;
 * once an identifier has shown shared codes, neighbours no longer count, so that a lost half cannot
 * marry the next pair's.
 *
 * Attitude: a pose is made when every angle has come that comes as often as the one at hand, or
 * when an angle comes round a second time (another was lost). So pitch, roll and heading of one
 * minor frame leave together, and a slow heading does not hold up a fast pitch. */
#include "io/canaerospace.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "base/bytes.h"

#define TYPE_NODATA  0
#define TYPE_FLOAT   2
#define TYPE_SHORT2  12
#define TYPE_UCHAR4  16
#define TYPE_DOUBLEH 30
#define TYPE_DOUBLEL 31

#define ID_IDENTIFY_REQUEST 128
#define ID_IDENTIFY_ANSWER  129

#define PAIR_SAME_CODE_NS (500 * NSEC_PER_MSEC)
#define PAIR_NEIGHBOUR_NS (10 * NSEC_PER_MSEC)

static const struct {
    uint32_t id;
    double limit; /* of its magnitude */
    const char *name;
} parameters[CANAEROSPACE_PARAMETERS] = {
    [CANAEROSPACE_PITCH_RATE] = {303, DECODE_RATE_MAX_DPS, "pitch rate"},
    [CANAEROSPACE_ROLL_RATE] = {304, DECODE_RATE_MAX_DPS, "roll rate"},
    [CANAEROSPACE_YAW_RATE] = {305, DECODE_RATE_MAX_DPS, "yaw rate"},
    [CANAEROSPACE_PITCH] = {311, DECODE_ANGLE_MAX_DEG, "pitch"},
    [CANAEROSPACE_ROLL] = {312, DECODE_ANGLE_MAX_DEG, "roll"},
    [CANAEROSPACE_BARO_ALTITUDE] = {320, DECODE_HEIGHT_MAX_M, "baro corrected altitude"},
    [CANAEROSPACE_HEADING] = {321, DECODE_ANGLE_MAX_DEG, "heading"},
    [CANAEROSPACE_TRUE_ALTITUDE] = {332, DECODE_HEIGHT_MAX_M, "true altitude"},
    [CANAEROSPACE_GPS_LATITUDE] = {1036, 90.0, "GPS latitude"},
    [CANAEROSPACE_GPS_LONGITUDE] = {1037, DECODE_LON_MAX_DEG, "GPS longitude"},
    [CANAEROSPACE_GPS_HEIGHT] = {1038, DECODE_HEIGHT_MAX_M, "GPS height"},
    [CANAEROSPACE_INS_LATITUDE] = {1049, 90.0, "INS latitude"},
    [CANAEROSPACE_INS_LONGITUDE] = {1050, DECODE_LON_MAX_DEG, "INS longitude"},
    [CANAEROSPACE_INS_HEIGHT] = {1051, DECODE_HEIGHT_MAX_M, "INS height"},
    [CANAEROSPACE_EAST] = {1130, DECODE_SPEED_MAX_MPS, "east velocity"},
    [CANAEROSPACE_NORTH] = {1131, DECODE_SPEED_MAX_MPS, "north velocity"},
    [CANAEROSPACE_UP] = {1132, DECODE_SPEED_MAX_MPS, "up velocity"},
    [CANAEROSPACE_TRUE_HEADING] = {1133, DECODE_ANGLE_MAX_DEG, "true heading"},
};

static const enum canaerospace_parameter attitude_parameters[] = {
    CANAEROSPACE_PITCH, CANAEROSPACE_ROLL, CANAEROSPACE_HEADING, CANAEROSPACE_TRUE_HEADING};

uint32_t canaerospace_id(enum canaerospace_parameter parameter)
{
    return parameters[parameter].id;
}

void canaerospace_init(struct canaerospace *state)
{
    *state = (struct canaerospace){0};
}

static int parameter_of_id(uint32_t can_id)
{
    if (can_id & (CAN_ERR_FLAG | CAN_RTR_FLAG))
        return -1;
    uint32_t id = can_id & (can_id & CAN_EFF_FLAG ? CAN_EFF_MASK : CAN_SFF_MASK);
    for (int i = 0; i < CANAEROSPACE_PARAMETERS; i++)
        if (parameters[i].id == id)
            return i;
    return -1;
}

/* Message codes go up by one with each message, or with each pair of halves. */
static void count_lost(struct canaerospace *state, struct canaerospace_value *value, uint8_t code,
                       uint8_t type)
{
    if (value->counted) {
        uint8_t step = (uint8_t)(code - value->code);
        if (step > 1 && step < 128)
            state->lost += step - 1u;
    }
    value->counted = true;
    value->code = code;
    value->type = type;
}

static bool halves_pair(const struct canaerospace_value *value)
{
    const struct canaerospace_half *low = &value->low, *high = &value->high;
    if (!low->present || !high->present)
        return false;
    nsec_t apart_ns = llabs(low->time_ns - high->time_ns);
    if (low->code == high->code)
        return apart_ns <= PAIR_SAME_CODE_NS;
    int step = (int8_t)(uint8_t)(low->code - high->code);
    return !value->halves_share_code && (step == 1 || step == -1) && apart_ns <= PAIR_NEIGHBOUR_NS;
}

/* Returns true and the double where this half completes one. */
static bool take_half(struct canaerospace_value *value, bool high, uint8_t code, uint32_t word,
                      nsec_t now_ns, double *ret_value)
{
    struct canaerospace_half *half = high ? &value->high : &value->low;
    *half =
        (struct canaerospace_half){.present = true, .code = code, .word = word, .time_ns = now_ns};
    if (!halves_pair(value))
        return false;
    value->halves_share_code |= value->low.code == value->high.code;
    *ret_value = double_from_bits((uint64_t)value->high.word << 32 | value->low.word);
    value->low.present = value->high.present = false;
    return true;
}

static double double_from_short2(uint32_t word)
{
    double scale = (double)(int16_t)(uint16_t)word;
    return (double)(int16_t)(uint16_t)(word >> 16) / 32767.0 * scale;
}

/* Returns 1 with the value, 0 where a half waits for its other, -EBADMSG. */
static int decode_value(struct canaerospace_value *value, int parameter,
                        const struct can_frame *frame, nsec_t now_ns, double *ret_value,
                        struct rejection *ret_rejection)
{
    const char *name = parameters[parameter].name;
    if (frame->can_dlc < 8)
        return reject(ret_rejection, REJECT_SHORT, frame->can_dlc,
                      "%s (id %u) has %u bytes, 8 expected", name, parameters[parameter].id,
                      frame->can_dlc);
    uint8_t type = frame->data[1], code = frame->data[3];
    struct byte_reader in = byte_reader_over(frame->data, 8);
    byte_reader_seek(&in, 4);
    uint32_t word = read_u32be(&in);
    double number;
    if (type == TYPE_FLOAT)
        number = (double)float_from_bits(word);
    else if (type == TYPE_SHORT2)
        number = double_from_short2(word);
    else if (type != TYPE_DOUBLEL && type != TYPE_DOUBLEH)
        return reject(ret_rejection, REJECT_FIELD, 1,
                      "%s (id %u) has data type %u; FLOAT, SHORT2 or a half DOUBLE expected", name,
                      parameters[parameter].id, type);
    else if (!take_half(value, type == TYPE_DOUBLEH, code, word, now_ns, &number))
        return 0;
    if (!isfinite(number))
        return reject(ret_rejection, REJECT_NOT_FINITE, 4, "%s (id %u) is not a finite number",
                      name, parameters[parameter].id);
    if (fabs(number) > parameters[parameter].limit)
        return reject(ret_rejection, REJECT_RANGE, 4, "%s (id %u) is %g, beyond %g", name,
                      parameters[parameter].id, number, parameters[parameter].limit);
    *ret_value = number;
    return 1;
}

static bool live(const struct canaerospace *state, enum canaerospace_parameter parameter,
                 nsec_t now_ns)
{
    const struct canaerospace_value *value = &state->values[parameter];
    return value->known && now_ns - value->time_ns <= CANAEROSPACE_STALE_NS;
}

static double number(const struct canaerospace *state, enum canaerospace_parameter parameter)
{
    return state->values[parameter].value;
}

static void add_motion(const struct canaerospace *state, nsec_t now_ns, struct pose *pose)
{
    if (live(state, CANAEROSPACE_EAST, now_ns) && live(state, CANAEROSPACE_NORTH, now_ns)) {
        pose->valid |= POSE_VELOCITY;
        pose->velocity_ned_mps[0] = number(state, CANAEROSPACE_NORTH);
        pose->velocity_ned_mps[1] = number(state, CANAEROSPACE_EAST);
        if (live(state, CANAEROSPACE_UP, now_ns))
            pose->velocity_ned_mps[2] = -number(state, CANAEROSPACE_UP);
    }
    if (live(state, CANAEROSPACE_ROLL_RATE, now_ns) &&
        live(state, CANAEROSPACE_PITCH_RATE, now_ns) &&
        live(state, CANAEROSPACE_YAW_RATE, now_ns)) {
        pose->valid |= POSE_RATES;
        pose->rates_body_dps[0] = number(state, CANAEROSPACE_ROLL_RATE);
        pose->rates_body_dps[1] = number(state, CANAEROSPACE_PITCH_RATE);
        pose->rates_body_dps[2] = number(state, CANAEROSPACE_YAW_RATE);
    }
}

static void add_attitude(const struct canaerospace *state, nsec_t now_ns, struct pose *pose)
{
    bool true_heading = live(state, CANAEROSPACE_TRUE_HEADING, now_ns);
    if (!live(state, CANAEROSPACE_PITCH, now_ns) || !live(state, CANAEROSPACE_ROLL, now_ns) ||
        (!true_heading && !live(state, CANAEROSPACE_HEADING, now_ns)))
        return;
    pose->valid |= POSE_ATTITUDE;
    pose->attitude.pitch_deg = number(state, CANAEROSPACE_PITCH);
    pose->attitude.roll_deg = number(state, CANAEROSPACE_ROLL);
    pose->attitude.heading_deg =
        number(state, true_heading ? CANAEROSPACE_TRUE_HEADING : CANAEROSPACE_HEADING);
}

/* The height that there is, best first: with the position's own receiver, then barometric. */
static bool find_height(const struct canaerospace *state, enum canaerospace_parameter own,
                        nsec_t now_ns, enum canaerospace_parameter *ret_parameter)
{
    const enum canaerospace_parameter order[] = {
        own, CANAEROSPACE_GPS_HEIGHT, CANAEROSPACE_INS_HEIGHT, CANAEROSPACE_TRUE_ALTITUDE,
        CANAEROSPACE_BARO_ALTITUDE};
    for (size_t i = 0; i < sizeof(order) / sizeof(order[0]); i++)
        if (live(state, order[i], now_ns)) {
            *ret_parameter = order[i];
            return true;
        }
    return false;
}

static bool fix_live(const struct canaerospace_fix *fix, nsec_t now_ns)
{
    return fix->known && now_ns - fix->time_ns <= CANAEROSPACE_STALE_NS;
}

/* The newest fix, carried to `now_ns`, which may be a little before it. */
static bool add_position(const struct canaerospace *state, nsec_t now_ns,
                         struct pose_sample *sample)
{
    bool gps = fix_live(&state->gps, now_ns);
    const struct canaerospace_fix *newest = gps ? &state->gps : &state->ins;
    enum canaerospace_parameter height = gps ? CANAEROSPACE_GPS_HEIGHT : CANAEROSPACE_INS_HEIGHT;
    if (!fix_live(newest, now_ns) || !find_height(state, height, now_ns, &height))
        return false;
    nsec_t fix_ns = newest->time_ns;
    double up_mps = sample->pose.valid & POSE_VELOCITY ? -sample->pose.velocity_ned_mps[2] : 0.0;
    double height_age_s = seconds_from_ns(fix_ns - state->values[height].time_ns);
    struct pose fix = {.valid = POSE_POSITION | (sample->pose.valid & POSE_VELOCITY),
                       .position = {.lat_deg = newest->lat_deg,
                                    .lon_deg = newest->lon_deg,
                                    .height_m = number(state, height) + up_mps * height_age_s}};
    memcpy(fix.velocity_ned_mps, sample->pose.velocity_ned_mps, sizeof(fix.velocity_ned_mps));
    struct pose carried = fix;
    if (fix.valid & POSE_VELOCITY)
        pose_extrapolate(&fix, seconds_from_ns(now_ns - fix_ns), &carried);
    sample->pose.position = carried.position;
    sample->pose.position_age_ns = now_ns - fix_ns;
    sample->pose.valid |= POSE_POSITION;
    sample->datum = height == CANAEROSPACE_TRUE_ALTITUDE || height == CANAEROSPACE_BARO_ALTITUDE
                        ? ALTITUDE_EGM96
                        : ALTITUDE_ELLIPSOID;
    return true;
}

static bool make_sample(const struct canaerospace *state, nsec_t now_ns,
                        struct pose_sample *ret_sample)
{
    struct pose_sample sample = {.pose = {.time_ns = now_ns, .receive_ns = now_ns}};
    add_motion(state, now_ns, &sample.pose);
    add_attitude(state, now_ns, &sample.pose);
    if (!add_position(state, now_ns, &sample))
        return false;
    decode_normalise(&sample.pose);
    *ret_sample = sample;
    return true;
}

/* True where no other angle that comes as often as `parameter` is still to come. */
static bool attitude_complete(const struct canaerospace *state, int parameter, nsec_t now_ns)
{
    nsec_t interval_ns = state->values[parameter].interval_ns;
    for (size_t i = 0; i < sizeof(attitude_parameters) / sizeof(attitude_parameters[0]); i++) {
        const struct canaerospace_value *value = &state->values[attitude_parameters[i]];
        bool as_often = value->known && interval_ns > 0 && value->interval_ns > 0 &&
                        value->interval_ns <= 2 * interval_ns &&
                        now_ns - value->time_ns <= 3 * interval_ns;
        if (as_often && !(state->fresh_attitude & 1u << attitude_parameters[i]))
            return false;
    }
    return true;
}

static bool is_attitude(int parameter)
{
    return parameter == CANAEROSPACE_PITCH || parameter == CANAEROSPACE_ROLL ||
           parameter == CANAEROSPACE_HEADING || parameter == CANAEROSPACE_TRUE_HEADING;
}

static bool is_position(int parameter)
{
    return parameter == CANAEROSPACE_GPS_LATITUDE || parameter == CANAEROSPACE_GPS_LONGITUDE ||
           parameter == CANAEROSPACE_INS_LATITUDE || parameter == CANAEROSPACE_INS_LONGITUDE;
}

/* Returns true where `parameter`, just stored, makes a fix with its other coordinate. One that
 * waits since longer than half a cycle is of the last cycle, whose partner was lost. */
static bool complete_fix(struct canaerospace *state, int parameter)
{
    bool gps = parameter == CANAEROSPACE_GPS_LATITUDE || parameter == CANAEROSPACE_GPS_LONGITUDE;
    bool is_lat = parameter == CANAEROSPACE_GPS_LATITUDE || parameter == CANAEROSPACE_INS_LATITUDE;
    struct canaerospace_fix *fix = gps ? &state->gps : &state->ins;
    int lat_at = gps ? CANAEROSPACE_GPS_LATITUDE : CANAEROSPACE_INS_LATITUDE;
    const struct canaerospace_value *lat = &state->values[lat_at], *lon = lat + 1;
    const struct canaerospace_value *mine = is_lat ? lat : lon, *other = is_lat ? lon : lat;
    bool *other_fresh = is_lat ? &fix->lon_fresh : &fix->lat_fresh;
    if (mine->cycle_ns > 0 && mine->time_ns - other->time_ns > mine->cycle_ns / 2)
        *other_fresh = false;
    *(is_lat ? &fix->lat_fresh : &fix->lon_fresh) = true;
    if (!*other_fresh)
        return false;
    *fix = (struct canaerospace_fix){
        .known = true, .lat_deg = lat->value, .lon_deg = lon->value, .time_ns = mine->time_ns};
    return true;
}

static void store(struct canaerospace_value *value, double number_, nsec_t now_ns)
{
    value->interval_ns = value->known ? now_ns - value->time_ns : 0;
    nsec_t longer_ns = value->cycle_ns + value->cycle_ns / 16;
    value->cycle_ns =
        value->cycle_ns > 0 && value->interval_ns > longer_ns ? longer_ns : value->interval_ns;
    value->known = true;
    value->value = number_;
    value->time_ns = now_ns;
}

/* Where attitude flows, it alone says when; a bus that carries none is timed by its position. */
static bool attitude_flows(const struct canaerospace *state, nsec_t now_ns)
{
    return live(state, CANAEROSPACE_PITCH, now_ns) && live(state, CANAEROSPACE_ROLL, now_ns) &&
           (live(state, CANAEROSPACE_HEADING, now_ns) ||
            live(state, CANAEROSPACE_TRUE_HEADING, now_ns));
}

int canaerospace_take(struct canaerospace *state, const struct can_frame *frame, nsec_t now_ns,
                      struct pose_sample *ret_sample, struct rejection *ret_rejection)
{
    int parameter = parameter_of_id(frame->can_id);
    if (parameter < 0)
        return 0;
    state->frames++;
    struct canaerospace_value *value = &state->values[parameter];
    double taken = 0.0;
    int r = decode_value(value, parameter, frame, now_ns, &taken, ret_rejection);
    if (r < 0)
        return r;
    count_lost(state, value, frame->data[3], frame->data[1]);
    if (r == 0)
        return 0;
    if (!is_attitude(parameter)) {
        store(value, taken, now_ns);
        return is_position(parameter) && complete_fix(state, parameter) &&
               !attitude_flows(state, now_ns) && make_sample(state, now_ns, ret_sample);
    }
    unsigned bit = 1u << parameter;
    if (state->fresh_attitude & bit) {
        /* Round again before the others came: give out what was there, keep this for the next. */
        bool made = make_sample(state, state->fresh_since_ns, ret_sample);
        store(value, taken, now_ns);
        state->fresh_attitude = bit;
        state->fresh_since_ns = now_ns;
        return made;
    }
    store(value, taken, now_ns);
    state->fresh_attitude |= bit;
    state->fresh_since_ns = now_ns;
    if (!attitude_complete(state, parameter, now_ns))
        return 0;
    state->fresh_attitude = 0;
    return make_sample(state, now_ns, ret_sample);
}

bool canaerospace_identify(const struct can_frame *frame, uint8_t node,
                           struct can_frame *ret_answer)
{
    if (frame->can_id != ID_IDENTIFY_REQUEST || frame->can_dlc < 4 ||
        frame->data[1] != TYPE_NODATA || frame->data[2] != 0 ||
        (frame->data[0] != 0 && frame->data[0] != node))
        return false;
    struct can_frame answer = {.can_id = ID_IDENTIFY_ANSWER, .can_dlc = 8};
    const uint8_t data[8] = {node,
                             TYPE_UCHAR4,
                             0,
                             frame->data[3],
                             1 /* hardware revision */,
                             1 /* software revision */,
                             0 /* default distribution */,
                             0 /* default header */};
    memcpy(answer.data, data, sizeof(data));
    *ret_answer = answer;
    return true;
}

static void put_word(struct canaerospace_encoder *encoder, enum canaerospace_parameter parameter,
                     uint8_t type, uint32_t word, struct can_frame *ret_frame)
{
    struct can_frame frame = {.can_id = parameters[parameter].id, .can_dlc = 8};
    frame.data[0] = encoder->node;
    frame.data[1] = type;
    frame.data[3] = encoder->codes[parameter];
    struct byte_writer out = {.data = frame.data, .size = 8, .offset = 4};
    byte_writer_put(&out, word, 4, true);
    *ret_frame = frame;
}

static size_t put_float(struct canaerospace_encoder *encoder, enum canaerospace_parameter parameter,
                        double value, struct can_frame *ret_frame)
{
    put_word(encoder, parameter, TYPE_FLOAT, bits_from_float((float)value), ret_frame);
    encoder->codes[parameter]++;
    return 1;
}

static size_t put_double(struct canaerospace_encoder *encoder,
                         enum canaerospace_parameter parameter, double value,
                         struct can_frame ret_frames[2])
{
    uint64_t bits = bits_from_double(value);
    put_word(encoder, parameter, TYPE_DOUBLEL, (uint32_t)bits, &ret_frames[0]);
    put_word(encoder, parameter, TYPE_DOUBLEH, (uint32_t)(bits >> 32), &ret_frames[1]);
    encoder->codes[parameter]++;
    return 2;
}

size_t canaerospace_encode(struct canaerospace_encoder *encoder, const struct pose *pose,
                           struct can_frame ret_frames[CANAEROSPACE_FRAMES_MAX])
{
    struct can_frame *f = ret_frames;
    size_t n = 0;
    unsigned every = encoder->position_every ? encoder->position_every : 1;
    if (pose->valid & POSE_POSITION && encoder->count % every == 0) {
        n += put_double(encoder, CANAEROSPACE_GPS_LATITUDE, pose->position.lat_deg, f + n);
        n += put_double(encoder, CANAEROSPACE_GPS_LONGITUDE, pose->position.lon_deg, f + n);
        n += put_float(encoder, CANAEROSPACE_GPS_HEIGHT, pose->position.height_m, f + n);
    }
    encoder->count++;
    if (pose->valid & POSE_VELOCITY) {
        n += put_float(encoder, CANAEROSPACE_EAST, pose->velocity_ned_mps[1], f + n);
        n += put_float(encoder, CANAEROSPACE_NORTH, pose->velocity_ned_mps[0], f + n);
        n += put_float(encoder, CANAEROSPACE_UP, -pose->velocity_ned_mps[2], f + n);
    }
    if (pose->valid & POSE_RATES) {
        n += put_float(encoder, CANAEROSPACE_ROLL_RATE, pose->rates_body_dps[0], f + n);
        n += put_float(encoder, CANAEROSPACE_PITCH_RATE, pose->rates_body_dps[1], f + n);
        n += put_float(encoder, CANAEROSPACE_YAW_RATE, pose->rates_body_dps[2], f + n);
    }
    if (pose->valid & POSE_ATTITUDE) {
        double heading_deg = longitude_normalised_deg(pose->attitude.heading_deg);
        n += put_float(encoder, CANAEROSPACE_PITCH, pose->attitude.pitch_deg, f + n);
        n += put_float(encoder, CANAEROSPACE_ROLL, pose->attitude.roll_deg, f + n);
        n += put_float(encoder, CANAEROSPACE_TRUE_HEADING, heading_deg, f + n);
    }
    return n;
}
