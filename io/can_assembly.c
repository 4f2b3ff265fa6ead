/* When a pose leaves: when every angle has come that comes as often as the one at hand, or when an
 * angle comes round a second time (another was lost). So pitch, roll and heading of one minor frame
 * leave together, and a slow heading does not hold up a fast pitch. */
#include "io/can_assembly.h"

#include <math.h>
#include <string.h>

#include "geo/frames.h"

#define RAD_PER_DEG (M_PI / 180.0)

#define LENGTH(array) (sizeof(array) / sizeof((array)[0]))

static const struct {
    double limit; /* of its magnitude */
    const char *name;
} quantities[CAN_QUANTITIES] = {
    [CAN_PITCH_RATE] = {DECODE_RATE_MAX_DPS, "pitch rate"},
    [CAN_ROLL_RATE] = {DECODE_RATE_MAX_DPS, "roll rate"},
    [CAN_YAW_RATE] = {DECODE_RATE_MAX_DPS, "yaw rate"},
    [CAN_PITCH] = {DECODE_ANGLE_MAX_DEG, "pitch"},
    [CAN_ROLL] = {DECODE_ANGLE_MAX_DEG, "roll"},
    [CAN_TRUE_HEADING] = {DECODE_ANGLE_MAX_DEG, "true heading"},
    [CAN_HEADING] = {DECODE_ANGLE_MAX_DEG, "heading"},
    [CAN_MAGNETIC_HEADING] = {DECODE_ANGLE_MAX_DEG, "magnetic heading"},
    [CAN_MAGNETIC_VARIATION] = {DECODE_ANGLE_MAX_DEG, "magnetic variation"},
    [CAN_GPS_LATITUDE] = {90.0, "GPS latitude"},
    [CAN_GPS_LONGITUDE] = {DECODE_LON_MAX_DEG, "GPS longitude"},
    [CAN_GPS_HEIGHT] = {DECODE_HEIGHT_MAX_M, "GPS height"},
    [CAN_INS_LATITUDE] = {90.0, "INS latitude"},
    [CAN_INS_LONGITUDE] = {DECODE_LON_MAX_DEG, "INS longitude"},
    [CAN_INS_HEIGHT] = {DECODE_HEIGHT_MAX_M, "INS height"},
    [CAN_TRUE_ALTITUDE] = {DECODE_HEIGHT_MAX_M, "true altitude"},
    [CAN_BARO_ALTITUDE] = {DECODE_HEIGHT_MAX_M, "baro corrected altitude"},
    [CAN_NORTH] = {DECODE_SPEED_MAX_MPS, "north velocity"},
    [CAN_EAST] = {DECODE_SPEED_MAX_MPS, "east velocity"},
    [CAN_UP] = {DECODE_SPEED_MAX_MPS, "up velocity"},
    [CAN_ALTITUDE_RATE] = {DECODE_SPEED_MAX_MPS, "altitude rate"},
    [CAN_GPS_SPEED] = {DECODE_SPEED_MAX_MPS, "GPS ground speed"},
    [CAN_GPS_TRACK] = {DECODE_ANGLE_MAX_DEG, "GPS true track"},
    [CAN_INS_SPEED] = {DECODE_SPEED_MAX_MPS, "INS ground speed"},
    [CAN_INS_TRACK] = {DECODE_ANGLE_MAX_DEG, "INS true track"},
    [CAN_BODY_FORWARD] = {DECODE_SPEED_MAX_MPS, "body longitudinal velocity"},
    [CAN_BODY_RIGHT] = {DECODE_SPEED_MAX_MPS, "body lateral velocity"},
    [CAN_BODY_UP] = {DECODE_SPEED_MAX_MPS, "body normal velocity"},
};

static const enum can_quantity headings[] = {CAN_TRUE_HEADING, CAN_HEADING, CAN_MAGNETIC_HEADING};
static const enum can_quantity angles[] = {CAN_PITCH, CAN_ROLL, CAN_TRUE_HEADING, CAN_HEADING,
                                           CAN_MAGNETIC_HEADING};

const char *can_quantity_name(enum can_quantity quantity)
{
    return quantities[quantity].name;
}

