#include <errno.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "io/arbiter.h"
#include "io/flightgear.h"
#include "io/native.h"
#include "io/source.h"
#include "io/udp.h"
#include "tests/check.h"
#include "tests/hex.h"

static char scratch[] = "/tmp/otwd-io-XXXXXX";

static double constant_undulation_m(void *context, double lat_deg, double lon_deg)
{
    return 50.0;
}

/* What a source told. */
struct heard {
    int poses, packets, troubles;
    struct pose pose;
    size_t packet_size;
    char trouble[DIAG_TEXT_MAX];
};

static void hear_pose(void *context, struct pose_source *source, const struct pose *pose)
{
    struct heard *heard = context;
    heard->poses++;
    heard->pose = *pose;
}

static void hear_packet(void *context, struct pose_source *source, const void *data, size_t size,
                        nsec_t receive_ns)
{
    struct heard *heard = context;
    heard->packets++;
    heard->packet_size = size;
}

static void hear_trouble(void *context, struct pose_source *source, const char *sentence)
{
    struct heard *heard = context;
    heard->troubles++;
    snprintf(heard->trouble, sizeof(heard->trouble), "%s", sentence);
}

/* Waits up to two seconds for something, then dispatches all that is there. */
static void dispatch(struct pose_source *source, struct heard *heard)
{
    struct pose_source_events events = {
        .context = heard, .pose = hear_pose, .packet = hear_packet, .trouble = hear_trouble};
    struct pollfd wait = {.fd = pose_source_fd(source), .events = POLLIN};
    for (int timeout_ms = 2000; poll(&wait, 1, timeout_ms) > 0; timeout_ms = 0)
        pose_source_dispatch(source, clock_monotonic_ns(), &events);
}

static struct pose_source *open_source(enum pose_protocol protocol, const char *endpoint,
                                       const char *allow)
{
    struct pose_source *source = NULL;
    struct diag diag = {""};
    struct pose_source_params params = {
        .name = "host",
        .endpoint = endpoint,
        .intake = {.protocol = protocol, .geoid = {.undulation_m = constant_undulation_m}},
        .allow = &allow,
        .allow_count = allow != NULL};
    CHECK_INT(pose_source_open(&params, &source, &diag), 0);
    CHECK_STRING(diag.text, "");
    if (!source)
        exit(1);
    return source;
}

static struct udp connected_to(const struct pose_source *source)
{
    struct udp udp;
    char peer[32];
    snprintf(peer, sizeof(peer), "127.0.0.1:%u", pose_source_port(source));
    CHECK_INT(udp_connect(&udp, peer, NULL), 0);
    return udp;
}

static void send_native(struct udp *udp, uint32_t session, uint32_t sequence,
                        enum altitude_datum datum, int64_t sender_ns)
{
    uint8_t data[NATIVE_SIZE];
    struct pose_sample sample = {
        .datum = datum,
        .session = session,
        .sequence = sequence,
        .sender_ns = sender_ns,
        .pose = {.valid = POSE_POSITION, .position = {10, 20, 100.0 + sequence % 1000}}};
    native_encode(&sample, data);
    CHECK_INT(udp_send(udp, data, sizeof(data)), 0);
}

