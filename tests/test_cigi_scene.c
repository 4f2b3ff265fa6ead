/* What a host puts into the world, and what it asks about it. */
#include "io/cigi_scene.h"

#include <errno.h>

#include "geo/geographic.h"
#include "tests/cigi_session_fixture.h"

#define LAT_DEG 47.4582
#define LON_DEG 8.5555

static const struct cigi_format little_3 = {3, 3, false}, little_4 = {4, 0, false};

static const struct cigi_scene *scene(void)
{
    return cigi_session_scene(talk.session);
}

/* A slope that rises 1 m in 10 towards the east, 400 m above the ellipsoid at LON_DEG. */
static int slope(void *context, double lat_deg, double lon_deg, double *ret_height_m,
                 double ret_normal_enu[3])
{
    double metres = (lon_deg - LON_DEG) * M_PI / 180.0 * 6378137.0 * cos(lat_deg * M_PI / 180.0);
    double length = sqrt(1.01);
    if (context && *(const bool *)context)
        return -EAGAIN;
    *ret_height_m = 400.0 + 0.1 * metres;
    ret_normal_enu[0] = -0.1 / length;
    ret_normal_enu[1] = 0.0;
    ret_normal_enu[2] = 1.0 / length;
    return 0;
}

static const struct cigi_ground ground = {.at = slope};

static struct cigi_packet entity_at(uint16_t id, double x, double y, double z)
{
    struct cigi_packet packet = {.kind = CIGI_ENTITY_CONTROL};
    packet.entity_control = (struct cigi_entity_control){
        .entity = id, .state = CIGI_ACTIVE, .alpha = 255, .placement = {.place = {x, y, z}}};
    return packet;
}

static struct cigi_packet child_of(uint16_t id, uint16_t parent, double x, double y, double z)
{
    struct cigi_packet packet = entity_at(id, x, y, z);
    packet.entity_control.placement.attach = 1;
    packet.entity_control.placement.parent = parent;
    return packet;
}

/* One frame with one packet from the host. */
static int exchange(const struct cigi_packet *packet)
{
    pair_open();
    if (packet)
        pair_put(packet);
    return pair_exchange(&ground);
}

static struct pose pose_of(uint16_t entity)
{
    struct pose pose = {.valid = 0};
    CHECK_INT(cigi_scene_entity_pose(scene(), entity, &ground, &pose), 0);
    return pose;
}

/* `pose` lies so many metres east, north, up of the own-ship's usual place at 1500 m. */
static void check_enu(const struct pose *pose, double east, double north, double up)
{
    static const struct geodetic origin = {LAT_DEG, LON_DEG, 1500.0};
    double enu[3];
    enu_from_geodetic(&origin, &pose->position, enu);
    CHECK_NEAR(enu[0], east, 1e-3);
    CHECK_NEAR(enu[1], north, 1e-3);
    CHECK_NEAR(enu[2], up, 1e-3);
}

static void test_children(void)
{
    struct cigi_packet ship = entity_at(0, LAT_DEG, LON_DEG, 1500.0);
    struct cigi_packet tank = child_of(1, 0, 10.0, 2.0, 1.0);
    struct cigi_packet cap = child_of(2, 1, 1.0, 0.0, 0.0);
    pair_operate(little_3);
    ship.entity_control.placement.yaw_deg = 90.0f;
    tank.entity_control.placement.yaw_deg = 90.0f;
    exchange(&ship);
    exchange(&tank);
    CHECK_INT(exchange(&cap), 0);
    struct pose pose = pose_of(1);
    check_enu(&pose, 10.0, -2.0, -1.0); /* ahead is east, right is south, down is down */
    CHECK_NEAR(pose.attitude.heading_deg, 180.0, 1e-3);
    pose = pose_of(2);
    check_enu(&pose, 10.0, -3.0, -1.0);
    /* A tree stays a tree. */
    struct cigi_packet loop = child_of(0, 2, 0.0, 0.0, 0.0), self = child_of(2, 2, 0.0, 0.0, 0.0);
    CHECK(exchange(&loop) == CIGI_PARTLY && talk.why.reason == REJECT_REFERENCE);
    CHECK(exchange(&self) == CIGI_PARTLY && talk.why.reason == REJECT_REFERENCE);
    /* It goes as a whole. */
    struct cigi_packet part = {.kind = CIGI_ARTICULATED_PART};
    part.articulated_part.entity = 1;
    exchange(&part);
    CHECK(cigi_scene_part(scene(), 1, 0));
    ship.entity_control.state = CIGI_DESTROYED;
    CHECK_INT(exchange(&ship), 0);
    CHECK_INT(scene()->entities.count, 0);
    CHECK_INT(scene()->parts.count, 0);
    CHECK_INT(cigi_scene_entity_pose(scene(), 0, NULL, &pose), -ENOENT);
    pair_end();
}

