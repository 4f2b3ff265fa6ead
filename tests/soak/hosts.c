#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "io/dis.h"
#include "io/native.h"
#include "tests/soak/soak.h"

#define LAP_S      40.0
#define DIS_EVERY  6 /* ticks */
#define STAMP_NS   10000
#define STALE_ECHO 600 /* frames of the host; a stopped daemon answers late */

/* Where the hosts' own clocks begin: so many seconds before they roll over. */
#define CIGI_CLOCK_NS   (INT64_C(42949672960000) * 3 - 90 * NSEC_PER_SEC)
#define NATIVE_CLOCK_NS (INT64_C(4294967296000000) - 110 * NSEC_PER_SEC)
#define DIS_CLOCK_NS    ((3600 - 130) * NSEC_PER_SEC)

static void need(int r, const struct diag *diag)
{
    if (r >= 0)
        return;
    fprintf(stderr, "soak: %s\n", diag->text);
    exit(1);
}

static void address(char ret[32], unsigned port)
{
    snprintf(ret, 32, "127.0.0.1:%u", port);
}

void hosts_open(struct hosts *hosts, const struct hosts_ports *ports)
{
    struct diag diag = {""};
    char text[32];
    hosts->host = (struct cigi_host){.format = {.major = 3, .minor = 3}, .frame = -(60u * 100)};
    hosts->cigi_first = hosts->host.frame;
    hosts->native_first = hosts->native_next = -(60u * 80);
    address(text, ports->cigi);
    need(address_parse(text, &hosts->cigi_to, &diag), &diag);
    address(text, ports->reply);
    need(udp_listen(&hosts->cigi, text, &diag), &diag);
    address(text, ports->native);
    need(address_parse(text, &hosts->native_to, &diag), &diag);
    need(udp_connect(&hosts->native, text, &diag), &diag);
    address(text, ports->dis);
    need(udp_connect(&hosts->dis, text, &diag), &diag);
    need(udp_listen(&hosts->noise, "127.0.0.9:0", &diag), &diag);
}

void hosts_join_bus(struct hosts *hosts, const char *url)
{
    struct diag diag = {""};
    need(can_bus_create(url, &(struct can_bus_params){0}, &hosts->bus, &diag), &diag);
}

void hosts_close(struct hosts *hosts)
{
    can_bus_destroy(hosts->bus);
    udp_close(&hosts->cigi);
    udp_close(&hosts->native);
    udp_close(&hosts->dis);
    udp_close(&hosts->noise);
}

static struct pose pose_of(const struct hosts *hosts, enum soak_source source, nsec_t now_ns)
{
    double turn = 2.0 * M_PI * seconds_from_ns(now_ns - hosts->start_ns) / LAP_S;
    return (struct pose){
        .valid = POSE_POSITION | POSE_ATTITUDE,
        .position = {SOAK_LAT_DEG(source) + SOAK_RADIUS_DEG * sin(turn),
                     7.9 + SOAK_RADIUS_DEG * cos(turn), 4000.0},
        .attitude = {.heading_deg = fmod(360.0 - turn * 180.0 / M_PI, 360.0) + 360.0},
    };
}

static void normalise(struct pose *pose)
{
    pose->attitude.heading_deg = heading_normalised_deg(pose->attitude.heading_deg);
}

void hosts_native(struct hosts *hosts, nsec_t now_ns)
{
    uint8_t data[NATIVE_SIZE];
    struct pose_sample sample = {.pose = pose_of(hosts, SOAK_NATIVE, now_ns),
                                 .has_sequence = true,
                                 .session = 1,
                                 .sequence = hosts->native_next++,
                                 .sender_ns = NATIVE_CLOCK_NS + now_ns - hosts->start_ns};
    normalise(&sample.pose);
    native_encode(&sample, data);
    udp_send(&hosts->native, data, sizeof(data));
    hosts->sent[SOAK_NATIVE]++;
}

static void send_cigi(struct hosts *hosts, nsec_t now_ns)
{
    static uint8_t data[CIGI_MESSAGE_MAX];
    struct cigi_writer writer;
    struct pose pose = pose_of(hosts, SOAK_CIGI, now_ns);
    normalise(&pose);
    cigi_host_begin(&hosts->host, CIGI_CLOCK_NS + now_ns - hosts->start_ns, data, &writer);
    cigi_host_put_pose(&hosts->host, &writer, 0, 1, &pose);
    udp_send_to(&hosts->cigi, &hosts->cigi_to, data, writer.size);
    hosts->sent[SOAK_CIGI]++;
}

