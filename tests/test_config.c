#include "tests/config_fixture.h"

static void check_defaults(const struct config *c)
{
    CHECK_STRING(c->channel.name, "front");
    CHECK_NEAR(c->channel.offset.x_m, 0, 0);
    CHECK_NEAR(c->channel.frustum.left_deg, -30, 0);
    CHECK_NEAR(c->channel.frustum.right_deg, 30, 0);
    CHECK_NEAR(c->channel.frustum.bottom_deg, -17.5, 0);
    CHECK_NEAR(c->channel.frustum.top_deg, 17.5, 0);
    CHECK_INT(c->display.backend, CONFIG_BACKEND_HEADLESS);
    CHECK_INT(c->display.width, 1920);
    CHECK_INT(c->display.height, 1080);
    CHECK_NEAR(c->display.rate_hz, 60, 0);
    CHECK_INT(c->display.samples, CONFIG_SAMPLES_ONE);
    CHECK_STRING(c->display.monitor, "");
    CHECK(!c->display.fullscreen);
    CHECK(c->display.program_cache);
    CHECK_STRING(c->terrain.database, "");
    CHECK_STRING(c->terrain.geoid, "egm96");
    CHECK_NEAR(c->terrain.pixel_error, 1, 0);
    CHECK_INT(c->terrain.technique, CONFIG_TECHNIQUE_CLIPMAP);
    CHECK(!c->terrain.allow_dig);
    CHECK_NEAR(c->environment.visibility_m, 40000, 0);
    CHECK_INT(c->environment.time_utc_ns, 0);
    CHECK(c->environment.atmosphere);
    CHECK_INT(c->pose.mode, CONFIG_POSE_EXTRAPOLATE);
    CHECK_INT(c->pose.delay_ms, 40);
    CHECK_INT(c->pose.max_extrapolation_ms, 250);
    CHECK_INT(c->pose.on_loss, CONFIG_ON_LOSS_COAST);
    CHECK_STRING(c->health.modbus.listen, "127.0.0.1:1502");
    CHECK_INT(c->health.modbus.unit, 1);
    CHECK(!c->health.modbus.allow_control);
    CHECK_STRING(c->record.directory, "");
    CHECK_INT(c->record.max_mib, 1024);
    CHECK_INT(c->sources_count, 1);
    CHECK_STRING(c->sources[0].name, "source1");
    CHECK_INT(c->sources[0].type, CONFIG_SOURCE_NATIVE);
    CHECK_STRING(c->sources[0].listen, "127.0.0.1:5600");
    CHECK_INT(c->sources[0].priority, 1);
    CHECK_INT(c->sources[0].timeout_ms, 500);
    CHECK_INT(c->sources[0].allow_count, 2);
    CHECK_STRING(c->sources[0].allow[0].range, "127.0.0.0/8");
}

static void no_file_an_empty_file_and_comments_give_the_defaults(void)
{
    static const char *const texts[] = {"", "# nothing\n", "\n\n", "{}\n"};
    struct config config = {0};
    struct config_errors errors = {0};
    CHECK_INT(config_load(NULL, &config, &errors), 0);
    check_defaults(&config);
    config_finish(&config);
    for (size_t i = 0; i < sizeof(texts) / sizeof(texts[0]); i++) {
        CHECK_INT(load(texts[i], &config, &errors), 0);
        check_defaults(&config);
        config_finish(&config);
        config_errors_finish(&errors);
    }
}

