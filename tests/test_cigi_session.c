#include "io/cigi_session.h"

#include <errno.h>

#include "tests/cigi_fixture.h"
#include "tests/cigi_session_fixture.h"
#include "tests/hex.h"

static const struct cigi_format little_3 = {3, 3, false}, little_4 = {4, 0, false};

static struct cigi_packet ship_at(double lat_deg)
{
    struct cigi_packet packet = {.kind = CIGI_ENTITY_CONTROL};
    packet.entity_control.state = CIGI_ACTIVE;
    packet.entity_control.placement.place[0] = lat_deg;
    return packet;
}

static const struct cigi_entity *own_ship(void)
{
    return cigi_scene_entity(cigi_session_scene(talk.session), 0);
}

static void test_before_a_host(void)
{
    static uint8_t data[CIGI_MESSAGE_MAX];
    struct cigi_session_params params = {.one_database = true};
    struct cigi_host host = {.format = little_3};
    CHECK_INT(cigi_session_create(&params, &talk.session), 0);
    for (unsigned i = 0; i < 3; i++) {
        cigi_session_begin(talk.session, i * FIXTURE_FRAME_NS, NULL);
        size_t size = cigi_session_message(talk.session, i * FIXTURE_FRAME_NS, data);
        CHECK_INT(size, 24);
        CHECK_INT(cigi_host_receive(&host, data, size, NULL, NULL), 0);
        CHECK(host.seen.mode == CIGI_STANDBY && host.seen.database == 0);
        CHECK(host.seen.ig_frame == i && host.seen.timestamp == i * 100000 / 60);
    }
    CHECK_INT(host.gaps, 0);
    pair_end();
    cigi_session_destroy(NULL);
}

static void test_configured_version(void)
{
    static uint8_t data[CIGI_MESSAGE_MAX];
    struct cigi_session_params params = {.major = 4};
    struct cigi_host host = {.format = little_4};
    CHECK_INT(cigi_session_create(&params, &talk.session), 0);
    size_t size = cigi_session_message(talk.session, 0, data);
    CHECK_INT(cigi_host_receive(&host, data, size, NULL, NULL), 0);
    pair_end();
}

/* The answer is in the version and byte order of the last good IG Control. */
static void test_versions(void)
{
    static const struct cigi_format formats[] = {{3, 3, false}, {3, 3, true},  {3, 2, false},
                                                 {3, 1, true},  {3, 0, false}, {4, 0, false},
                                                 {4, 0, true},  {3, 3, false}};
    struct cigi_session_params params = {.one_database = true, .major = 4};
    pair_start(&params, formats[0]);
    for (size_t i = 0; i < sizeof(formats) / sizeof(formats[0]); i++) {
        talk.host = (struct cigi_host){.format = formats[i], .frame = 5000 * (uint32_t)(i + 1)};
        pair_open();
        CHECK_INT(pair_exchange(NULL), 0);
        CHECK_INT(pair_link()->format.big, formats[i].big);
        CHECK_INT(talk.ig_size, formats[i].major == 3 && formats[i].minor < 2 ? 16 : 24);
    }
    /* What cannot be read changes nothing. */
    uint8_t data[64];
    size_t size = bytes_from_hex("180000000505000d e9030000e8030000 40e2010000000000", data, 64);
    CHECK_INT(cigi_session_receive(talk.session, data, size, talk.now_ns, NULL), -EBADMSG);
    size = bytes_from_hex("1800ffff04fb0005 ea03000060e40100 e903000000000000", data, 64);
    CHECK_INT(cigi_session_receive(talk.session, data, size, talk.now_ns, NULL), -EBADMSG);
    pair_answer();
    CHECK(pair_link()->format.major == 3 && pair_link()->format.minor == 3);
    CHECK_INT(pair_link()->counters.messages_refused, 2);
    CHECK_INT(pair_link()->counters.rejected[REJECT_VERSION], 1);
    CHECK_INT(pair_link()->counters.rejected[REJECT_MAGIC], 1);
    pair_end();
}

static void send_mode(uint8_t mode, const struct cigi_packet *more)
{
    struct cigi_packet control = {.kind = CIGI_IG_CONTROL};
    control.ig_control.mode = mode;
    control.ig_control.database = 7;
    control.ig_control.host_frame = talk.host.frame++;
    talk.writer = (struct cigi_writer){
        .data = talk.host_data, .capacity = CIGI_MESSAGE_MAX, .format = talk.host.format};
    pair_put(&control);
    if (more)
        pair_put(more);
    pair_exchange(NULL);
}