int can_quantity_check(enum can_quantity quantity, double value, uint32_t id, size_t offset,
                       struct rejection *ret_rejection)
{
    const char *name = quantities[quantity].name;
    if (!isfinite(value))
        return reject(ret_rejection, REJECT_NOT_FINITE, offset, "%s (id %u) is not a finite number",
                      name, id);
    if (fabs(value) > quantities[quantity].limit)
        return reject(ret_rejection, REJECT_RANGE, offset, "%s (id %u) is %g, beyond %g", name, id,
                      value, quantities[quantity].limit);
    return 0;
}

static bool live(const struct can_assembly *assembly, enum can_quantity quantity, nsec_t now_ns)
{
    const struct can_piece *piece = &assembly->pieces[quantity];
    return piece->known && now_ns - piece->time_ns <= CAN_STALE_NS;
}

static double number(const struct can_assembly *assembly, enum can_quantity quantity)
{
    return assembly->pieces[quantity].value;
}

/* The true heading, by whichever of the headings there is. */
static bool find_heading(const struct can_assembly *assembly, nsec_t now_ns, double *ret_deg)
{
    size_t i = 0;
    while (i < LENGTH(headings) && !live(assembly, headings[i], now_ns))
        i++;
    if (i == LENGTH(headings))
        return false;
    bool magnetic = headings[i] == CAN_MAGNETIC_HEADING;
    if (magnetic && !live(assembly, CAN_MAGNETIC_VARIATION, now_ns))
        return false;
    double variation_deg = magnetic ? number(assembly, CAN_MAGNETIC_VARIATION) : 0.0;
    *ret_deg = number(assembly, headings[i]) + variation_deg;
    return true;
}

static void add_attitude(const struct can_assembly *assembly, nsec_t now_ns, struct pose *pose)
{
    double heading_deg;
    if (!live(assembly, CAN_PITCH, now_ns) || !live(assembly, CAN_ROLL, now_ns) ||
        !find_heading(assembly, now_ns, &heading_deg))
        return;
    pose->valid |= POSE_ATTITUDE;
    pose->attitude = (struct attitude){.roll_deg = number(assembly, CAN_ROLL),
                                       .pitch_deg = number(assembly, CAN_PITCH),
                                       .heading_deg = heading_deg};
}

static bool along_track(const struct can_assembly *assembly, enum can_quantity speed, nsec_t now_ns,
                        double ret_ned_mps[3])
{
    enum can_quantity track = speed + 1;
    if (!live(assembly, speed, now_ns) || !live(assembly, track, now_ns))
        return false;
    ret_ned_mps[0] = number(assembly, speed) * cos(number(assembly, track) * RAD_PER_DEG);
    ret_ned_mps[1] = number(assembly, speed) * sin(number(assembly, track) * RAD_PER_DEG);
    return true;
}

static bool by_body_axes(const struct can_assembly *assembly, nsec_t now_ns, struct pose *pose)
{
    if (!(pose->valid & POSE_ATTITUDE) || !live(assembly, CAN_BODY_FORWARD, now_ns) ||
        !live(assembly, CAN_BODY_RIGHT, now_ns) || !live(assembly, CAN_BODY_UP, now_ns))
        return false;
    const double body_mps[3] = {number(assembly, CAN_BODY_FORWARD),
                                number(assembly, CAN_BODY_RIGHT), -number(assembly, CAN_BODY_UP)};
    double m[3][3];
    ned_matrix_from_attitude(&pose->attitude, m);
    frames_rotate(m, body_mps, pose->velocity_ned_mps);
    return true;
}

/* Needs the attitude for the velocity in body axes. */
static void add_velocity(const struct can_assembly *assembly, nsec_t now_ns, struct pose *pose)
{
    double *ned_mps = pose->velocity_ned_mps;
    bool level = live(assembly, CAN_NORTH, now_ns) && live(assembly, CAN_EAST, now_ns);
    if (level) {
        ned_mps[0] = number(assembly, CAN_NORTH);
        ned_mps[1] = number(assembly, CAN_EAST);
    } else {
        level = along_track(assembly, CAN_GPS_SPEED, now_ns, ned_mps) ||
                along_track(assembly, CAN_INS_SPEED, now_ns, ned_mps);
    }
    if (level && live(assembly, CAN_UP, now_ns))
        ned_mps[2] = -number(assembly, CAN_UP);
    else if (level && live(assembly, CAN_ALTITUDE_RATE, now_ns))
        ned_mps[2] = -number(assembly, CAN_ALTITUDE_RATE);
    if (level || by_body_axes(assembly, now_ns, pose))
        pose->valid |= POSE_VELOCITY;
}

