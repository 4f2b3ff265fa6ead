/* What a host asks, and what it is told. */
#include "io/cigi_requests.h"

#include <errno.h>

#include "geo/geographic.h"
#include "tests/cigi_session_fixture.h"

#define LAT_DEG 47.4582
#define LON_DEG 8.5555

static const struct cigi_format little_3 = {3, 3, false}, big_4 = {4, 0, true};

static struct cigi_question questions[1100];
static struct cigi_packet responses[1100];

static void put_ship(void)
{
    struct cigi_packet ship = {.kind = CIGI_ENTITY_CONTROL}, place = {.kind = CIGI_ENTITY_POSITION};
    struct cigi_placement placement = {.yaw_deg = 90.0f, .place = {LAT_DEG, LON_DEG, 1500.0}};
    ship.entity_control =
        (struct cigi_entity_control){.state = CIGI_ACTIVE, .placement = placement};
    place.entity_position.placement = placement;
    pair_put(&ship);
    if (talk.host.format.major == 4)
        pair_put(&place);
}

static void operate(struct cigi_format format)
{
    pair_operate(format);
    pair_open();
    put_ship();
    CHECK_INT(pair_exchange(NULL), 0);
}

/* The host's message with one request comes; a frame begins. Returns how many questions there are.
 */
static size_t ask(const struct cigi_packet *request)
{
    pair_open();
    if (request)
        pair_put(request);
    pair_send();
    cigi_session_begin(talk.session, talk.now_ns, NULL);
    return cigi_session_questions(talk.session, questions, 1100);
}

static void end_frame(void)
{
    pair_answer();
    talk.now_ns += FIXTURE_FRAME_NS;
}

/* The question is answered, and the message read for responses of a kind. */
static size_t answered(const struct cigi_answer *answer, enum cigi_kind kind)
{
    CHECK_INT(cigi_session_answer(talk.session, questions[0].token, answer), 0);
    CHECK_INT(cigi_session_answer(talk.session, questions[0].token, answer), -ENOENT);
    end_frame();
    return pair_responses(kind, responses, 1100);
}

static struct cigi_packet height_request(uint16_t id, enum cigi_height_type type)
{
    struct cigi_packet packet = {.kind = CIGI_HEIGHT_REQUEST};
    packet.height_request = (struct cigi_height_request){
        .request = id, .type = (uint8_t)type, .place = {LAT_DEG, LON_DEG, 1500.25}};
    return packet;
}

static const struct cigi_answer ground_432 = {
    .known = true, .height_m = 432.5, .normal_enu = {0.0, 0.6, 0.8}, .material = 11};

static void check_heights(struct cigi_format format)
{
    operate(format);
    struct cigi_packet request = height_request(77, CIGI_HAT);
    CHECK_INT(ask(&request), 1);
    CHECK(questions[0].ask == CIGI_ASK_GROUND && !questions[0].detailed);
    CHECK(questions[0].from.lat_deg == LAT_DEG && questions[0].from.height_m == 1500.25);
    CHECK_INT(cigi_session_questions(talk.session, questions + 1, 10), 0); /* told but once */
    CHECK_INT(answered(&ground_432, CIGI_HEIGHT_RESPONSE), 1);
    const struct cigi_height_response *basic = &responses[0].height_response;
    CHECK(basic->request == 77 && basic->valid && !basic->hot);
    CHECK_NEAR(basic->height_m, 1067.75, 1e-9);
    CHECK_INT(basic->frame_low, (talk.host.frame - 1) & 15);
    request = height_request(78, CIGI_HOT);
    ask(&request);
    CHECK_INT(answered(&ground_432, CIGI_HEIGHT_RESPONSE), 1);
    CHECK(basic->hot && basic->height_m == 432.5);
    request = height_request(79, CIGI_HAT_HOT_EXTENDED);
    ask(&request);
    CHECK(questions[0].detailed);
    CHECK_INT(answered(&ground_432, CIGI_HEIGHT_EXTENDED), 1);
    const struct cigi_height_extended *more = &responses[0].height_extended;
    CHECK(more->request == 79 && more->valid && more->hat_m == 1067.75 && more->hot_m == 432.5);
    CHECK_INT(more->material, 11);
    CHECK_NEAR(more->normal_azimuth_deg, 0.0, 1e-5);
    CHECK_NEAR(more->normal_elevation_deg, 53.130102, 1e-5);
    /* Outside of the database. */
    request = height_request(80, CIGI_HAT_HOT_EXTENDED);
    ask(&request);
    CHECK_INT(answered(&(struct cigi_answer){.known = false}, CIGI_HEIGHT_EXTENDED), 1);
    CHECK(more->request == 80 && !more->valid && more->hat_m == 0.0);
    pair_end();
}