static void test_depth(void)
{
    pair_operate(little_3);
    struct cigi_packet packet = entity_at(0, LAT_DEG, LON_DEG, 0.0);
    exchange(&packet);
    int r = 0;
    for (uint16_t id = 1; id < 40 && r == 0; id++) {
        packet = child_of(id, id - 1, 1.0, 0.0, 0.0);
        r = exchange(&packet);
    }
    CHECK(r == CIGI_PARTLY && talk.why.reason == REJECT_LIMIT);
    CHECK_INT(scene()->entities.count, CIGI_DEPTH_MAX);
    pose_of(CIGI_DEPTH_MAX - 1);
    pair_end();
}

static void test_clamps(void)
{
    bool blind = true;
    const struct cigi_ground unknown = {.context = &blind, .at = slope};
    struct cigi_packet car = entity_at(7, LAT_DEG, LON_DEG, 2.0);
    struct pose pose;
    pair_operate(little_3);
    car.entity_control.placement.clamp = CIGI_CLAMPED;
    car.entity_control.placement.pitch_deg = 5.0f;
    exchange(&car);
    pose = pose_of(7);
    CHECK_NEAR(pose.position.height_m, 402.0, 1e-6);
    CHECK_NEAR(pose.attitude.pitch_deg, 5.0, 1e-6);
    CHECK_INT(cigi_scene_entity_pose(scene(), 7, &unknown, &pose), -EAGAIN);
    CHECK_INT(cigi_scene_entity_pose(scene(), 7, NULL, &pose), -EAGAIN);
    /* On the slope: heading east it climbs, heading north it leans to the left. */
    car.entity_control.placement.clamp = CIGI_CONFORMAL;
    car.entity_control.placement.pitch_deg = 0.0f;
    car.entity_control.placement.yaw_deg = 90.0f;
    exchange(&car);
    double steep_deg = atan(0.1) * 180.0 / M_PI;
    pose = pose_of(7);
    CHECK_NEAR(pose.attitude.pitch_deg, steep_deg, 1e-6);
    CHECK_NEAR(pose.attitude.roll_deg, 0.0, 1e-6);
    CHECK_NEAR(pose.attitude.heading_deg, 90.0, 1e-6);
    struct cigi_packet moved = {.kind = CIGI_CLAMPED_ENTITY};
    moved.clamped_entity = (struct cigi_clamped_entity){7, 0.0f, LAT_DEG, LON_DEG + 0.01};
    CHECK_INT(exchange(&moved), 0);
    pose = pose_of(7);
    CHECK_NEAR(pose.attitude.roll_deg, -steep_deg, 1e-6);
    CHECK_NEAR(pose.attitude.pitch_deg, 0.0, 1e-6);
    CHECK_NEAR(pose.position.height_m, 402.0 + 75.27, 0.01);
    /* Others are not moved so. */
    car.entity_control.placement.clamp = CIGI_UNCLAMPED;
    exchange(&car);
    CHECK(exchange(&moved) == CIGI_PARTLY && talk.why.reason == REJECT_FIELD);
    pair_end();
}

static void give_rate(bool local, float forward_mps, float yaw_dps)
{
    struct cigi_packet rate = {.kind = CIGI_RATE};
    rate.rate.local = local;
    rate.rate.linear_mps[0] = forward_mps;
    rate.rate.yaw_dps = yaw_dps;
    CHECK_INT(exchange(&rate), 0);
}

