#include "io/cigi_codec.h"

#include <errno.h>

#include "tests/check.h"
#include "tests/cigi_fixture.h"
#include "tests/hex.h"

#define PACKETS_MAX 16

static struct cigi_packet packets[PACKETS_MAX];

/* Reads a whole message; every packet must be read. Returns how many there are. */
static size_t read_all(const uint8_t *data, size_t size, struct cigi_format *ret_format)
{
    struct cigi_reader reader;
    struct rejection why = {.text = ""};
    CHECK_INT(cigi_read_begin(data, size, &reader, &why), 0);
    if (*why.text) {
        CHECK_STRING(why.text, "");
        return 0;
    }
    *ret_format = reader.format;
    size_t count = 0;
    for (int r; count < PACKETS_MAX && (r = cigi_read(&reader, &packets[count], &why)); count++) {
        CHECK_INT(r, CIGI_PACKET);
        if (r != CIGI_PACKET)
            CHECK_STRING(why.text, "");
    }
    return count;
}

static size_t read_hex(const char *hex, struct cigi_format *ret_format)
{
    uint8_t data[1024];
    return read_all(data, bytes_from_hex(hex, data, sizeof(data)), ret_format);
}

static void test_host_message_3(void)
{
    struct cigi_format format;
    CHECK_INT(read_hex(cigi_golden_host_3, &format), 8);
    CHECK(format.major == 3 && format.minor == 3 && !format.big);
    CHECK_INT(packets[0].kind, CIGI_IG_CONTROL);
    const struct cigi_ig_control *control = &packets[0].ig_control;
    CHECK_INT(control->database, 5);
    CHECK_INT(control->mode, CIGI_OPERATE);
    CHECK(control->timestamp_valid == 1 && control->extrapolate == 1 && control->minor == 3);
    CHECK_INT(control->host_frame, 1001);
    CHECK_INT(control->timestamp, 123456);
    CHECK_INT(control->ig_frame, 1000);
    const struct cigi_entity_control *entity = &packets[1].entity_control;
    CHECK_INT(packets[1].kind, CIGI_ENTITY_CONTROL);
    CHECK(entity->entity == 0 && entity->state == CIGI_ACTIVE && entity->extrapolate == 1);
    CHECK(entity->type == 700 && entity->alpha == 255 && !entity->placement.attach);
    CHECK_NEAR(entity->placement.roll_deg, -12.5, 0.0);
    CHECK_NEAR(entity->placement.pitch_deg, 3.25, 0.0);
    CHECK_NEAR(entity->placement.yaw_deg, 271.5, 0.0);
    CHECK_NEAR(entity->placement.place[0], 47.4582, 0.0);
    CHECK_NEAR(entity->placement.place[1], 8.5555, 0.0);
    CHECK_NEAR(entity->placement.place[2], 1500.25, 0.0);
    const struct cigi_view_definition *view = &packets[2].view_definition;
    CHECK_INT(packets[2].kind, CIGI_VIEW_DEFINITION);
    CHECK(view->view == 1 && view->group == 2 && view->use == 0x3f && view->mirror == 0);
    CHECK_NEAR(view->near_m, 0.5, 0.0);
    CHECK_NEAR(view->far_m, 50000.0, 0.0);
    CHECK(view->left == -30.0f && view->right == 30.0f && view->top == 20.0f);
    CHECK(view->bottom == -20.0f);
    const struct cigi_view_control *eye = &packets[3].view_control;
    CHECK(eye->view == 1 && eye->group == 0 && eye->entity == 0 && eye->use == 0x3f);
    CHECK(eye->offset_m[0] == 4.5f && eye->offset_m[1] == -0.5f && eye->offset_m[2] == -1.25f);
    CHECK_NEAR(eye->yaw_deg, 300.0, 0.0);
}