static void a_key_that_is_given_is_used_and_its_neighbours_keep_their_defaults(void)
{
    struct config c;
    struct config_errors errors;
    CHECK_INT(load("display: {width: 800, fullscreen: yes}\n"
                   "channel: {offset: {yaw_deg: -60.5}, name: left}\n"
                   "environment: {atmosphere: false, time_utc: \"2000-01-01T00:00:01Z\"}\n"
                   "health: {modbus: {listen: \"\"}}\n"
                   "sources:\n"
                   "- {type: flightgear, allow: [10.0.0.0/8, 192.168.1.7, \"::1\"]}\n"
                   "- {name: bus, type: canaerospace, interface: \"sim:/tmp/bus\", priority: 9,\n"
                   "   timeout_ms: 1000, altitude: ellipsoid}\n",
                   &c, &errors),
              0);
    CHECK_INT(c.display.width, 800);
    CHECK_INT(c.display.height, 1080);
    CHECK(c.display.fullscreen);
    CHECK_NEAR(c.channel.offset.yaw_deg, -60.5, 0);
    CHECK_STRING(c.channel.name, "left");
    CHECK_NEAR(c.channel.frustum.top_deg, 17.5, 0);
    CHECK(!c.environment.atmosphere);
    CHECK_INT(c.environment.time_utc_ns, 946684801 * NSEC_PER_SEC);
    CHECK_STRING(c.health.modbus.listen, "");
    CHECK_INT(c.health.modbus.unit, 1);
    CHECK_INT(c.sources_count, 2);
    CHECK_STRING(c.sources[0].name, "source1");
    CHECK_STRING(c.sources[0].listen, "127.0.0.1:5500");
    CHECK_INT(c.sources[0].priority, 1);
    CHECK_INT(c.sources[0].timeout_ms, 500);
    CHECK_INT(c.sources[0].allow_count, 3);
    CHECK_STRING(c.sources[0].allow[2].range, "::1");
    CHECK_STRING(c.sources[1].interface, "sim:/tmp/bus");
    CHECK_STRING(c.sources[1].listen, "");
    CHECK_INT(c.sources[1].priority, 9);
    CHECK_INT(c.sources[1].timeout_ms, 1000);
    CHECK_INT(c.sources[1].altitude, CONFIG_ALTITUDE_ELLIPSOID);
    CHECK_INT(c.sources[1].allow_count, 0);
    config_finish(&c);
    config_errors_finish(&errors);
}

static void each_protocol_has_its_own_defaults(void)
{
    struct config c;
    struct config_errors errors;
    CHECK_INT(load("sources:\n"
                   "- {type: xplane}\n"
                   "- {type: xplane, listen: \"0.0.0.0:1\", subscribe: \"[fe80::1]:49000\"}\n"
                   "- {type: xplane, listen: \"127.0.0.1:2\", subscribe: \"\", rate_hz: 30}\n"
                   "- {type: dis}\n"
                   "- {type: dis, listen: \"127.0.0.1:3\", entity: 7:65535:9, exercise: 4}\n",
                   &c, &errors),
              0);
    CHECK_STRING(c.sources[0].listen, "127.0.0.1:49003");
    CHECK_STRING(c.sources[0].subscribe, "127.0.0.1:49000");
    CHECK_INT(c.sources[0].rate_hz, 60);
    CHECK_INT(c.sources[0].timeout_ms, 500);
    CHECK_INT(c.sources[0].allow_count, 3);
    CHECK_STRING(c.sources[1].allow[2].range, "fe80::1"); /* who is asked may answer */
    CHECK_STRING(c.sources[2].subscribe, "");
    CHECK_INT(c.sources[2].rate_hz, 30);
    CHECK_INT(c.sources[2].allow_count, 2);
    CHECK_STRING(c.sources[3].listen, "127.0.0.1:3000");
    CHECK_INT(c.sources[3].timeout_ms, 12000);
    CHECK_INT(c.sources[3].entity_id.site, 1);
    CHECK_INT(c.sources[3].exercise, 0);
    CHECK_INT(c.sources[4].entity_id.application, 65535);
    CHECK_INT(c.sources[4].entity_id.entity, 9);
    CHECK_INT(c.sources[4].exercise, 4);
    config_finish(&c);
    config_errors_finish(&errors);
}

static void an_empty_list_of_sources_is_obeyed(void)
{
    struct config c;
    struct config_errors errors;
    CHECK_INT(load("sources: []\n", &c, &errors), 0);
    CHECK_INT(c.sources_count, 0);
    config_finish(&c);
    config_errors_finish(&errors);
}