/* A minute at 100 m/s due north, then in its own axes, nose to the east. */
static void test_rates(void)
{
    struct cigi_packet ship = entity_at(0, LAT_DEG, LON_DEG, 1500.0);
    pair_operate(little_3);
    ship.entity_control.placement.yaw_deg = 90.0f;
    exchange(&ship);
    struct pose pose = pose_of(0);
    CHECK(!(pose.valid & POSE_VELOCITY));
    check_enu(&pose, 0.0, 0.0, 0.0);
    give_rate(false, 100.0f, 0.0f); /* shown from the next frame on */
    pose = pose_of(0);
    check_enu(&pose, 0.0, 0.0, 0.0);
    for (int frame = 0; frame < 3600; frame++)
        exchange(NULL);
    pose = pose_of(0);
    CHECK_NEAR((pose.position.lat_deg - LAT_DEG) * 111180.0, 6000.0, 5.0);
    CHECK_NEAR(pose.position.lon_deg, LON_DEG, 1e-9);
    CHECK_NEAR(pose.position.height_m, 1500.0, 0.01); /* along the Earth's curve */
    CHECK_NEAR(pose.velocity_ned_mps[0], 100.0, 1e-9);
    /* A new place is shown as it is; the rate goes on from there. */
    exchange(&ship);
    pose = pose_of(0);
    check_enu(&pose, 0.0, 0.0, 0.0);
    give_rate(true, 60.0f, 36.0f);
    exchange(&ship);
    for (int frame = 0; frame < 60; frame++)
        exchange(NULL);
    pose = pose_of(0);
    CHECK_NEAR(pose.attitude.heading_deg, 126.0, 1e-4);
    CHECK_NEAR(pose.rates_body_dps[2], 36.0, 1e-9);
    double enu[3];
    enu_from_geodetic(&(struct geodetic){LAT_DEG, LON_DEG, 1500.0}, &pose.position, enu);
    double turned = 36.0 * M_PI / 180.0, radius = 60.0 / turned; /* along an arc to the right */
    CHECK_NEAR(enu[0], radius * sin(turned), 0.4);
    CHECK_NEAR(enu[1], -radius * (1.0 - cos(turned)), 0.4);
    give_rate(false, 0.0f, 0.0f);
    CHECK(!(pose_of(0).valid & POSE_VELOCITY));
    pair_end();
}

/* Rates of the angles go on past straight up: half a turn brings it onto its back. */
static void test_loop(void)
{
    struct cigi_packet ship = entity_at(0, LAT_DEG, LON_DEG, 1500.0), rate = {.kind = CIGI_RATE};
    rate.rate.pitch_dps = 60.0f;
    pair_operate(little_3);
    exchange(&ship);
    exchange(&rate);
    for (int frame = 0; frame < 120; frame++)
        exchange(NULL);
    struct pose pose = pose_of(0);
    CHECK_NEAR(pose.attitude.pitch_deg, 60.0, 1e-4);
    CHECK_NEAR(pose.attitude.heading_deg, 180.0, 1e-4);
    CHECK_NEAR(fabs(pose.attitude.roll_deg), 180.0, 1e-4);
    for (int frame = 0; frame < 180; frame++)
        exchange(NULL);
    pose = pose_of(0);
    CHECK_NEAR(pose.attitude.pitch_deg, -60.0, 1e-4);
    CHECK_NEAR(remainder(pose.attitude.heading_deg, 360.0), 0.0, 1e-4);
    CHECK_NEAR(pose.attitude.roll_deg, 0.0, 1e-4);
    pair_end();
}

/* With extrapolation a place counts from when it came, not from the frame that shows it. */
static void test_extrapolation(void)
{
    for (int allowed = 0; allowed < 2; allowed++) {
        struct cigi_packet ship = entity_at(0, LAT_DEG, LON_DEG, 1500.0);
        pair_operate(little_3);
        ship.entity_control.extrapolate = allowed != 0;
        exchange(&ship);
        give_rate(false, 100.0f, 0.0f);
        pair_open();
        pair_put(&ship);
        pair_send();
        cigi_session_begin(talk.session, talk.now_ns + NSEC_PER_SEC / 100, &ground);
        struct pose pose = pose_of(0);
        check_enu(&pose, 0.0, allowed ? 1.0 : 0.0, 0.0);
        pair_end();
    }
}

static void test_turning_child(void)
{
    struct cigi_packet ship = entity_at(0, LAT_DEG, LON_DEG, 1500.0);
    struct cigi_packet radar = child_of(1, 0, 0.0, 0.0, -5.0), rate = {.kind = CIGI_RATE};
    pair_operate(little_3);
    exchange(&ship);
    exchange(&radar);
    rate.rate.entity = 1;
    rate.rate.yaw_dps = 90.0f;
    exchange(&rate);
    for (int frame = 0; frame < 180; frame++)
        exchange(NULL);
    struct pose pose = pose_of(1);
    check_enu(&pose, 0.0, 0.0, 5.0);
    CHECK_NEAR(pose.attitude.heading_deg, 270.0, 1e-4);
    pair_end();
}