static void addresses_and_networks_are_parsed(void)
{
    union address address;
    struct diag diag;
    char text[ADDRESS_TEXT_MAX];
    CHECK_INT(address_parse("[::1]:5500", &address, NULL), 0);
    address_format(&address, text);
    CHECK_STRING(text, "[::1]:5500");
    CHECK_INT(address_parse("10.1.2.3:65535", &address, NULL), 0);
    address_format(&address, text);
    CHECK_STRING(text, "10.1.2.3:65535");
    static const char *const bad[] = {
        "",           ":1",          "1.2.3.4", "1.2.3.4:", "1.2.3.4:65536",
        "1.2.3.4:-1", "localhost:1", "::1:5",   "[::1:5",   "1.2.3:4"};
    for (size_t i = 0; i < sizeof(bad) / sizeof(bad[0]); i++) {
        CHECK_INT(address_parse(bad[i], &address, &diag), -EINVAL);
        CHECK_CONTAINS(diag.text, bad[i]);
    }
    struct allow_list list = {0};
    CHECK_INT(allow_list_add(&list, "10.1.0.0/15", NULL), 0);
    CHECK_INT(allow_list_add(&list, "192.168.1.7", NULL), 0);
    CHECK_INT(allow_list_add(&list, "fd00::/8", NULL), 0);
    CHECK_INT(allow_list_add(&list, "10.0.0.0/33", &diag), -EINVAL);
    CHECK_INT(allow_list_add(&list, "host", &diag), -EINVAL);
    static const struct {
        const char *address;
        bool admitted;
    } senders[] = {{"10.1.255.255:1", true}, {"10.0.0.0:1", true},         {"10.2.0.0:1", false},
                   {"192.168.1.7:1", true},  {"192.168.1.6:1", false},     {"[fdff::1]:1", true},
                   {"[fe00::1]:1", false},   {"[::ffff:10.1.0.1]:1", true}};
    for (size_t i = 0; i < sizeof(senders) / sizeof(senders[0]); i++) {
        CHECK_INT(address_parse(senders[i].address, &address, NULL), 0);
        CHECK_INT(allow_list_admits(&list, &address), senders[i].admitted);
    }
}

static void a_port_in_use_is_named(void)
{
    struct udp a, b;
    struct diag diag;
    char listen[ADDRESS_TEXT_MAX];
    CHECK_INT(udp_listen(&a, "127.0.0.1:0", NULL), 0);
    address_format(&a.local, listen);
    CHECK_INT(udp_listen(&b, listen, &diag), -EADDRINUSE);
    CHECK_CONTAINS(diag.text, listen);
    CHECK_CONTAINS(diag.text, "another program has that port");
    CHECK_INT(b.fd, -1);
    udp_close(&a);
    udp_close(&a);
    CHECK(udp_listen(&b, "203.0.113.1:5", &diag) < 0); /* an address that is not ours */
    CHECK_CONTAINS(diag.text, "203.0.113.1:5");
}

static void a_group_is_heard_by_all_who_join_it_and_by_the_sender(void)
{
    struct udp members[2];
    struct datagram datagram;
    struct diag diag;
    char group[ADDRESS_TEXT_MAX], buffer[8];
    CHECK_INT(udp_listen_group(&members[0], "239.192.0.1:0", "127.0.0.1", &diag), 0);
    address_format(&members[0].local, group);
    CHECK_INT(udp_listen_group(&members[1], group, "127.0.0.1", &diag), 0);
    CHECK_INT(udp_send_to(&members[0], &members[0].local, "swap", 4), 0);
    for (int i = 0; i < 2; i++) {
        CHECK_INT(udp_receive(&members[i], buffer, sizeof(buffer), &datagram), 1);
        CHECK_INT(datagram.size, 4);
        udp_close(&members[i]);
    }
    CHECK_INT(udp_listen_group(&members[0], group, "eth0", &diag), -EINVAL);
    CHECK_CONTAINS(diag.text, "eth0");
    CHECK(udp_listen_group(&members[0], group, "203.0.113.1", &diag) < 0);
    CHECK_CONTAINS(diag.text, group);
    CHECK_INT(members[0].fd, -1);
}

static void datagrams_carry_the_kernels_stamp(void)
{
    struct udp in, out;
    char peer[ADDRESS_TEXT_MAX], buffer[4];
    CHECK_INT(udp_listen(&in, "127.0.0.1:0", NULL), 0);
    address_format(&in.local, peer);
    CHECK_INT(udp_connect(&out, peer, NULL), 0);
    struct datagram datagram;
    CHECK_INT(udp_receive(&in, buffer, sizeof(buffer), &datagram), 0);
    /* The kernel begins to stamp a moment after it was asked to. */
    clock_sleep_until(clock_monotonic_ns() + 100 * NSEC_PER_MSEC);
    nsec_t before_ns = clock_monotonic_ns();
    CHECK_INT(udp_send(&out, "otwd!", 5), 0);
    nsec_t after_ns = clock_monotonic_ns();
    clock_sleep_until(after_ns + 50 * NSEC_PER_MSEC); /* read late: the stamp must not be */
    CHECK_INT(udp_receive(&in, buffer, sizeof(buffer), &datagram), 1);
    CHECK(datagram.receive_ns >= before_ns - NSEC_PER_MSEC);
    CHECK(datagram.receive_ns <= after_ns + 10 * NSEC_PER_MSEC);
    CHECK(datagram.truncated);
    CHECK_INT(datagram.size, 4);
    udp_close(&in);
    udp_close(&out);
}