static void test_heights(void)
{
    check_heights(little_3);
    check_heights(big_4);
}

static void test_height_of_entity(void)
{
    operate(little_3);
    struct cigi_packet request = height_request(5, CIGI_HOT);
    request.height_request.of_entity = 1;
    memcpy(request.height_request.place, (double[3]){100.0, 0.0, 3.0}, 3 * sizeof(double));
    CHECK_INT(ask(&request), 1); /* 100 m ahead, which is east */
    double enu[3];
    enu_from_geodetic(&(struct geodetic){LAT_DEG, LON_DEG, 1500.0}, &questions[0].from, enu);
    CHECK_NEAR(enu[0], 100.0, 1e-6);
    CHECK_NEAR(enu[1], 0.0, 1e-5);
    CHECK_NEAR(enu[2], -3.0, 1e-6);
    CHECK_INT(answered(&ground_432, CIGI_HEIGHT_RESPONSE), 1);
    /* Of an entity that is not there, and at a place that is none: answered, and not valid. */
    request.height_request.entity = 9;
    CHECK_INT(ask(&request), 0);
    end_frame();
    CHECK_INT(pair_responses(CIGI_HEIGHT_RESPONSE, responses, 10), 1);
    CHECK(!responses[0].height_response.valid);
    request = height_request(6, CIGI_HOT);
    request.height_request.place[0] = 91.0;
    CHECK_INT(ask(&request), 0);
    end_frame();
    CHECK_INT(pair_responses(CIGI_HEIGHT_RESPONSE, responses, 10), 1);
    CHECK(pair_link()->counters.rejected[REJECT_REFERENCE] == 1 &&
          pair_link()->counters.rejected[REJECT_RANGE] == 1);
    request.height_request.type = 3;
    CHECK_INT(ask(&request), 0);
    CHECK_INT(pair_link()->counters.rejected[REJECT_FIELD], 1);
    pair_end();
}

/* The ground has one height, whatever a host has left in the altitude. */
static void test_hot_without_altitude(void)
{
    static const double altitudes_m[] = {NAN, INFINITY, 1e300, 5e8};
    struct cigi_packet request = height_request(5, CIGI_HOT);
    operate(little_3);
    for (size_t i = 0; i < sizeof(altitudes_m) / sizeof(altitudes_m[0]); i++) {
        request.height_request.place[2] = altitudes_m[i];
        request.height_request.type = CIGI_HOT;
        CHECK_INT(ask(&request), 1);
        CHECK_INT(answered(&ground_432, CIGI_HEIGHT_RESPONSE), 1);
        CHECK(responses[0].height_response.valid);
        CHECK_NEAR(responses[0].height_response.height_m, 432.5, 0.0);
        request.height_request.type = CIGI_HAT;
        CHECK_INT(ask(&request), 0);
    }
    pair_end();
}