/* 4.0 makes an entity and places it in two packets. */
static void test_entities_4(void)
{
    struct cigi_packet ship = entity_at(0, 0.0, 0.0, 0.0), place = {.kind = CIGI_ENTITY_POSITION};
    struct pose pose;
    pair_operate(little_4);
    place.entity_position.placement =
        (struct cigi_placement){.yaw_deg = 30.0f, .place = {LAT_DEG, LON_DEG, 1500.0}};
    CHECK(exchange(&place) == CIGI_PARTLY && talk.why.reason == REJECT_REFERENCE);
    exchange(&ship);
    CHECK_INT(cigi_scene_entity_pose(scene(), 0, &ground, &pose), -ENODATA);
    CHECK_INT(exchange(&place), 0);
    pose = pose_of(0);
    check_enu(&pose, 0.0, 0.0, 0.0);
    ship.entity_control.alpha = 128;
    exchange(&ship); /* does not move it */
    pose = pose_of(0);
    check_enu(&pose, 0.0, 0.0, 0.0);
    CHECK_NEAR(pose.attitude.heading_deg, 30.0, 1e-6);
    pair_end();
}

/* Two besides own-ship, one of them not to be seen, and one that hangs below it. */
static void test_seen(void)
{
    struct cigi_packet ship = entity_at(0, LAT_DEG, LON_DEG, 1500.0);
    struct cigi_packet other = entity_at(7, LAT_DEG, LON_DEG, 1600.0);
    struct cigi_packet hidden = entity_at(8, LAT_DEG, LON_DEG, 1700.0);
    struct cigi_packet child = child_of(9, 0, 0.0, 0.0, 5.0);
    struct cigi_seen seen[4];
    struct pose pose;
    pair_operate(little_3);
    exchange(&ship);
    other.entity_control.type = 700;
    other.entity_control.placement.yaw_deg = 90.0f;
    exchange(&other);
    hidden.entity_control.state = CIGI_INACTIVE;
    exchange(&hidden);
    exchange(&child);
    CHECK_INT(cigi_scene_seen(scene(), 0, &ground, seen, 4), 2);
    CHECK(seen[0].entity == 7 && seen[0].type == 700 && seen[0].alpha == 255 &&
          !seen[0].enumerated);
    CHECK_INT(seen[1].entity, 9);
    check_enu(&seen[0].pose, 0.0, 0.0, 100.0);
    CHECK_NEAR(seen[0].pose.attitude.heading_deg, 90.0, 1e-9);
    check_enu(&seen[1].pose, 0.0, 0.0, -5.0);
    /* A child is placed when what it hangs below is, by the message that came last. */
    nsec_t came_ns = talk.now_ns;
    exchange(&ship);
    CHECK_INT(cigi_scene_seen(scene(), 0, &ground, seen, 4), 2);
    CHECK(seen[0].placed_ns < came_ns && !seen[0].moves);
    CHECK_INT(seen[1].placed_ns, came_ns);
    struct cigi_packet rate = {.kind = CIGI_RATE};
    rate.rate = (struct cigi_rate){.entity = 7, .linear_mps = {100.0f, 0.0f, 0.0f}};
    exchange(&rate);
    CHECK_INT(cigi_scene_seen(scene(), 0, &ground, seen, 4), 2);
    CHECK(seen[0].moves && !seen[1].moves);
    CHECK_INT(cigi_scene_entity_pose(scene(), 7, &ground, &pose), 0);
    CHECK_NEAR(seen[0].pose.position.lat_deg, pose.position.lat_deg, 0.0);
    /* A DIS enumeration of kind 0 ("other") is one, too. */
    pair_end();
    pair_operate(little_4);
    struct cigi_packet dis = other, place = {.kind = CIGI_ENTITY_POSITION};
    dis.entity_control.extended = 1;
    dis.entity_control.type = 225;
    dis.entity_control.dis_domain = 1;
    place.entity_position.entity = 7;
    place.entity_position.placement.place[0] = LAT_DEG;
    exchange(&dis);
    exchange(&place);
    CHECK_INT(cigi_scene_seen(scene(), 0, &ground, seen, 4), 1);
    CHECK(seen[0].enumerated && seen[0].type == 225 && seen[0].domain == 1);
    pair_end();
}

