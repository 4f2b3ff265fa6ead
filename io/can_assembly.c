/* When a pose leaves: when every angle has come that comes as often as the one at hand, or when an
 * angle comes round a second time (another was lost). So pitch, roll and heading of one minor frame
 * leave together, and a slow heading does not hold up a fast pitch. */
#include "io/can_assembly.h"

#include <math.h>
#include <string.h>

#include "geo/frames.h"

#define RAD_PER_DEG (M_PI / 180.0)

#define LENGTH(array) (sizeof(array) / sizeof((array)[0]))

#define CYCLE_DEFAULT_NS (100 * NSEC_PER_MSEC) /* of the position, until two have come */
#define CYCLE_MOST_NS    (60 * NSEC_PER_SEC)
#define TOGETHER_NS      (4 * NSEC_PER_MSEC) /* what comes within that is of one cycle */
#define HEIGHT_GONE      3   /* cycles of the position without it: then another height has to do */
#define SLOPE_S          0.1 /* over which it is taken, and may be used */
#define SLOPE_MOST       300.0 /* m/s^2 or deg/s: beyond it somebody was moved */

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

/* What it was or will be at an instant nearby: one that was lost is made up for by how it changed.
 */
static double number_at(const struct can_assembly *assembly, enum can_quantity quantity,
                        nsec_t at_ns)
{
    const struct can_piece *piece = &assembly->pieces[quantity];
    double dt_s = seconds_from_ns(at_ns - piece->time_ns);
    return piece->value + piece->slope * fmax(fmin(dt_s, SLOPE_S), -SLOPE_S);
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
    *ret_deg = number_at(assembly, headings[i], now_ns) + variation_deg;
    return true;
}

