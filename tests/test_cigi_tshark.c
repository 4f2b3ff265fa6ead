/* Wireshark reads every CIGI 3.x packet that we send, and finds in it what we meant. */
#include "io/cigi_codec.h"
#include "tests/tshark.h"

#define NAME(f) "cigi." f

static const struct cigi_format *format;
static uint8_t data[CIGI_MESSAGE_MAX];
static struct cigi_writer writer;
static struct tshark_expected expected;

static void expect(const char *name, double value)
{
    tshark_expect(&expected, name, value);
}

/* Wireshark has two sets of names for this packet. */
static void expect_extended(const char *field, double value)
{
    char name[64];
    snprintf(name, sizeof(name), NAME("%slos_ext_response.%s"), format->minor >= 2 ? "3_2_" : "",
             field);
    expect(name, value);
}

/* A message of Start of Frame and one packet. */
static void begin(const struct cigi_packet *packet)
{
    struct cigi_packet start = {.kind = CIGI_START_OF_FRAME};
    start.start_of_frame = (struct cigi_start_of_frame){.database = -5,
                                                        .status = 43,
                                                        .mode = CIGI_OPERATE,
                                                        .timestamp_valid = 1,
                                                        .ig_frame = 1002,
                                                        .timestamp = 124000,
                                                        .host_frame = 1001};
    writer = (struct cigi_writer){.data = data, .capacity = sizeof(data), .format = *format};
    CHECK(cigi_write(&writer, &start));
    if (packet)
        CHECK(cigi_write(&writer, packet));
    expected.count = 0;
}

static void check(void)
{
    char what[32];
    snprintf(what, sizeof(what), "CIGI 3.%u %s", format->minor, format->big ? "big" : "little");
    tshark_check(what, data, writer.size, 8004, "cigi", &expected);
}

static void check_start(void)
{
    begin(NULL);
    expect(NAME("version"), 3);
    expect(NAME("byte_swap"), format->big ? 0x8000 : 0x0080);
    expect(NAME("sof.db_number"), -5);
    expect(NAME("sof.ig_status"), 43);
    expect(NAME("sof.ig_mode"), CIGI_OPERATE);
    expect(NAME("sof.timestamp_valid"), 1);
    expect(NAME("sof.earth_reference_model"), 0);
    expect(NAME("sof.timestamp"), 124000);
    if (format->minor < 2) {
        expect(NAME("sof.frame_ctr"), 1002);
    } else {
        expect(NAME("sof.minor_version"), format->minor);
        expect(NAME("sof.ig_frame_number"), 1002);
        expect(NAME("sof.last_host_frame_number"), 1001);
    }
    check();
}

static void check_heights(void)
{
    struct cigi_packet packet = {.kind = CIGI_HEIGHT_RESPONSE};
    packet.height_response = (struct cigi_height_response){77, 1, 1, 9, 432.5};
    begin(&packet);
    expect(NAME("hat_hot_response.hat_hot_id"), 77);
    expect(NAME("hat_hot_response.valid"), 1);
    expect(NAME("hat_hot_response.type"), 1);
    expect(NAME("hat_hot_response.height"), 432.5);
    if (format->minor >= 2)
        expect(NAME("hat_hot_response.host_frame_number_lsn"), 9);
    check();
    packet.kind = CIGI_HEIGHT_EXTENDED;
    packet.height_extended =
        (struct cigi_height_extended){78, 1, 9, 1067.75, 432.5, 11, 10.0f, 88.0f};
    begin(&packet);
    expect(NAME("hat_hot_ext_response.hat_hot_id"), 78);
    expect(NAME("hat_hot_ext_response.valid"), 1);
    expect(NAME("hat_hot_ext_response.hat"), 1067.75);
    expect(NAME("hat_hot_ext_response.hot"), 432.5);
    expect(NAME("hat_hot_ext_response.material_code"), 11);
    expect(NAME("hat_hot_ext_response.normal_vector_azimuth"), 10);
    expect(NAME("hat_hot_ext_response.normal_vector_elevation"), 88);
    if (format->minor >= 2)
        expect(NAME("hat_hot_ext_response.host_frame_number_lsn"), 9);
    check();
}

static void check_sights(void)
{
    struct cigi_packet packet = {.kind = CIGI_SIGHT_RESPONSE};
    packet.sight_response = (struct cigi_sight_response){9, 12, 1, 1, 1, 9, 3, 6150.5};
    begin(&packet);
    expect(NAME("los_response.los_id"), 9);
    expect(NAME("los_response.entity_id"), 12);
    expect(NAME("los_response.valid"), 1);
    expect(NAME("los_response.entity_id_valid"), 1);
    expect(NAME("los_response.visible"), 1);
    expect(NAME("los_response.count"), 3);
    expect(NAME("los_response.range"), 6150.5);
    if (format->minor >= 2)
        expect(NAME("los_response.host_frame_number_lsn"), 9);
    check();
    packet.kind = CIGI_SIGHT_EXTENDED;
    packet.sight_extended = (struct cigi_sight_extended){
        9, 12, 1, 0, 1, 1, 9, 1, 6150.5, {47.25, 8.5, 99.0}, {1, 2, 3, 4}, 11, 10.0f, 88.0f};
    begin(&packet);
    expect_extended("los_id", 9);
    expect_extended("entity_id", 12);
    expect_extended("valid", 1);
    expect_extended("entity_id_valid", 0);
    expect_extended("range_valid", 1);
    expect_extended("visible", 1);
    expect_extended("response_count", 1);
    expect_extended("range", 6150.5);
    expect_extended("lat_xoff", 47.25);
    expect_extended("lon_yoff", 8.5);
    expect_extended("alt_zoff", 99);
    expect_extended("red", 1);
    expect_extended("green", 2);
    expect_extended("blue", 3);
    expect_extended("alpha", 4);
    expect_extended("material_code", 11);
    expect_extended("normal_vector_azimuth", 10);
    expect_extended("normal_vector_elevation", 88);
    if (format->minor >= 2)
        expect_extended("host_frame_number_lsn", 9);
    check();
}

