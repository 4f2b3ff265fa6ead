#include <errno.h>
#include <glob.h>
#include <sys/stat.h>
#include <unistd.h>

#include "geo/geographic.h"
#include "io/arbiter.h"
#include "io/crc32.h"
#include "io/flight.h"
#include "io/flight_formats.h"
#include "io/otwlog.h"
#include "tests/check.h"

#define UNDULATION_M 65.5

static double constant_undulation_m(void *context, double lat_deg, double lon_deg)
{
    return UNDULATION_M;
}

static const struct flight_params params = {.geoid = {.undulation_m = constant_undulation_m}};

static int load_text(const char *text, struct flight **ret_flight, struct diag *diag)
{
    return flight_load_memory("f.txt", text, strlen(text), &params, ret_flight, diag);
}

#define CSV_HEADER "time_s,lat_deg,lon_deg,alt_m,roll_deg,pitch_deg,heading_deg\n"

static void csv_is_read_and_its_datum_honoured(void)
{
    for (int egm96 = 0; egm96 < 2; egm96++) {
        char text[512];
        struct flight *flight = NULL;
        struct diag diag = {""};
        snprintf(text, sizeof(text),
                 "%s# made by hand\n# altitude: %s\n" CSV_HEADER "10.0,47.5,8.5,500,0,1,350\r\n"
                 "11.0, 47.5 ,8.501,510,10,3,10\n# end\n12.5,47.5,8.502,520,20,5,30",
                 egm96 ? "\xef\xbb\xbf" : "", egm96 ? "egm96" : "ellipsoid");
        CHECK_INT(load_text(text, &flight, &diag), 0);
        CHECK_STRING(diag.text, "");
        if (!flight)
            return;
        CHECK_STRING(flight->format, "csv");
        CHECK_INT(flight->count, 3);
        CHECK_INT(flight->poses[0].time_ns, 0);
        CHECK_INT(flight_duration_ns(flight), 2500000000);
        CHECK_NEAR(flight->poses[0].position.height_m, 500 + (egm96 ? UNDULATION_M : 0), 0.0);
        struct pose pose;
        flight_sample(flight, 500000000, &pose);
        CHECK_NEAR(pose.position.lon_deg, 8.5005, 1e-9);
        CHECK_NEAR(remainder(pose.attitude.heading_deg, 360.0), 0.0,
                   0.1); /* through north, not round by south */
        CHECK_NEAR(pose.attitude.roll_deg, 5.0, 0.1);
        CHECK_INT(pose.time_ns, 500000000);
        CHECK_NEAR(pose.velocity_ned_mps[2], -10.0, 2.0);
        flight_sample(flight, -5, &pose);
        CHECK_NEAR(pose.position.lon_deg, 8.5, 0.0);
        flight_sample(flight, INT64_MAX, &pose);
        CHECK_NEAR(pose.position.lon_deg, 8.502, 0.0);
        flight_destroy(flight);
    }
}

static void csv_errors_name_line_and_column(void)
{
    static const struct {
        const char *text, *says;
    } cases[] = {
        {CSV_HEADER "0,1,2,3,4,5,6\n", "f.txt:1:1: no \"# altitude:"},
        {"# altitude: msl\n" CSV_HEADER, "f.txt:1:13: altitude is neither"},
        {"# altitude: ellipsoid\n", "f.txt:2:1: no header"},
        {"# altitude: ellipsoid\ntime_s,lat_deg,lon\n", "f.txt:2:19: the header is not"},
        {"# altitude: ellipsoid\n" CSV_HEADER "0,1,x,3,4,5,6\n", "f.txt:3:5: lon_deg is not a"},
        {"# altitude: ellipsoid\n" CSV_HEADER "0,91,2,3,4,5,6\n", "f.txt:3:3: lat_deg is 91"},
        {"# altitude: ellipsoid\n" CSV_HEADER "0,1,2,nan,4,5,6\n",
         "f.txt:3:7: alt_m is not a number"},
        {"# altitude: ellipsoid\n" CSV_HEADER "0,1,2,3,4,5\n",
         "f.txt:3:12: a comma is missing after pitch_deg"},
        {"# altitude: ellipsoid\n" CSV_HEADER "0,1,2,3,4,5,6,7\n",
         "f.txt:3:14: there is more after heading_deg"},
        {"# altitude: ellipsoid\n" CSV_HEADER "1,1,2,3,4,5,6\n1,1,2,3,4,5,6\n",
         "f.txt:4:1: time_s is 1, not after 1"},
        {"# altitude: ellipsoid\n" CSV_HEADER, "holds no pose"},
        {"hello", "f.txt: byte 0: not a flight"},
        {"", "f.txt: byte 0: not a flight"},
    };
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        struct flight *flight = NULL;
        struct diag diag = {""};
        CHECK_INT(load_text(cases[i].text, &flight, &diag), -EBADMSG);
        CHECK_CONTAINS(diag.text, cases[i].says);
        CHECK(!flight);
    }
}