static void test_modes(void)
{
    struct cigi_session_params params = {.one_database = false};
    struct cigi_packet ship = ship_at(47.0);
    pair_start(&params, little_3);
    send_mode(CIGI_STANDBY, &ship);
    CHECK(!own_ship() && talk.host.seen.mode == CIGI_STANDBY);
    CHECK_INT(cigi_session_database_wanted(talk.session), 0);
    CHECK_INT(pair_link()->counters.packets_ignored, 1);
    send_mode(CIGI_MAINTENANCE, &ship);
    CHECK(!own_ship() && talk.host.seen.mode == CIGI_STANDBY);
    send_mode(CIGI_OPERATE, &ship);
    CHECK(own_ship() && talk.host.seen.mode == CIGI_OPERATE);
    CHECK_INT(cigi_session_database_wanted(talk.session), 7);
    ship.entity_control.placement.place[0] = 48.0;
    send_mode(CIGI_DEBUG, &ship);
    CHECK_INT(talk.host.seen.mode, CIGI_DEBUG);
    CHECK_NEAR(own_ship()->place[0], 48.0, 0.0);
    send_mode(CIGI_MAINTENANCE, NULL);
    CHECK(own_ship() && talk.host.seen.mode == CIGI_DEBUG);
    CHECK_INT(pair_link()->counters.rejected[REJECT_FIELD], 2);
    send_mode(CIGI_STANDBY, &ship);
    CHECK(!own_ship() && talk.host.seen.mode == CIGI_STANDBY);
    CHECK_INT(talk.ig_size, 24);
    pair_end();
}

/* One host frame in which the host sends `number`; returns what Start of Frame says. */
static int exchange_database(int number)
{
    struct cigi_packet control = {.kind = CIGI_IG_CONTROL};
    control.ig_control.mode = CIGI_OPERATE;
    control.ig_control.database = (int8_t)number;
    control.ig_control.host_frame = talk.host.frame++;
    talk.writer = (struct cigi_writer){
        .data = talk.host_data, .capacity = CIGI_MESSAGE_MAX, .format = talk.host.format};
    pair_put(&control);
    pair_exchange(NULL);
    return talk.host.seen.database;
}

static void test_database(void)
{
    struct cigi_session_params params = {.one_database = false};
    pair_start(&params, little_3);
    CHECK_INT(exchange_database(0), 0);
    CHECK_INT(exchange_database(5), -5);
    CHECK_INT(cigi_session_database_wanted(talk.session), 5);
    CHECK_INT(exchange_database(5), -5);                 /* it has not seen our answer yet */
    cigi_session_database_loaded(talk.session, 4, true); /* of long ago */
    CHECK_INT(cigi_session_database_wanted(talk.session), 5);
    cigi_session_database_loaded(talk.session, 5, true);
    CHECK_INT(cigi_session_database_wanted(talk.session), 0);
    CHECK_INT(exchange_database(5), -5); /* loaded, not acknowledged */
    CHECK_INT(exchange_database(0), 5);
    CHECK_INT(exchange_database(0), 5);
    CHECK_INT(exchange_database(5), -5); /* again, please */
    CHECK_INT(exchange_database(0), -5); /* acknowledged, not loaded */
    cigi_session_database_loaded(talk.session, 5, true);
    CHECK_INT(exchange_database(0), 5);
    CHECK_INT(exchange_database(9), -9);
    cigi_session_database_loaded(talk.session, 9, false);
    CHECK_INT(exchange_database(9), -128);
    CHECK_INT(exchange_database(0), -128);
    CHECK_INT(exchange_database(5), -5);
    CHECK_INT(exchange_database(-5), -5);
    CHECK_INT(pair_link()->counters.rejected[REJECT_FIELD], 1);
    pair_end();
}

static void test_scripted_database(void)
{
    struct cigi_session_params params = {.one_database = false};
    pair_start(&params, little_3);
    talk.host.database = 3;
    for (int frame = 0; frame < 10; frame++) {
        if (frame == 5)
            cigi_session_database_loaded(talk.session, 3, true);
        pair_open();
        pair_exchange(NULL);
        CHECK(talk.host.seen.database == (frame < 1 ? 0 : frame < 5 ? -3 : 3));
    }
    pair_end();
}