static void add_rates(const struct can_assembly *assembly, nsec_t now_ns, struct pose *pose)
{
    static const enum can_quantity about[3] = {CAN_ROLL_RATE, CAN_PITCH_RATE, CAN_YAW_RATE};
    for (int i = 0; i < 3; i++)
        if (!live(assembly, about[i], now_ns))
            return;
    for (int i = 0; i < 3; i++)
        pose->rates_body_dps[i] = number(assembly, about[i]);
    pose->valid |= POSE_RATES;
}

/* The height that there is, best first: with the position's own receiver, then barometric. */
static bool find_height(const struct can_assembly *assembly, enum can_quantity own, nsec_t now_ns,
                        enum can_quantity *ret_quantity)
{
    const enum can_quantity order[] = {own, CAN_GPS_HEIGHT, CAN_INS_HEIGHT, CAN_TRUE_ALTITUDE,
                                       CAN_BARO_ALTITUDE};
    for (size_t i = 0; i < LENGTH(order); i++)
        if (live(assembly, order[i], now_ns)) {
            *ret_quantity = order[i];
            return true;
        }
    return false;
}

static bool fix_live(const struct can_fix *fix, nsec_t now_ns)
{
    return fix->known && now_ns - fix->time_ns <= CAN_STALE_NS;
}

/* The newest fix, carried forward to `now_ns`. */
static bool add_position(const struct can_assembly *assembly, nsec_t now_ns,
                         struct pose_sample *sample)
{
    bool gps = fix_live(&assembly->gps, now_ns);
    const struct can_fix *newest = gps ? &assembly->gps : &assembly->ins;
    enum can_quantity height = gps ? CAN_GPS_HEIGHT : CAN_INS_HEIGHT;
    if (!fix_live(newest, now_ns) || !find_height(assembly, height, now_ns, &height))
        return false;
    nsec_t fix_ns = newest->time_ns;
    double up_mps = sample->pose.valid & POSE_VELOCITY ? -sample->pose.velocity_ned_mps[2] : 0.0;
    double height_age_s = seconds_from_ns(fix_ns - assembly->pieces[height].time_ns);
    struct pose fix = {.valid = POSE_POSITION | (sample->pose.valid & POSE_VELOCITY),
                       .position = {.lat_deg = newest->lat_deg,
                                    .lon_deg = newest->lon_deg,
                                    .height_m = number(assembly, height) + up_mps * height_age_s}};
    memcpy(fix.velocity_ned_mps, sample->pose.velocity_ned_mps, sizeof(fix.velocity_ned_mps));
    struct pose carried = fix;
    if (fix.valid & POSE_VELOCITY && now_ns > fix_ns)
        pose_extrapolate(&fix, seconds_from_ns(now_ns - fix_ns), &carried);
    sample->pose.position = carried.position;
    sample->pose.valid |= POSE_POSITION;
    sample->datum = height == CAN_TRUE_ALTITUDE || height == CAN_BARO_ALTITUDE ? ALTITUDE_EGM96
                                                                               : ALTITUDE_ELLIPSOID;
    return true;
}

static bool make_sample(const struct can_assembly *assembly, nsec_t now_ns,
                        struct pose_sample *ret_sample)
{
    struct pose_sample sample = {.pose = {.time_ns = now_ns, .receive_ns = now_ns}};
    add_attitude(assembly, now_ns, &sample.pose);
    add_velocity(assembly, now_ns, &sample.pose);
    add_rates(assembly, now_ns, &sample.pose);
    if (!add_position(assembly, now_ns, &sample))
        return false;
    decode_normalise(&sample.pose);
    *ret_sample = sample;
    return true;
}

static bool is_angle(enum can_quantity quantity)
{
    for (size_t i = 0; i < LENGTH(angles); i++)
        if (quantity == angles[i])
            return true;
    return false;
}