static void a_flight_that_is_not_there_is_named(void)
{
    struct flight *flight = NULL;
    struct diag diag;
    CHECK_INT(flight_load("no/such.csv", &params, &flight, &diag), -ENOENT);
    CHECK_CONTAINS(diag.text, "no/such.csv: No such file");
    CHECK_INT(flight_load("/", &params, &flight, &diag), -EISDIR);
    CHECK_INT(flight_load("/dev/null", &params, &flight, &diag), -EBADMSG);
    flight_destroy(NULL);
}

static const char *shared_path(const char *name)
{
    static char path[4096];
    const char *shared = getenv("OTWD_SHARED");
    snprintf(path, sizeof(path), "%s/data/%s", shared ? shared : "", name);
    if (shared && access(path, R_OK) == 0)
        return path;
    printf("skip: %s: $OTWD_SHARED/data/%s is not there\n", check_title, name);
    return NULL;
}

static void flightgears_own_capture_is_read(void)
{
    const char *path = shared_path("flights/flightgear-2020.3-c172p-bikf.pcap");
    struct flight *flight = NULL;
    struct diag diag = {""};
    if (!path)
        return;
    CHECK_INT(flight_load(path, &params, &flight, &diag), 0);
    CHECK_STRING(diag.text, "");
    if (!flight)
        return;
    CHECK_STRING(flight->format, "pcap");
    CHECK_INT(flight->count, 590);
    CHECK_INT(flight->counters.received, 590);
    CHECK_INT(flight->counters.accepted, 590);
    CHECK_INT(intake_rejected_total(&flight->counters), 0);
    CHECK_NEAR(seconds_from_ns(flight_duration_ns(flight)), 290.280687, 1e-6);
    size_t above_ground = 0;
    for (size_t i = 0; i < flight->count; i++) {
        above_ground += flight->agl_m[i] > 0.0f;
        CHECK_NEAR(flight->poses[i].position.lat_deg, 64.0, 0.5);
        CHECK_NEAR(flight->poses[i].position.lon_deg, -22.5, 0.5);
    }
    CHECK(above_ground > 500);
    flight_destroy(flight);
}