static void a_source_gives_poses_above_the_ellipsoid(void)
{
    struct pose_source *source = open_source(POSE_PROTOCOL_NATIVE, "127.0.0.1:0", NULL);
    struct udp udp = connected_to(source);
    struct heard heard = {0};
    send_native(&udp, 1, 1, ALTITUDE_EGM96, 0);
    dispatch(source, &heard);
    CHECK_INT(heard.poses, 1);
    CHECK_INT(heard.packets, 1);
    CHECK_INT(heard.packet_size, NATIVE_SIZE);
    CHECK_NEAR(heard.pose.position.height_m, 151.0, 0.0);
    CHECK_INT(heard.pose.time_ns, heard.pose.receive_ns);
    send_native(&udp, 1, 2, ALTITUDE_ELLIPSOID, 0);
    dispatch(source, &heard);
    CHECK_NEAR(heard.pose.position.height_m, 102.0, 0.0);
    udp_close(&udp);
    pose_source_close(source);
    pose_source_close(NULL);
}

static void late_and_lost_packets_are_counted(void)
{
    struct pose_source *source = open_source(POSE_PROTOCOL_NATIVE, "127.0.0.1:0", NULL);
    struct udp udp = connected_to(source);
    struct heard heard = {0};
    static const uint32_t sequence[] = {UINT32_MAX - 1, UINT32_MAX, 2, 1, 1, 2, 7};
    for (size_t i = 0; i < sizeof(sequence) / sizeof(sequence[0]); i++)
        send_native(&udp, 1, sequence[i], ALTITUDE_ELLIPSOID, 0);
    send_native(&udp, 2, 1, ALTITUDE_ELLIPSOID, 0); /* the sender began anew */
    dispatch(source, &heard);
    const struct intake_counters *counters = pose_source_counters(source);
    CHECK_INT(counters->received, 8);
    CHECK_INT(counters->accepted, 5);
    CHECK_INT(counters->rejected[REJECT_LATE], 3);
    CHECK_INT(counters->reordered, 1);
    CHECK_INT(counters->duplicates, 2);
    CHECK_INT(counters->lost, 1 + 4); /* 0, and 3 to 6 */
    CHECK_INT(heard.troubles, 0);
    udp_close(&udp);
    pose_source_close(source);
}

static void bad_packets_are_counted_and_told_once_a_second(void)
{
    struct pose_source *source = open_source(POSE_PROTOCOL_FLIGHTGEAR, "127.0.0.1:0", NULL);
    struct udp udp = connected_to(source);
    struct heard heard = {0};
    uint8_t data[4000] = {[3] = 24};
    for (int i = 0; i < 100; i++)
        CHECK_INT(udp_send(&udp, data, 112), 0);
    CHECK_INT(udp_send(&udp, data, sizeof(data)), 0); /* longer than any buffer of ours */
    CHECK_INT(udp_send(&udp, data, FLIGHTGEAR_SIZE_V24), 0);
    dispatch(source, &heard);
    CHECK_INT(heard.troubles, 1);
    CHECK_CONTAINS(heard.trouble, "source host: packet refused (short): FGNetFDM version 24");
    CHECK_INT(heard.poses, 1); /* the good one after the bad */
    CHECK_INT(pose_source_counters(source)->rejected[REJECT_SHORT], 100);
    CHECK_INT(pose_source_counters(source)->rejected[REJECT_LENGTH], 1);
    CHECK_INT(intake_rejected_total(pose_source_counters(source)), 101);
    udp_close(&udp);
    pose_source_close(source);
}