static void the_examples_load(void)
{
    static const char *const names[] = {"minimal",
                                        "flightgear",
                                        "xplane",
                                        "dis",
                                        "canaerospace",
                                        "can-table",
                                        "full",
                                        "cigi",
                                        "three-channels/left",
                                        "three-channels/front",
                                        "three-channels/right"};
    for (size_t i = 0; i < sizeof(names) / sizeof(names[0]); i++) {
        char path[1024];
        struct config c = {0};
        struct config_errors errors = {0};
        snprintf(path, sizeof(path), "%s/%s.yaml", getenv("OTWD_CONFIG_EXAMPLES"), names[i]);
        CHECK_INT(config_load(path, &c, &errors), 0);
        for (size_t k = 0; k < errors.count; k++)
            CHECK_FAIL("%s", errors.list[k].text);
        config_finish(&c);
        config_errors_finish(&errors);
    }
}

static void unknown_and_repeated_keys_are_named(void)
{
    static const struct bad bad[] = {
        {"chanel: {}\n", "1:1: unknown key 'chanel'; did you mean 'channel'?"},
        {"display:\n  widht: 800\n", "2:3: unknown key 'display.widht'; did you mean 'width'?"},
        {"environment:\n  visibility_km: 40\n",
         "2:3: unknown key 'environment.visibility_km'; did you mean 'visibility_m'?"},
        {"pose: {max_extrapolation: 3}\n",
         "1:8: unknown key 'pose.max_extrapolation'; did you mean 'max_extrapolation_ms'?"},
        {"colour: red\n", "1:1: unknown key 'colour'"},
        {"health: {modbus: {port: 1502}}\n", "1:19: unknown key 'health.modbus.port'"},
        {"sources:\n  - {name: a, lisen: x}\n",
         "2:15: unknown key 'sources[0].lisen'; did you mean 'listen'?"},
        {"display: {width: 800, width: 900}\n",
         "1:23: 'display.width' is given twice, first in line 1"},
        {"record: {}\npose: {}\nrecord: {}\n", "3:1: 'record' is given twice, first in line 1"},
    };
    check_bad(bad, sizeof(bad) / sizeof(bad[0]));
}

static void wrong_kinds_and_units_are_named(void)
{
    static const struct bad bad[] = {
        {"display: {width: wide}\n", "1:18: display.width is 'wide'; it must be a whole number"},
        {"display: {width: 800px}\n", "1:18: display.width is '800px'; it must be a whole number"},
        {"display: {width: 800.5}\n", "1:18: display.width is '800.5'; it must be a whole number"},
        {"display: {width: 0800}\n", "1:18: display.width is '0800'; it must be a whole number"},
        {"display: {width: \"800\"}\n", "1:18: display.width is '800'; it must be a whole number"},
        {"environment: {visibility_m: 40 km}\n",
         "1:29: environment.visibility_m is '40 km'; it must be a number"},
        {"environment: {visibility_m: .nan}\n",
         "1:29: environment.visibility_m is '.nan'; it must be a number"},
        {"display: {fullscreen: maybe}\n",
         "1:23: display.fullscreen is 'maybe'; it must be true or false"},
        {"display: {backend: glx}\n",
         "1:20: display.backend is 'glx'; it must be one of headless, window"},
        {"swap_lock: {group: \"192.168.1.1:8010\"}\n",
         "1:20: swap_lock.group is '192.168.1.1:8010'; it must be a multicast group and a port, "
         "like 239.192.0.1:8010"},
        {"swap_lock: {group: \"239.192.0.1:8010\", interface: eth0}\n",
         "1:51: swap_lock.interface is 'eth0'; it must be the address of an interface of this "
         "machine, like 192.168.10.21"},
        {"swap_lock: {group: \"239.192.0.1:8010\", channel: 4, channels: 3}\n",
         "1:49: swap_lock: channel 4 of 3 channels"},
        {"display: 5\n", "1:10: display must hold keys and values, not a single value"},
        {"display:\n", "1:9: display must hold keys and values, not nothing"},
        {"- a\n", "1:1: the file must hold keys and values, not a list"},
        {"sources: {name: x}\n", "1:10: sources must be a list, not keys and values"},
        {"sources: [5]\n", "1:11: sources[0] must hold keys and values, not a single value"},
        {"channel: {name: [a]}\n", "1:17: channel.name must be a single value, not a list"},
        {"channel: {name: 123456789012345678901234567890123}\n",
         "1:17: channel.name is 33 bytes long; at most 31 are allowed"},
        {"[a]: 1\n", "1:1: a key must be a single word, not a list"},
    };
    check_bad(bad, sizeof(bad) / sizeof(bad[0]));
}