/* The same UDP packet under each link's header. */
static void every_link_type_is_understood(void)
{
    static const struct {
        unsigned link;
        size_t size;
        uint8_t header[24];
    } links[] = {
        {0, 4, {2, 0, 0, 0}},
        {1, 14, {[12] = 8, [13] = 0}},
        {1, 18, {[12] = 0x81, [13] = 0, [16] = 8, [17] = 0}},
        {101, 0, {0}},
        {108, 4, {0, 0, 0, 2}},
        {113, 16, {[14] = 8, [15] = 0}},
        {228, 0, {0}},
        {276, 20, {8, 0}},
    };
    for (size_t i = 0; i < sizeof(links) / sizeof(links[0]); i++)
        for (int v6 = 0; v6 < 2; v6++) {
            if (v6 && links[i].link != 101)
                continue;
            uint8_t file[1024] = {0xd4, 0xc3, 0xb2, 0xa1, 2, 0, 4, 0};
            size_t ip = v6 ? 40 : 20, at = 24, length = links[i].size + ip + 8 + 408;
            file[20] = (uint8_t)links[i].link;
            file[21] = (uint8_t)(links[i].link >> 8);
            file[at + 8] = (uint8_t)length;
            file[at + 9] = (uint8_t)(length >> 8);
            memcpy(file + at + 16, links[i].header, links[i].size);
            at += 16 + links[i].size;
            file[at] = v6 ? 0x60 : 0x45;
            file[at + (v6 ? 6 : 9)] = 17;
            at += ip;
            file[at + 4] = (8 + 408) >> 8;
            file[at + 5] = (8 + 408) & 255;
            file[at + 8 + 3] = 24;
            struct flight *flight = NULL;
            struct diag diag = {""};
            CHECK_INT(flight_load_memory("c.pcap", file, 40 + length, &params, &flight, &diag), 0);
            CHECK_STRING(diag.text, "");
            if (flight)
                CHECK_NEAR(flight->poses[0].position.height_m, UNDULATION_M, 0.0);
            flight_destroy(flight);
            /* Cut off within the next packet's head: good up to there, and it says where. */
            char note[64];
            flight = NULL;
            snprintf(note, sizeof(note), "c.pcap: byte %zu: it ends within a packet", 40 + length);
            CHECK_INT(flight_load_memory("c.pcap", file, 45 + length, &params, &flight, &diag), 0);
            if (flight)
                CHECK_STRING(flight->note.text, note);
            flight_destroy(flight);
            /* Cut off within the packet: nothing is left. */
            flight = NULL;
            CHECK_INT(flight_load_memory("c.pcap", file, 39 + length, &params, &flight, &diag),
                      -EBADMSG);
            /* Of another length: refused, and the sentence says so. */
            file[at + 8 + 3] = 23;
            struct flight_params forced = params;
            forced.force_protocol = true;
            forced.protocol = POSE_PROTOCOL_FLIGHTGEAR;
            CHECK_INT(flight_load_memory("c.pcap", file, 40 + length, &forced, &flight, &diag),
                      -EBADMSG);
            CHECK_CONTAINS(diag.text, "version 23 seen");
        }
}

static const char candump_example[] = "(1700000000.000000) vcan0 40C#091F00054C2F837B\n"
                                      "(1700000000.000100) vcan0 40C#091E00054047BAA6\n"
                                      "(1700000000.000200) vcan0 40D#091F00057EF9DB23\n"
                                      "(1700000000.000300) vcan0 40D#091E000540211C6A\n"
                                      "(1700000000.000400) vcan0 40E#0902000544BB8800\n"
                                      "(1700000000.000500) vcan1 137#0102000042000000\n"
                                      "(1700000000.0005) vcan0 137#0102000040500000\n"
                                      "(1700000000.001) vcan0 2000000C#0000000000000000\n"
                                      "(1700000000.001) vcan0 138##101020000C1480000\n"
                                      "(1700000000.001000) vcan0 138#01020000C1480000 R\n"
                                      "a comment\n"
                                      "(1700000000.002000000) vcan0 141#01.02.00.00.C2.B1.00.00 T\n"
                                      "(1700000001) vcan0 137#0102000140A00000\n"
                                      "(1700000001) vcan0 138#01020001C1480000\n"
                                      "(1700000001) vcan0 141#01020001C2B10000\n";

static void a_candump_log_is_read(void)
{
    struct flight *flight = NULL;
    struct diag diag = {""};
    CHECK_INT(load_text(candump_example, &flight, &diag), 0);
    CHECK_STRING(diag.text, "");
    if (!flight)
        return;
    CHECK_STRING(flight->format, "candump");
    const struct pose *last = &flight->poses[flight->count - 1];
    CHECK_NEAR(last->position.lat_deg, 47.4582, 1e-12);
    CHECK_NEAR(last->position.height_m, 1500.25, 0.0);
    CHECK_NEAR(last->attitude.heading_deg, 271.5, 0.0);
    CHECK_NEAR(last->attitude.pitch_deg, 5.0, 0.0);
    CHECK_INT(flight->counters.lost, 0);
    flight_destroy(flight);
}

