/* A double comes as two frames of one identifier. The specification gives no order and no rule for
 * pairing. Senders that give both halves one message code are paired by it, in either order.
 * Senders that count every frame are paired by neighbouring codes within a few milliseconds; once
 * an identifier has shown shared codes, neighbours no longer count, so that a lost half cannot
 * marry the next pair's. */
#include "io/canaerospace.h"

#include <assert.h>
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

static const uint16_t ids[CAN_QUANTITIES] = {
    [CAN_PITCH_RATE] = 303,
    [CAN_ROLL_RATE] = 304,
    [CAN_YAW_RATE] = 305,
    [CAN_PITCH] = 311,
    [CAN_ROLL] = 312,
    [CAN_ALTITUDE_RATE] = 314,
    [CAN_BARO_ALTITUDE] = 320,
    [CAN_HEADING] = 321,
    [CAN_TRUE_ALTITUDE] = 332,
    [CAN_BODY_UP] = 336,
    [CAN_BODY_FORWARD] = 337,
    [CAN_BODY_RIGHT] = 338,
    [CAN_GPS_LATITUDE] = 1036,
    [CAN_GPS_LONGITUDE] = 1037,
    [CAN_GPS_HEIGHT] = 1038,
    [CAN_GPS_SPEED] = 1039,
    [CAN_GPS_TRACK] = 1040,
    [CAN_INS_LATITUDE] = 1049,
    [CAN_INS_LONGITUDE] = 1050,
    [CAN_INS_HEIGHT] = 1051,
    [CAN_INS_SPEED] = 1052,
    [CAN_INS_TRACK] = 1053,
    [CAN_MAGNETIC_HEADING] = 1069,
    [CAN_MAGNETIC_VARIATION] = 1121,
    [CAN_EAST] = 1130,
    [CAN_NORTH] = 1131,
    [CAN_UP] = 1132,
    [CAN_TRUE_HEADING] = 1133,
};

uint32_t canaerospace_id(enum can_quantity quantity, unsigned redundancy)
{
    assert(redundancy <= CANAEROSPACE_REDUNDANCY_MAX);
    return redundancy > 0 ? CAN_EFF_FLAG | (ids[quantity] + (redundancy << 16)) : ids[quantity];
}

void canaerospace_init(struct canaerospace *state, unsigned redundancy)
{
    *state = (struct canaerospace){.redundancy = redundancy};
}

static int quantity_of_id(const struct canaerospace *state, uint32_t can_id)
{
    if (can_id & (CAN_ERR_FLAG | CAN_RTR_FLAG))
        return -1;
    uint32_t id = can_id & (can_id & CAN_EFF_FLAG ? CAN_EFF_MASK : CAN_SFF_MASK);
    for (int i = 0; i < CAN_QUANTITIES; i++)
        if (ids[i] + (state->redundancy << 16) == id)
            return i;
    return -1;
}

/* Message codes go up by one with each message, or with each pair of halves. */
static void count_lost(struct canaerospace *state, struct canaerospace_channel *channel,
                       uint8_t code)
{
    if (channel->counted) {
        uint8_t step = (uint8_t)(code - channel->code);
        if (step > 1 && step < 128)
            state->lost += step - 1u;
    }
    channel->counted = true;
    channel->code = code;
}

static bool halves_pair(const struct canaerospace_channel *channel)
{
    const struct canaerospace_half *low = &channel->low, *high = &channel->high;
    if (!low->present || !high->present)
        return false;
    nsec_t apart_ns = llabs(low->time_ns - high->time_ns);
    if (low->code == high->code)
        return apart_ns <= PAIR_SAME_CODE_NS;
    int step = (int8_t)(uint8_t)(low->code - high->code);
    return !channel->halves_share_code && (step == 1 || step == -1) &&
           apart_ns <= PAIR_NEIGHBOUR_NS;
}

/* Returns true and the double where this half completes one. */
static bool take_half(struct canaerospace_channel *channel, bool high, uint8_t code, uint32_t word,
                      nsec_t now_ns, double *ret_value)
{
    struct canaerospace_half *half = high ? &channel->high : &channel->low;
    *half =
        (struct canaerospace_half){.present = true, .code = code, .word = word, .time_ns = now_ns};
    if (!halves_pair(channel))
        return false;
    channel->halves_share_code |= channel->low.code == channel->high.code;
    *ret_value = double_from_bits((uint64_t)channel->high.word << 32 | channel->low.word);
    channel->low.present = channel->high.present = false;
    return true;
}

static double double_from_short2(uint32_t word)
{
    double scale = (double)(int16_t)(uint16_t)word;
    return (double)(int16_t)(uint16_t)(word >> 16) / 32767.0 * scale;
}

