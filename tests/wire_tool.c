/* Messages of X-Plane, DIS and CANaerospace for the system tests, sound or not:
 *
 *   wire_tool PROTOCOL PORT-OR-BUS KIND      one message; "good" is sound, see `changes`
 *   wire_tool noise PORT SECONDS RATE        datagrams that are none, from 127.0.0.9
 */
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/clock.h"
#include "io/can_bus.h"
#include "io/canaerospace.h"
#include "io/dis.h"
#include "io/xplane.h"
#include "tests/hex.h"

#define LIFE_S    60 /* an orphan ends by itself */
#define SIZE_MOST 512

/* What makes a sound message another: bytes of it, or its end. */
static const struct change {
    const char *protocol, *kind;
    size_t offset;
    const char *hex;
    size_t size; /* 0: as it was */
} changes[] = {
    {"xplane", "short", 0, "", 68},
    {"xplane", "long", 0, "", 70},
    {"xplane", "magic", 0, "58585858", 0},
    {"xplane", "nan", 5, "000000000000f87f", 0},    /* longitude */
    {"xplane", "range", 13, "0000000000c05640", 0}, /* latitude 91 */
    {"xplane", "nan-pitch", 33, "0000c07f", 0},     /* and so on: each number has its own place */
    {"xplane", "nan-velocity", 45, "0000807f", 0},  /* infinite */
    {"dis", "short", 0, "", 100},                   /* shorter than its header says */
    {"dis", "length-0", 8, "0000", 0},
    {"dis", "past-end", 8, "00c8", 0},
    {"dis", "version", 0, "09", 0},
    {"dis", "nan", 48, "7ff8000000000000", 0},
    {"dis", "range", 48, "000000000000000000000000000000000000000000000000", 0},
    {"dis", "nan-velocity", 36, "7f800000", 0},
    {"dis", "other", 16, "0009", 0},                                  /* another entity */
    {"dis", "fire", 2, "02", 0},                                      /* another PDU */
    {"dis", "garbage", 144, "5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a5a", 160}, /* behind a sound one */
    {"can", "short", 0, "", 4},
    {"can", "type", 1, "07", 0},
    {"can", "nan", 4, "7fc00000", 0},
    {"can", "range", 4, "42b60000", 0}, /* latitude 91 */
};

static void fail(const char *what)
{
    perror(what);
    exit(1);
}

static const struct pose somewhere = {
    .valid = POSE_POSITION | POSE_ATTITUDE | POSE_VELOCITY,
    .position = {46.5, 7.9, 4000.0},
};

/* Returns its new size. */
static size_t change(const char *protocol, const char *kind, uint8_t *data, size_t size)
{
    for (size_t i = 0; i < sizeof(changes) / sizeof(changes[0]); i++) {
        const struct change *c = &changes[i];
        if (strcmp(c->protocol, protocol) != 0 || strcmp(c->kind, kind) != 0)
            continue;
        bytes_from_hex(c->hex, data + c->offset, SIZE_MOST - c->offset);
        return c->size ? c->size : size;
    }
    if (strcmp(kind, "good") == 0)
        return size;
    fprintf(stderr, "%s has no kind %s\n", protocol, kind);
    exit(64);
}

static struct sockaddr_in loopback(unsigned port)
{
    return (struct sockaddr_in){.sin_family = AF_INET,
                                .sin_port = htons((uint16_t)port),
                                .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
}

static int send_datagram(const char *protocol, unsigned port, const char *kind)
{
    uint8_t data[SIZE_MOST] = {0};
    size_t size = XPLANE_RPOS_SIZE;
    struct sockaddr_in to = loopback(port);
    if (strcmp(protocol, "xplane") == 0 && strcmp(kind, "other") == 0) {
        struct xplane_pose pose = {.sample.pose = somewhere, .aircraft = 3};
        xplane_encode_vehx(&pose, data);
        size = XPLANE_VEHX_SIZE;
        kind = "good";
    } else if (strcmp(protocol, "xplane") == 0) {
        xplane_encode_rpos(&(struct xplane_pose){.sample.pose = somewhere}, data);
    } else {
        struct dis_entity entity = {
            .version = 7, .exercise = 1, .id = {1, 1, 1}, .kind = DIS_PLATFORM, .domain = DIS_AIR};
        dis_motion_from_pose(&somewhere, &entity.motion);
        dis_encode(&entity, data);
        size = DIS_ENTITY_STATE_SIZE;
    }
    size = change(protocol, kind, data, size);
    int fd = socket(AF_INET, SOCK_DGRAM, 0);
    if (fd < 0 || sendto(fd, data, size, 0, (struct sockaddr *)&to, sizeof(to)) != (ssize_t)size)
        fail("sendto");
    close(fd);
    return 0;
}

/* A sound pose in frames, or one frame of a latitude that is not. */
static int send_frames(const char *path, const char *kind)
{
    struct canaerospace_encoder encoder = {.node = 1};
    struct can_frame frames[CANAEROSPACE_FRAMES_MAX];
    size_t count = canaerospace_encode(&encoder, &somewhere, frames);
    struct can_bus *bus = NULL;
    char url[256];
    snprintf(url, sizeof(url), "sim:%s", path);
    if (can_bus_create(url, &(struct can_bus_params){0}, &bus, NULL) < 0)
        fail(url);
    if (strcmp(kind, "remote") == 0) {
        frames[0].can_id |= CAN_RTR_FLAG;
        count = 1;
    } else if (strcmp(kind, "good") != 0) {
        frames[0].data[1] = 2; /* FLOAT */
        frames[0].can_dlc = (uint8_t)change("can", kind, frames[0].data, 8);
        count = 1;
    }
    for (size_t i = 0; i < count; i++)
        if (can_bus_send(bus, &frames[i]) < 0)
            fail(url);
    can_bus_destroy(bus);
    return 0;
}

static int make_noise(unsigned port, double seconds, double rate_hz)
{
    static const uint8_t data[300] = {0x5a, 0x5a, 0x5a, 0x5a};
    struct sockaddr_in to = loopback(port), from = loopback(0);
    from.sin_addr.s_addr = htonl(0x7f000009);
    int fd = socket(AF_INET, SOCK_DGRAM, 0);
    if (fd < 0 || bind(fd, (struct sockaddr *)&from, sizeof(from)) < 0)
        fail("noise");
    nsec_t start_ns = clock_monotonic_ns();
    unsigned long count = (unsigned long)(seconds * rate_hz);
    for (unsigned long i = 0; i < count; i++) {
        if (i % 10 == 0)
            clock_sleep_until(start_ns + ns_from_seconds((double)i / rate_hz));
        if (sendto(fd, data, sizeof(data), 0, (struct sockaddr *)&to, sizeof(to)) < 0)
            fail("sendto");
    }
    close(fd);
    printf("%lu\n", count);
    return 0;
}

int main(int argc, char **argv)
{
    alarm(LIFE_S);
    if (argc == 5 && strcmp(argv[1], "noise") == 0)
        return make_noise((unsigned)atoi(argv[2]), atof(argv[3]), atof(argv[4]));
    if (argc == 4 && strcmp(argv[1], "can") == 0)
        return send_frames(argv[2], argv[3]);
    if (argc == 4)
        return send_datagram(argv[1], (unsigned)atoi(argv[2]), argv[3]);
    fputs("usage: see the head of tests/wire_tool.c\n", stderr);
    return 64;
}