static void test_periodic(void)
{
    operate(little_3);
    struct cigi_packet request = height_request(1, CIGI_HOT);
    request.height_request.period = 3;
    int asked = 0;
    for (int frame = 0; frame < 12; frame++) {
        size_t count = ask(frame == 0 ? &request : NULL);
        CHECK_INT(count, frame % 3 == 0);
        asked += (int)count;
        if (count)
            CHECK_INT(answered(&ground_432, CIGI_HEIGHT_RESPONSE), 1);
        else
            end_frame();
    }
    CHECK_INT(asked, 4);
    /* A late answer is not asked for twice. */
    CHECK_INT(ask(NULL), 1);
    struct cigi_question late = questions[0];
    for (int frame = 0; frame < 7; frame++) {
        end_frame();
        CHECK_INT(ask(NULL), 0);
    }
    questions[0] = late;
    CHECK_INT(answered(&ground_432, CIGI_HEIGHT_RESPONSE), 1);
    CHECK_INT(ask(NULL), 1);
    answered(&ground_432, CIGI_HEIGHT_RESPONSE);
    /* The same request once ends it. */
    request.height_request.period = 0;
    CHECK_INT(ask(&request), 1);
    answered(&ground_432, CIGI_HEIGHT_RESPONSE);
    for (int frame = 0; frame < 6; frame++) {
        CHECK_INT(ask(NULL), 0);
        end_frame();
    }
    /* So does the end of its entity. */
    request.height_request.period = request.height_request.of_entity = 1;
    memset(request.height_request.place, 0, sizeof(request.height_request.place));
    CHECK_INT(ask(&request), 1);
    answered(&ground_432, CIGI_HEIGHT_RESPONSE);
    struct cigi_packet gone = {.kind = CIGI_ENTITY_CONTROL};
    gone.entity_control.state = CIGI_DESTROYED;
    CHECK_INT(ask(&gone), 0);
    end_frame();
    CHECK_INT(ask(NULL), 0);
    pair_end();
}

static void test_many(void)
{
    operate(little_3);
    pair_open();
    for (uint16_t id = 0; id < 1001; id++) {
        struct cigi_packet request = height_request(id, CIGI_HAT_HOT_EXTENDED);
        pair_put(&request);
    }
    CHECK_INT(pair_send(), CIGI_PARTLY);
    CHECK_INT(talk.why.reason, REJECT_LIMIT);
    cigi_session_begin(talk.session, talk.now_ns, NULL);
    CHECK_INT(cigi_session_questions(talk.session, questions, 1100), 1000);
    for (int i = 999; i >= 0; i--) /* in any order */
        CHECK_INT(cigi_session_answer(talk.session, questions[i].token, &ground_432), 0);
    end_frame();
    CHECK_INT(pair_responses(CIGI_HEIGHT_EXTENDED, responses, 1100), 1000);
    for (uint16_t id = 0; id < 1000; id++)
        CHECK_INT(responses[id].height_extended.request, id);
    pair_end();
}

/* The daemon may never answer; the host is told then. */
static void test_patience(void)
{
    operate(little_3);
    struct cigi_packet request = height_request(3, CIGI_HOT);
    CHECK_INT(ask(&request), 1);
    uint32_t token = questions[0].token;
    int frames = 0;
    for (end_frame(); !pair_responses(CIGI_HEIGHT_RESPONSE, responses, 1) && frames < 100;
         frames++) {
        ask(NULL);
        end_frame();
    }
    CHECK_INT(frames, 61);
    CHECK(!responses[0].height_response.valid);
    CHECK_INT(cigi_session_answer(talk.session, token, &ground_432), -ENOENT);
    pair_end();
}

