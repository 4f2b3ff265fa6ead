#include "io/xplane.h"

#include <math.h>
#include <stdio.h>

#include "base/bytes.h"

#define DEG_PER_RAD (180.0 / M_PI)
#define HEAD_SIZE   5 /* four letters and a byte */

/* The order of the wire: doubles first. */
static const struct decode_field rpos_fields[] = {
    DECODE_FIELD(POSE_POSITION, position.lon_deg, 5, "longitude", "deg"),
    DECODE_FIELD(POSE_POSITION, position.lat_deg, 13, "latitude", "deg"),
    DECODE_FIELD(POSE_POSITION, position.height_m, 21, "elevation", "m"),
    DECODE_FIELD(POSE_ATTITUDE, attitude.pitch_deg, 33, "pitch", "deg"),
    DECODE_FIELD(POSE_ATTITUDE, attitude.heading_deg, 37, "heading", "deg"),
    DECODE_FIELD(POSE_ATTITUDE, attitude.roll_deg, 41, "roll", "deg"),
    DECODE_FIELD(POSE_VELOCITY, velocity_ned_mps[1], 45, "vx", "m/s"),
    DECODE_FIELD(POSE_VELOCITY, velocity_ned_mps[2], 49, "vy", "m/s"),
    DECODE_FIELD(POSE_VELOCITY, velocity_ned_mps[0], 53, "vz", "m/s"),
    DECODE_FIELD(POSE_RATES, rates_body_dps[0], 57, "P", "deg/s"),
    DECODE_FIELD(POSE_RATES, rates_body_dps[1], 61, "Q", "deg/s"),
    DECODE_FIELD(POSE_RATES, rates_body_dps[2], 65, "R", "deg/s"),
};

static const struct decode_field vehx_fields[] = {
    DECODE_FIELD(POSE_POSITION, position.lat_deg, 9, "latitude", "deg"),
    DECODE_FIELD(POSE_POSITION, position.lon_deg, 17, "longitude", "deg"),
    DECODE_FIELD(POSE_POSITION, position.height_m, 25, "elevation", "m"),
    DECODE_FIELD(POSE_ATTITUDE, attitude.heading_deg, 33, "heading", "deg"),
    DECODE_FIELD(POSE_ATTITUDE, attitude.pitch_deg, 37, "pitch", "deg"),
    DECODE_FIELD(POSE_ATTITUDE, attitude.roll_deg, 41, "roll", "deg"),
};

#define COUNT(fields) (sizeof(fields) / sizeof((fields)[0]))

/* The length that a message with these letters has; 0 where they are none of ours. */
static size_t size_of_letters(const void *data)
{
    if (memcmp(data, "RPOS", 4) == 0)
        return XPLANE_RPOS_SIZE;
    return memcmp(data, "VEHX", 4) == 0 || memcmp(data, "VEHS", 4) == 0 ? XPLANE_VEHX_SIZE : 0;
}

bool xplane_recognises(const void *data, size_t size)
{
    return size > HEAD_SIZE && size_of_letters(data) == size;
}

static int check_size(const uint8_t *data, size_t size, struct rejection *ret_rejection)
{
    if (size < HEAD_SIZE)
        return reject(ret_rejection, REJECT_SHORT, size, "it ends at byte %zu, within the head",
                      size);
    size_t expected = size_of_letters(data);
    bool letters = true;
    for (int i = 0; i < 4; i++)
        letters = letters && data[i] >= 'A' && data[i] <= 'Z';
    if (!expected && letters)
        return reject(ret_rejection, REJECT_MAGIC, 0, "%.4s seen, RPOS or VEHX expected",
                      (const char *)data);
    if (!expected)
        return reject(ret_rejection, REJECT_MAGIC, 0, "it is not an X-Plane message");
    if (size != expected)
        return reject(ret_rejection, size < expected ? REJECT_SHORT : REJECT_LENGTH,
                      size < expected ? size : expected, "%.4s is %zu bytes, this has %zu",
                      (const char *)data, expected, size);
    return 0;
}

static void read_rpos(struct byte_reader *in, struct xplane_pose *ret)
{
    struct pose *pose = &ret->sample.pose;
    pose->position.lon_deg = read_f64le(in);
    pose->position.lat_deg = read_f64le(in);
    pose->position.height_m = read_f64le(in);
    ret->agl_m = (double)read_f32le(in);
    pose->attitude.pitch_deg = (double)read_f32le(in);
    pose->attitude.heading_deg = (double)read_f32le(in);
    pose->attitude.roll_deg = (double)read_f32le(in);
    pose->velocity_ned_mps[1] = (double)read_f32le(in);
    pose->velocity_ned_mps[2] = -(double)read_f32le(in); /* up */
    pose->velocity_ned_mps[0] = -(double)read_f32le(in); /* south */
    for (int i = 0; i < 3; i++)
        pose->rates_body_dps[i] = (double)read_f32le(in) * DEG_PER_RAD;
    pose->valid = POSE_POSITION | POSE_ATTITUDE | POSE_VELOCITY | POSE_RATES;
    ret->subscribed = true;
}