static void test_requests_and_weather_3(void)
{
    struct cigi_format format;
    read_hex(cigi_golden_host_3, &format);
    const struct cigi_height_request *height = &packets[4].height_request;
    CHECK_INT(packets[4].kind, CIGI_HEIGHT_REQUEST);
    CHECK(height->request == 77 && height->type == CIGI_HAT_HOT_EXTENDED && !height->of_entity);
    CHECK_NEAR(height->place[2], 1500.25, 0.0);
    const struct cigi_vector_request *sight = &packets[5].vector_request;
    CHECK_INT(packets[5].kind, CIGI_VECTOR_REQUEST);
    CHECK(sight->request == 9 && !sight->extended && sight->material_mask == 0xffffffff);
    CHECK(sight->azimuth_deg == 45.0f && sight->elevation_deg == -10.0f);
    CHECK(sight->least_m == 1.0f && sight->most_m == 20000.0f);
    const struct cigi_atmosphere *air = &packets[6].atmosphere;
    CHECK(air->enable == 1 && air->humidity_percent == 40 && air->temperature_c == 15.0f);
    CHECK(air->visibility_m == 8000.0f && air->wind_mps == 10.0f && air->wind_from_deg == 270.0f);
    CHECK_NEAR(air->pressure_hpa, 1013.25, 0.0);
    const struct cigi_celestial *sky = &packets[7].celestial;
    CHECK(sky->hour == 18 && sky->minute == 30 && sky->date == 6212025);
    CHECK(sky->ephemeris && sky->sun && sky->moon && sky->stars && sky->date_valid);
    CHECK_NEAR(sky->star_percent, 50.0, 0.0);
}

static void test_ig_message_3(void)
{
    struct cigi_format format;
    CHECK_INT(read_hex(cigi_golden_ig_3, &format), 4);
    const struct cigi_start_of_frame *start = &packets[0].start_of_frame;
    CHECK(start->database == -5 && start->status == 0 && start->mode == CIGI_OPERATE);
    CHECK(start->timestamp_valid == 1 && start->earth_of_host == 0 && start->minor == 3);
    CHECK(start->ig_frame == 1002 && start->timestamp == 124000 && start->host_frame == 1001);
    const struct cigi_height_response *height = &packets[1].height_response;
    CHECK(height->request == 77 && height->valid && height->hot && height->frame_low == 9);
    CHECK_NEAR(height->height_m, 432.5, 0.0);
    const struct cigi_height_extended *more = &packets[2].height_extended;
    CHECK(more->request == 78 && more->material == 11 && more->valid && more->frame_low == 9);
    CHECK(more->hat_m == 1067.75 && more->hot_m == 432.5);
    CHECK(more->normal_azimuth_deg == 10.0f && more->normal_elevation_deg == 88.0f);
    const struct cigi_sight_response *sight = &packets[3].sight_response;
    CHECK(sight->request == 9 && sight->valid && sight->visible && !sight->entity_valid);
    CHECK(sight->count == 1 && sight->frame_low == 9 && sight->range_m == 6150.5);
}

static void test_message_4(void)
{
    struct cigi_format format;
    CHECK_INT(read_hex(cigi_golden_host_4, &format), 8);
    CHECK(format.major == 4 && format.minor == 0 && !format.big);
    const struct cigi_ig_control *control = &packets[0].ig_control;
    CHECK(control->host_frame == 1001 && control->ig_frame == 1000 && control->timestamp == 123456);
    CHECK(control->database == 5 && control->extrapolate && control->mode == CIGI_OPERATE);
    const struct cigi_entity_control *entity = &packets[1].entity_control;
    CHECK(entity->state == CIGI_ACTIVE && entity->extrapolate && entity->extended);
    CHECK(entity->alpha == 255 && entity->type == 225);
    CHECK(entity->dis_kind == 1 && entity->dis_domain == 2 && entity->dis_category == 1);
    CHECK(entity->dis_subcategory == 9 && entity->dis_specific == 3 && entity->dis_extra == 0);
    const struct cigi_placement *placement = &packets[2].entity_position.placement;
    CHECK_INT(packets[2].kind, CIGI_ENTITY_POSITION);
    CHECK(placement->roll_deg == -12.5f && placement->place[2] == 1500.25);
    CHECK(packets[3].view_definition.bottom == -20.0f && packets[4].view_control.view == 1);
    CHECK(packets[5].height_request.request == 77 && packets[5].height_request.type == 2);
    CHECK(packets[6].atmosphere.enable == 1 && packets[6].atmosphere.humidity_percent == 40);
    CHECK(packets[7].celestial.seconds == 15.0f && packets[7].celestial.date == 6212025);
    CHECK_INT(read_hex(cigi_golden_ig_4, &format), 3);
    CHECK(packets[0].start_of_frame.database == -5 && packets[0].start_of_frame.ig_frame == 1002);
    CHECK(packets[1].height_response.height_m == 432.5 &&
          packets[2].height_extended.hat_m == 1067.75);
}

