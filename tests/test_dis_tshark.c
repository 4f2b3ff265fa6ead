/* Wireshark reads what `otwd send --protocol dis` sends, and finds in it what was flown. */
#include "io/sender.h"
#include "tests/tshark.h"

static double no_undulation_m(void *context, double lat_deg, double lon_deg)
{
    return 0.0;
}

static const struct geoid_function geoid = {.undulation_m = no_undulation_m};

/* Due east along the equator, nose 5 degrees up, climbing. */
static const char flight_csv[] =
    "# altitude: ellipsoid\ntime_s,lat_deg,lon_deg,alt_m,roll_deg,pitch_deg,heading_deg\n"
    "0,0,10.000,1000,0,5,90\n1,0,10.001,1010,0,5,90\n2,0,10.002,1020,0,5,90\n";

static double along_m(double lon_deg, double height_m, double (*axis)(double))
{
    return (6378137.0 + height_m) * axis(lon_deg * M_PI / 180.0);
}

static struct send_schedule *make_schedule(void)
{
    struct flight *flight = NULL;
    struct send_schedule *schedule = NULL;
    struct send_params params = {.protocol = POSE_PROTOCOL_DIS, .rate_hz = 1, .geoid = geoid};
    if (flight_load_memory("f.csv", flight_csv, strlen(flight_csv),
                           &(struct flight_params){.geoid = geoid}, &flight, NULL) < 0 ||
        send_schedule_create(flight, &params, &schedule, NULL) < 0)
        exit(1);
    flight_destroy(flight);
    return schedule;
}

static void expect_head(struct tshark_expected *e)
{
    tshark_expect(e, "dis.proto_ver", 7);
    tshark_expect(e, "dis.exer_id", 1);
    tshark_expect(e, "dis.pdu_type", 1);
    tshark_expect(e, "dis.proto_fam", 1);
    tshark_expect_within(e, "dis.timestamp", 1.0, 2e-6);
    tshark_expect(e, "dis.pdu_length", 144);
    tshark_expect(e, "dis.entity_id_site", 1);
    tshark_expect(e, "dis.entity_id_application", 1);
    tshark_expect(e, "dis.entity_id_entity", 1);
    tshark_expect(e, "dis.num_articulation_params", 0);
    tshark_expect(e, "dis.entityKind", 1);
    tshark_expect(e, "dis.entityDomain", 2);
}

/* East at 10 degrees of longitude lies 100 degrees from ECEF x; the nose, 5 degrees up, 95. The
 * right wing points south, along -z. */
static void expect_motion(struct tshark_expected *e)
{
    static const double turned[] = {95, 0, -90};
    static const char *const names[] = {"psi", "theta", "phi"};
    char name[64];
    tshark_expect_within(e, "dis.entity_location.x", along_m(10.001, 1010, cos), 1e-13);
    tshark_expect_within(e, "dis.entity_location.y", along_m(10.001, 1010, sin), 1e-13);
    tshark_expect(e, "dis.entity_location.z", 0);
    for (int i = 0; i < 3; i++) {
        snprintf(name, sizeof(name), "dis.entity_orientation.%s", names[i]);
        double angle_deg = turned[i] + (i == 0 ? 0.001 : 0.0);
        tshark_expect_within(e, name, angle_deg * M_PI / 180.0, 5e-6); /* printed with 6 digits */
    }
    tshark_expect(e, "dis.entity_linear_velocity.x",
                  0.5 * (along_m(10.002, 1020, cos) - along_m(10.0, 1000, cos)));
    tshark_expect(e, "dis.entity_linear_velocity.y",
                  0.5 * (along_m(10.002, 1020, sin) - along_m(10.0, 1000, sin)));
    tshark_expect(e, "dis.entity_linear_velocity.z", 0);
    tshark_expect(e, "dis.entity_linear_acceleration.x", 0);
    tshark_expect(e, "dis.entity_angular_velocity.x", 0);
    tshark_expect_within(e, "dis.entity_angular_velocity.y", -0.001 * M_PI / 180.0, 1e-9);
    tshark_expect(e, "dis.entity_angular_velocity.z", 0);
}

static void an_entity_state_is_read(void)
{
    struct send_schedule *schedule = make_schedule();
    struct tshark_expected expected = {0};
    const struct send_item *item = &schedule->items[1];
    expect_head(&expected);
    expect_motion(&expected);
    tshark_check("DIS", schedule->bytes + item->offset, item->size, 3000, "dis", &expected);
    send_schedule_destroy(schedule);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"Wireshark reads the Entity State PDU that is sent", an_entity_state_is_read},
    };
    return tshark_main(tests, sizeof(tests) / sizeof(tests[0]));
}