static void test_own_database(void)
{
    struct cigi_session_params params = {.one_database = true};
    pair_start(&params, little_3);
    CHECK_INT(exchange_database(5), 0);
    CHECK_INT(cigi_session_database_wanted(talk.session), 0);
    pair_end();
}

/* `count` frames in lock-step; both counters and the host's clock wrap on the way. */
static void run_frames(struct cigi_format format, uint32_t count)
{
    struct cigi_session_params params = {.one_database = true};
    pair_start(&params, format);
    talk.host.frame = UINT32_MAX - count / 2;
    talk.now_ns = ((nsec_t)UINT32_MAX - count * 800) * 10000; /* in ticks of 10 us */
    nsec_t first_ns = talk.now_ns;
    for (uint32_t frame = 0; frame < count; frame++) {
        struct pose pose = {.valid = POSE_POSITION | POSE_ATTITUDE | POSE_VELOCITY,
                            .position = {47.0 + frame * 1e-5, 8.0, 1000.0},
                            .attitude = {1.0, 2.0, frame % 360}};
        pair_open();
        uint32_t host_frame = talk.host.frame - 1;
        CHECK(cigi_host_put_pose(&talk.host, &talk.writer, 0, 700, &pose));
        CHECK_INT(pair_exchange(NULL), 0);
        bool echoed =
            (format.major == 3 && format.minor < 2) || talk.host.seen.host_frame == host_frame;
        if (!echoed || talk.host.seen.ig_frame != frame || pair_link()->ig_frame != frame + 1 ||
            (frame > 0 && pair_link()->ig_frame_seen != frame - 1))
            CHECK_FAIL("frame %u: %u, %u", frame, talk.host.seen.host_frame,
                       talk.host.seen.ig_frame);
        if (frame > 0 && fabs(own_ship()->place[0] - pose.position.lat_deg) > 1e-9)
            CHECK_FAIL("frame %u shows %.9f", frame, own_ship()->place[0]);
    }
    const struct cigi_counters *counters = &pair_link()->counters;
    CHECK_INT(talk.host.gaps, 0);
    CHECK(counters->messages == count && counters->lost == 0 && counters->restarts == 0);
    CHECK_INT(counters->messages_refused, 0);
    CHECK_NEAR(seconds_from_ns(pair_link()->host_ns),
               seconds_from_ns(talk.now_ns - FIXTURE_FRAME_NS - first_ns), 2e-5);
    pair_end();
}

static void test_10_000_frames(void)
{
    run_frames((struct cigi_format){3, 3, false}, 10000);
    run_frames((struct cigi_format){3, 3, true}, 10000);
    run_frames((struct cigi_format){3, 0, false}, 1000);
    run_frames((struct cigi_format){4, 0, false}, 10000);
    run_frames((struct cigi_format){4, 0, true}, 1000);
}

/* The host sends, with the number that it saw last, or one that is `less` below. */
static bool answers(uint32_t less)
{
    talk.host.seen.ig_frame -= less;
    pair_open();
    talk.host.seen.ig_frame += less;
    CHECK_INT(pair_send(), 0);
    return pair_link()->answers;
}

/* Ours counts on over its end, too. */
static void test_ig_frame_wraps(void)
{
    pair_operate(little_3);
    struct cigi_link *link = (struct cigi_link *)(uintptr_t)pair_link();
    pair_answer();
    CHECK(answers(0));
    link->ig_frame = UINT32_MAX;
    talk.host.has_seen = false;
    for (int i = 0; i < 3; i++) {
        pair_answer();
        CHECK(answers(0));
    }
    CHECK_INT(talk.host.gaps, 0);
    CHECK_INT(talk.host.seen.ig_frame, 1);
    pair_end();
}

static void test_which_message_answers(void)
{
    static const struct cigi_format formats[] = {
        {3, 3, false}, {3, 3, true}, {3, 1, false}, {4, 0, false}};
    for (size_t i = 0; i < sizeof(formats) / sizeof(formats[0]); i++) {
        pair_operate(formats[i]);
        uint64_t behind = pair_link()->counters.behind;
        for (int frame = 0; frame < 3; frame++) {
            CHECK(answers(0));
            pair_answer();
        }
        CHECK(!answers(1)); /* late: our next frame has begun meanwhile */
        CHECK(answers(0));
        CHECK(answers(0));    /* twice */
        CHECK(!answers(-1u)); /* a frame that there has not been */
        CHECK(!answers(1000));
        CHECK_INT(pair_link()->counters.behind, behind + 3);
        int waited = 0;
        for (pair_answer(); !answers(1); pair_answer())
            waited++;
        CHECK_INT(waited, 58); /* from then on it is one that is a frame behind */
        pair_answer();
        CHECK(answers(1));
        CHECK(answers(0)); /* no more */
        CHECK(!answers(1));
        pair_end();
    }
}