static void senders_not_on_the_list_are_refused(void)
{
    struct pose_source *source = open_source(POSE_PROTOCOL_NATIVE, "127.0.0.1:0", "10.0.0.0/8");
    struct udp udp = connected_to(source);
    struct heard heard = {0};
    send_native(&udp, 1, 1, ALTITUDE_ELLIPSOID, 0);
    dispatch(source, &heard);
    CHECK_INT(heard.poses + heard.packets, 0);
    CHECK_CONTAINS(heard.trouble, "127.0.0.1:");
    CHECK_CONTAINS(heard.trouble, "not on the allow-list");
    CHECK_INT(pose_source_counters(source)->rejected[REJECT_SENDER], 1);
    udp_close(&udp);
    pose_source_close(source);
}

static void the_senders_clock_takes_the_jitter_out(void)
{
    struct intake intake;
    intake_init(&intake, &(struct intake_params){.protocol = POSE_PROTOCOL_NATIVE,
                                                 .geoid = {.undulation_m = constant_undulation_m}});
    static const int late_ms[] = {3, 0, 9, 4, 8, 1, 2, 0, 7, 5};
    for (int i = 0; i < 10; i++) {
        uint8_t data[NATIVE_SIZE];
        struct pose pose;
        nsec_t sent_ns = NSEC_PER_SEC + i * 16 * NSEC_PER_MSEC;
        struct pose_sample sample = {
            .sequence = (uint32_t)i, .sender_ns = sent_ns, .pose = {.valid = POSE_POSITION}};
        native_encode(&sample, data);
        nsec_t receive_ns = 77 * NSEC_PER_SEC + sent_ns + late_ms[i] * NSEC_PER_MSEC;
        CHECK_INT(intake_packet(&intake, data, sizeof(data), receive_ns, &pose, NULL), 1);
        CHECK_INT(pose.receive_ns, receive_ns);
        if (i >= 1) /* from the first prompt one on, within the creep that drift is allowed */
            CHECK_NEAR((double)(pose.time_ns - 77 * NSEC_PER_SEC - sent_ns), 0.0, 1e5);
    }
}

/* 300 ms is too little for a jump. Poses that seem older than they are would be extrapolated. */
static void a_senders_clock_that_is_set_back_is_followed(void)
{
    struct intake intake;
    intake_init(&intake, &(struct intake_params){.protocol = POSE_PROTOCOL_NATIVE,
                                                 .geoid = {.undulation_m = constant_undulation_m}});
    for (int i = 0; i < 60 * 20; i++) {
        uint8_t data[NATIVE_SIZE];
        struct pose pose;
        nsec_t now_ns = 100 * NSEC_PER_SEC + i * 16 * NSEC_PER_MSEC;
        nsec_t back_ns = i < 60 ? 0 : 300 * NSEC_PER_MSEC;
        struct pose_sample sample = {.sequence = (uint32_t)i,
                                     .sender_ns = now_ns - back_ns,
                                     .pose = {.valid = POSE_POSITION}};
        native_encode(&sample, data);
        CHECK_INT(intake_packet(&intake, data, sizeof(data), now_ns, &pose, NULL), 1);
        if (i > 60 * 11)
            CHECK_NEAR((double)(pose.time_ns - now_ns), 0.0, 1e6);
    }
}

static void a_bad_endpoint_names_the_source(void)
{
    struct pose_source *source = NULL;
    struct diag diag;
    const char *allow = "10.0.0.0/99";
    struct pose_source_params params = {
        .name = "fg",
        .endpoint = "nowhere",
        .intake = {.geoid = {.undulation_m = constant_undulation_m}}};
    CHECK_INT(pose_source_open(&params, &source, &diag), -EINVAL);
    CHECK_STRING(diag.text, "source fg: \"nowhere\" is not ADDRESS:PORT");
    params.endpoint = "127.0.0.1:0";
    params.allow = &allow;
    params.allow_count = 1;
    CHECK_INT(pose_source_open(&params, &source, &diag), -EINVAL);
    CHECK_CONTAINS(diag.text, "10.0.0.0/99");
    params.allow_count = 0;
    params.intake.protocol = POSE_PROTOCOL_CANAEROSPACE;
    CHECK_INT(pose_source_open(&params, &source, &diag), -EINVAL);
    CHECK_CONTAINS(diag.text, "neither can:INTERFACE nor sim:PATH");
    CHECK(!source);
}