static void check_segments(struct cigi_format format)
{
    operate(format);
    struct cigi_packet request = {.kind = CIGI_SEGMENT_REQUEST};
    request.segment_request = (struct cigi_segment_request){.request = 7,
                                                            .to_of_entity = 1,
                                                            .from = {LAT_DEG, LON_DEG, 1500.0},
                                                            .to = {3000.0, 0.0, 4000.0}};
    CHECK_INT(ask(&request), 1);
    CHECK_INT(questions[0].ask, CIGI_ASK_SIGHT);
    struct cigi_answer clear = {.known = true}, hit = {.known = true,
                                                       .hit = true,
                                                       .distance_m = 1234.5,
                                                       .at = {47.0, 8.0, 99.0},
                                                       .normal_enu = {0.0, 0.0, 1.0},
                                                       .material = 2};
    CHECK_INT(answered(&clear, CIGI_SIGHT_RESPONSE), 1);
    const struct cigi_sight_response *basic = &responses[0].sight_response;
    CHECK(basic->request == 7 && basic->valid && basic->visible && basic->count == 1);
    CHECK_NEAR(basic->range_m, 5000.0, 1e-3);
    ask(&request);
    CHECK_INT(answered(&hit, CIGI_SIGHT_RESPONSE), 1);
    CHECK(basic->valid && !basic->visible && basic->range_m == 1234.5);
    request.segment_request.extended = 1;
    ask(&request);
    CHECK_INT(answered(&hit, CIGI_SIGHT_EXTENDED), 1);
    const struct cigi_sight_extended *more = &responses[0].sight_extended;
    CHECK(more->valid && !more->visible && !more->range_valid && !more->entity_valid);
    CHECK(more->place[0] == 47.0 && more->place[1] == 8.0 && more->place[2] == 99.0);
    CHECK(more->material == 2 && more->normal_elevation_deg == 90.0f);
    request.segment_request.to_entity = 9;
    request.segment_request.to_entity_valid = 1;
    CHECK_INT(ask(&request), 0);
    end_frame();
    CHECK_INT(pair_responses(CIGI_SIGHT_EXTENDED, responses, 10), 1);
    CHECK(!more->valid && !more->visible);
    pair_end();
}

static void test_segments(void)
{
    check_segments(little_3);
    check_segments(big_4);
}

static void test_vectors(void)
{
    operate(little_3);
    struct cigi_packet request = {.kind = CIGI_VECTOR_REQUEST};
    struct geodetic ship = {LAT_DEG, LON_DEG, 1500.0};
    double enu[3];
    request.vector_request = (struct cigi_vector_request){.request = 9,
                                                          .azimuth_deg = 90.0f,
                                                          .elevation_deg = -30.0f,
                                                          .least_m = 100.0f,
                                                          .most_m = 2000.0f,
                                                          .from = {LAT_DEG, LON_DEG, 1500.0}};
    CHECK_INT(ask(&request), 1);
    enu_from_geodetic(&ship, &questions[0].from, enu);
    CHECK_NEAR(enu[0], 100.0 * cos(M_PI / 6.0), 1e-4);
    CHECK_NEAR(enu[2], -50.0, 1e-4);
    enu_from_geodetic(&ship, &questions[0].to, enu);
    CHECK_NEAR(enu[0], 2000.0 * cos(M_PI / 6.0), 1e-4);
    CHECK_NEAR(enu[1], 0.0, 1e-3);
    struct cigi_answer hit = {.known = true, .hit = true, .distance_m = 900.0};
    CHECK_INT(answered(&hit, CIGI_SIGHT_RESPONSE), 1);
    CHECK_NEAR(responses[0].sight_response.range_m, 1000.0, 1e-9); /* from the source */
    ask(&request);
    CHECK_INT(answered(&(struct cigi_answer){.known = true}, CIGI_SIGHT_RESPONSE), 1);
    CHECK(!responses[0].sight_response.valid);
    /* In the entity's axes: its nose is to the east, its right to the south. */
    request.vector_request.from_of_entity = 1;
    request.vector_request.extended = 1;
    memset(request.vector_request.from, 0, sizeof(request.vector_request.from));
    CHECK_INT(ask(&request), 1);
    enu_from_geodetic(&ship, &questions[0].to, enu);
    CHECK_NEAR(enu[0], 0.0, 1e-3);
    CHECK_NEAR(enu[1], -2000.0 * cos(M_PI / 6.0), 1e-3);
    CHECK_NEAR(enu[2], -1000.0, 1e-3);
    CHECK_INT(answered(&hit, CIGI_SIGHT_EXTENDED), 1);
    CHECK(responses[0].sight_extended.range_valid && responses[0].sight_extended.valid);
    request.vector_request.most_m = 50.0f; /* less than the least */
    CHECK_INT(ask(&request), 0);
    end_frame();
    CHECK_INT(pair_responses(CIGI_SIGHT_EXTENDED, responses, 10), 1);
    CHECK(!responses[0].sight_extended.valid);
    pair_end();
}