/* As many as there is room for; the one whose eye it is is left out. */
static void test_seen_limits(void)
{
    struct cigi_packet ship = entity_at(0, LAT_DEG, LON_DEG, 1500.0);
    struct cigi_packet other = entity_at(7, LAT_DEG, LON_DEG, 1600.0);
    struct cigi_packet child = child_of(9, 0, 0.0, 0.0, 5.0);
    struct cigi_seen seen[4];
    pair_operate(little_3);
    exchange(&ship);
    exchange(&other);
    exchange(&child);
    CHECK_INT(cigi_scene_seen(scene(), 0, &ground, seen, 1), 1);
    CHECK_INT(cigi_scene_seen(scene(), 7, &ground, seen, 4), 2);
    pair_end();
}

static void test_any_angles(void)
{
    struct cigi_packet ship = entity_at(0, LAT_DEG, LON_DEG + 360.0 - 8.0, 1500.0);
    pair_operate(little_3);
    ship.entity_control.placement.place[1] = 190.0;
    ship.entity_control.placement.yaw_deg = -30.0f;
    ship.entity_control.placement.pitch_deg = 100.0f; /* over the top */
    ship.entity_control.placement.roll_deg = 540.0f;
    CHECK_INT(exchange(&ship), 0);
    struct pose pose = pose_of(0);
    CHECK(pose_is_sane(&pose));
    CHECK_NEAR(pose.position.lon_deg, -170.0, 1e-9);
    CHECK_NEAR(pose.attitude.pitch_deg, 80.0, 1e-6);
    CHECK_NEAR(pose.attitude.heading_deg, 150.0, 1e-6);
    CHECK_NEAR(fabs(pose.attitude.roll_deg), 0.0, 1e-6);
    pair_end();
}

static void test_views(void)
{
    struct cigi_packet ship = entity_at(0, LAT_DEG, LON_DEG, 1500.0);
    struct cigi_packet left = {.kind = CIGI_VIEW_DEFINITION}, turn = {.kind = CIGI_VIEW_CONTROL};
    struct pose eye;
    pair_operate(little_3);
    CHECK_INT(cigi_scene_eye_pose(scene(), 1, &ground, &eye), -ENOENT); /* no own-ship yet */
    exchange(&ship);
    CHECK_INT(cigi_scene_eye_pose(scene(), 1, &ground, &eye), 0);
    check_enu(&eye, 0.0, 0.0, 0.0);
    /* Only what `use` names is taken. */
    turn.view_control = (struct cigi_view_control){.view = 1,
                                                   .use = 0x21,
                                                   .offset_m = {4.5f, 9.0f, 9.0f},
                                                   .roll_deg = 9.0f,
                                                   .yaw_deg = 300.0f};
    CHECK_INT(exchange(&turn), 0);
    CHECK_INT(cigi_scene_eye_pose(scene(), 1, &ground, &eye), 0);
    check_enu(&eye, 0.0, 4.5, 0.0);
    CHECK_NEAR(eye.attitude.heading_deg, 300.0, 1e-4);
    CHECK_NEAR(eye.attitude.roll_deg, 0.0, 1e-4);
    /* A group turns as one; the channel's own view is not in it. */
    left.view_definition = (struct cigi_view_definition){
        .view = 2, .group = 5, .use = 0x0c, .left = -60.0f, .right = -10.0f, .mirror = 1};
    CHECK_INT(exchange(&left), 0);
    left.view_definition.view = 3;
    CHECK_INT(exchange(&left), 0);
    const struct cigi_view *view = cigi_scene_view(scene(), 2);
    CHECK(view->definition.left == -60.0f && view->definition.right == -10.0f);
    CHECK(view->definition.top == 20.0f && view->definition.near_m == 0.5f);
    CHECK_INT(view->definition.mirror, CIGI_MIRROR_HORIZONTAL);
    turn.view_control = (struct cigi_view_control){.group = 5, .use = 0x20, .yaw_deg = 45.0f};
    CHECK_INT(exchange(&turn), 0);
    for (uint16_t id = 1; id <= 3; id++)
        CHECK_NEAR(cigi_scene_view(scene(), id)->attitude.heading_deg, id == 1 ? 300.0 : 45.0,
                   1e-4);
    /* What cannot be drawn leaves the view as it was. */
    left.view_definition.left = 91.0f;
    CHECK(exchange(&left) == CIGI_PARTLY && talk.why.reason == REJECT_RANGE);
    CHECK_NEAR(cigi_scene_view(scene(), 3)->definition.left, -60.0, 0.0);
    pair_end();
}