static const char *bus_url(void)
{
    static char url[64];
    snprintf(url, sizeof(url), "sim:%s/bus", scratch);
    return url;
}

static struct can_frame frame_of(uint32_t id, const char *hex)
{
    struct can_frame frame = {.can_id = id};
    frame.can_dlc = (uint8_t)bytes_from_hex(hex, frame.data, 8);
    return frame;
}

static void a_canaerospace_source_reads_the_simulated_bus(void)
{
    struct pose_source *source = NULL;
    struct pose_source_params params = {
        .name = "bus",
        .endpoint = bus_url(),
        .intake = {.protocol = POSE_PROTOCOL_CANAEROSPACE,
                   .geoid = {.undulation_m = constant_undulation_m}},
        .transmit = true};
    CHECK_INT(pose_source_open(&params, &source, NULL), 0);
    struct can_bus *a = NULL, *b = NULL;
    struct can_bus_params member = {0};
    CHECK_INT(can_bus_create(bus_url(), &member, &a, NULL), 0);
    CHECK_INT(can_bus_create(bus_url(), &member, &b, NULL), 0);
    struct heard heard = {0};
    poll(NULL, 0, 10);
    struct canaerospace_encoder encoder = {.node = 3};
    struct pose pose = {.valid = POSE_POSITION | POSE_ATTITUDE,
                        .position = {47.4582, 8.5555, 1500.25},
                        .attitude = {-12.5, 3.25, 271.5}};
    size_t sent = 0;
    for (int i = 0; i < 3; i++) {
        struct can_frame frames[CANAEROSPACE_FRAMES_MAX];
        size_t count = canaerospace_encode(&encoder, &pose, frames);
        for (size_t k = 0; k < count; k++, sent++) {
            frames[k].can_id |= i == 1 ? CAN_EFF_FLAG : 0; /* a bus may have either length */
            CHECK_INT(can_bus_send(a, &frames[k]), 0);
        }
        dispatch(source, &heard);
    }
    CHECK(heard.poses >= 3);
    CHECK_INT(heard.packets, sent);
    CHECK_INT(heard.packet_size, sizeof(struct can_frame));
    CHECK_NEAR(heard.pose.position.lat_deg, 47.4582, 1e-12);
    CHECK_NEAR(heard.pose.position.height_m, 1500.25, 0.0);
    CHECK_NEAR(heard.pose.attitude.heading_deg, 271.5, 0.0);
    CHECK_INT(pose_source_can_state(source), CAN_STATE_ACTIVE);
    CHECK_INT(pose_source_counters(source)->received, sent);
    /* The other member heard all of it, as on a wire; the sender did not hear itself. */
    struct can_frame frame;
    nsec_t at_ns;
    size_t overheard = 0;
    while (can_bus_receive(b, &frame, &at_ns, NULL) > 0)
        overheard++;
    CHECK_INT(overheard, sent);
    CHECK_INT(can_bus_receive(a, &frame, &at_ns, NULL), 0);
    /* And the daemon answers who it is. */
    struct can_frame who = frame_of(128, "00000005");
    CHECK_INT(can_bus_send(b, &who), 0);
    dispatch(source, &heard);
    CHECK_INT(can_bus_receive(a, &frame, &at_ns, NULL), 1); /* the request, relayed */
    CHECK_INT(can_bus_receive(a, &frame, &at_ns, NULL), 1);
    CHECK_INT(frame.can_id, 129);
    CHECK_INT(frame.data[3], 5);
    can_bus_destroy(a);
    can_bus_destroy(b);
    can_bus_destroy(NULL);
    pose_source_close(source);
}