static struct cigi_packet position_request(enum cigi_object of, uint16_t object,
                                           enum cigi_axes axes)
{
    struct cigi_packet packet = {.kind = CIGI_POSITION_REQUEST};
    packet.position_request =
        (struct cigi_position_request){.object = object, .of = (uint8_t)of, .axes = (uint8_t)axes};
    return packet;
}

static size_t position(enum cigi_object of, uint16_t object, enum cigi_axes axes)
{
    struct cigi_packet request = position_request(of, object, axes);
    CHECK_INT(ask(&request), 0);
    end_frame();
    return pair_responses(CIGI_POSITION_RESPONSE, responses, 10);
}

static void test_positions(void)
{
    operate(little_3);
    struct cigi_packet turn = {.kind = CIGI_VIEW_CONTROL};
    turn.view_control = (struct cigi_view_control){
        .view = 1, .use = 0x3f, .offset_m = {4.5f, -0.5f, -1.25f}, .yaw_deg = 300.0f};
    pair_open();
    pair_put(&turn);
    pair_exchange(NULL);
    const struct cigi_position_response *told = &responses[0].position_response;
    CHECK_INT(position(CIGI_OF_ENTITY, 0, CIGI_GEODETIC), 1);
    CHECK(told->object == 0 && told->of == CIGI_OF_ENTITY && told->axes == CIGI_GEODETIC);
    CHECK(told->place[0] == LAT_DEG && told->place[2] == 1500.0 && told->yaw_deg == 90.0f);
    CHECK_INT(position(CIGI_OF_VIEW, 1, CIGI_IN_PARENT), 1);
    CHECK(told->place[0] == 4.5 && told->place[2] == -1.25 && told->yaw_deg == 300.0f);
    CHECK_INT(position(CIGI_OF_VIEW, 1, CIGI_GEODETIC), 1);
    CHECK_NEAR(told->place[2], 1501.25, 1e-3);
    CHECK_NEAR(told->yaw_deg, 30.0, 1e-3);
    CHECK_INT(position(CIGI_OF_ENTITY, 0, CIGI_IN_PARENT), 0); /* it has none */
    CHECK_INT(position(CIGI_OF_ENTITY, 4, CIGI_GEODETIC), 0);
    CHECK_INT(position(CIGI_OF_GROUP, 4, CIGI_GEODETIC), 0);
    CHECK_INT(pair_link()->counters.rejected[REJECT_REFERENCE], 3);
    CHECK_INT(position(CIGI_OF_TRACKER, 1, CIGI_GEODETIC), 0);
    CHECK_INT(position(CIGI_OF_VIEW, 1, CIGI_IN_SUBMODEL), 0);
    CHECK_INT(pair_link()->counters.rejected[REJECT_FIELD], 2);
    struct cigi_packet always = position_request(CIGI_OF_ENTITY, 0, CIGI_GEODETIC);
    always.position_request.continuous = 1;
    for (int frame = 0; frame < 5; frame++) {
        ask(frame == 0 ? &always : NULL);
        end_frame();
        CHECK_INT(pair_responses(CIGI_POSITION_RESPONSE, responses, 10), 1);
    }
    pair_end();
}

static void check_environment(struct cigi_format format)
{
    operate(format);
    struct cigi_packet air = {.kind = CIGI_ATMOSPHERE};
    struct cigi_packet request = {.kind = CIGI_ENVIRONMENT_REQUEST};
    air.atmosphere = (struct cigi_atmosphere){1, 40, 12.5f, 8000.0f, 10.0f, 1.0f, 270.0f, 1002.0f};
    pair_open();
    pair_put(&air);
    pair_exchange(NULL);
    request.environment_request = (struct cigi_environment_request){
        .what = CIGI_WEATHER | CIGI_TERRESTRIAL | CIGI_AEROSOL, .request = 8, .place = {47, 8, 0}};
    CHECK_INT(ask(&request), 0);
    end_frame();
    CHECK_INT(pair_responses(CIGI_WEATHER_RESPONSE, responses, 10), 1);
    const struct cigi_weather_response *weather = &responses[0].weather_response;
    CHECK(weather->request == 8 && weather->humidity_percent == 40);
    CHECK(weather->temperature_c == 12.5f && weather->visibility_m == 8000.0f);
    CHECK(weather->wind_mps == 10.0f && weather->wind_up_mps == 1.0f);
    CHECK(weather->wind_from_deg == 270.0f && weather->pressure_hpa == 1002.0f);
    CHECK_INT(pair_responses(CIGI_TERRESTRIAL_RESPONSE, responses, 10), 1);
    CHECK_INT(pair_responses(CIGI_AEROSOL_RESPONSE, responses, 10), 1);
    CHECK_INT(pair_responses(CIGI_MARITIME_RESPONSE, responses, 10), 0);
    request.environment_request.what = CIGI_MARITIME;
    CHECK_INT(ask(&request), 1);
    CHECK_INT(questions[0].ask, CIGI_ASK_SEA);
    struct cigi_answer sea = {.known = true, .height_m = 47.25};
    CHECK_INT(answered(&sea, CIGI_MARITIME_RESPONSE), 1);
    CHECK(responses[0].maritime_response.request == 8);
    CHECK_NEAR(responses[0].maritime_response.height_m, 47.25, 0.0);
    pair_end();
}