static void impossible_values_are_named_with_their_limits(void)
{
    static const struct bad bad[] = {
        {"display: {width: 0}\n",
         "1:18: display.width is 0; it must lie between 16 and 16384 pixels"},
        {"display: {width: -1}\n",
         "1:18: display.width is -1; it must lie between 16 and 16384 pixels"},
        {"display:\n  rate_hz: 1e9\n",
         "2:12: display.rate_hz is 1e9; it must lie between 1 and 1000 Hz"},
        {"channel: {frustum: {left_deg: -90}}\n",
         "1:31: channel.frustum.left_deg is -90; it must lie between -85 and 85 degrees"},
        {"channel: {frustum: {left_deg: 20, right_deg: 10}}\n",
         "1:46: channel.frustum: left_deg 20 must be less than right_deg 10, by 0.1 at least"},
        {"channel: {frustum: {top_deg: -20}}\n",
         "1:30: channel.frustum: bottom_deg -17.5 must be less than top_deg -20, by 0.1 at least"},
        {"channel: {name: \"a b\"}\n",
         "1:17: channel.name is 'a b'; letters, digits, '_', '-' and '.' make a name"},
        {"terrain: {technique: quadtree}\n",
         "1:22: terrain.technique: 'quadtree' is not supported by this version; use clipmap"},
        {"terrain: {geoid: \"\"}\n",
         "1:18: terrain.geoid is empty; it must be egm96 or the path of a geoid grid"},
        {"environment: {time_utc: yesterday}\n",
         "1:25: environment.time_utc is 'yesterday'; it must be like 2024-06-21T12:00:00Z"},
        {"health: {modbus: {unit: 248}}\n",
         "1:25: health.modbus.unit is 248; it must lie between 1 and 247"},
        {"health: {modbus: {listen: \"localhost:1502\"}}\n",
         "1:27: health.modbus.listen is 'localhost:1502'; it must be a numeric address and a port, "
         "like 127.0.0.1:5500 or [::1]:5500"},
        {"record: {max_mib: 0}\n",
         "1:19: record.max_mib is 0; it must lie between 1 and 16777216 MiB"},
    };
    check_bad(bad, sizeof(bad) / sizeof(bad[0]));
}