/* A host that fills in nothing, or always the same. */
static void test_no_frame_is_answered(void)
{
    struct cigi_session_params params = {.one_database = true};
    pair_start(&params, little_3);
    for (int frame = 0; frame < 200; frame++) {
        CHECK(answers(talk.host.seen.ig_frame - (frame < 100 ? 0 : 5)));
        pair_answer();
    }
    CHECK_INT(pair_link()->counters.behind, 0);
    pair_end();
}

static int send_frame(uint32_t frame, double lat_deg)
{
    struct cigi_packet ship = ship_at(lat_deg);
    talk.host.frame = frame;
    pair_open();
    pair_put(&ship);
    return pair_exchange(NULL);
}

static void test_disorder(void)
{
    pair_operate(little_3);
    CHECK_INT(send_frame(10, 1.0), 0);
    CHECK_INT(send_frame(12, 2.0), 0);
    CHECK_INT(send_frame(11, 3.0), -EBADMSG); /* overtaken */
    CHECK_NEAR(own_ship()->place[0], 2.0, 0.0);
    CHECK_INT(pair_link()->counters.rejected[REJECT_LATE], 1);
    CHECK_INT(send_frame(12, 4.0), 0); /* a host that does not count */
    CHECK_NEAR(own_ship()->place[0], 4.0, 0.0);
    CHECK_INT(pair_link()->counters.lost, 9); /* 2 .. 9 and 11 */
    CHECK_INT(send_frame(100000, 5.0), 0);
    CHECK_INT(send_frame(0, 6.0), 0); /* it began anew */
    CHECK_NEAR(own_ship()->place[0], 6.0, 0.0);
    CHECK_INT(pair_link()->counters.restarts, 2);
    CHECK_INT(send_frame(20, 7.0), 0);
    talk.now_ns += NSEC_PER_SEC / 2;
    CHECK_INT(send_frame(1, 8.0), 0); /* it ran for 20 frames only, and began anew */
    CHECK_NEAR(own_ship()->place[0], 8.0, 0.0);
    CHECK_INT(pair_link()->counters.restarts, 3);
    CHECK_INT(send_frame(0, 9.0), -EBADMSG);
    /* Another host, whose frame numbers are its own; before it one that counted ours. */
    talk.host.format.minor = 1;
    CHECK_INT(send_frame(0, 10.0), 0);
    talk.host.format.minor = 3;
    uint32_t counted = pair_link()->host_frame;
    CHECK_INT(send_frame(counted - 1, 11.0), 0);
    CHECK_NEAR(own_ship()->place[0], 11.0, 0.0);
    pair_end();
}

/* Bytes after the IG Control of a good message; then own-ship at 40 N. */
static int receive_with(const char *hex, bool framed)
{
    uint8_t data[1024];
    struct cigi_packet ship = ship_at(40.0);
    pair_open();
    talk.writer.size += bytes_from_hex(hex, talk.host_data + talk.writer.size, sizeof(data));
    pair_put(&ship);
    int r = pair_exchange(NULL);
    CHECK((own_ship() != NULL) == framed);
    return r;
}

static void check_bad(const char *hex, bool framed, enum reject_reason reason)
{
    struct cigi_packet said[8];
    pair_operate(little_3);
    int r = receive_with(hex, framed);
    const struct cigi_counters *counters = &pair_link()->counters;
    if (reason == REJECT_NONE) {
        CHECK_INT(r, 0);
        CHECK_INT(counters->skipped + counters->unknown, 1);
    } else {
        CHECK_INT(r, CIGI_PARTLY);
        if (talk.why.reason != reason || counters->rejected[reason] != 1)
            CHECK_FAIL("\"%s\" is refused as %s: %s", hex, reject_reason_name(talk.why.reason),
                       talk.why.text);
        CHECK_INT(pair_responses(CIGI_MESSAGE, said, 8), 1);
        CHECK_INT(said[0].message.id, CIGI_SAY_REFUSED);
        CHECK(strncmp(said[0].message.text, talk.why.text, CIGI_TEXT_MAX - 1) == 0);
    }
    pair_end();
}