/* Returns 1 with the value, 0 where a half waits for its other, -EBADMSG. */
static int decode_value(struct canaerospace_channel *channel, enum can_quantity quantity,
                        const struct can_frame *frame, nsec_t now_ns, double *ret_value,
                        struct rejection *ret_rejection)
{
    const char *name = can_quantity_name(quantity);
    if (frame->can_dlc < 8)
        return reject(ret_rejection, REJECT_SHORT, frame->can_dlc,
                      "%s (id %u) has %u bytes, 8 expected", name, ids[quantity], frame->can_dlc);
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
                      ids[quantity], type);
    else if (!take_half(channel, type == TYPE_DOUBLEH, code, word, now_ns, &number))
        return 0;
    int r = can_quantity_check(quantity, number, ids[quantity], 4, ret_rejection);
    if (r < 0)
        return r;
    *ret_value = number;
    return 1;
}

int canaerospace_take(struct canaerospace *state, const struct can_frame *frame, nsec_t now_ns,
                      struct pose_sample *ret_sample, struct rejection *ret_rejection)
{
    int quantity = quantity_of_id(state, frame->can_id);
    if (quantity < 0)
        return 0;
    state->frames++;
    struct canaerospace_channel *channel = &state->channels[quantity];
    double value = 0.0;
    int r =
        decode_value(channel, (enum can_quantity)quantity, frame, now_ns, &value, ret_rejection);
    if (r < 0)
        return r;
    count_lost(state, channel, frame->data[3]);
    return r == 0 ? 0
                  : can_assembly_take(&state->assembly, (enum can_quantity)quantity, value, now_ns,
                                      ret_sample);
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

static void put_word(struct canaerospace_encoder *encoder, enum can_quantity quantity, uint8_t type,
                     uint32_t word, struct can_frame *ret_frame)
{
    struct can_frame frame = {.can_id = canaerospace_id(quantity, encoder->redundancy),
                              .can_dlc = 8};
    frame.data[0] = encoder->node;
    frame.data[1] = type;
    frame.data[3] = encoder->codes[quantity];
    struct byte_writer out = {.data = frame.data, .size = 8, .offset = 4};
    byte_writer_put(&out, word, 4, true);
    *ret_frame = frame;
}

static size_t put_float(struct canaerospace_encoder *encoder, enum can_quantity quantity,
                        double value, struct can_frame *ret_frame)
{
    put_word(encoder, quantity, TYPE_FLOAT, bits_from_float((float)value), ret_frame);
    encoder->codes[quantity]++;
    return 1;
}

static size_t put_double(struct canaerospace_encoder *encoder, enum can_quantity quantity,
                         double value, struct can_frame ret_frames[2])
{
    uint64_t bits = bits_from_double(value);
    put_word(encoder, quantity, TYPE_DOUBLEL, (uint32_t)bits, &ret_frames[0]);
    put_word(encoder, quantity, TYPE_DOUBLEH, (uint32_t)(bits >> 32), &ret_frames[1]);
    encoder->codes[quantity]++;
    return 2;
}

size_t canaerospace_encode(struct canaerospace_encoder *encoder, const struct pose *pose,
                           struct can_frame ret_frames[CANAEROSPACE_FRAMES_MAX])
{
    struct can_frame *f = ret_frames;
    size_t n = 0;
    unsigned every = encoder->position_every ? encoder->position_every : 1;
    if (pose->valid & POSE_POSITION && encoder->count % every == 0) {
        n += put_double(encoder, CAN_GPS_LATITUDE, pose->position.lat_deg, f + n);
        n += put_double(encoder, CAN_GPS_LONGITUDE, pose->position.lon_deg, f + n);
        n += put_float(encoder, CAN_GPS_HEIGHT, pose->position.height_m, f + n);
    }
    encoder->count++;
    if (pose->valid & POSE_VELOCITY) {
        n += put_float(encoder, CAN_EAST, pose->velocity_ned_mps[1], f + n);
        n += put_float(encoder, CAN_NORTH, pose->velocity_ned_mps[0], f + n);
        n += put_float(encoder, CAN_UP, -pose->velocity_ned_mps[2], f + n);
    }
    if (pose->valid & POSE_RATES) {
        n += put_float(encoder, CAN_ROLL_RATE, pose->rates_body_dps[0], f + n);
        n += put_float(encoder, CAN_PITCH_RATE, pose->rates_body_dps[1], f + n);
        n += put_float(encoder, CAN_YAW_RATE, pose->rates_body_dps[2], f + n);
    }
    if (pose->valid & POSE_ATTITUDE) {
        double heading_deg = longitude_normalised_deg(pose->attitude.heading_deg);
        n += put_float(encoder, CAN_PITCH, pose->attitude.pitch_deg, f + n);
        n += put_float(encoder, CAN_ROLL, pose->attitude.roll_deg, f + n);
        n += put_float(encoder, CAN_TRUE_HEADING, heading_deg, f + n);
    }
    return n;
}