static void sources_that_contradict_themselves_or_each_other_are_named(void)
{
    static const struct bad bad[] = {
        {"sources: [{type: cigi, version: 3.4}]\n",
         "1:33: sources[0].version is 3.4; it must be 3.0, 3.1, 3.2, 3.3 or 4.0"},
        {"sources: [{type: cigi, version: 2.0}]\n",
         "1:33: sources[0].version is 2.0; it must lie between 3 and 4"},
        {"sources: [{type: cigi, reply: here}]\n",
         "1:31: sources[0].reply is 'here'; it must be a numeric address and a port, like "
         "127.0.0.1:5500 or [::1]:5500"},
        {"sources: [{type: cigi, reply: \"127.0.0.1:8004\"}]\n",
         "1:31: sources[0].reply: 127.0.0.1:8004 is where the source itself listens"},
        {"sources: [{type: cigi, altitude: egm96}]\n",
         "1:24: sources[0].altitude: cigi counts heights from the ellipsoid"},
        {"sources: [{type: cigi, database: 0}]\n",
         "1:34: sources[0].database is 0; it must lie between 1 and 127"},
        {"sources: [{type: flightgear, sync_wait_ms: 5}]\n",
         "1:30: sources[0].sync_wait_ms: flightgear is not waited for"},
        {"sources:\n- {name: a, listen: \"127.0.0.1:1\"}\n- {name: a, listen: \"127.0.0.1:2\"}\n",
         "3:10: sources[1].name: 'a' is already the name of sources[0]"},
        {"sources:\n- {name: a, listen: \"127.0.0.1:1\"}\n- {name: b, listen: \"127.0.0.1:1\"}\n",
         "3:21: sources[1].listen: 127.0.0.1:1 is already taken by source 'a'"},
        {"sources: [{type: canaerospace, listen: \"127.0.0.1:1\"}]\n",
         "1:32: sources[0].listen: canaerospace reads a CAN bus; give it an interface"},
        {"sources: [{type: flightgear, interface: can0}]\n",
         "1:30: sources[0].interface: flightgear arrives over UDP; give it a listen address"},
        {"sources: [{type: native, version: 4.0}]\n",
         "1:26: sources[0].version: native finds its version in the packets"},
        {"sources: [{type: native, reply: \"127.0.0.1:9\"}]\n",
         "1:26: sources[0].reply: native sends no replies"},
        {"sources: [{type: canaerospace, interface: \"sim:\"}]\n",
         "1:43: sources[0].interface: sim: needs the path of a socket, at most 107 bytes"},
        {"sources: [{type: canaerospace, interface: a/b}]\n",
         "1:43: sources[0].interface is 'a/b'; it must be an interface like can0, or sim:PATH"},
        {"sources: [{listen: \"127.0.0.1:99999\"}]\n",
         "1:20: sources[0].listen is '127.0.0.1:99999'; it must be a numeric address and a port, "
         "like 127.0.0.1:5500 or [::1]:5500"},
        {"sources:\n- allow:\n  - 10.0.0.1\n  - 10.0.0.1/33\n",
         "4:5: sources[0].allow[1] is '10.0.0.1/33'; it must be an address like 192.168.1.20 or a "
         "network like 192.168.1.0/24"},
        {"sources: [{allow: []}]\n",
         "1:19: sources[0].allow is empty; list the senders, or 0.0.0.0/0 and ::/0 for anyone"},
        {"sources: [{type: native, redundancy: 1}]\n",
         "1:26: sources[0].redundancy: native knows no redundancy channels"},
        {"sources: [{type: canaerospace, redundancy: 8191}]\n",
         "1:44: sources[0].redundancy is 8191; it must lie between 0 and 8190"},
        {"sources: [{type: native, allow_transmit: true}]\n",
         "1:26: sources[0].allow_transmit: native has nothing to transmit"},
        {"sources: [{type: canaerospace, fields: []}]\n",
         "1:32: sources[0].fields: canaerospace defines its own fields"},
        {"sources: [{type: xplane, subscribe: here}]\n",
         "1:37: sources[0].subscribe is 'here'; it must be a numeric address and a port, like "
         "127.0.0.1:5500 or [::1]:5500"},
        {"sources: [{type: native, subscribe: \"127.0.0.1:49000\"}]\n",
         "1:26: sources[0].subscribe: native sends without being asked"},
        {"sources: [{type: xplane, rate_hz: 100}]\n",
         "1:35: sources[0].rate_hz is 100; it must lie between 1 and 99 Hz"},
        {"sources:\n- type: dis\n  entity: 1:2\n",
         "3:11: sources[0].entity is '1:2'; it must be SITE:APPLICATION:ENTITY, like 1:1:1"},
        {"sources: [{type: dis, entity: \"0:0:0\"}]\n",
         "1:31: sources[0].entity is '0:0:0'; it must be SITE:APPLICATION:ENTITY, like 1:1:1"},
        {"sources: [{type: dis, altitude: egm96}]\n",
         "1:23: sources[0].altitude: dis tells places from the Earth's centre, not altitudes"},
        {"sources: [{type: flightgear, exercise: 1}]\n",
         "1:30: sources[0].exercise: flightgear knows no exercises"},
        {"sources: [{timeout_ms: 5}]\n",
         "1:24: sources[0].timeout_ms is 5; it must lie between 10 and 60000 ms"},
    };
    check_bad(bad, sizeof(bad) / sizeof(bad[0]));
}