static void a_broken_candump_line_is_named(void)
{
    static const struct {
        const char *text, *says;
    } cases[] = {
        {"(1.) can0 137#00\n", "f.txt:1:3:"},
        {"(1.0) can0 137#00\n(1.0) can0 13#00\n", "f.txt:2:"},
        {"(1.0) can0 137#0\n", "f.txt:1:16:"},
        {"(1.0) can0 137#001122334455667788\n", "f.txt:1:32:"},
        {"(1.0)\n", "f.txt:1:6:"},
    };
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        struct flight *flight = NULL;
        struct diag diag = {""};
        CHECK_INT(load_text(cases[i].text, &flight, &diag), -EBADMSG);
        CHECK_CONTAINS(diag.text, cases[i].says);
    }
}

static const char igc_example[] = "AXXX001\r\nHFDTE150717\r\nI023636LAD3737LOD\r\n"
                                  "B2359584458082N00549988EA001000017125\r\n"
                                  "B2359594458182N00549988EA001000018125\r\n"
                                  "B0000004458282N00549988EA001000019125\r\n"
                                  "B0000014458382N00549988EA001000020125\r\n";

static void igc_gets_an_attitude_from_its_track(void)
{
    struct flight *flight = NULL;
    struct diag diag = {""};
    CHECK_INT(load_text(igc_example, &flight, &diag), 0);
    CHECK_STRING(diag.text, "");
    if (!flight)
        return;
    CHECK_INT(flight->count, 4);
    CHECK_INT(flight_duration_ns(flight), 3 * NSEC_PER_SEC); /* across midnight */
    CHECK_NEAR(flight->poses[0].position.lat_deg, 44 + 58.0822 / 60, 1e-9);
    CHECK_NEAR(flight->poses[0].position.lon_deg, 5 + 49.9885 / 60, 1e-9);
    CHECK_NEAR(flight->poses[0].position.height_m, 171.0, 0.0);
    const struct pose *pose = &flight->poses[1];
    CHECK_INT(pose->valid, POSE_POSITION | POSE_ATTITUDE | POSE_VELOCITY | POSE_RATES);
    CHECK_NEAR(remainder(pose->attitude.heading_deg, 360.0), 0.0, 0.1);
    CHECK_NEAR(pose->attitude.roll_deg, 0.0, 0.2);
    CHECK_NEAR(pose->velocity_ned_mps[0], 185.2, 0.5);
    CHECK_NEAR(pose->attitude.pitch_deg, atan2(9.7, 185.2) * 180 / M_PI, 0.3);
    flight_destroy(flight);
}

static void igc_without_gnss_altitude_uses_pressure_above_the_geoid(void)
{
    struct flight *flight = NULL;
    CHECK_INT(load_text("AXXX\nB1000004458082N00549988EA0012300000\n"
                        "B1000014458182N00549988WA0012400000\n",
                        &flight, NULL),
              0);
    if (!flight)
        return;
    CHECK_NEAR(flight->poses[0].position.height_m, 123 + UNDULATION_M, 0.0);
    CHECK_NEAR(flight->poses[1].position.lon_deg, -(5 + 49.988 / 60), 1e-9);
    flight_destroy(flight);
    struct diag diag;
    CHECK_INT(load_text("AXXX\nB1000004458082N00549988XA0012300000\n", &flight, &diag), -EBADMSG);
    CHECK_CONTAINS(diag.text, "f.txt:2:16");
}

static void real_igc_files_fly_as_aircraft_do(void)
{
    static const struct {
        const char *name;
        size_t count;
    } files[] = {{"flights/1G_77fv6m71.igc", 4047},
                 {"flights/lad_lod_extensions.igc", 424},
                 {"flights/new_zealand.igc", 5367},
                 {"flights/olsztyn.igc", 2469}};
    for (size_t i = 0; i < sizeof(files) / sizeof(files[0]); i++) {
        const char *path = shared_path(files[i].name);
        struct flight *flight = NULL;
        struct diag diag = {""};
        if (!path)
            return;
        CHECK_INT(flight_load(path, &params, &flight, &diag), 0);
        CHECK_STRING(diag.text, "");
        if (!flight)
            continue;
        CHECK_INT(flight->counters.received, files[i].count);
        for (size_t k = 0; k < flight->count; k++)
            if (!pose_is_sane(&flight->poses[k]) || fabs(flight->poses[k].attitude.roll_deg) > 60.0)
                CHECK_FAIL("%s: pose %zu is not one of an aircraft", files[i].name, k);
        flight_destroy(flight);
    }
}

