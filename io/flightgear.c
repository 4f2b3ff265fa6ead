#include "io/flightgear.h"

#include <math.h>

#include "base/bytes.h"

/* Checked after conversion to our units; the offsets are FlightGear's. A body rate is made of all
 * three Euler rates, so one that is not finite is laid at the first. */
static const struct decode_field fields[] = {
    DECODE_FIELD(POSE_POSITION, position.lon_deg, 8, "longitude", "deg"),
    DECODE_FIELD(POSE_POSITION, position.lat_deg, 16, "latitude", "deg"),
    DECODE_FIELD(POSE_POSITION, position.height_m, 24, "altitude", "m"),
    DECODE_FIELD(POSE_ATTITUDE, attitude.roll_deg, 36, "phi", "deg"),
    DECODE_FIELD(POSE_ATTITUDE, attitude.pitch_deg, 40, "theta", "deg"),
    DECODE_FIELD(POSE_ATTITUDE, attitude.heading_deg, 44, "psi", "deg"),
    DECODE_FIELD(POSE_VELOCITY, velocity_ned_mps[0], 76, "v_north", "m/s"),
    DECODE_FIELD(POSE_VELOCITY, velocity_ned_mps[1], 80, "v_east", "m/s"),
    DECODE_FIELD(POSE_VELOCITY, velocity_ned_mps[2], 84, "v_down", "m/s"),
    DECODE_FIELD(POSE_RATES, rates_body_dps[0], 56, "phidot", "deg/s"),
    DECODE_FIELD(POSE_RATES, rates_body_dps[1], 60, "thetadot", "deg/s"),
    DECODE_FIELD(POSE_RATES, rates_body_dps[2], 64, "psidot", "deg/s"),
};
#define FIELDS (sizeof(fields) / sizeof(fields[0]))

#define DEG_PER_RAD   (180.0 / M_PI)
#define M_PER_FT      0.3048
#define AGL_UNKNOWN_M (-9000.0) /* FlightGear's own convention: at or below is "unknown" */
#define GUI_VERSION   8
#define GUI_SIZE      112
#define ENGINES_AT    120
#define TANKS_AT      284
#define WHEELS_AT_V24 304
#define WHEELS_AT_V25 448

static size_t size_of_version(uint32_t version)
{
    return version == 24 ? FLIGHTGEAR_SIZE_V24 : version == 25 ? FLIGHTGEAR_SIZE_V25 : 0;
}

bool flightgear_recognises(const void *data, size_t size)
{
    struct byte_reader in = byte_reader_over(data, size);
    size_t expected = size_of_version(read_u32be(&in));
    return expected && expected == size;
}

/* The usual mistakes have a sentence of their own. */
static int check_version(const void *data, size_t size, uint32_t *ret_version,
                         struct rejection *ret_rejection)
{
    struct byte_reader in = byte_reader_over(data, size);
    uint32_t version = read_u32be(&in);
    if (in.overrun)
        return reject(ret_rejection, REJECT_SHORT, size, "it ends at byte %zu, within the version",
                      size);
    uint32_t swapped = __builtin_bswap32(version);
    if (size_of_version(swapped))
        return reject(ret_rejection, REJECT_MAGIC, 0,
                      "FGNetFDM version %u in little-endian byte order seen, big-endian expected",
                      swapped);
    if ((version == GUI_VERSION || swapped == GUI_VERSION) && size == GUI_SIZE)
        return reject(ret_rejection, REJECT_MAGIC, 0,
                      "native-gui (FGNetGUI version 8) seen, native-fdm (FGNetFDM version 24 or 25)"
                      " expected: start FlightGear with --native-fdm");
    size_t expected = size_of_version(version);
    if (!expected)
        return reject(ret_rejection, REJECT_VERSION, 0,
                      "FGNetFDM version %u seen, 24 or 25 expected", version);
    if (size != expected)
        return reject(ret_rejection, size < expected ? REJECT_SHORT : REJECT_LENGTH,
                      size < expected ? size : expected,
                      "FGNetFDM version %u is %zu bytes, this has %zu", version, expected, size);
    *ret_version = version;
    return 0;
}

/* Body rates of Euler rates (radians per second), e.g. Stevens and Lewis, eq. 1.3-22. */
static void body_rates_from_euler(double roll, double pitch, const double euler[3],
                                  double ret_body[3])
{
    ret_body[0] = euler[0] - euler[2] * sin(pitch);
    ret_body[1] = euler[1] * cos(roll) + euler[2] * cos(pitch) * sin(roll);
    ret_body[2] = euler[2] * cos(pitch) * cos(roll) - euler[1] * sin(roll);
}

static void euler_rates_from_body(double roll, double pitch, const double body[3],
                                  double ret_euler[3])
{
    double c = cos(pitch);
    if (fabs(c) < 1e-6) /* straight up or down the yaw rate is undefined; keep it finite */
        c = copysign(1e-6, c);
    ret_euler[2] = (body[1] * sin(roll) + body[2] * cos(roll)) / c;
    ret_euler[1] = body[1] * cos(roll) - body[2] * sin(roll);
    ret_euler[0] = body[0] + ret_euler[2] * sin(pitch);
}