/* A whole position, so that only the field that is added can be wrong. */
#define TABLE                                                                                      \
    "sources:\n- type: can-table\n  fields:\n"                                                     \
    "  - {id: 18FEF301, field: latitude, scale: 1.0e-7}\n"                                         \
    "  - {id: 18FEF301, field: longitude, bit: 32, scale: 1.0e-7}\n"                               \
    "  - {id: 120, field: altitude, type: unsigned, bits: 16, order: little, unit: ft}\n"

static void a_can_table_is_read(void)
{
    struct config c;
    struct config_errors errors;
    CHECK_INT(load(TABLE "  - {id: 121, field: up, type: float, unit: ft/min, offset: -5}\n", &c,
                   &errors),
              0);
    CHECK_STRING(c.sources[0].interface, "can0");
    struct can_table table = config_can_table(&c.sources[0]);
    CHECK_INT(table.count, 4);
    CHECK_INT(table.fields[0].can_id, 0x18fef301 | CAN_EFF_FLAG);
    CHECK_INT(table.fields[0].bits, 32);
    CHECK_INT(table.fields[0].number, CAN_NUMBER_SIGNED);
    CHECK_INT(table.fields[0].order, CAN_ORDER_BIG);
    CHECK_NEAR(table.fields[0].scale, 1e-7, 0);
    CHECK_INT(table.fields[1].quantity, CAN_GPS_LONGITUDE);
    CHECK_INT(table.fields[1].bit, 32);
    CHECK_INT(table.fields[2].can_id, 0x120);
    CHECK_INT(table.fields[2].order, CAN_ORDER_LITTLE);
    CHECK_INT(table.fields[2].unit, CAN_UNIT_FT);
    CHECK_NEAR(table.fields[2].scale, 1, 0);
    CHECK_INT(table.fields[3].number, CAN_NUMBER_FLOAT);
    CHECK_NEAR(table.fields[3].offset, -5, 0);
    config_finish(&c);
    config_errors_finish(&errors);
}

static void what_is_wrong_in_a_can_table_is_named(void)
{
    static const struct bad bad[] = {
        {"sources: [{type: can-table}]\n",
         "1:11: sources[0].fields has no latitude, without which there is no position"},
        {"sources:\n- type: can-table\n  fields:\n"
         "  - {id: 120, field: latitude}\n  - {id: 121, field: longitude}\n",
         "4:3: sources[0].fields has no height or altitude, without which there is no position"},
        {TABLE "  - {id: 12, field: roll}\n",
         "7:10: sources[0].fields[3].id is '12'; it must be 3 hexadecimal digits, or 8 of a 29-bit "
         "identifier"},
        {TABLE "  - {field: roll}\n", "7:5: sources[0].fields[3].id is missing"},
        {TABLE "  - {id: 122}\n", "7:5: sources[0].fields[3].field is missing"},
        {TABLE "  - {id: 122, field: latitude}\n",
         "7:22: sources[0].fields[3].field: fields[0] is already the latitude"},
        {TABLE "  - {id: 122, field: speed}\n",
         "7:22: sources[0].fields[3].field is 'speed'; it must be one of latitude, longitude, "
         "height, altitude, roll, pitch, heading, magnetic_heading, magnetic_variation, north, "
         "east, up, ground_speed, track, body_forward, body_right, body_up, roll_rate, "
         "pitch_rate, yaw_rate"},
        {TABLE "  - {id: 122, field: roll, bit: 40}\n",
         "7:33: sources[0].fields[3]: 32 bits from bit 40 are more than the 64 of a frame"},
        {TABLE "  - {id: 122, field: roll, bits: 16, type: float}\n",
         "7:34: sources[0].fields[3].bits is 16; a float has 32 or 64"},
        {TABLE "  - {id: 122, field: roll, scale: 0}\n", "7:35: sources[0].fields[3].scale is 0"},
        {TABLE "  - {id: 122, field: roll, unit: kt}\n",
         "7:34: sources[0].fields[3].unit: a roll is not told in kt"},
        {TABLE "  - {id: 122, field: roll, unit: grad}\n",
         "7:34: sources[0].fields[3].unit is 'grad'; it must be one of default, deg, rad, m, km, "
         "ft, m/s, km/h, kt, ft/s, ft/min, deg/s, rad/s"},
        {TABLE "  - {id: 122, field: roll, bit: 64}\n",
         "7:33: sources[0].fields[3].bit is 64; it must lie between 0 and 63"},
        {TABLE "  - {id: 122, fild: roll}\n",
         "7:5: sources[0].fields[3].field is missing\n"
         "7:15: unknown key 'sources[0].fields[3].fild'; did you mean 'field'?"},
    };
    check_bad(bad, sizeof(bad) / sizeof(bad[0]));
}