static void check_position(void)
{
    struct cigi_packet packet = {.kind = CIGI_POSITION_RESPONSE};
    packet.position_response = (struct cigi_position_response){
        300, 4, CIGI_OF_VIEW, CIGI_IN_PARENT, {4.5, -0.5, -1.25}, 1.0f, 2.0f, 300.0f};
    begin(&packet);
    expect(NAME("pos_response.object_id"), 300);
    expect(NAME("pos_response.part_id"), 4);
    expect(NAME("pos_response.object_class"), CIGI_OF_VIEW);
    expect(NAME("pos_response.coord_system"), CIGI_IN_PARENT);
    expect(NAME("pos_response.lat_xoff"), 4.5);
    expect(NAME("pos_response.lon_yoff"), -0.5);
    expect(NAME("pos_response.alt_zoff"), -1.25);
    expect(NAME("pos_response.roll"), 1);
    expect(NAME("pos_response.pitch"), 2);
    expect(NAME("pos_response.yaw"), 300);
    check();
}

static void check_environment(void)
{
    struct cigi_packet packet = {.kind = CIGI_WEATHER_RESPONSE};
    packet.weather_response =
        (struct cigi_weather_response){8, 40, 12.5f, 8000.0f, 10.0f, 1.0f, 270.0f, 1002.0f};
    begin(&packet);
    expect(NAME("wea_cond_response.request_id"), 8);
    expect(NAME("wea_cond_response.humidity"), 40);
    expect(NAME("wea_cond_response.air_temp"), 12.5);
    expect(NAME("wea_cond_response.visibility_range"), 8000);
    expect(NAME("wea_cond_response.horiz_speed"), 10);
    expect(NAME("wea_cond_response.vert_speed"), 1);
    expect(NAME("wea_cond_response.wind_direction"), 270);
    expect(NAME("wea_cond_response.barometric_pressure"), 1002);
    check();
    packet.kind = CIGI_AEROSOL_RESPONSE;
    packet.aerosol_response = (struct cigi_aerosol_response){8, 4, 0.5f};
    begin(&packet);
    expect(NAME("aerosol_concentration_response.request_id"), 8);
    expect(NAME("aerosol_concentration_response.layer_id"), 4);
    expect(NAME("aerosol_concentration_response.aerosol_concentration"), 0.5);
    check();
    packet.kind = CIGI_MARITIME_RESPONSE;
    packet.maritime_response = (struct cigi_maritime_response){8, 47.25f, 15.0f, 100.0f};
    begin(&packet);
    expect(NAME("maritime_surface_conditions_response.request_id"), 8);
    expect(NAME("maritime_surface_conditions_response.sea_surface_height"), 47.25);
    expect(NAME("maritime_surface_conditions_response.surface_water_temp"), 15);
    expect(NAME("maritime_surface_conditions_response.surface_clarity"), 100);
    check();
    packet.kind = CIGI_TERRESTRIAL_RESPONSE;
    packet.terrestrial_response = (struct cigi_terrestrial_response){8, 3};
    begin(&packet);
    expect(NAME("terr_surface_cond_response.request_id"), 8);
    expect(NAME("terr_surface_cond_response.surface_id"), 3);
    check();
    packet.kind = CIGI_MESSAGE;
    packet.message = (struct cigi_message){104, "4711"};
    begin(&packet);
    expect(NAME("image_generator_message.message_id"), 104);
    expect(NAME("image_generator_message.message"), 4711);
    check();
}

/* Each in 3.3 of both byte orders, 3.2 and 3.0. */
static const struct cigi_format formats[] = {
    {3, 3, false}, {3, 3, true}, {3, 2, false}, {3, 0, true}};

static void each(void (*run)(void))
{
    for (size_t i = 0; i < sizeof(formats) / sizeof(formats[0]); i++) {
        format = &formats[i];
        run();
    }
}

static void test_start(void)
{
    each(check_start);
}

static void test_heights(void)
{
    each(check_heights);
}

static void test_sights(void)
{
    each(check_sights);
}

static void test_position(void)
{
    each(check_position);
}

static void test_environment(void)
{
    format = &formats[0];
    check_environment();
    format = &formats[1];
    check_environment();
}

int main(void)
{
    static const struct check_test tests[] = {
        {"Wireshark reads Start of Frame", test_start},
        {"and HAT/HOT responses", test_heights},
        {"and LOS responses", test_sights},
        {"and positions", test_position},
        {"and the environment, and messages", test_environment},
    };
    return tshark_main(tests, sizeof(tests) / sizeof(tests[0]));
}