/* Edges in degrees are none in metres, nor the other way round. */
static void test_projection(void)
{
    struct cigi_packet parallel = {.kind = CIGI_VIEW_DEFINITION};
    struct cigi_view_definition *d = &parallel.view_definition;
    *d = (struct cigi_view_definition){.view = 1,
                                       .use = 0x34, /* the right edge is not enabled */
                                       .orthographic = 1,
                                       .left = -40.0f,
                                       .right = 40.0f,
                                       .top = 30.0f,
                                       .bottom = -30.0f};
    pair_operate(little_3);
    CHECK(exchange(&parallel) == CIGI_PARTLY && talk.why.reason == REJECT_RANGE);
    d->use |= 0x08;
    CHECK_INT(exchange(&parallel), 0);
    d->use = 0x04; /* the same projection: the others are as they were */
    d->left = -50.0f;
    CHECK_INT(exchange(&parallel), 0);
    CHECK_NEAR(cigi_scene_view(scene(), 1)->definition.right, 40.0, 0.0);
    d->orthographic = 0;
    CHECK(exchange(&parallel) == CIGI_PARTLY && talk.why.reason == REJECT_RANGE);
    CHECK(cigi_scene_view(scene(), 1)->definition.orthographic);
    d->use = 0x3c;
    CHECK_INT(exchange(&parallel), 0);
    pair_end();
}

static void test_sky(void)
{
    struct cigi_packet sky = {.kind = CIGI_CELESTIAL};
    sky.celestial = (struct cigi_celestial){
        .hour = 18, .minute = 30, .ephemeris = 1, .sun = 1, .date_valid = 1, .date = 6212025};
    nsec_t given_ns;
    CHECK_INT(clock_parse_utc("2025-06-21T18:30:00Z", &given_ns), 0);
    pair_operate(little_3);
    CHECK(!scene()->has_utc);
    exchange(&sky);
    nsec_t begun_ns = talk.now_ns - FIXTURE_FRAME_NS;
    CHECK_INT(scene()->utc_ns, given_ns);
    for (int frame = 0; frame < 120; frame++)
        exchange(&sky); /* a host that repeats itself does not stop the clock */
    CHECK_INT(scene()->utc_ns - given_ns, talk.now_ns - FIXTURE_FRAME_NS - begun_ns);
    sky.celestial.minute = 31;
    sky.celestial.ephemeris = 0;
    exchange(&sky);
    exchange(&sky);
    CHECK_INT(scene()->utc_ns, given_ns + 60 * NSEC_PER_SEC);
    sky.celestial = (struct cigi_celestial){.sun = 0, .date = 99999999, .star_percent = 7.0f};
    CHECK_INT(exchange(&sky), 0); /* it says that its date is not valid */
    CHECK(scene()->celestial.date == 6212025 && scene()->celestial.star_percent == 7.0f);
    CHECK_INT(scene()->utc_ns, given_ns + 60 * NSEC_PER_SEC);
    pair_end();
}