/* What was read in `format` is written as it was; and through the other byte order, too. */
static void check_written(const char *hex)
{
    uint8_t golden[1024], written[1024], other[1024];
    size_t size = bytes_from_hex(hex, golden, sizeof(golden));
    struct cigi_writer same = {.data = written, .capacity = sizeof(written)};
    size_t count = read_all(golden, size, &same.format);
    struct cigi_writer swapped = {.data = other, .capacity = sizeof(other), .format = same.format};
    swapped.format.big = !same.format.big;
    for (size_t i = 0; i < count; i++)
        CHECK(cigi_write(&same, &packets[i]) && cigi_write(&swapped, &packets[i]));
    CHECK_INT(same.size, size);
    CHECK(memcmp(written, golden, size) == 0);
    CHECK_INT(swapped.size, size);
    CHECK(memcmp(other, golden, size) != 0);
    struct cigi_writer back = {.data = written, .capacity = sizeof(written)};
    CHECK_INT(read_all(other, swapped.size, &back.format), count);
    CHECK(back.format.big == swapped.format.big);
    back.format = same.format;
    for (size_t i = 0; i < count; i++)
        CHECK(cigi_write(&back, &packets[i]));
    CHECK(back.size == size && memcmp(written, golden, size) == 0);
}

static void test_bytes(void)
{
    check_written(cigi_golden_host_3);
    check_written(cigi_golden_ig_3);
    check_written(cigi_golden_host_4);
    check_written(cigi_golden_ig_4);
    check_written(cigi_golden_big_3);
}

static void test_big_endian(void)
{
    struct cigi_format format;
    CHECK_INT(read_hex(cigi_golden_big_3, &format), 1);
    CHECK(format.big && format.minor == 3);
    CHECK_INT(packets[0].ig_control.host_frame, 1001);
    CHECK_INT(packets[0].ig_control.timestamp, 123456);
}

/* Every kind, every field with a value of its own: nothing overlaps, nothing is lost. */
static void fill(struct cigi_packet *packet, const struct cigi_layout *layout, int g)
{
    for (size_t i = 0; i < layout->count; i++) {
        const struct cigi_field *field = &layout->fields[i];
        void *member = (char *)packet + field->member;
        float single = 1.5f + (float)i;
        double whole = 60.25 - (double)i;
        uint32_t word = 0x01020304u + (uint32_t)i;
        if (!field->at[g])
            continue;
        if (field->type == CIGI_F32)
            memcpy(member, &single, sizeof(single));
        else if (field->type == CIGI_F64)
            memcpy(member, &whole, sizeof(whole));
        else if (field->type == CIGI_BITS)
            *(uint8_t *)member = 1;
        else
            memcpy(member, &word, field->type == CIGI_U32 ? 4 : field->type == CIGI_U16 ? 2 : 1);
    }
}

static void check_kind(enum cigi_kind kind, struct cigi_format format)
{
    struct cigi_packet packet = {.kind = kind}, again;
    fill(&packet, &cigi_layouts[kind], format.major == 4);
    if (kind == CIGI_MESSAGE)
        strcpy(packet.message.text, "the ground is late");
    uint8_t data[512];
    struct cigi_writer writer = {.data = data, .capacity = sizeof(data), .format = format};
    struct cigi_packet head = {.kind = CIGI_IG_CONTROL};
    CHECK(cigi_write(&writer, &head) && cigi_write(&writer, &packet));
    CHECK_INT(writer.size % 8, 0);
    struct cigi_reader reader;
    CHECK_INT(cigi_read_begin(data, writer.size, &reader, NULL), 0);
    CHECK_INT(cigi_read(&reader, &again, NULL), CIGI_PACKET);
    CHECK_INT(cigi_read(&reader, &again, NULL), CIGI_PACKET);
    CHECK_INT(cigi_read(&reader, &packets[0], NULL), CIGI_END);
    CHECK_INT(again.kind, kind);
    if (kind == CIGI_IG_CONTROL || kind == CIGI_START_OF_FRAME)
        return; /* the writer gives them the version */
    if (memcmp(&again, &packet, sizeof(packet)) != 0)
        CHECK_FAIL("%s of %d.%d is not read as it was written", cigi_layouts[kind].name,
                   format.major, format.minor);
}