/* Power goes while a line is written: it ends early, or in zeros that the file system made of it.
 */
static void a_text_that_breaks_off_is_read_up_to_there(void)
{
    static const struct {
        const char *text;
        size_t zeros, poses;
        const char *says;
    } cases[] = {
        {"# altitude: ellipsoid\n" CSV_HEADER "0,1,2,3,4,5,6\n1,1,2,3,4,5,6\n2,1,2", 0, 2,
         "f.txt:5: it ends within this line"},
        {"# altitude: ellipsoid\n" CSV_HEADER "0,1,2,3,4,5,6\n1,1,2,3,4,5,6\n2,1,", 9, 2,
         "f.txt:5: it ends within this line"},
        {"AXXX001\nB1200004730000N00830000EA0050000550\nB1200014730000N00830010EA0050000550\n"
         "B120002473000",
         0, 2, "f.txt:4: it ends within this line"},
        {"(1.0) can0 40C#011F0000AE147AE1\n(1.0) can0 40C#011E000040474147\n"
         "(1.0) can0 40D#011F00000A3D70A4\n(1.0) can0 40E#01020000457A0000\n"
         "(1.01) can0 40D#011E0000401FA3D7\n(1.2) can0 40C#011F0",
         0, 1, "f.txt:6: it ends within this line"},
    };
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        char text[512] = "";
        struct flight *flight = NULL;
        struct diag diag = {""};
        size_t size = strlen(cases[i].text);
        memcpy(text, cases[i].text, size);
        CHECK_INT(flight_load_memory("f.txt", text, size + cases[i].zeros, &params, &flight, &diag),
                  0);
        if (!flight)
            continue;
        CHECK_INT(flight->count, cases[i].poses);
        CHECK_CONTAINS(flight->note.text, cases[i].says);
        flight_destroy(flight);
    }
}

static void crc_is_the_one_of_ieee_802_3(void)
{
    CHECK_INT(crc32_of_bytes(0, "123456789", 9), 0xcbf43926);
    CHECK_INT(crc32_of_bytes(crc32_of_bytes(0, "1234", 4), "56789", 5), 0xcbf43926);
}

static char scratch[] = "/tmp/otwd-flight-XXXXXX";

static struct pose pose_number(int i)
{
    return (struct pose){.time_ns = NSEC_PER_SEC + i * 10 * NSEC_PER_MSEC,
                         .receive_ns = NSEC_PER_SEC + i * 10 * NSEC_PER_MSEC + 5,
                         .valid = POSE_POSITION | POSE_ATTITUDE | POSE_VELOCITY | POSE_RATES,
                         .position = {47.0 + i * 1e-5, 8.0, 500.0 + i},
                         .attitude = {1, 2, 3},
                         .velocity_ned_mps = {4, 5, 6},
                         .rates_body_dps = {7, 8, 9}};
}

/* Records `count` poses and some packets; returns the path of the (last) file. */
static void record(int count, unsigned max_mib, size_t packet_size, char ret_path[4096])
{
    struct otwlog_writer *writer = NULL;
    struct diag diag = {""};
    struct otwlog_params p = {.directory = scratch, .max_mib = max_mib};
    CHECK_INT(otwlog_create(&p, &writer, &diag), 0);
    CHECK_STRING(diag.text, "");
    if (!writer)
        exit(1);
    CHECK(otwlog_add_source(writer, 2, POSE_PROTOCOL_FLIGHTGEAR, "fg", 1));
    static const uint8_t packet[4096];
    for (int i = 0; i < count; i++) {
        struct pose pose = pose_number(i);
        CHECK(otwlog_add_packet(writer, 2, packet, packet_size, pose.receive_ns));
        CHECK(otwlog_add_pose(writer, 2, &pose));
        if (i % 50 == 0)
            CHECK_INT(otwlog_flush(writer, &diag), 0);
    }
    CHECK_INT(otwlog_flush(writer, &diag), 0);
    CHECK_INT(otwlog_written(writer), 1 + 2 * count);
    CHECK_INT(otwlog_dropped(writer), 0);
    snprintf(ret_path, 4096, "%s", otwlog_path(writer));
    otwlog_destroy(writer);
}