static void a_source_that_may_not_transmit_stays_silent(void)
{
    struct pose_source *source = open_source(POSE_PROTOCOL_CANAEROSPACE, bus_url(), NULL);
    struct can_bus *member = NULL;
    struct can_frame who = frame_of(128, "00000005"), frame;
    struct heard heard = {0};
    nsec_t at_ns;
    CHECK_INT(can_bus_create(bus_url(), &(struct can_bus_params){0}, &member, NULL), 0);
    poll(NULL, 0, 10);
    CHECK_INT(can_bus_send(member, &who), 0);
    struct pose_source_events events = {.context = &heard, .pose = hear_pose};
    for (int i = 0; i < 5; i++, poll(NULL, 0, 10))
        pose_source_dispatch(source, clock_monotonic_ns(), &events);
    CHECK_INT(can_bus_receive(member, &frame, &at_ns, NULL), 0);
    CHECK_INT(pose_source_counters(source)->received, 0);
    can_bus_destroy(member);
    pose_source_close(source);
}

static void a_member_that_speaks_no_can_is_shown_the_door(void)
{
    struct pose_source *source = open_source(POSE_PROTOCOL_CANAEROSPACE, bus_url(), NULL);
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    snprintf(address.sun_path, sizeof(address.sun_path), "%s", bus_url() + 4);
    int fd = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    CHECK_INT(connect(fd, (struct sockaddr *)&address, sizeof(address)), 0);
    CHECK_INT(send(fd, "hello", 5, MSG_NOSIGNAL), 5);
    struct heard heard = {0};
    dispatch(source, &heard);
    char byte;
    CHECK_INT(recv(fd, &byte, 1, MSG_DONTWAIT), 0); /* closed */
    CHECK_INT(heard.poses, 0);
    close(fd);
    pose_source_close(source);
}

static void a_bus_that_is_gone_comes_back(void)
{
    struct can_bus *hub = NULL, *member = NULL;
    struct diag diag = {""};
    struct can_bus_params serve = {.serve = true}, join = {0};
    CHECK_INT(can_bus_create(bus_url(), &join, &member, &diag), CAN_BUS_DOWN);
    CHECK_CONTAINS(diag.text, "nobody serves a bus there");
    CHECK_INT(can_bus_service(member, clock_monotonic_ns()), 0); /* not yet */
    CHECK_INT(can_bus_create(bus_url(), &serve, &hub, NULL), 0);
    nsec_t later_ns = clock_monotonic_ns() + 10 * NSEC_PER_SEC;
    CHECK_INT(can_bus_service(member, later_ns), 1);
    CHECK_INT(member->state, CAN_STATE_ACTIVE);
    can_bus_destroy(hub);
    struct can_frame frame = {0};
    nsec_t at_ns;
    CHECK_INT(can_bus_receive(member, &frame, &at_ns, &diag), -ENETDOWN);
    CHECK_CONTAINS(diag.text, "went down");
    CHECK_INT(member->state, CAN_STATE_NONE);
    CHECK_INT(can_bus_send(member, &frame), -ENETDOWN);
    can_bus_destroy(member);
}

static void an_interface_that_is_not_there_is_down_not_fatal(void)
{
    struct pose_source *source = NULL;
    struct diag diag = {""};
    struct pose_source_params params = {
        .name = "bus",
        .endpoint = "can:otwdnone0",
        .intake = {.protocol = POSE_PROTOCOL_CANAEROSPACE,
                   .geoid = {.undulation_m = constant_undulation_m}}};
    CHECK_INT(pose_source_open(&params, &source, &diag), POSE_SOURCE_DOWN);
    CHECK_CONTAINS(diag.text, "source bus: can:otwdnone0: ");
    CHECK_INT(pose_source_can_state(source), CAN_STATE_NONE);
    struct heard heard = {0};
    struct pose_source_events events = {.context = &heard};
    pose_source_dispatch(source, clock_monotonic_ns() + 10 * NSEC_PER_SEC, &events);
    CHECK_INT(heard.poses, 0);
    pose_source_close(source);
}

static int switched_from, switched_to;

static void note_switch(void *context, int from, int to)
{
    switched_from = from;
    switched_to = to;
}

