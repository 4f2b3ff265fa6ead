#include "io/dis.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "base/bytes.h"
#include "geo/geographic.h"

#define RAD_PER_DEG   (M_PI / 180.0)
#define TYPE_STATE    1
#define FAMILY_ENTITY 1
#define CHARSET_ASCII 1
#define VERSION_LEAST 5
#define VERSION_MOST  7
#define PLACE_LEAST_M 6.3e6 /* from the centre: deeper than any sea at the poles */
#define PLACE_MOST_M  1e8
#define ACCEL_MOST    1e5 /* m/s^2 */

int dis_id_parse(const char *text, struct dis_id *ret_id)
{
    uint16_t numbers[3];
    for (int i = 0; i < 3; i++) {
        char *end;
        unsigned long number = strtoul(text, &end, 10);
        if (*text < '0' || *text > '9' || number > UINT16_MAX || *end != (i < 2 ? ':' : '\0'))
            return -EINVAL;
        numbers[i] = (uint16_t)number;
        text = end + 1;
    }
    if (!numbers[0] && !numbers[1] && !numbers[2])
        return -EINVAL;
    *ret_id = (struct dis_id){numbers[0], numbers[1], numbers[2]};
    return 0;
}

bool dis_recognises(const void *data, size_t size)
{
    struct byte_reader in = byte_reader_over(data, size);
    unsigned version = read_u8(&in);
    read_u8(&in);
    return version >= VERSION_LEAST && version <= VERSION_MOST && read_u8(&in) == TYPE_STATE &&
           read_u8(&in) == FAMILY_ENTITY && size >= DIS_ENTITY_STATE_SIZE;
}

/* Leaves `in` behind the header. Returns 0, DIS_OTHER_PDU or -EBADMSG. */
static int read_header(struct byte_reader *in, struct dis_entity *entity, size_t *ret_size,
                       struct rejection *ret_rejection)
{
    if (in->size < DIS_HEADER_SIZE)
        return reject(ret_rejection, REJECT_SHORT, in->size,
                      "it ends at byte %zu, within the PDU header", in->size);
    entity->version = read_u8(in);
    entity->exercise = read_u8(in);
    unsigned type = read_u8(in), family = read_u8(in);
    entity->timestamp = read_u32be(in);
    size_t length = read_u16be(in);
    read_u16be(in); /* status, padding */
    if (length < DIS_HEADER_SIZE || length > in->size)
        return reject(ret_rejection, length > in->size ? REJECT_SHORT : REJECT_LENGTH, 8,
                      "its header says %zu bytes of the %zu that there are", length, in->size);
    if (entity->version < VERSION_LEAST || entity->version > VERSION_MOST)
        return reject(ret_rejection, REJECT_VERSION, 0, "DIS version %u seen, %d to %d expected",
                      entity->version, VERSION_LEAST, VERSION_MOST);
    *ret_size = length;
    if (type != TYPE_STATE || family != FAMILY_ENTITY)
        return DIS_OTHER_PDU;
    if (length < DIS_ENTITY_STATE_SIZE)
        return reject(ret_rejection, REJECT_SHORT, length,
                      "an Entity State PDU has at least %d bytes, this has %zu",
                      DIS_ENTITY_STATE_SIZE, length);
    return 0;
}

static void read_identity(struct byte_reader *in, struct dis_entity *entity)
{
    entity->id.site = read_u16be(in);
    entity->id.application = read_u16be(in);
    entity->id.entity = read_u16be(in);
    entity->force = read_u8(in);
    read_u8(in); /* articulations, which the length has told of */
    entity->kind = read_u8(in);
    entity->domain = read_u8(in);
    entity->country = read_u16be(in);
    entity->category = read_u8(in);
    entity->subcategory = read_u8(in);
    entity->specific = read_u8(in);
    entity->extra = read_u8(in);
}

/* Three numbers of at most `limit`; sets them to zero where they are not used. */
static int read_triple(struct byte_reader *in, size_t offset, bool used, double limit,
                       const char *name, double ret[3], struct rejection *ret_rejection)
{
    byte_reader_seek(in, offset);
    for (size_t i = 0; i < 3; i++) {
        double value = (double)read_f32be(in);
        if (used && !isfinite(value))
            return reject(ret_rejection, REJECT_NOT_FINITE, offset + 4 * i,
                          "%s at byte %zu is not a finite number", name, offset + 4 * i);
        if (used && fabs(value) > limit)
            return reject(ret_rejection, REJECT_RANGE, offset + 4 * i,
                          "%s at byte %zu is %g, beyond %g", name, offset + 4 * i, value, limit);
        ret[i] = used ? value : 0.0;
    }
    return 0;
}