static void send_dis(struct hosts *hosts, nsec_t now_ns)
{
    uint8_t data[DIS_ENTITY_STATE_SIZE];
    struct pose pose = pose_of(hosts, SOAK_DIS, now_ns);
    double hours = seconds_from_ns(DIS_CLOCK_NS + now_ns - hosts->start_ns) / 3600.0;
    struct dis_entity entity = {.version = 7,
                                .exercise = 1,
                                .timestamp = (uint32_t)(uint64_t)(hours * DIS_HOUR) << 1,
                                .id = {1, 1, 1},
                                .kind = DIS_PLATFORM,
                                .domain = DIS_AIR};
    normalise(&pose);
    dis_motion_from_pose(&pose, &entity.motion);
    dis_encode(&entity, data);
    udp_send(&hosts->dis, data, sizeof(data));
    hosts->sent[SOAK_DIS]++;
}

/* A member of the simulated bus that does not read would fill up. */
static void put_frame(struct hosts *hosts, const struct can_frame *frame)
{
    struct can_frame heard;
    nsec_t at_ns;
    while (can_bus_receive(hosts->bus, &heard, &at_ns, NULL) > 0)
        ;
    *(can_bus_send(hosts->bus, frame) < 0 ? &hosts->frames_refused : &hosts->frames_sent) += 1;
}

static void send_can(struct hosts *hosts, nsec_t now_ns)
{
    struct can_frame frames[CANAEROSPACE_FRAMES_MAX];
    struct pose pose = pose_of(hosts, SOAK_CAN, now_ns);
    normalise(&pose);
    size_t count = canaerospace_encode(&hosts->can, &pose, frames);
    for (size_t i = 0; i < count; i++)
        put_frame(hosts, &frames[i]);
    hosts->sent[SOAK_CAN]++;
}

static void take_starts(struct hosts *hosts, nsec_t now_ns)
{
    static uint8_t data[CIGI_MESSAGE_MAX];
    struct datagram datagram;
    while (udp_receive(&hosts->cigi, data, sizeof(data), &datagram) > 0) {
        struct cigi_start_of_frame before = hosts->host.seen;
        bool first = !hosts->host.has_seen;
        if (cigi_host_receive(&hosts->host, data, datagram.size, NULL, NULL) < 0) {
            hosts->refused++;
            continue;
        }
        if (first)
            hosts->first_start_ns = now_ns;
        else
            hosts->stamp_units += hosts->host.seen.timestamp - before.timestamp;
        hosts->last_start_ns = now_ns;
        hosts->starts++;
        uint32_t behind = hosts->host.frame - 1 - hosts->host.seen.host_frame;
        hosts->strange_echoes += hosts->sent[SOAK_CIGI] > STALE_ECHO && behind > STALE_ECHO;
    }
}

void hosts_tick(struct hosts *hosts, uint64_t tick, nsec_t now_ns)
{
    take_starts(hosts, now_ns);
    if (!hosts->silent[SOAK_CIGI])
        send_cigi(hosts, now_ns);
    if (!hosts->silent[SOAK_NATIVE])
        hosts_native(hosts, now_ns);
    if (!hosts->silent[SOAK_DIS] && tick % DIS_EVERY == 0)
        send_dis(hosts, now_ns);
    if (!hosts->silent[SOAK_CAN])
        send_can(hosts, now_ns);
}

static void fill_bad(uint8_t data[NATIVE_SIZE], unsigned kind)
{
    struct pose_sample sample = {.session = 1,
                                 .pose = {.valid = POSE_POSITION, .position = {46.5, 7.9, 4000.0}}};
    if (kind == 1)
        sample.pose.position.lat_deg = 91.0;
    if (kind == 2)
        sample.pose.position.lon_deg = NAN;
    native_encode(&sample, data);
    if (kind == 0)
        memset(data, 0x5a, 40);
    if (kind == 3)
        data[4] = 9;
}

void hosts_bad(struct hosts *hosts, unsigned kind)
{
    uint8_t data[NATIVE_SIZE];
    fill_bad(data, kind % 5);
    udp_send(&hosts->native, data, kind % 5 == 4 ? NATIVE_SIZE - 1 : NATIVE_SIZE);
    hosts->bad++;
}

void hosts_noise(struct hosts *hosts)
{
    uint8_t data[NATIVE_SIZE];
    fill_bad(data, 4);
    udp_send_to(&hosts->noise, &hosts->native_to, data, sizeof(data));
    hosts->bad++;
}