static void test_every_kind(void)
{
    for (int kind = 0; kind < CIGI_KINDS; kind++) {
        for (int big = 0; big < 2; big++) {
            if (cigi_layouts[kind].id[0] >= 0)
                check_kind((enum cigi_kind)kind, (struct cigi_format){3, 3, big});
            check_kind((enum cigi_kind)kind, (struct cigi_format){4, 0, big});
        }
    }
}

/* 3.0 and 3.1: a head of 16 bytes with one frame counter. */
static void test_old_heads(void)
{
    uint8_t data[64];
    struct cigi_format format;
    size_t size = bytes_from_hex("0110030001000080 2a00000040e20100", data, sizeof(data));
    CHECK_INT(read_all(data, size, &format), 1);
    CHECK(format.major == 3 && format.minor == 0);
    CHECK(packets[0].ig_control.host_frame == 42 && packets[0].ig_control.ig_frame == 0);
    struct cigi_writer writer = {.data = data, .capacity = sizeof(data), .format = {3, 1, false}};
    struct cigi_packet start = {.kind = CIGI_START_OF_FRAME};
    start.start_of_frame.ig_frame = 7;
    CHECK(cigi_write(&writer, &start));
    CHECK_INT(writer.size, 16);
    CHECK_INT(read_all(data, 16, &format), 1);
    CHECK(format.minor == 1 && packets[0].start_of_frame.ig_frame == 7);
}

static void test_whole_seconds(void)
{
    uint8_t data[64];
    struct cigi_format format;
    size_t size = bytes_from_hex("180000000400000d e9030000e8030000 40e2010000000000"
                                 "180008001f00121e 2a000000b9c95e00 0000484200000000",
                                 data, sizeof(data));
    CHECK_INT(read_all(data, size, &format), 2);
    CHECK_NEAR(packets[1].celestial.seconds, 42.0, 0.0);
}

/* No message at all. */
static void test_no_message(void)
{
    static const struct {
        const char *hex;
        enum reject_reason reason;
    } cases[] = {
        {"", REJECT_SHORT},
        {"01180305", REJECT_SHORT},
        {"011803053d000080", REJECT_SHORT},
        {"0110030501000080e903000040e201", REJECT_SHORT},
        {"18000000040500", REJECT_SHORT},
        {"180000000405000d e903", REJECT_SHORT},
        {"4f54575001000080 0000002a0000000f", REJECT_MAGIC},
        {"023000000110ff00 bc020000000048c1", REJECT_MAGIC},
        {"011802053d000080 e903000040e20100 e803000000000000", REJECT_VERSION},
        {"180000000505000d e9030000e8030000 40e2010000000000", REJECT_VERSION},
        {"011803053d000000 e903000040e20100 e803000000000000", REJECT_FIELD},
        {"012003053d000080 e903000040e20100 e803000000000000", REJECT_SHORT},
    };
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        uint8_t data[64];
        struct cigi_reader reader;
        struct rejection why = {.reason = REJECT_NONE};
        size_t size = bytes_from_hex(cases[i].hex, data, sizeof(data));
        CHECK_INT(cigi_read_begin(data, size, &reader, &why), -EBADMSG);
        if (why.reason != cases[i].reason)
            CHECK_FAIL("\"%s\" is refused as %s: %s", cases[i].hex, reject_reason_name(why.reason),
                       why.text);
    }
}

/* A message whose second packet is `hex`, then a Celestial Sphere Control. */
static int read_second(const char *hex, struct rejection *ret_rejection, int *ret_third)
{
    uint8_t data[256];
    size_t size = bytes_from_hex(cigi_golden_host_3, data, 24);
    size += bytes_from_hex(hex, data + size, sizeof(data) - size);
    size += bytes_from_hex("0910121e1f000000 b9c95e0000004842", data + size, sizeof(data) - size);
    struct cigi_reader reader;
    CHECK_INT(cigi_read_begin(data, size, &reader, NULL), 0);
    CHECK_INT(cigi_read(&reader, &packets[0], NULL), CIGI_PACKET);
    int r = cigi_read(&reader, &packets[1], ret_rejection);
    *ret_third = cigi_read(&reader, &packets[2], NULL);
    return r;
}