static int read_place(struct byte_reader *in, struct dis_motion *motion,
                      struct rejection *ret_rejection)
{
    byte_reader_seek(in, 48);
    double square = 0.0;
    for (size_t i = 0; i < 3; i++) {
        double value = read_f64be(in);
        if (!isfinite(value))
            return reject(ret_rejection, REJECT_NOT_FINITE, 48 + 8 * i,
                          "location at byte %zu is not a finite number", 48 + 8 * i);
        motion->position_ecef_m[i] = value;
        square += value * value;
    }
    double distance_m = sqrt(square);
    if (distance_m < PLACE_LEAST_M || distance_m > PLACE_MOST_M)
        return reject(ret_rejection, REJECT_RANGE, 48,
                      "its location is %g m from the Earth's centre, which is no place of a visual",
                      distance_m);
    return 0;
}

static int read_motion(struct byte_reader *in, struct dis_motion *motion,
                       struct rejection *ret_rejection)
{
    byte_reader_seek(in, 88);
    unsigned algorithm = read_u8(in);
    motion->algorithm =
        algorithm < DIS_ALGORITHMS ? (enum dis_algorithm)algorithm : DIS_OTHER_ALGORITHM;
    bool moves = motion->algorithm > DIS_STATIC;
    double euler_rad[3] = {0};
    int r = read_place(in, motion, ret_rejection);
    if (r == 0)
        r = read_triple(in, 72, true, 4.0 * M_PI, "orientation", euler_rad, ret_rejection);
    if (r == 0)
        r = read_triple(in, 36, moves, DECODE_SPEED_MAX_MPS, "velocity", motion->velocity_mps,
                        ret_rejection);
    if (r == 0)
        r = read_triple(in, 104, dis_algorithm_accelerates(motion->algorithm), ACCEL_MOST,
                        "acceleration", motion->acceleration_mps2, ret_rejection);
    if (r == 0)
        r = read_triple(in, 116, dis_algorithm_turns(motion->algorithm),
                        DECODE_RATE_MAX_DPS * RAD_PER_DEG, "angular velocity",
                        motion->rates_body_radps, ret_rejection);
    const struct attitude about_ecef = {.heading_deg = euler_rad[0] / RAD_PER_DEG,
                                        .pitch_deg = euler_rad[1] / RAD_PER_DEG,
                                        .roll_deg = euler_rad[2] / RAD_PER_DEG};
    motion->orientation = ned_quaternion_from_attitude(&about_ecef);
    return r;
}

static bool wanted(const struct dis_filter *filter, const struct dis_entity *entity)
{
    struct dis_id id = filter->id;
    bool any = !id.site && !id.application && !id.entity;
    return (!filter->exercise || entity->exercise == filter->exercise) &&
           (any || (entity->id.site == id.site && entity->id.application == id.application &&
                    entity->id.entity == id.entity));
}

int dis_decode(const void *data, size_t size, const struct dis_filter *filter, size_t *ret_size,
               struct dis_entity *ret_entity, struct rejection *ret_rejection)
{
    struct byte_reader in = byte_reader_over(data, size);
    struct dis_entity entity = {0};
    size_t length = 0;
    int r = read_header(&in, &entity, &length, ret_rejection);
    if (r < 0)
        return r;
    *ret_size = length;
    if (r == 0)
        read_identity(&in, &entity);
    if (r != 0 || !wanted(filter, &entity))
        return DIS_OTHER_PDU;
    r = read_motion(&in, &entity.motion, ret_rejection);
    if (r < 0)
        return r;
    byte_reader_seek(&in, 84);
    entity.appearance = read_u32be(&in);
    byte_reader_seek(&in, 128);
    if (read_u8(&in) == CHARSET_ASCII)
        for (int i = 0; i < DIS_MARKING_SIZE; i++)
            entity.marking[i] = (char)read_u8(&in);
    if (entity.kind == DIS_PLATFORM && entity.appearance & DIS_FROZEN)
        entity.motion.algorithm = DIS_STATIC;
    *ret_entity = entity;
    return 0;
}

static void put_triple(struct byte_writer *out, size_t offset, const double values[3])
{
    out->offset = offset;
    for (int i = 0; i < 3; i++)
        byte_writer_put(out, bits_from_float((float)values[i]), 4, true);
}

static void put_type(struct byte_writer *out, const struct dis_entity *entity)
{
    const uint8_t first[] = {entity->kind, entity->domain};
    const uint8_t last[] = {entity->category, entity->subcategory, entity->specific, entity->extra};
    for (size_t i = 0; i < sizeof(first); i++)
        byte_writer_put(out, first[i], 1, true);
    byte_writer_put(out, entity->country, 2, true);
    for (size_t i = 0; i < sizeof(last); i++)
        byte_writer_put(out, last[i], 1, true);
}