static void a_recording_comes_back_as_it_was(void)
{
    char path[4096];
    record(100, 0, 408, path);
    struct flight *flight = NULL;
    struct diag diag = {""};
    CHECK_INT(flight_load(path, &params, &flight, &diag), 0);
    CHECK_STRING(diag.text, "");
    if (!flight)
        return;
    CHECK_STRING(flight->format, "otwlog");
    CHECK_INT(flight->count, 100);
    for (int i = 0; i < 100; i++) {
        struct pose expected = pose_number(i);
        const struct pose *actual = &flight->poses[i];
        CHECK_INT(actual->time_ns, i * 10 * NSEC_PER_MSEC);
        CHECK_INT(actual->receive_ns, i * 10 * NSEC_PER_MSEC);
        CHECK_INT(actual->valid, expected.valid);
        CHECK(memcmp(&expected.position, &actual->position, sizeof(expected.position)) == 0);
        CHECK(memcmp(&expected.attitude, &actual->attitude, sizeof(expected.attitude)) == 0);
        for (int k = 0; k < 3; k++) {
            CHECK_NEAR(actual->velocity_ned_mps[k], 4 + k, 0.0);
            CHECK_NEAR(actual->rates_body_dps[k], 7 + k, 0.0);
        }
    }
    flight_destroy(flight);
    unlink(path);
}

static void a_torn_tail_costs_only_itself(void)
{
    char path[4096];
    record(20, 0, 10, path);
    static uint8_t data[16384];
    FILE *file = fopen(path, "rb");
    size_t size = file ? fread(data, 1, sizeof(data), file) : 0;
    if (file)
        fclose(file);
    const size_t last = 24 + 112; /* the record of the last pose */
    CHECK_INT(size, 16 + 32 + 20 * (24 + 16 + last));
    for (size_t cut = 1; cut < last; cut++) {
        struct flight *flight = NULL;
        CHECK_INT(flight_load_memory("t", data, size - cut, &params, &flight, NULL), 0);
        if (flight)
            CHECK_INT(flight->count, 19);
        flight_destroy(flight);
    }
    data[size - 1] ^= 1; /* a bit that rotted */
    struct flight *flight = NULL;
    CHECK_INT(flight_load_memory("t", data, size, &params, &flight, NULL), 0);
    if (flight) {
        CHECK_INT(flight->count, 19);
        CHECK_CONTAINS(
            flight->note.text,
            "t: byte 3432: a record that is cut off or damaged; the flight ends there, after 40 "
            "records, and leaves out 136 bytes");
    }
    flight_destroy(flight);
    struct diag diag;
    data[8] = 9;
    CHECK_INT(flight_load_memory("t", data, size, &params, &flight, &diag), -EBADMSG);
    CHECK_STRING(diag.text, "t: byte 8: recording version 9, 1 expected");
    unlink(path);
}

static void recordings_stay_within_their_limit(void)
{
    char path[4096], pattern[4096];
    record(1000, 1, 4000, path); /* 4.1 MB into 1 MiB */
    snprintf(pattern, sizeof(pattern), "%s/otwd-*.otwlog", scratch);
    glob_t found;
    CHECK_INT(glob(pattern, 0, NULL, &found), 0);
    CHECK_INT(found.gl_pathc, 8);
    size_t total = 0;
    for (size_t i = 0; i < found.gl_pathc; i++) {
        struct stat st;
        CHECK_INT(stat(found.gl_pathv[i], &st), 0);
        total += (size_t)st.st_size;
        struct flight *flight = NULL; /* each can be read alone */
        CHECK_INT(flight_load(found.gl_pathv[i], &params, &flight, NULL), 0);
        flight_destroy(flight);
        unlink(found.gl_pathv[i]);
    }
    CHECK(total <= 1 << 20);
    CHECK(total > 700 << 10);
    globfree(&found);
}