static void add_attitude(const struct can_assembly *assembly, nsec_t now_ns, struct pose *pose)
{
    double heading_deg;
    if (!live(assembly, CAN_PITCH, now_ns) || !live(assembly, CAN_ROLL, now_ns) ||
        !find_heading(assembly, now_ns, &heading_deg))
        return;
    pose->valid |= POSE_ATTITUDE;
    pose->attitude = (struct attitude){.roll_deg = number_at(assembly, CAN_ROLL, now_ns),
                                       .pitch_deg = number_at(assembly, CAN_PITCH, now_ns),
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

/* That of `at_ns`, from what counts at `now_ns`. Needs the attitude for the velocity in body axes.
 */
static void add_velocity(const struct can_assembly *assembly, nsec_t now_ns, nsec_t at_ns,
                         struct pose *pose)
{
    double *ned_mps = pose->velocity_ned_mps;
    bool level = live(assembly, CAN_NORTH, now_ns) && live(assembly, CAN_EAST, now_ns);
    if (level) {
        ned_mps[0] = number_at(assembly, CAN_NORTH, at_ns);
        ned_mps[1] = number_at(assembly, CAN_EAST, at_ns);
    } else {
        level = along_track(assembly, CAN_GPS_SPEED, now_ns, ned_mps) ||
                along_track(assembly, CAN_INS_SPEED, now_ns, ned_mps);
    }
    if (level && live(assembly, CAN_UP, now_ns))
        ned_mps[2] = -number_at(assembly, CAN_UP, at_ns);
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

/* The best that there is; NULL where there is none. */
static const struct can_fix *find_fix(const struct can_assembly *assembly, nsec_t now_ns)
{
    return fix_live(&assembly->gps, now_ns)   ? &assembly->gps
           : fix_live(&assembly->ins, now_ns) ? &assembly->ins
                                              : NULL;
}

/* The height of a fix above whatever it is told above: its own, or one of another cycle carried to
 * it. */
static bool height_of_fix(const struct can_assembly *assembly, const struct can_fix *fix,
                          nsec_t now_ns, double up_mps, struct pose_sample *sample)
{
    enum can_quantity height;
    sample->pose.position.height_m = fix->height_m;
    sample->datum = ALTITUDE_ELLIPSOID;
    if (fix->has_height)
        return true;
    if (!find_height(assembly, fix == &assembly->gps ? CAN_GPS_HEIGHT : CAN_INS_HEIGHT, now_ns,
                     &height))
        return false;
    double age_s = seconds_from_ns(fix->time_ns - assembly->pieces[height].time_ns);
    sample->pose.position.height_m = number(assembly, height) + up_mps * age_s;
    if (height == CAN_TRUE_ALTITUDE || height == CAN_BARO_ALTITUDE)
        sample->datum = ALTITUDE_EGM96;
    return true;
}

/* The fix, carried to `now_ns`, which may be a little before it. */
static bool add_position(const struct can_assembly *assembly, const struct can_fix *fix,
                         nsec_t now_ns, struct pose_sample *sample)
{
    struct pose *pose = &sample->pose;
    double up_mps = pose->valid & POSE_VELOCITY ? -pose->velocity_ned_mps[2] : 0.0;
    if (!height_of_fix(assembly, fix, now_ns, up_mps, sample))
        return false;
    pose->position.lat_deg = fix->lat_deg;
    pose->position.lon_deg = fix->lon_deg;
    pose->position_age_ns = now_ns - fix->time_ns;
    pose->valid |= POSE_POSITION;
    struct pose carried;
    pose_extrapolate(pose, seconds_from_ns(pose->position_age_ns), &carried);
    pose->position = carried.position;
    return true;
}

static bool make_sample(const struct can_assembly *assembly, nsec_t now_ns,
                        struct pose_sample *ret_sample)
{
    struct pose_sample sample = {.pose = {.time_ns = now_ns, .receive_ns = now_ns}};
    const struct can_fix *fix = find_fix(assembly, now_ns);
    if (!fix)
        return false;
    add_attitude(assembly, now_ns, &sample.pose);
    add_velocity(assembly, now_ns, fix->time_ns, &sample.pose);
    add_rates(assembly, now_ns, &sample.pose);
    if (!add_position(assembly, fix, now_ns, &sample))
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
    return quantity >= CAN_GPS_LATITUDE && quantity <= CAN_INS_HEIGHT;
}

/* Bits of can_fix.fresh, in the order of the quantities. */
#define FRESH_PLACE  3u
#define FRESH_HEIGHT 4u

/* The shorter one of both: a loss makes the other look longer. */
static nsec_t cycle_of_fix(const struct can_piece *lat, const struct can_piece *lon)
{
    if (lat->cycle_ns == 0 || lon->cycle_ns == 0)
        return lat->cycle_ns + lon->cycle_ns > 0 ? lat->cycle_ns + lon->cycle_ns : CYCLE_DEFAULT_NS;
    return lat->cycle_ns < lon->cycle_ns ? lat->cycle_ns : lon->cycle_ns;
}

/* Returns true where `quantity`, just stored, makes a fix with what else came of its cycle. What
 * waits since longer than half a cycle is of the last one, of which a part was lost: a height that
 * is a cycle old would have to be carried by a time that jitters, which is seen as a bump. */
static bool complete_fix(struct can_assembly *assembly, enum can_quantity quantity)
{
    bool gps = quantity <= CAN_GPS_HEIGHT;
    struct can_fix *fix = gps ? &assembly->gps : &assembly->ins;
    const struct can_piece *lat = &assembly->pieces[gps ? CAN_GPS_LATITUDE : CAN_INS_LATITUDE];
    const struct can_piece *lon = lat + 1, *height = lat + 2, *mine = &assembly->pieces[quantity];
    nsec_t cycle_ns = cycle_of_fix(lat, lon);
    nsec_t apart_ns = cycle_ns / 2 > TOGETHER_NS ? cycle_ns / 2 : TOGETHER_NS;
    for (int i = 0; i < 3; i++)
        if (mine->time_ns - lat[i].time_ns > apart_ns)
            fix->fresh &= ~(1u << i);
    fix->fresh |= 1u << (mine - lat);
    bool as_often = height->known && height->cycle_ns < 2 * cycle_ns &&
                    mine->time_ns - height->time_ns < HEIGHT_GONE * cycle_ns &&
                    mine->time_ns - fix->time_ns < HEIGHT_GONE * cycle_ns;
    unsigned wanted = as_often ? FRESH_PLACE | FRESH_HEIGHT : FRESH_PLACE;
    if ((fix->fresh & wanted) != wanted)
        return false;
    *fix = (struct can_fix){.known = true,
                            .has_height = as_often,
                            .lat_deg = lat->value,
                            .lon_deg = lon->value,
                            .height_m = height->value,
                            .time_ns = lat->time_ns > lon->time_ns ? lat->time_ns : lon->time_ns};
    return true;
}

/* A silence of hours, or a log whose clock jumps by years, is no cycle. */
static nsec_t interval_at(const struct can_piece *piece, nsec_t now_ns)
{
    nsec_t interval_ns = piece->known ? now_ns - piece->time_ns : 0;
    if (interval_ns > CYCLE_MOST_NS)
        return CYCLE_MOST_NS;
    return interval_ns < -CYCLE_MOST_NS ? -CYCLE_MOST_NS : interval_ns;
}

static void store(struct can_piece *piece, double value, bool wraps, nsec_t now_ns)
{
    piece->interval_ns = interval_at(piece, now_ns);
    nsec_t longer_ns = piece->cycle_ns + piece->cycle_ns / 16;
    piece->cycle_ns =
        piece->cycle_ns > 0 && piece->interval_ns > longer_ns ? longer_ns : piece->interval_ns;
    double dt_s = fmax(seconds_from_ns(piece->interval_ns), 0.0);
    double off = value - piece->value - piece->slope * dt_s;
    if (piece->known)
        piece->slope += (wraps ? remainder(off, 360.0) : off) / (SLOPE_S + dt_s);
    if (fabs(piece->slope) > SLOPE_MOST)
        piece->slope = 0.0;
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
        store(piece, value, false, now_ns);
        return is_position(quantity) && complete_fix(assembly, quantity) &&
               !attitude_flows(assembly, now_ns) && make_sample(assembly, now_ns, ret_sample);
    }
    unsigned bit = 1u << quantity;
    if (assembly->fresh_attitude & bit) {
        /* Round again before the others came: give out what was there, keep this for the next. */
        bool made = make_sample(assembly, assembly->fresh_since_ns, ret_sample);
        store(piece, value, true, now_ns);
        assembly->fresh_attitude = bit;
        assembly->fresh_since_ns = now_ns;
        return made;
    }
    store(piece, value, true, now_ns);
    assembly->fresh_attitude |= bit;
    assembly->fresh_since_ns = now_ns;
    if (!attitude_complete(assembly, quantity, now_ns))
        return 0;
    assembly->fresh_attitude = 0;
    return make_sample(assembly, now_ns, ret_sample);
}