static void the_best_live_source_drives(void)
{
    struct arbiter arbiter;
    struct pose pose = {.valid = POSE_POSITION}, none = {.valid = POSE_ATTITUDE};
    arbiter_init(&arbiter, note_switch, NULL);
    int fg = arbiter_add(&arbiter, 2, 200), host = arbiter_add(&arbiter, 1, 100);
    CHECK_INT(arbiter_update(&arbiter, 0), ARBITER_NONE);
    CHECK_INT(arbiter_age_ns(&arbiter, 0), -1);
    CHECK(arbiter_offer(&arbiter, fg, &pose, 1000));
    CHECK_INT(switched_from, ARBITER_NONE);
    CHECK_INT(switched_to, fg);
    CHECK(!arbiter_offer(&arbiter, host, &none, 1000)); /* no position, no pose */
    CHECK(arbiter_offer(&arbiter, host, &pose, 1050));
    CHECK_INT(switched_to, host);
    CHECK(!arbiter_offer(&arbiter, fg, &pose, 1100));
    CHECK_INT(arbiter_update(&arbiter, 1150), host);
    CHECK_INT(arbiter_update(&arbiter, 1151), fg); /* host silent for more than 100 */
    CHECK_INT(arbiter.switches, 3);
    CHECK_INT(arbiter_update(&arbiter, 1301), ARBITER_NONE);
    CHECK(arbiter_offer(&arbiter, fg, &pose, 2000));
    for (int i = 2; i < ARBITER_SOURCES_MAX; i++)
        CHECK_INT(arbiter_add(&arbiter, 1, 1), i);
    CHECK_INT(arbiter_add(&arbiter, 1, 1), -ENOSPC);
}

static void a_source_that_is_replaced_drives_no_more(void)
{
    struct arbiter arbiter;
    struct pose pose = {.valid = POSE_POSITION};
    arbiter_init(&arbiter, note_switch, NULL);
    int best = arbiter_add(&arbiter, 1, 100), spare = arbiter_add(&arbiter, 2, 100);
    CHECK(arbiter_offer(&arbiter, best, &pose, 1000));
    CHECK(!arbiter_offer(&arbiter, spare, &pose, 1000));
    arbiter_replace(&arbiter, best, 3, 100);
    CHECK_INT(arbiter_update(&arbiter, 1010), spare);
    CHECK_INT(switched_from, best);
    CHECK(!arbiter_offer(&arbiter, best, &pose, 1020)); /* by its new priority */
    CHECK_INT(arbiter_update(&arbiter, 1101), best);
}

static const struct check_test tests[] = {
    {"addresses and networks are parsed", addresses_and_networks_are_parsed},
    {"a port in use is named", a_port_in_use_is_named},
    {"a group is heard by all who join it, and by the sender",
     a_group_is_heard_by_all_who_join_it_and_by_the_sender},
    {"datagrams carry the kernel's stamp", datagrams_carry_the_kernels_stamp},
    {"a source gives poses above the ellipsoid", a_source_gives_poses_above_the_ellipsoid},
    {"late and lost packets are counted", late_and_lost_packets_are_counted},
    {"bad packets are counted and told once a second",
     bad_packets_are_counted_and_told_once_a_second},
    {"senders not on the list are refused", senders_not_on_the_list_are_refused},
    {"the sender's clock takes the jitter out", the_senders_clock_takes_the_jitter_out},
    {"a sender's clock that is set back is followed", a_senders_clock_that_is_set_back_is_followed},
    {"a bad endpoint names the source", a_bad_endpoint_names_the_source},
    {"a CANaerospace source reads the simulated bus",
     a_canaerospace_source_reads_the_simulated_bus},
    {"a source that may not transmit stays silent", a_source_that_may_not_transmit_stays_silent},
    {"a member that speaks no CAN is shown the door",
     a_member_that_speaks_no_can_is_shown_the_door},
    {"a bus that is gone comes back", a_bus_that_is_gone_comes_back},
    {"an interface that is not there is down, not fatal",
     an_interface_that_is_not_there_is_down_not_fatal},
    {"the best live source drives", the_best_live_source_drives},
    {"a source that is replaced drives no more", a_source_that_is_replaced_drives_no_more},
};

int main(void)
{
    if (!mkdtemp(scratch))
        return 1;
    int failed = CHECK_MAIN(tests);
    rmdir(scratch);
    return failed;
}
