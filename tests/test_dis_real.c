/* What other programs sent: PDUs of VR-Forces, VBS and JCATS, and an exercise in which a truck
 * turns (shared data, protocols/dis; SOURCES.md says whose they are). */
#include <stdint.h>

#include "io/dis_tracker.h"
#include "tests/check.h"

static const char *folder;
static const struct dis_filter anyone = {0};

static size_t read_file(const char *name, void *ret_data, size_t capacity)
{
    char path[4096];
    snprintf(path, sizeof(path), "%s/data/protocols/dis/%s", folder, name);
    FILE *file = fopen(path, "re");
    CHECK(file != NULL);
    size_t size = file ? fread(ret_data, 1, capacity, file) : 0;
    if (file)
        fclose(file);
    return size;
}

/* Written down from Wireshark's dissection of the files; two of the vehicles are frozen. */
static void pdus_of_other_programs_are_read(void)
{
    static const struct {
        const char *name;
        unsigned version, exercise, size;
        struct dis_id id;
        const char *marking;
        enum dis_algorithm algorithm;
        double lat_deg, lon_deg;
    } files[] = {
        {"dis_EntityStatePdu-26.raw", 6, 7, 144, {42, 4, 26}, "26", DIS_STATIC, 42.7, 20.9},
        {"dis7_EntityStatePdu-articulated_parts.raw", 7, 1, 176, {1, 200, 1}, "", DIS_FPW, 56, 8.4},
        {"dis_EntityStatePdu-vbs-articulated-parameters.raw",
         6,
         1,
         400,
         {1425, 2850, 1},
         "13",
         DIS_STATIC,
         51.1,
         -2.1},
        {"dis_EntityStatePdu-vrf-articulated-parameters.raw",
         6,
         1,
         272,
         {1, 3001, 4},
         "Leo2A4 1",
         DIS_RVW,
         56,
         8.7},
    };
    for (size_t i = 0; i < sizeof(files) / sizeof(files[0]); i++) {
        uint8_t data[1024];
        struct dis_entity entity = {0};
        struct rejection rejection = {0};
        struct pose pose;
        size_t size = read_file(files[i].name, data, sizeof(data)), pdu_size = 0;
        if (dis_decode(data, size, &anyone, &pdu_size, &entity, &rejection) != 0)
            CHECK_FAIL("%s: %s", files[i].name, rejection.text);
        CHECK_INT(pdu_size, files[i].size);
        CHECK_INT(entity.version, files[i].version);
        CHECK_INT(entity.exercise, files[i].exercise);
        CHECK_INT(entity.id.site, files[i].id.site);
        CHECK_INT(entity.id.application, files[i].id.application);
        CHECK_INT(entity.id.entity, files[i].id.entity);
        CHECK_STRING(entity.marking, files[i].marking);
        CHECK_INT(entity.motion.algorithm, files[i].algorithm);
        pose_from_dis_motion(&entity.motion, &pose);
        CHECK_NEAR(pose.position.lat_deg, files[i].lat_deg, 0.5);
        CHECK_NEAR(pose.position.lon_deg, files[i].lon_deg, 0.5);
        CHECK(fabs(pose.position.height_m) < 2000.0);
        /* vehicles on the ground stand upright */
        CHECK(fabs(pose.attitude.roll_deg) < 30.0 && fabs(pose.attitude.pitch_deg) < 30.0);
    }
}

static int base64_digit(char c)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    const char *at = c ? strchr(digits, c) : NULL;
    return at ? (int)(at - digits) : -1;
}

static size_t bytes_from_base64(const char *text, uint8_t *ret_data, size_t capacity)
{
    uint32_t word = 0;
    size_t size = 0;
    for (unsigned bits = 0; base64_digit(*text) >= 0; text++) {
        word = word << 6 | (uint32_t)base64_digit(*text);
        bits += 6;
        if (bits >= 8 && size < capacity) {
            bits -= 8;
            ret_data[size++] = (uint8_t)(word >> bits);
        }
    }
    return size;
}

static double distance_m(const struct dis_motion *a, const struct dis_motion *b)
{
    double square = 0.0;
    for (int i = 0; i < 3; i++)
        square += pow(a->position_ecef_m[i] - b->position_ecef_m[i], 2);
    return sqrt(square);
}

/* Its simulation tells a new state before the old one leads far astray. */
static void dead_reckoning_follows_a_truck_round_a_corner(void)
{
    static char text[1 << 19];
    size_t size = read_file("Entity90DegreesTurnBase64.dislog", text, sizeof(text) - 1);
    const struct dis_filter truck = {.exercise = 1, .id = {1, 3001, 3}};
    struct dis_entity before = {0}, now;
    double worst_m = 0.0, gone_m = 0.0, held_m = 0.0;
    int states = 0;
    text[size] = '\0';
    for (char *rest = text, *line; (line = strsep(&rest, "\n"));) {
        uint8_t data[4096];
        size_t pdu_size;
        char *comma = strchr(line, ',');
        if (*line == '#' || !comma)
            continue;
        size = bytes_from_base64(comma + 1, data, sizeof(data));
        if (dis_decode(data, size, &truck, &pdu_size, &now, NULL) != 0)
            continue;
        if (states++) {
            double dt_s = ((now.timestamp >> 1) - (before.timestamp >> 1)) * 3600.0 / DIS_HOUR;
            struct dis_motion there;
            dis_dead_reckon(&before.motion, dt_s, &there);
            worst_m = fmax(worst_m, distance_m(&there, &now.motion));
            held_m = fmax(held_m, distance_m(&before.motion, &now.motion));
            gone_m += distance_m(&before.motion, &now.motion);
        }
        before = now;
    }
    printf("%d states over %.0f m: dead reckoning at most %.2f m off, standing still %.2f m\n",
           states, gone_m, worst_m, held_m);
    CHECK_INT(states, 100);
    CHECK(gone_m > 100.0);
    CHECK(worst_m < 0.1);
    CHECK(held_m > 10.0);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"PDUs of other programs are read", pdus_of_other_programs_are_read},
        {"dead reckoning follows a truck round a corner",
         dead_reckoning_follows_a_truck_round_a_corner},
    };
    char probe[4096];
    folder = getenv("OTWD_SHARED");
    snprintf(probe, sizeof(probe), "%s/data/protocols/dis/dis_EntityStatePdu-26.raw",
             folder ? folder : "");
    FILE *file = fopen(probe, "re");
    if (!file) {
        printf("skip: no recorded DIS traffic at %s\n", probe);
        return 77;
    }
    fclose(file);
    return CHECK_MAIN(tests);
}