static void check_second(const char *hex, int expected, enum reject_reason reason, bool goes_on)
{
    struct rejection why = {.reason = REJECT_NONE};
    int third = -1, r = read_second(hex, &why, &third);
    if (r != expected || (r < 0 && why.reason != reason))
        CHECK_FAIL("\"%s\": %d, %s: %s", hex, r, reject_reason_name(why.reason), why.text);
    CHECK_INT(third, goes_on ? CIGI_PACKET : CIGI_END);
    if (goes_on)
        CHECK_INT(packets[2].kind, CIGI_CELESTIAL);
}

static void test_bad_packets(void)
{
    /* Framing that cannot be: the rest is lost. */
    check_second("0900121e1f000000 b9c95e0000004842", -EBADMSG, REJECT_LENGTH, false);
    check_second("0913121e1f000000 b9c95e0000004842", -EBADMSG, REJECT_LENGTH, false);
    check_second("09f8121e1f000000 b9c95e0000004842", -EBADMSG, REJECT_LENGTH, false);
    /* Packets that cannot be: the rest is used. */
    check_second("0908121e1f000000", -EBADMSG, REJECT_SHORT, true);
    check_second("0910121e1f000000 b9c95e000000807f", -EBADMSG, REJECT_NOT_FINITE, true);
    check_second("0910121e1f000000 b9c95e000000c07f", -EBADMSG, REJECT_NOT_FINITE, true);
    check_second("18204d0002000000 000000000000f87f 23dbf97e6a1c2140 0000000000719740", -EBADMSG,
                 REJECT_NOT_FINITE, true);
    check_second("18204d0002000000 7b832f4ca6ba4740 ffffffffffffef7f 0000000000719740", -EBADMSG,
                 REJECT_RANGE, true);
    /* Unknown ones are passed over, longer ones read as far as they are known. */
    check_second("c808000000000000", CIGI_UNKNOWN, REJECT_NONE, true);
    check_second("1118000000000000 0000000000000000 0000000000000000", CIGI_SKIPPED, REJECT_NONE,
                 true);
    check_second("0918121e1f000000 b9c95e0000004842 ffffffffffffffff", CIGI_PACKET, REJECT_NONE,
                 true);
}

/* Reads it back; `ok`: it is to be read, else to be refused. */
static void check_taken(const struct cigi_packet *packet, bool ok)
{
    static const struct cigi_format formats[] = {{3, 3, false}, {4, 0, true}};
    for (size_t i = 0; i < sizeof(formats) / sizeof(formats[0]); i++) {
        struct cigi_packet head = {.kind = CIGI_IG_CONTROL}, again;
        struct cigi_reader reader;
        uint8_t data[256];
        struct cigi_writer writer = {.data = data, .capacity = 256, .format = formats[i]};
        if (packet->kind == CIGI_ENTITY_CONTROL && formats[i].major == 4)
            continue; /* it has no numbers */
        CHECK(cigi_write(&writer, &head) && cigi_write(&writer, packet));
        CHECK_INT(cigi_read_begin(data, writer.size, &reader, NULL), 0);
        CHECK_INT(cigi_read(&reader, &again, NULL), CIGI_PACKET);
        int r = cigi_read(&reader, &again, NULL);
        if (r != (ok ? CIGI_PACKET : -EBADMSG))
            CHECK_FAIL("%s of %d.%d: %d", cigi_layouts[packet->kind].name, formats[i].major,
                       formats[i].minor, r);
    }
}

/* Each of six numbers is used by a bit of its own. */
static void check_used(struct cigi_packet *packet, uint8_t *use, float *const numbers[6])
{
    for (int i = 0; i < 6; i++) {
        *numbers[i] = NAN;
        *use = (uint8_t)(0x3f & ~(1 << i));
        check_taken(packet, true);
        *use = (uint8_t)(1 << i);
        check_taken(packet, false);
        *numbers[i] = 1.0f;
    }
}