static void read_pose(struct byte_reader *in, struct pose *pose, double *ret_agl_m)
{
    byte_reader_seek(in, 8);
    pose->position.lon_deg = read_f64be(in) * DEG_PER_RAD;
    pose->position.lat_deg = read_f64be(in) * DEG_PER_RAD;
    pose->position.height_m = read_f64be(in);
    double agl_m = (double)read_f32be(in);
    *ret_agl_m = agl_m > AGL_UNKNOWN_M && isfinite(agl_m) ? agl_m : NAN;
    double roll = (double)read_f32be(in), pitch = (double)read_f32be(in);
    pose->attitude = (struct attitude){.roll_deg = roll * DEG_PER_RAD,
                                       .pitch_deg = pitch * DEG_PER_RAD,
                                       .heading_deg = (double)read_f32be(in) * DEG_PER_RAD};
    byte_reader_seek(in, 56);
    double euler[3];
    for (int i = 0; i < 3; i++)
        euler[i] = (double)read_f32be(in);
    body_rates_from_euler(roll, pitch, euler, pose->rates_body_dps);
    byte_reader_seek(in, 76);
    for (int i = 0; i < 3; i++) {
        pose->rates_body_dps[i] *= DEG_PER_RAD;
        pose->velocity_ned_mps[i] = (double)read_f32be(in) * M_PER_FT;
    }
    pose->valid = POSE_POSITION | POSE_ATTITUDE | POSE_VELOCITY | POSE_RATES;
}

static unsigned read_count(struct byte_reader *in, size_t offset, unsigned room)
{
    byte_reader_seek(in, offset);
    uint32_t count = read_u32be(in);
    return count < room ? count : room;
}

int flightgear_decode(const void *data, size_t size, struct flightgear_fdm *ret_fdm,
                      struct rejection *ret_rejection)
{
    struct flightgear_fdm fdm = {.sample.datum = ALTITUDE_EGM96};
    int r = check_version(data, size, &fdm.version, ret_rejection);
    if (r < 0)
        return r;
    struct byte_reader in = byte_reader_over(data, size);
    read_pose(&in, &fdm.sample.pose, &fdm.agl_m);
    r = decode_check_fields(&fdm.sample.pose, fields, FIELDS, ret_rejection);
    if (r < 0)
        return r;
    decode_normalise(&fdm.sample.pose);
    fdm.engines = read_count(&in, ENGINES_AT, FLIGHTGEAR_ENGINES);
    fdm.tanks = read_count(&in, TANKS_AT, FLIGHTGEAR_TANKS);
    fdm.wheels =
        read_count(&in, fdm.version == 24 ? WHEELS_AT_V24 : WHEELS_AT_V25, FLIGHTGEAR_WHEELS);
    for (unsigned i = 0; i < fdm.wheels; i++)
        fdm.wheels_on_ground += read_u32be(&in) != 0;
    *ret_fdm = fdm;
    return 0;
}

static void put_f32(uint8_t *data, size_t offset, double value)
{
    struct byte_writer out = {.data = data, .size = FLIGHTGEAR_SIZE_V24, .offset = offset};
    byte_writer_put(&out, bits_from_float((float)value), 4, true);
}

static void put_f64(uint8_t *data, size_t offset, double value)
{
    struct byte_writer out = {.data = data, .size = FLIGHTGEAR_SIZE_V24, .offset = offset};
    byte_writer_put(&out, bits_from_double(value), 8, true);
}

static void put_u32(uint8_t *data, size_t offset, uint32_t value)
{
    struct byte_writer out = {.data = data, .size = FLIGHTGEAR_SIZE_V24, .offset = offset};
    byte_writer_put(&out, value, 4, true);
}

static void put_motion(uint8_t *data, const struct pose *pose)
{
    double roll = pose->attitude.roll_deg / DEG_PER_RAD;
    double pitch = pose->attitude.pitch_deg / DEG_PER_RAD;
    if (pose->valid & POSE_ATTITUDE) {
        put_f32(data, 36, roll);
        put_f32(data, 40, pitch);
        put_f32(data, 44, pose->attitude.heading_deg / DEG_PER_RAD);
    }
    if (pose->valid & POSE_RATES) {
        double body[3], euler[3];
        for (int i = 0; i < 3; i++)
            body[i] = pose->rates_body_dps[i] / DEG_PER_RAD;
        euler_rates_from_body(roll, pitch, body, euler);
        for (int i = 0; i < 3; i++)
            put_f32(data, 56 + 4 * (size_t)i, euler[i]);
    }
    if (pose->valid & POSE_VELOCITY) {
        put_f32(data, 72, -pose->velocity_ned_mps[2] / M_PER_FT);
        for (int i = 0; i < 3; i++)
            put_f32(data, 76 + 4 * (size_t)i, pose->velocity_ned_mps[i] / M_PER_FT);
    }
}

void flightgear_encode(const struct flightgear_fdm *fdm, uint8_t ret_data[FLIGHTGEAR_SIZE_V24])
{
    const struct pose *pose = &fdm->sample.pose;
    memset(ret_data, 0, FLIGHTGEAR_SIZE_V24);
    put_u32(ret_data, 0, 24);
    put_f64(ret_data, 8, pose->position.lon_deg / DEG_PER_RAD);
    put_f64(ret_data, 16, pose->position.lat_deg / DEG_PER_RAD);
    put_f64(ret_data, 24, pose->position.height_m);
    put_f32(ret_data, 32, isfinite(fdm->agl_m) ? fdm->agl_m : AGL_UNKNOWN_M);
    put_motion(ret_data, pose);
    put_u32(ret_data, ENGINES_AT, fdm->engines);
    put_u32(ret_data, TANKS_AT, fdm->tanks);
    put_u32(ret_data, WHEELS_AT_V24, fdm->wheels);
    for (unsigned i = 0; i < fdm->wheels && i < FLIGHTGEAR_WHEELS; i++)
        put_u32(ret_data, WHEELS_AT_V24 + 4 + 4 * (size_t)i, i < fdm->wheels_on_ground);
}