static void syntax_errors_have_their_place(void)
{
    CHECK_CONTAINS(complaints("display: {width: 800\npose: {}\n"), "2:");
    CHECK_STRING(complaints("display:\n\twidth: 800\n"),
                 "2:1: a tab: lines are indented by spaces");
    CHECK_CONTAINS(complaints("display:\r\twidth: 800\r"), "2:1: found character that cannot");
    CHECK_STRING(complaints("pose: {}\n---\nrecord: {}\n"),
                 "3:1: a second document; the file may hold only one");
    CHECK_CONTAINS(complaints("channel: {name: *nobody}\n"), "1:17: found undefined alias");
    CHECK_CONTAINS(complaints("channel: \xff\xfe\n"), "at byte 9");
}

static void a_typo_does_not_hide_what_is_wrong_elsewhere(void)
{
    CHECK_STRING(
        complaints("display: {widht: 800, rate_hz: 5000}\n"
                   "channel: {frustum: {left_deg: 30, right_deg: -30}}\n"
                   "sources: [{listen: here}]\n"),
        "1:11: unknown key 'display.widht'; did you mean 'width'?\n"
        "1:32: display.rate_hz is 5000; it must lie between 1 and 1000 Hz\n"
        "2:46: channel.frustum: left_deg 30 must be less than right_deg -30, by 0.1 at least\n"
        "3:20: sources[0].listen is 'here'; it must be a numeric address and a port, like "
        "127.0.0.1:5500 or [::1]:5500");
}

/* A list in a list in a list: libyaml alone takes 20 s to say what is wrong with this. */
static void deep_nesting_is_refused_at_once(void)
{
    static char text[200001];
    memset(text, '[', sizeof(text) - 1);
    nsec_t start_ns = clock_monotonic_ns();
    CHECK_STRING(complaints(text), "1:33: nested more than 32 deep");
    CHECK(clock_monotonic_ns() - start_ns < NSEC_PER_SEC);
}

static void anchors_and_aliases_mean_what_yaml_says(void)
{
    struct config c;
    struct config_errors errors;
    CHECK_INT(load("channel: {name: &n left}\ndisplay: {monitor: *n}\n", &c, &errors), 0);
    CHECK_STRING(c.display.monitor, "left");
    config_finish(&c);
    config_errors_finish(&errors);
}

static void all_errors_are_reported_in_the_order_of_the_file(void)
{
    CHECK_STRING(complaints("pose: {mode: guess, typo: 1}\n"
                            "display: {width: 1, height: tall}\n"
                            "record: 5\n"),
                 "1:14: pose.mode is 'guess'; it must be one of extrapolate, latest\n"
                 "1:21: unknown key 'pose.typo'\n"
                 "2:18: display.width is 1; it must lie between 16 and 16384 pixels\n"
                 "2:29: display.height is 'tall'; it must be a whole number\n"
                 "3:9: record must hold keys and values, not a single value");
}

static void a_flood_of_errors_is_cut_and_counted(void)
{
    static char text[8192];
    size_t used = 0;
    for (int i = 0; i < 150; i++)
        used += (size_t)sprintf(text + used, "unknown_%d: 1\n", i);
    struct config config;
    struct config_errors errors;
    CHECK_INT(load(text, &config, &errors), -EBADMSG);
    CHECK_INT(errors.count, CONFIG_ERRORS_MAX);
    CHECK_INT(errors.dropped, 50);
    config_errors_finish(&errors);
}