static void test_stored(void)
{
    struct cigi_packet ship = entity_at(0, LAT_DEG, LON_DEG, 1500.0);
    struct cigi_packet component = {.kind = CIGI_COMPONENT}, part = {.kind = CIGI_ARTICULATED_PART};
    struct cigi_packet pair_of_parts = {.kind = CIGI_SHORT_ARTICULATED_PART};
    struct cigi_packet region = {.kind = CIGI_REGION};
    pair_operate(little_3);
    exchange(&ship);
    component.component = (struct cigi_component){
        .component = 3, .instance = 0, .of = 0, .state = 2, .words = {1, 2, 3, 4, 5, 6}};
    CHECK_INT(exchange(&component), 0);
    component.kind = CIGI_SHORT_COMPONENT;
    component.component.state = 9;
    CHECK_INT(exchange(&component), 0);
    CHECK_INT(scene()->components.count, 1);
    const struct cigi_component_state *state = cigi_table_at(&scene()->components, 0);
    CHECK(state->component.state == 9 && state->component.words[1] == 2);
    CHECK_INT(state->component.words[2], 0); /* the short one stands for zeros */
    part.articulated_part = (struct cigi_articulated_part){
        .part = 4, .enable = 1, .use = 0x12, .offset_m = {1.0f, 2.0f, 3.0f}, .pitch_deg = 30.0f};
    CHECK_INT(exchange(&part), 0);
    CHECK_NEAR(cigi_scene_part(scene(), 0, 4)->offset_m[1], 2.0, 0.0);
    CHECK_NEAR(cigi_scene_part(scene(), 0, 4)->offset_m[0], 0.0, 0.0);
    CHECK_NEAR(cigi_scene_part(scene(), 0, 4)->attitude.pitch_deg, 30.0, 0.0);
    pair_of_parts.short_articulated_part = (struct cigi_short_articulated_part){
        .part = {4, 6}, .freedom = {4, 3}, .enable = {1, 1}, .value = {45.0f, 2.5f}};
    CHECK_INT(exchange(&pair_of_parts), 0);
    CHECK_NEAR(cigi_scene_part(scene(), 0, 4)->attitude.heading_deg, 45.0, 0.0);
    CHECK_NEAR(cigi_scene_part(scene(), 0, 4)->attitude.pitch_deg, 30.0, 0.0);
    CHECK_NEAR(cigi_scene_part(scene(), 0, 6)->offset_m[2], 2.5, 0.0);
    pair_of_parts.short_articulated_part.value[0] = 99.0f;
    pair_of_parts.short_articulated_part.freedom[1] = 7; /* is none: the packet is not taken */
    CHECK(exchange(&pair_of_parts) == CIGI_PARTLY && talk.why.reason == REJECT_FIELD);
    CHECK_NEAR(cigi_scene_part(scene(), 0, 4)->attitude.heading_deg, 45.0, 0.0);
    region.region = (struct cigi_region){.region = 8, .state = CIGI_ACTIVE, .lat_deg = 47.0};
    CHECK_INT(exchange(&region), 0);
    CHECK_INT(scene()->regions.count, 1);
    region.region.state = CIGI_DESTROYED;
    CHECK_INT(exchange(&region), 0);
    CHECK_INT(scene()->regions.count, 0);
    pair_end();
}

static void test_limits(void)
{
    struct cigi_session_params params = {.limits = {.entities = 3, .components = 2}};
    struct cigi_packet component = {.kind = CIGI_COMPONENT};
    pair_start(&params, little_3);
    exchange(NULL);
    for (uint16_t i = 0; i < 3; i++) {
        struct cigi_packet packet = entity_at(i, LAT_DEG, LON_DEG, 0.0);
        CHECK_INT(exchange(&packet), 0);
    }
    struct cigi_packet packet = entity_at(3, LAT_DEG, LON_DEG, 0.0);
    CHECK(exchange(&packet) == CIGI_PARTLY && talk.why.reason == REJECT_LIMIT);
    packet.entity_control.entity = 2;
    CHECK_INT(exchange(&packet), 0); /* those that are there still move */
    for (uint16_t i = 0; i < 3; i++) {
        component.component.component = i;
        CHECK_INT(exchange(&component), i < 2 ? 0 : CIGI_PARTLY);
    }
    pair_end();
}

int main(void)
{
    static const struct check_test tests[] = {
        {"what is to be drawn: active entities but own-ship, in ECEF", test_seen},
        {"of what is to be drawn no more than there is room for", test_seen_limits},
        {"children ride on their parents and go with them", test_children},
        {"attachment has a depth that ends", test_depth},
        {"entities are clamped to the ground and to its slope", test_clamps},
        {"rates move an entity along the Earth, or along its own axes", test_rates},
        {"rates of angles go on over the top", test_loop},
        {"extrapolation counts from the arrival", test_extrapolation},
        {"rates turn a child in its parent's axes", test_turning_child},
        {"4.0 makes an entity and places it apart", test_entities_4},
        {"any finite angle is taken", test_any_angles},
        {"views are attached, offset, turned alone and in groups", test_views},
        {"another projection wants edges of its own", test_projection},
        {"date and time run as the host says", test_sky},
        {"components, parts and regions are kept", test_stored},
        {"what a host can make has its limits", test_limits},
    };
    return CHECK_MAIN(tests);
}