static void test_unused_numbers(void)
{
    struct cigi_packet packet = {.kind = CIGI_VIEW_DEFINITION};
    struct cigi_view_definition *d = &packet.view_definition;
    check_used(&packet, &d->use,
               (float *[]){&d->near_m, &d->far_m, &d->left, &d->right, &d->top, &d->bottom});
    packet = (struct cigi_packet){.kind = CIGI_VIEW_CONTROL};
    struct cigi_view_control *v = &packet.view_control;
    check_used(&packet, &v->use,
               (float *[]){&v->offset_m[0], &v->offset_m[1], &v->offset_m[2], &v->roll_deg,
                           &v->pitch_deg, &v->yaw_deg});
    packet = (struct cigi_packet){.kind = CIGI_ARTICULATED_PART};
    struct cigi_articulated_part *a = &packet.articulated_part;
    check_used(&packet, &a->use,
               (float *[]){&a->offset_m[0], &a->offset_m[1], &a->offset_m[2], &a->roll_deg,
                           &a->pitch_deg, &a->yaw_deg});
    for (int i = 0; i < 4; i++) {
        packet = (struct cigi_packet){.kind = CIGI_ENTITY_CONTROL};
        packet.entity_control.placement.place[i % 3] = i < 3 ? NAN : 1e300;
        packet.entity_control.placement.yaw_deg = INFINITY;
        check_taken(&packet, false);
        packet.entity_control.state = CIGI_DESTROYED;
        check_taken(&packet, true);
        packet = (struct cigi_packet){.kind = CIGI_HEIGHT_REQUEST};
        packet.height_request.type = CIGI_HOT;
        packet.height_request.place[i % 3] = i < 3 ? NAN : -1e300;
        check_taken(&packet, i == 2);
        packet.height_request.of_entity = 1;
        check_taken(&packet, false);
    }
}

static void test_what_is_passed_over(void)
{
    struct rejection why;
    int third;
    read_second("1118000000000000 0000000000000000 0000000000000000", &why, &third);
    CHECK_CONTAINS(why.text, "Sensor Control");
    read_second("c808000000000000", &why, &third);
    CHECK_CONTAINS(why.text, "unknown");
    CHECK(cigi_other_name(0, 34) && cigi_other_name(1, 0x26) && !cigi_other_name(1, 0x27));
}

static void test_no_room(void)
{
    uint8_t data[24];
    struct cigi_writer writer = {.data = data, .capacity = sizeof(data), .format = {3, 3, false}};
    struct cigi_packet packet = {.kind = CIGI_START_OF_FRAME};
    CHECK(cigi_write(&writer, &packet));
    CHECK(!cigi_write(&writer, &packet));
    CHECK_INT(writer.size, 24);
    struct cigi_packet position = {.kind = CIGI_ENTITY_POSITION};
    writer.size = 0;
    CHECK(!cigi_write(&writer, &position)); /* 3.3 has no such packet */
    struct cigi_packet message = {.kind = CIGI_MESSAGE};
    memset(message.message.text, 'x', CIGI_TEXT_MAX); /* nor a NUL */
    uint8_t room[120];
    writer = (struct cigi_writer){.data = room, .capacity = sizeof(room), .format = {3, 3, false}};
    CHECK(cigi_write(&writer, &message));
    CHECK_INT(writer.size, 104);
    CHECK_INT(room[103], 0);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"a 3.3 host's message is read field by field", test_host_message_3},
        {"its requests and its weather, too", test_requests_and_weather_3},
        {"a 3.3 image generator's message is read field by field", test_ig_message_3},
        {"messages of 4.0 are read field by field", test_message_4},
        {"what was read is written again, byte for byte, in both orders", test_bytes},
        {"a big-endian host is understood", test_big_endian},
        {"every field of every packet has its own place", test_every_kind},
        {"3.0 and 3.1 have shorter heads", test_old_heads},
        {"seconds may be whole numbers or floats", test_whole_seconds},
        {"what is no CIGI is refused for its reason", test_no_message},
        {"a bad packet costs no more than it must", test_bad_packets},
        {"what a packet says is not used may be anything", test_unused_numbers},
        {"what is passed over has a name", test_what_is_passed_over},
        {"the writer stays in its room and its version", test_no_room},
    };
    return CHECK_MAIN(tests);
}