static void a_file_that_cannot_be_read_says_so(void)
{
    struct config config = {0};
    struct config_errors errors = {0};
    CHECK_INT(config_load("/nonexistent/otwd.yaml", &config, &errors), -ENOENT);
    CHECK_INT(errors.count, 1);
    CHECK_STRING(errors.list[0].text,
                 "/nonexistent/otwd.yaml: cannot be read: No such file or directory");
    config_errors_finish(&errors);
    CHECK_INT(config_load("/", &config, &errors), -EISDIR);
    config_errors_finish(&errors);
    config_finish(&config);

    char *large = calloc(1, CONFIG_FILE_MAX + 1);
    memset(large, '#', CONFIG_FILE_MAX + 1);
    write_file(large, CONFIG_FILE_MAX + 1);
    free(large);
    CHECK_INT(config_load(file_path, &config, &errors), -EFBIG);
    config_errors_finish(&errors);
}

static void no_damaged_file_gets_past_without_a_complaint_or_a_configuration(void)
{
    char path[1024], original[4096];
    uint32_t state = 1;
    snprintf(path, sizeof(path), "%s/full.yaml", getenv("OTWD_CONFIG_EXAMPLES"));
    FILE *file = fopen(path, "r");
    CHECK(file != NULL);
    size_t size = file ? fread(original, 1, sizeof(original), file) : 0;
    fclose(file);
    unsigned loaded = 0, refused = 0;
    for (unsigned i = 0; i < 1000; i++) {
        char text[sizeof(original)];
        memcpy(text, original, size);
        for (unsigned k = 0; k < 1 + i % 3; k++) {
            state = state * 1664525u + 1013904223u;
            text[(state >> 8) % size] = " :-[]{}&*\"#\n\t0a\xff"[state >> 28];
        }
        struct config config = {0};
        struct config_errors errors = {0};
        write_file(text, size);
        int r = config_load(file_path, &config, &errors);
        loaded += r == 0 && errors.count == 0;
        refused += r == -EBADMSG && errors.count > 0;
        config_finish(&config);
        config_errors_finish(&errors);
    }
    CHECK_INT(loaded + refused, 1000);
    CHECK(loaded > 10 && refused > 10);
}

int main(void)
{
    int fd = mkstemp(file_path);
    if (fd < 0 || !getenv("OTWD_CONFIG_EXAMPLES")) {
        perror("test_config needs /tmp and OTWD_CONFIG_EXAMPLES");
        return 1;
    }
    close(fd);
    static const struct check_test tests[] = {
        {"no file, an empty file and comments give the defaults",
         no_file_an_empty_file_and_comments_give_the_defaults},
        {"a key that is given is used and its neighbours keep their defaults",
         a_key_that_is_given_is_used_and_its_neighbours_keep_their_defaults},
        {"each protocol has its own defaults", each_protocol_has_its_own_defaults},
        {"an empty list of sources is obeyed", an_empty_list_of_sources_is_obeyed},
        {"the examples load", the_examples_load},
        {"unknown and repeated keys are named", unknown_and_repeated_keys_are_named},
        {"wrong kinds and units are named", wrong_kinds_and_units_are_named},
        {"impossible values are named with their limits",
         impossible_values_are_named_with_their_limits},
        {"sources that contradict themselves or each other are named",
         sources_that_contradict_themselves_or_each_other_are_named},
        {"a CAN table is read", a_can_table_is_read},
        {"what is wrong in a CAN table is named", what_is_wrong_in_a_can_table_is_named},
        {"syntax errors have their place", syntax_errors_have_their_place},
        {"a typo does not hide what is wrong elsewhere",
         a_typo_does_not_hide_what_is_wrong_elsewhere},
        {"deep nesting is refused at once", deep_nesting_is_refused_at_once},
        {"anchors and aliases mean what YAML says", anchors_and_aliases_mean_what_yaml_says},
        {"all errors are reported in the order of the file",
         all_errors_are_reported_in_the_order_of_the_file},
        {"a flood of errors is cut and counted", a_flood_of_errors_is_cut_and_counted},
        {"no damaged file gets past without a complaint or a configuration",
         no_damaged_file_gets_past_without_a_complaint_or_a_configuration},
        {"a file that cannot be read says so", a_file_that_cannot_be_read_says_so},
    };
    int status = CHECK_MAIN(tests);
    unlink(file_path);
    return status;
}