static void put_head(struct byte_writer *out, const struct dis_entity *entity)
{
    byte_writer_put(out, entity->version, 1, true);
    byte_writer_put(out, entity->exercise, 1, true);
    byte_writer_put(out, TYPE_STATE, 1, true);
    byte_writer_put(out, FAMILY_ENTITY, 1, true);
    byte_writer_put(out, entity->timestamp, 4, true);
    byte_writer_put(out, DIS_ENTITY_STATE_SIZE, 2, true);
    byte_writer_put(out, 0, 2, true);
    byte_writer_put(out, entity->id.site, 2, true);
    byte_writer_put(out, entity->id.application, 2, true);
    byte_writer_put(out, entity->id.entity, 2, true);
    byte_writer_put(out, entity->force, 1, true);
    byte_writer_put(out, 0, 1, true); /* articulations */
    put_type(out, entity);
    put_type(out, entity); /* as others see it */
}

void dis_encode(const struct dis_entity *entity, uint8_t ret_data[DIS_ENTITY_STATE_SIZE])
{
    struct byte_writer out = {.data = ret_data, .size = DIS_ENTITY_STATE_SIZE};
    const struct dis_motion *motion = &entity->motion;
    memset(ret_data, 0, DIS_ENTITY_STATE_SIZE);
    put_head(&out, entity);
    put_triple(&out, 36, motion->velocity_mps);
    for (int i = 0; i < 3; i++)
        byte_writer_put(&out, bits_from_double(motion->position_ecef_m[i]), 8, true);
    struct attitude about_ecef = attitude_from_ned_quaternion(motion->orientation);
    const double euler_rad[3] = {longitude_normalised_deg(about_ecef.heading_deg) * RAD_PER_DEG,
                                 about_ecef.pitch_deg * RAD_PER_DEG,
                                 about_ecef.roll_deg * RAD_PER_DEG};
    put_triple(&out, 72, euler_rad);
    byte_writer_put(&out, entity->appearance, 4, true);
    byte_writer_put(&out, motion->algorithm, 1, true);
    put_triple(&out, 104, motion->acceleration_mps2);
    put_triple(&out, 116, motion->rates_body_radps);
    byte_writer_put(&out, CHARSET_ASCII, 1, true);
    for (int i = 0; i < DIS_MARKING_SIZE && entity->marking[i]; i++)
        byte_writer_put(&out, (uint8_t)entity->marking[i], 1, true);
}

void pose_from_dis_motion(const struct dis_motion *motion, struct pose *ret_pose)
{
    struct pose pose = {.valid = POSE_POSITION | POSE_ATTITUDE | POSE_VELOCITY | POSE_RATES};
    double axes[3][3], body[3][3], velocity_ecef_mps[3];
    geodetic_from_geocentric(motion->position_ecef_m, &pose.position);
    pose.attitude = attitude_from_ecef_quaternion(&pose.position, motion->orientation);
    memcpy(velocity_ecef_mps, motion->velocity_mps, sizeof(velocity_ecef_mps));
    if (dis_algorithm_in_body(motion->algorithm)) {
        matrix_from_quaternion(motion->orientation, body);
        frames_rotate(body, motion->velocity_mps, velocity_ecef_mps);
    }
    frames_ned_axes_ecef(pose.position.lat_deg, pose.position.lon_deg, axes);
    frames_rotate(axes, velocity_ecef_mps, pose.velocity_ned_mps);
    for (int i = 0; i < 3; i++)
        pose.rates_body_dps[i] = motion->rates_body_radps[i] / RAD_PER_DEG;
    *ret_pose = pose;
}

void dis_motion_from_pose(const struct pose *pose, struct dis_motion *ret_motion)
{
    bool moves = pose->valid & POSE_VELOCITY, turns = moves && pose->valid & POSE_RATES;
    const struct attitude level = {0};
    struct dis_motion motion = {.algorithm = turns ? DIS_RPW : moves ? DIS_FPW : DIS_STATIC};
    geocentric_from_geodetic(&pose->position, motion.position_ecef_m);
    motion.orientation = ecef_quaternion_from_attitude(
        &pose->position, pose->valid & POSE_ATTITUDE ? &pose->attitude : &level);
    if (moves) {
        double axes[3][3];
        frames_ned_axes_ecef(pose->position.lat_deg, pose->position.lon_deg, axes);
        frames_rotate_back(axes, pose->velocity_ned_mps, motion.velocity_mps);
    }
    for (int i = 0; turns && i < 3; i++)
        motion.rates_body_radps[i] = pose->rates_body_dps[i] * RAD_PER_DEG;
    *ret_motion = motion;
}