static void read_vehx(struct byte_reader *in, struct xplane_pose *ret)
{
    struct pose *pose = &ret->sample.pose;
    ret->aircraft = (int32_t)read_u32le(in);
    pose->position.lat_deg = read_f64le(in);
    pose->position.lon_deg = read_f64le(in);
    pose->position.height_m = read_f64le(in);
    pose->attitude.heading_deg = (double)read_f32le(in);
    pose->attitude.pitch_deg = (double)read_f32le(in);
    pose->attitude.roll_deg = (double)read_f32le(in);
    pose->valid = POSE_POSITION | POSE_ATTITUDE;
}

int xplane_decode(const void *data, size_t size, struct xplane_pose *ret_pose,
                  struct rejection *ret_rejection)
{
    struct xplane_pose result = {.sample.datum = ALTITUDE_EGM96, .agl_m = NAN};
    int r = check_size(data, size, ret_rejection);
    if (r < 0)
        return r;
    struct byte_reader in = byte_reader_over(data, size);
    byte_reader_seek(&in, HEAD_SIZE);
    bool rpos = size == XPLANE_RPOS_SIZE;
    (rpos ? read_rpos : read_vehx)(&in, &result);
    r = decode_check_fields(&result.sample.pose, rpos ? rpos_fields : vehx_fields,
                            rpos ? COUNT(rpos_fields) : COUNT(vehx_fields), ret_rejection);
    if (r < 0)
        return r;
    if (!isfinite(result.agl_m))
        result.agl_m = NAN;
    decode_normalise(&result.sample.pose);
    *ret_pose = result;
    return 0;
}

static void put_f64(struct byte_writer *out, double value)
{
    byte_writer_put(out, bits_from_double(value), 8, false);
}

static void put_f32(struct byte_writer *out, double value)
{
    byte_writer_put(out, bits_from_float((float)value), 4, false);
}

/* The pose with zero for what it does not claim. */
static struct pose claimed(const struct pose *pose)
{
    struct pose result = {.position = pose->position};
    if (pose->valid & POSE_ATTITUDE)
        result.attitude = pose->attitude;
    if (pose->valid & POSE_VELOCITY)
        memcpy(result.velocity_ned_mps, pose->velocity_ned_mps, sizeof(result.velocity_ned_mps));
    if (pose->valid & POSE_RATES)
        memcpy(result.rates_body_dps, pose->rates_body_dps, sizeof(result.rates_body_dps));
    return result;
}

void xplane_encode_rpos(const struct xplane_pose *pose, uint8_t ret_data[XPLANE_RPOS_SIZE])
{
    struct byte_writer out = {.data = ret_data, .size = XPLANE_RPOS_SIZE, .offset = HEAD_SIZE};
    struct pose p = claimed(&pose->sample.pose);
    memcpy(ret_data, "RPOS4", HEAD_SIZE);
    put_f64(&out, p.position.lon_deg);
    put_f64(&out, p.position.lat_deg);
    put_f64(&out, p.position.height_m);
    put_f32(&out, isfinite(pose->agl_m) ? pose->agl_m : 0.0);
    put_f32(&out, p.attitude.pitch_deg);
    put_f32(&out, p.attitude.heading_deg);
    put_f32(&out, p.attitude.roll_deg);
    put_f32(&out, p.velocity_ned_mps[1]);
    put_f32(&out, -p.velocity_ned_mps[2]);
    put_f32(&out, -p.velocity_ned_mps[0]);
    for (int i = 0; i < 3; i++)
        put_f32(&out, p.rates_body_dps[i] / DEG_PER_RAD);
}

void xplane_encode_vehx(const struct xplane_pose *pose, uint8_t ret_data[XPLANE_VEHX_SIZE])
{
    struct byte_writer out = {.data = ret_data, .size = XPLANE_VEHX_SIZE, .offset = HEAD_SIZE};
    struct pose p = claimed(&pose->sample.pose);
    memcpy(ret_data, "VEHX", HEAD_SIZE); /* with its zero */
    byte_writer_put(&out, (uint32_t)pose->aircraft, 4, false);
    put_f64(&out, p.position.lat_deg);
    put_f64(&out, p.position.lon_deg);
    put_f64(&out, p.position.height_m);
    put_f32(&out, p.attitude.heading_deg);
    put_f32(&out, p.attitude.pitch_deg);
    put_f32(&out, p.attitude.roll_deg);
}

size_t xplane_encode_request(unsigned rate_hz, uint8_t ret_data[XPLANE_REQUEST_MAX])
{
    memcpy(ret_data, "RPOS", HEAD_SIZE);
    int digits =
        snprintf((char *)ret_data + HEAD_SIZE, XPLANE_REQUEST_MAX - HEAD_SIZE, "%u", rate_hz);
    return HEAD_SIZE + (size_t)digits + 1;
}

bool xplane_subscription_due(struct xplane_subscription *subscription, nsec_t now_ns)
{
    nsec_t since_asked_ns = now_ns - subscription->asked_ns;
    bool silent = now_ns - subscription->heard_ns >= XPLANE_SILENCE_NS;
    bool due = !subscription->asked || since_asked_ns >= XPLANE_RENEWAL_NS ||
               (silent && since_asked_ns >= XPLANE_SILENCE_NS);
    if (due) {
        subscription->asked = true;
        subscription->asked_ns = now_ns;
    }
    return due;
}