static void test_bad_input(void)
{
    /* Sizes of 0, not of eights, past the end. */
    check_bad("0900121e1f000000", false, REJECT_LENGTH);
    check_bad("090c121e1f000000", false, REJECT_LENGTH);
    check_bad("09f8121e1f000000", false, REJECT_LENGTH);
    /* Too short, no number, beyond the Earth: the rest is used. */
    check_bad("0908121e1f000000", true, REJECT_SHORT);
    check_bad("0a20012800007041 0000807f00002041 0000000000008743 00507d4400000000", true,
              REJECT_NOT_FINITE);
    check_bad("0230070001000000 bc02000000000000 0000000000000000 0000000000c05640 "
              "23dbf97e6a1c2140 0000000000719740",
              true, REJECT_RANGE); /* latitude 91 */
    /* A second IG Control; what only an image generator sends. */
    check_bad("011803053d000080 e903000040e20100 e803000000000000", true, REJECT_FIELD);
    check_bad("66104d0093000000 0000000000087b40", true, REJECT_FIELD);
    /* A date that is none; degrees of freedom that are none. */
    check_bad("0910121e1f000000 b9c9ff0f00004842", true, REJECT_RANGE);
    /* Things that are not there. */
    check_bad("0318180000000000 0000000000000000 0000000000000000", true, REJECT_REFERENCE);
    check_bad("0820180000000000 0000000000000000 0000000000000000 0000000000000000", true,
              REJECT_REFERENCE);
    check_bad("06201800017f0000 0000000000000000 0000000000000000 0000000000000000", true,
              REJECT_REFERENCE);
    check_bad("10201800003f0000 0000000000000000 0000000000000000 0000000000000000", true,
              REJECT_REFERENCE);
    check_bad("10200100093f0000 0000000000000000 0000000000000000 0000000000000000", true,
              REJECT_REFERENCE);
    check_bad("0230070002000000 bc02000000000000 0000000000000000 0000000000000000 "
              "0000000000000000 0000000000000000",
              true, REJECT_REFERENCE); /* destroyed, and never made */
    check_bad("0230070005000000 bc02090000000000 0000000000000000 0000000000000000 "
              "0000000000000000 0000000000000000",
              true, REJECT_REFERENCE); /* attached to entity 9 */
    check_bad("15200100023f0000 0000003f00504347 0000f0410000f0c1 0000a0410000a0c1", true,
              REJECT_RANGE); /* a view from right to left */
    /* Of the standard, and not. */
    check_bad("1118000000000000 0000000000000000 0000000000000000", true, REJECT_NONE);
    check_bad("c910000000000000 0000000000000000", true, REJECT_NONE);
}

static void test_told_once_a_second(void)
{
    struct cigi_packet said[8];
    int told = 0;
    pair_operate(little_3);
    for (int frame = 0; frame < 180; frame++) {
        pair_open();
        talk.writer.size +=
            bytes_from_hex("0908121e1f000000", talk.host_data + talk.writer.size, 8);
        CHECK_INT(pair_exchange(NULL), CIGI_PARTLY);
        told += (int)pair_responses(CIGI_MESSAGE, said, 8);
    }
    CHECK_INT(told, 3);
    CHECK_INT(pair_link()->counters.rejected[REJECT_SHORT], 180);
    pair_end();
}

/* Random bytes in the middle of everything: it goes on. */
static void test_noise(void)
{
    uint32_t random = 1;
    pair_operate(little_3);
    for (int round = 0; round < 20000; round++) {
        uint8_t data[512];
        size_t size = bytes_from_hex(cigi_golden_host_3, data, sizeof(data));
        for (int i = 0; i < 4; i++) {
            random = random * 1664525 + 1013904223;
            data[24 + (random >> 8) % (size - 24)] = (uint8_t)(random >> 24);
        }
        memcpy(data + 8, &(uint32_t){(uint32_t)round + 2},
               4); /* host frame; we are little-endian */
        CHECK(cigi_session_receive(talk.session, data, size, talk.now_ns, NULL) >= 0);
        cigi_session_begin(talk.session, talk.now_ns, NULL);
        pair_answer();
    }
    CHECK_INT(talk.host.gaps, 0);
    CHECK_INT(pair_link()->counters.messages, 20001);
    pair_end();
}