/* True where no other angle that comes as often as `quantity` is still to come. */
static bool attitude_complete(const struct can_assembly *assembly, enum can_quantity quantity,
                              nsec_t now_ns)
{
    nsec_t interval_ns = assembly->pieces[quantity].interval_ns;
    for (size_t i = 0; i < LENGTH(angles); i++) {
        const struct can_piece *piece = &assembly->pieces[angles[i]];
        bool as_often = piece->known && interval_ns > 0 && piece->interval_ns > 0 &&
                        piece->interval_ns <= 2 * interval_ns &&
                        now_ns - piece->time_ns <= 3 * interval_ns;
        if (as_often && !(assembly->fresh_attitude & 1u << angles[i]))
            return false;
    }
    return true;
}

static bool is_position(enum can_quantity quantity)
{
    return quantity == CAN_GPS_LATITUDE || quantity == CAN_GPS_LONGITUDE ||
           quantity == CAN_INS_LATITUDE || quantity == CAN_INS_LONGITUDE;
}

/* Returns true where `quantity`, just stored, makes a fix with its other coordinate. One that waits
 * since longer than half a cycle is of the last cycle, whose partner was lost. */
static bool complete_fix(struct can_assembly *assembly, enum can_quantity quantity)
{
    bool gps = quantity == CAN_GPS_LATITUDE || quantity == CAN_GPS_LONGITUDE;
    bool is_lat = quantity == CAN_GPS_LATITUDE || quantity == CAN_INS_LATITUDE;
    struct can_fix *fix = gps ? &assembly->gps : &assembly->ins;
    int lat_at = gps ? CAN_GPS_LATITUDE : CAN_INS_LATITUDE;
    const struct can_piece *lat = &assembly->pieces[lat_at], *lon = lat + 1;
    const struct can_piece *mine = is_lat ? lat : lon, *other = is_lat ? lon : lat;
    bool *other_fresh = is_lat ? &fix->lon_fresh : &fix->lat_fresh;
    if (mine->cycle_ns > 0 && mine->time_ns - other->time_ns > mine->cycle_ns / 2)
        *other_fresh = false;
    *(is_lat ? &fix->lat_fresh : &fix->lon_fresh) = true;
    if (!*other_fresh)
        return false;
    *fix = (struct can_fix){
        .known = true, .lat_deg = lat->value, .lon_deg = lon->value, .time_ns = mine->time_ns};
    return true;
}

static void store(struct can_piece *piece, double value, nsec_t now_ns)
{
    piece->interval_ns = piece->known ? now_ns - piece->time_ns : 0;
    nsec_t longer_ns = piece->cycle_ns + piece->cycle_ns / 16;
    piece->cycle_ns =
        piece->cycle_ns > 0 && piece->interval_ns > longer_ns ? longer_ns : piece->interval_ns;
    piece->known = true;
    piece->value = value;
    piece->time_ns = now_ns;
}

/* Where attitude flows, it alone says when; a bus that carries none is timed by its position. */
static bool attitude_flows(const struct can_assembly *assembly, nsec_t now_ns)
{
    double heading_deg;
    return live(assembly, CAN_PITCH, now_ns) && live(assembly, CAN_ROLL, now_ns) &&
           find_heading(assembly, now_ns, &heading_deg);
}

int can_assembly_take(struct can_assembly *assembly, enum can_quantity quantity, double value,
                      nsec_t now_ns, struct pose_sample *ret_sample)
{
    struct can_piece *piece = &assembly->pieces[quantity];
    if (!is_angle(quantity)) {
        store(piece, value, now_ns);
        return is_position(quantity) && complete_fix(assembly, quantity) &&
               !attitude_flows(assembly, now_ns) && make_sample(assembly, now_ns, ret_sample);
    }
    unsigned bit = 1u << quantity;
    if (assembly->fresh_attitude & bit) {
        /* Round again before the others came: give out what was there, keep this for the next. */
        bool made = make_sample(assembly, assembly->fresh_since_ns, ret_sample);
        store(piece, value, now_ns);
        assembly->fresh_attitude = bit;
        assembly->fresh_since_ns = now_ns;
        return made;
    }
    store(piece, value, now_ns);
    assembly->fresh_attitude |= bit;
    assembly->fresh_since_ns = now_ns;
    if (!attitude_complete(assembly, quantity, now_ns))
        return 0;
    assembly->fresh_attitude = 0;
    return make_sample(assembly, now_ns, ret_sample);
}