static void test_environment(void)
{
    check_environment(little_3);
    check_environment(big_4);
}

/* Standby forgets all that was asked. */
static void test_reset(void)
{
    operate(little_3);
    struct cigi_packet request = height_request(3, CIGI_HOT), control = {.kind = CIGI_IG_CONTROL};
    request.height_request.period = 1;
    CHECK_INT(ask(&request), 1);
    end_frame();
    control.ig_control.host_frame = talk.host.frame++;
    talk.writer.size = 0;
    pair_put(&control);
    pair_exchange(NULL);
    CHECK_INT(cigi_session_answer(talk.session, questions[0].token, &ground_432), -ENOENT);
    CHECK_INT(talk.host.seen.mode, CIGI_STANDBY);
    CHECK_INT(ask(NULL), 0);
    pair_end();
}

/* In synchronous operation a message starts its frame; the next one of ours has the answers. */
static void test_placed_when_it_comes(void)
{
    struct cigi_packet request = {.kind = CIGI_HEIGHT_REQUEST};
    const struct cigi_answer answer = {.known = true, .height_m = 432.5};
    request.height_request = (struct cigi_height_request){
        .request = 77, .type = CIGI_HOT, .place = {LAT_DEG, LON_DEG, 0.0}};
    operate(little_3);
    pair_open();
    pair_put(&request);
    uint32_t frame = talk.host.frame - 1;
    CHECK_INT(pair_send(), 0);
    CHECK_INT(cigi_session_questions(talk.session, questions, 1100), 0);
    cigi_session_place(talk.session, NULL);
    CHECK_INT(cigi_session_questions(talk.session, questions, 1100), 1);
    CHECK_INT(cigi_session_answer(talk.session, questions[0].token, &answer), 0);
    pair_answer();
    CHECK_INT(pair_responses(CIGI_HEIGHT_RESPONSE, responses, 1100), 1);
    CHECK(responses[0].height_response.height_m == 432.5);
    CHECK_INT(responses[0].height_response.frame_low, frame & 15);
    cigi_session_begin(talk.session, talk.now_ns, NULL);
    CHECK_INT(cigi_session_questions(talk.session, questions, 1100), 0);
    pair_end();
}

int main(void)
{
    static const struct check_test tests[] = {
        {"what is asked is placed when it comes, and answered in the next message",
         test_placed_when_it_comes},
        {"HAT, HOT and extended", test_heights},
        {"heights at places in an entity's axes", test_height_of_entity},
        {"of HOT the altitude is not looked at", test_hot_without_altitude},
        {"periodic requests begin, wait and end", test_periodic},
        {"1000 requests are answered in one message, one more is refused", test_many},
        {"what nobody answers is told to be invalid", test_patience},
        {"LOS segments, basic and extended", test_segments},
        {"LOS vectors, basic and extended", test_vectors},
        {"positions of entities and views", test_positions},
        {"the weather and the sea", test_environment},
        {"Standby forgets what was asked", test_reset},
    };
    return CHECK_MAIN(tests);
}