static void test_status(void)
{
    CHECK_INT(cigi_status_from_fault(0), 0);
    CHECK_INT(cigi_status_from_fault(101), 1);
    CHECK_INT(cigi_status_from_fault(139), 39);
    CHECK_INT(cigi_status_from_fault(203), 43);
    CHECK_INT(cigi_status_from_fault(303), 83);
    CHECK_INT(cigi_status_from_fault(501), 161);
    CHECK_INT(cigi_status_from_fault(639), 239);
    CHECK_INT(cigi_status_from_fault(140), 255);
    CHECK_INT(cigi_status_from_fault(99), 255);
    pair_operate(little_3);
    cigi_session_set_status(talk.session, 203, CIGI_PAGING);
    pair_open();
    pair_exchange(NULL);
    CHECK_INT(talk.host.seen.status, 43);
    pair_end();
    pair_operate(little_4);
    cigi_session_set_status(talk.session, 203, CIGI_PAGING | CIGI_OVERFRAMING);
    pair_open();
    pair_exchange(NULL);
    CHECK_INT(talk.host.seen.condition, 0x300);
    CHECK_INT(talk.ig_data[21], 3); /* as the standard has it for a little-endian sender */
    pair_end();
}

static void test_sayings(void)
{
    struct cigi_packet said[16];
    pair_operate(little_3);
    char text[200];
    memset(text, 'x', sizeof(text) - 1);
    text[199] = 0;
    for (int i = 0; i < 20; i++)
        cigi_session_say(talk.session, (uint16_t)(200 + i), text);
    pair_open();
    pair_exchange(NULL);
    CHECK_INT(pair_responses(CIGI_MESSAGE, said, 16), 8);
    CHECK_INT(said[7].message.id, 207);
    CHECK_INT(strlen(said[0].message.text), CIGI_TEXT_MAX - 1);
    pair_open();
    pair_exchange(NULL);
    CHECK_INT(pair_responses(CIGI_MESSAGE, said, 16), 0);
    pair_end();
}

/* The place holds for the frame that its message starts, though the host extrapolates; then its
 * rates move it. Asynchronously it would have moved from its arrival on. */
static void test_synchronous(void)
{
    for (int synchronous = 0; synchronous < 2; synchronous++) {
        struct cigi_session_params params = {.one_database = true, .synchronous = synchronous};
        struct cigi_packet ship = ship_at(10.0), rate = {.kind = CIGI_RATE};
        ship.entity_control.extrapolate = 1;
        rate.rate.linear_mps[2] = -60.0f; /* up a metre a frame */
        pair_start(&params, little_3);
        pair_open();
        CHECK_INT(pair_exchange(NULL), 0);
        pair_open();
        pair_put(&ship);
        pair_put(&rate);
        CHECK_INT(pair_send(), 0);
        cigi_session_advance(talk.session, talk.now_ns + FIXTURE_FRAME_NS);
        CHECK_NEAR(own_ship()->place[2], synchronous ? 0.0 : 1.0, 1e-6);
        cigi_session_advance(talk.session, talk.now_ns + 2 * FIXTURE_FRAME_NS);
        CHECK_NEAR(own_ship()->place[2], synchronous ? 1.0 : 2.0, 1e-6);
        pair_end();
    }
}

int main(void)
{
    static const struct check_test tests[] = {
        {"before a host speaks, Start of Frame is 3.3 in Standby", test_before_a_host},
        {"the version until then can be chosen", test_configured_version},
        {"a host is answered in its own version and byte order", test_versions},
        {"Standby and Maintenance ignore what they must; a reset forgets all", test_modes},
        {"databases are asked for, loaded, acknowledged and refused", test_database},
        {"the scripted host leads to its database", test_scripted_database},
        {"with one database the number is 0", test_own_database},
        {"10 000 frames in step, over the wraps of frames and time stamps", test_10_000_frames},
        {"our frame number wraps", test_ig_frame_wraps},
        {"the message that answers a frame is the one that echoes it", test_which_message_answers},
        {"hosts that echo no frame are taken as they are", test_no_frame_is_answered},
        {"messages out of order, lost ones, hosts that begin anew", test_disorder},
        {"a bad packet is counted by reason, told, and costs no other", test_bad_input},
        {"a reason is told once a second", test_told_once_a_second},
        {"noise within messages stops nothing", test_noise},
        {"in step, a place holds for the frame that it starts", test_synchronous},
        {"faults have their IG status", test_status},
        {"IG Messages are cut and limited", test_sayings},
    };
    return CHECK_MAIN(tests);
}