/* Two channels that began in the same second share a directory and a stem. */
static void a_recording_removes_files_of_its_own_only(void)
{
    struct otwlog_writer *mine = NULL, *other = NULL;
    struct otwlog_params p = {.directory = scratch, .max_mib = 1};
    for (int tries = 0; tries < 20; tries++) { /* until both begin in one second */
        char theirs[4096], pattern[4096];
        CHECK_INT(otwlog_create(&p, &other, NULL), 0);
        CHECK_INT(otwlog_create(&p, &mine, NULL), 0);
        snprintf(theirs, sizeof(theirs), "%s", otwlog_path(other));
        bool shared = strncmp(theirs, otwlog_path(mine), strlen(theirs) - 10) == 0;
        for (int i = 0; shared && i < 20000; i++) {
            struct pose pose = pose_number(i);
            CHECK(otwlog_add_pose(mine, 0, &pose));
            if (i % 1000 == 0)
                CHECK_INT(otwlog_flush(mine, NULL), 0);
        }
        CHECK_INT(access(theirs, F_OK), 0);
        CHECK(!shared || otwlog_removed(mine) > 0);
        otwlog_destroy(mine);
        otwlog_destroy(other);
        glob_t found;
        snprintf(pattern, sizeof(pattern), "%s/otwd-*.otwlog", scratch);
        CHECK_INT(glob(pattern, 0, NULL, &found), 0);
        for (size_t i = 0; i < found.gl_pathc; i++)
            unlink(found.gl_pathv[i]);
        globfree(&found);
        if (shared)
            return;
    }
    CHECK_FAIL("never two recordings in one second");
}

static void a_full_ring_drops_and_counts(void)
{
    struct otwlog_writer *writer = NULL;
    struct otwlog_params p = {.directory = scratch, .ring_bytes = 1};
    CHECK_INT(otwlog_create(&p, &writer, NULL), 0);
    struct pose pose = pose_number(0);
    int taken = 0;
    for (int i = 0; i < 1000; i++)
        taken += otwlog_add_pose(writer, 0, &pose);
    CHECK(taken > 0 && taken < 1000);
    CHECK_INT(otwlog_dropped(writer), 1000 - taken);
    CHECK_INT(otwlog_flush(writer, NULL), 0);
    CHECK(otwlog_add_pose(writer, 0, &pose));
    char path[4096];
    snprintf(path, sizeof(path), "%s", otwlog_path(writer));
    otwlog_destroy(writer);
    unlink(path);
    struct diag diag;
    p.directory = "/no/such/directory";
    CHECK_INT(otwlog_create(&p, &writer, &diag), -ENOENT);
    CHECK_CONTAINS(diag.text, "/no/such/directory/otwd-");
    otwlog_destroy(NULL);
}

static const struct check_test tests[] = {
    {"CSV is read and its datum honoured", csv_is_read_and_its_datum_honoured},
    {"CSV errors name line and column", csv_errors_name_line_and_column},
    {"a flight that is not there is named", a_flight_that_is_not_there_is_named},
    {"FlightGear's own capture is read", flightgears_own_capture_is_read},
    {"every link type of a pcap is understood", every_link_type_is_understood},
    {"a candump log is read", a_candump_log_is_read},
    {"a broken candump line is named", a_broken_candump_line_is_named},
    {"IGC gets an attitude from its track", igc_gets_an_attitude_from_its_track},
    {"IGC without GNSS altitude uses pressure above the geoid",
     igc_without_gnss_altitude_uses_pressure_above_the_geoid},
    {"real IGC files fly as aircraft do", real_igc_files_fly_as_aircraft_do},
    {"a text that breaks off is read up to there", a_text_that_breaks_off_is_read_up_to_there},
    {"the CRC is the one of IEEE 802.3", crc_is_the_one_of_ieee_802_3},
    {"a recording comes back as it was", a_recording_comes_back_as_it_was},
    {"a torn tail costs only itself", a_torn_tail_costs_only_itself},
    {"recordings stay within their limit", recordings_stay_within_their_limit},
    {"a recording removes files of its own only", a_recording_removes_files_of_its_own_only},
    {"a full ring drops and counts", a_full_ring_drops_and_counts},
};

int main(void)
{
    if (!mkdtemp(scratch))
        return 1;
    int failed = CHECK_MAIN(tests);
    rmdir(scratch);
    return failed;
}
