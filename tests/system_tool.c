/* What the system tests need besides the shell:
 *
 *   system_tool free-port             a port of 127.0.0.1 that neither TCP nor UDP uses
 *   system_tool hold-port PORT        holds it for UDP until killed
 *   system_tool notify SOCKET FILE    a service manager's ear: each message's lines into FILE
 *   system_tool bad-input PORT KIND   one native datagram that has to be refused, or a good one
 *   system_tool cigi PORT KIND [N]    a message of a CIGI host, good or bad, or N of noise
 *   system_tool cigi-ask PORT REPLY HEIGHTS LINES FRAMES
 *                                     a CIGI host that asks so many heights and lines of sight at
 *                                     once, so many times, each time when all is answered
 *   system_tool cigi-late PORT REPLY  a CIGI host in synchronous operation that is late or behind:
 *                                     a line as each way of it begins
 *   system_tool picture-differs A.png B.png LEVELS
 *                                     the pixels, in 10000, of which some colour differs by more
 *                                     than that many levels of 255
 *   system_tool swaps GROUP INTERFACE FROM_S
 *                                     a line for each frame that channels of a swap lock tell that
 *                                     they show, until killed: number, channel, whose number (host
 *                                     or tick), ms of the system clock since FROM_S
 */
#include <math.h>
#include <netinet/in.h>
#include <png.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "io/cigi_host.h"
#include "io/native.h"
#include "io/swap_lock.h"
#include "io/udp.h"

#define LIFE_S           60 /* an orphan ends by itself */
#define LATE_FRAMES      6  /* of each way to be late */
#define SWAPS_SILENCE_MS 60000

static void fail(const char *what)
{
    perror(what);
    exit(1);
}

static int bound(int type, unsigned port, struct sockaddr_in *ret_address)
{
    struct sockaddr_in address = {.sin_family = AF_INET,
                                  .sin_port = htons((uint16_t)port),
                                  .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t length = sizeof(address);
    int fd = socket(AF_INET, type, 0);
    if (fd < 0)
        fail("socket");
    if (bind(fd, (struct sockaddr *)&address, length) < 0) {
        close(fd);
        return -1;
    }
    getsockname(fd, (struct sockaddr *)&address, &length);
    *ret_address = address;
    return fd;
}

static int free_port(void)
{
    for (int attempt = 0; attempt < 100; attempt++) {
        struct sockaddr_in address, same;
        int tcp = bound(SOCK_STREAM, 0, &address);
        if (tcp < 0)
            fail("bind");
        int udp = bound(SOCK_DGRAM, ntohs(address.sin_port), &same);
        close(tcp);
        if (udp < 0)
            continue;
        close(udp);
        printf("%u\n", ntohs(address.sin_port));
        return 0;
    }
    fputs("no free port\n", stderr);
    return 1;
}

static void hold_port(unsigned port)
{
    struct sockaddr_in address;
    if (bound(SOCK_DGRAM, port, &address) < 0)
        fail("bind");
    puts("held");
    fflush(stdout);
    pause();
}

static void notify(const char *path, const char *out_path)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    char message[4096];
    FILE *out = fopen(out_path, "w");
    int fd = socket(AF_UNIX, SOCK_DGRAM, 0);
    if (!out || fd < 0 || strlen(path) >= sizeof(address.sun_path))
        fail(out_path);
    strcpy(address.sun_path, path);
    if (bind(fd, (struct sockaddr *)&address, sizeof(address)) < 0)
        fail(path);
    for (;;) {
        ssize_t n = recv(fd, message, sizeof(message) - 1, 0);
        if (n < 0)
            fail("recv");
        message[n] = '\0';
        fprintf(out, "%s\n", message);
        fflush(out);
    }
}

static size_t make_datagram(const char *kind, uint8_t data[NATIVE_SIZE])
{
    struct pose_sample sample = {
        .session = 77,
        .sequence = 1,
        .pose = {.valid = POSE_POSITION | POSE_ATTITUDE, .position = {46.5, 7.9, 4000.0}}};
    if (strcmp(kind, "nan") == 0)
        sample.pose.position.lon_deg = NAN;
    if (strcmp(kind, "latitude") == 0)
        sample.pose.position.lat_deg = 91.0;
    native_encode(&sample, data);
    if (strcmp(kind, "malformed") == 0)
        memset(data, 0x5a, 40);
    if (strcmp(kind, "version") == 0)
        data[4] = 9;
    return strcmp(kind, "length") == 0 ? NATIVE_SIZE - 1 : NATIVE_SIZE;
}

static int bad_input(unsigned port, const char *kind)
{
    uint8_t data[NATIVE_SIZE];
    struct sockaddr_in to = {.sin_family = AF_INET,
                             .sin_port = htons((uint16_t)port),
                             .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    size_t size = make_datagram(kind, data);
    int fd = socket(AF_INET, SOCK_DGRAM, 0);
    if (fd < 0 || sendto(fd, data, size, 0, (struct sockaddr *)&to, sizeof(to)) != (ssize_t)size)
        fail("sendto");
    close(fd);
    return 0;
}

static void put_own_ship(const struct cigi_host *host, struct cigi_writer *writer, double lat_deg)
{
    const struct pose pose = {.valid = POSE_POSITION | POSE_ATTITUDE,
                              .position = {lat_deg, 7.9, 4000.0}};
    cigi_host_put_pose(host, writer, 0, 1, &pose);
}

static void put_bytes(struct cigi_writer *writer, const uint8_t *bytes, size_t size)
{
    memcpy(writer->data + writer->size, bytes, size);
    writer->size += size;
}

static void put_clamped(struct cigi_writer *writer)
{
    struct cigi_packet packet = {.kind = CIGI_ENTITY_CONTROL};
    packet.entity_control = (struct cigi_entity_control){
        .state = CIGI_ACTIVE, .placement = {.clamp = CIGI_CLAMPED, .place = {46.6, 7.9, 2000.0}}};
    cigi_write(writer, &packet);
}

static void put_surroundings(const char *kind, struct cigi_writer *writer)
{
    struct cigi_packet air = {.kind = CIGI_ATMOSPHERE,
                              .atmosphere = {.enable = 1, .visibility_m = 12340.0f}};
    struct cigi_packet sky = {.kind = CIGI_CELESTIAL};
    struct cigi_packet view = {.kind = CIGI_VIEW_DEFINITION,
                               .view_definition = {.use = 4, .left = -89.0f}};
    sky.celestial = (struct cigi_celestial){
        .hour = 6, .minute = 30, .ephemeris = 1, .sun = 1, .date_valid = 1, .date = 6212025};
    struct cigi_packet other = {.kind = CIGI_VIEW_DEFINITION,
                                .view_definition = {.use = 0x3f,
                                                    .near_m = 0.5f,
                                                    .far_m = 1e6f,
                                                    .left = -30.0f,
                                                    .right = 30.0f,
                                                    .top = 17.5f,
                                                    .bottom = -17.5f}};
    struct cigi_packet down = {.kind = CIGI_VIEW_CONTROL,
                               .view_control = {.use = 0x10, .pitch_deg = -90.0f}};
    if (strcmp(kind, "down") == 0)
        cigi_write(writer, &down);
    if (strcmp(kind, "perspective") == 0)
        cigi_write(writer, &other);
    if (strcmp(kind, "parallel") == 0) {
        other.view_definition.orthographic = 1;
        other.view_definition.left = other.view_definition.bottom = -3000.0f;
        other.view_definition.right = other.view_definition.top = 3000.0f;
        cigi_write(writer, &other);
    }
    if (strcmp(kind, "air") == 0)
        cigi_write(writer, &air);
    if (strcmp(kind, "sky") == 0)
        cigi_write(writer, &sky);
    if (strcmp(kind, "view") == 0)
        cigi_write(writer, &view);
}

/* Own-ship looks south; entity 5 is 500 m before it, or is no more. Entity 6 is 56 m north of where
 * own-ship was put last; the eye rides on it, or is back. */
static void put_traffic(const char *kind, const struct cigi_host *host, struct cigi_writer *writer)
{
    struct pose pose = {.valid = POSE_POSITION | POSE_ATTITUDE,
                        .position = {46.5, 7.9, 4000.0},
                        .attitude = {.heading_deg = 180.0}};
    struct cigi_packet gone = {.kind = CIGI_ENTITY_CONTROL,
                               .entity_control = {.entity = 5, .state = CIGI_DESTROYED}};
    if (strcmp(kind, "south") == 0)
        cigi_host_put_pose(host, writer, 0, 1, &pose);
    pose.position.lat_deg = 46.4955;
    if (strcmp(kind, "other") == 0)
        cigi_host_put_pose(host, writer, 5, 20, &pose);
    if (strcmp(kind, "gone") == 0)
        cigi_write(writer, &gone);
    struct cigi_packet ride = {.kind = CIGI_VIEW_CONTROL,
                               .view_control = {.entity = strcmp(kind, "ride") == 0 ? 6 : 0}};
    pose.position.lat_deg = 46.7005;
    if (strcmp(kind, "wingman") == 0)
        cigi_host_put_pose(host, writer, 6, 20, &pose);
    if (strcmp(kind, "ride") == 0 || strcmp(kind, "back") == 0)
        cigi_write(writer, &ride);
}

/* What speaks of a view, an entity or a place that is not there. */
static void put_unknown(const char *kind, struct cigi_writer *writer)
{
    struct cigi_packet view = {.kind = CIGI_VIEW_CONTROL, .view_control = {.view = 77}};
    struct cigi_packet request = {.kind = CIGI_HEIGHT_REQUEST};
    if (strcmp(kind, "no-view") == 0)
        cigi_write(writer, &view);
    request.height_request = (struct cigi_height_request){.request = 1, .place = {91.0, 7.9, 0.0}};
    if (strcmp(kind, "far-request") == 0)
        cigi_write(writer, &request);
    request.height_request =
        (struct cigi_height_request){.request = 2, .entity = 99, .of_entity = 1};
    if (strcmp(kind, "no-request-entity") == 0)
        cigi_write(writer, &request);
}

/* What is wrong stands before a place of own-ship, where that can be read at all. */
static size_t make_cigi(const char *kind, uint8_t data[CIGI_MESSAGE_MAX])
{
    static const uint8_t size_0[8] = {2, 0}, past_end[8] = {2, 240}, unknown[8] = {250, 8};
    static const uint8_t odd_size[16] = {2, 12}, garbage[24] = {90, 90, 90, 90, 90, 90, 90, 90};
    struct cigi_host host = {.format = {.major = 3, .minor = 3}, .frame = 1};
    struct cigi_packet orphan = {.kind = CIGI_RATE, .rate = {.entity = 99}};
    struct cigi_writer writer;
    cigi_host_begin(&host, 1, data, &writer);
    if (strcmp(kind, "operate") == 0)
        put_own_ship(&host, &writer, 46.5);
    if (strcmp(kind, "standby") == 0)
        data[4] &= 0xfc;
    if (strcmp(kind, "debug") == 0)
        data[4] = (uint8_t)((data[4] & 0xfc) | CIGI_DEBUG);
    if (strcmp(kind, "size-0") == 0)
        put_bytes(&writer, size_0, sizeof(size_0));
    if (strcmp(kind, "past-end") == 0)
        put_bytes(&writer, past_end, sizeof(past_end));
    if (strcmp(kind, "odd-size") == 0)
        put_bytes(&writer, odd_size, sizeof(odd_size));
    if (strcmp(kind, "garbage") == 0) {
        put_own_ship(&host, &writer, 46.65);
        put_bytes(&writer, garbage, sizeof(garbage));
    }
    if (strcmp(kind, "nan") == 0) {
        put_own_ship(&host, &writer, NAN);
        put_own_ship(&host, &writer, 46.6);
    }
    if (strcmp(kind, "no-entity") == 0)
        cigi_write(&writer, &orphan);
    if (strcmp(kind, "unknown") == 0) {
        put_bytes(&writer, unknown, sizeof(unknown));
        put_own_ship(&host, &writer, 46.7);
    }
    if (strcmp(kind, "place") == 0)
        put_own_ship(&host, &writer, 46.7);
    if (strcmp(kind, "clamped") == 0)
        put_clamped(&writer);
    put_surroundings(kind, &writer);
    put_unknown(kind, &writer);
    put_traffic(kind, &host, &writer);
    if (strcmp(kind, "magic") == 0 || strcmp(kind, "noise") == 0)
        memset(data, 0x5a, writer.size);
    return writer.size;
}

/* Noise comes from 127.0.0.9. */
static int cigi(unsigned port, const char *kind, int count)
{
    static uint8_t data[CIGI_MESSAGE_MAX];
    size_t size = make_cigi(kind, data);
    struct sockaddr_in to = {.sin_family = AF_INET,
                             .sin_port = htons((uint16_t)port),
                             .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    struct sockaddr_in from = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(0x7f000009)};
    int fd = socket(AF_INET, SOCK_DGRAM, 0);
    if (fd < 0 ||
        (strcmp(kind, "noise") == 0 && bind(fd, (struct sockaddr *)&from, sizeof(from)) < 0))
        fail("socket");
    for (int i = 0; i < count; i++) {
        if (sendto(fd, data, size, 0, (struct sockaddr *)&to, sizeof(to)) != (ssize_t)size)
            fail("sendto");
        if (i % 10 == 9)
            usleep(1000);
    }
    close(fd);
    return 0;
}

/* Heights, normals and lines of sight around own-ship. */
static void put_requests(struct cigi_writer *writer, unsigned heights, unsigned lines)
{
    for (unsigned i = 0; i < heights + lines; i++) {
        double turn = (double)i * 0.618, far_deg = 0.05 * (i % 50) / 50.0;
        double place[3] = {46.5 + far_deg * sin(turn), 7.9 + far_deg * cos(turn), 4000.0};
        uint16_t number = (uint16_t)i;
        struct cigi_packet packet = {.kind = CIGI_HEIGHT_REQUEST};
        if (i < heights) {
            packet.height_request =
                (struct cigi_height_request){.request = number, .type = (uint8_t)(i % 3)};
            memcpy(packet.height_request.place, place, sizeof(place));
        } else {
            packet.kind = CIGI_VECTOR_REQUEST;
            packet.vector_request = (struct cigi_vector_request){.request = number,
                                                                 .azimuth_deg = (float)i,
                                                                 .elevation_deg = -30.0f,
                                                                 .most_m = 20e3f};
            memcpy(packet.vector_request.from, place, sizeof(place));
        }
        if (!cigi_write(writer, &packet))
            fail("a message of requests");
    }
}

struct asking {
    struct udp udp;
    union address to;
    struct cigi_host host;
    uint32_t frame; /* in which was asked last */
    bool heard;     /* that has been echoed */
    unsigned long asked, answered, in_next;
    uint8_t data[CIGI_MESSAGE_MAX];
};

static bool is_response(const struct cigi_packet *packet)
{
    return (packet->kind == CIGI_HEIGHT_RESPONSE && packet->height_response.valid) ||
           (packet->kind == CIGI_HEIGHT_EXTENDED && packet->height_extended.valid) ||
           packet->kind == CIGI_SIGHT_RESPONSE;
}

/* False where nothing comes for a second. */
static bool take_start(struct asking *asking)
{
    struct pollfd ready = {.fd = asking->udp.fd, .events = POLLIN};
    struct datagram datagram;
    struct cigi_reader reader;
    struct cigi_packet packet;
    if (poll(&ready, 1, 1000) <= 0 ||
        udp_receive(&asking->udp, asking->data, sizeof(asking->data), &datagram) <= 0)
        return false;
    if (cigi_host_receive(&asking->host, asking->data, datagram.size, &reader, NULL) < 0)
        fail("a message that is no Start of Frame");
    bool echoes = (int32_t)(asking->host.seen.host_frame - asking->frame) >= 0;
    bool is_next = echoes && !asking->heard;
    while (cigi_read(&reader, &packet, NULL) != CIGI_END) {
        asking->answered += is_response(&packet);
        asking->in_next += is_next && is_response(&packet);
    }
    asking->heard = echoes;
    return true;
}

static int cigi_ask(char **arguments)
{
    static struct asking asking = {.host = {.format = {.major = 3, .minor = 3}, .frame = 1}};
    unsigned heights = (unsigned)atoi(arguments[2]), lines = (unsigned)atoi(arguments[3]);
    unsigned long all = (unsigned long)(heights + lines) * (unsigned)atoi(arguments[4]);
    char to[64], listen[64];
    struct cigi_writer writer;
    snprintf(to, sizeof(to), "127.0.0.1:%s", arguments[0]);
    snprintf(listen, sizeof(listen), "127.0.0.1:%s", arguments[1]);
    if (address_parse(to, &asking.to, NULL) < 0 || udp_listen(&asking.udp, listen, NULL) < 0)
        fail(to);
    while (asking.answered < all && take_start(&asking)) {
        cigi_host_begin(&asking.host, clock_monotonic_ns(), asking.data, &writer);
        put_own_ship(&asking.host, &writer, 46.5);
        if (asking.host.seen.mode == CIGI_OPERATE && asking.answered == asking.asked &&
            asking.asked < all) {
            put_requests(&writer, heights, lines);
            asking.asked += heights + lines;
            asking.frame = asking.host.frame - 1;
            asking.heard = false;
        }
        udp_send_to(&asking.udp, &asking.to, asking.data, writer.size);
    }
    udp_close(&asking.udp);
    printf("%lu asked, %lu answered, %lu in the next message\n", asking.asked, asking.answered,
           asking.in_next);
    return 0;
}

/* `echo`: how many frames older than the last Start of Frame is what it claims to have seen. */
static void put_answer(struct asking *asking, double lat_deg, uint32_t echo)
{
    struct cigi_writer writer;
    asking->host.seen.ig_frame -= echo;
    cigi_host_begin(&asking->host, clock_monotonic_ns(), asking->data, &writer);
    asking->host.seen.ig_frame += echo;
    put_own_ship(&asking->host, &writer, lat_deg);
    udp_send_to(&asking->udp, &asking->to, asking->data, writer.size);
}

/* One that is late is so by more than the wait, and by less than a frame. */
static int cigi_late(char **arguments)
{
    static const struct {
        const char *name;
        double decoy_deg,
            lat_deg; /* an answer to an older frame, which comes first; the right one */
        uint32_t echo;
        unsigned after_ms;
    } ways[] = {
        {"in step", 0.0, 46.5, 0, 0}, {"decoys", 46.6, 46.5, 0, 30}, {"behind", 0.0, 46.5, 2, 0},
        {"late", 0.0, 46.5, 0, 170},  {"again", 0.0, 46.7, 0, 0},
    };
    static struct asking asking = {.host = {.format = {.major = 3, .minor = 3}, .frame = 1}};
    char to[64], listen[64];
    snprintf(to, sizeof(to), "127.0.0.1:%s", arguments[0]);
    snprintf(listen, sizeof(listen), "127.0.0.1:%s", arguments[1]);
    setvbuf(stdout, NULL, _IOLBF, 0);
    if (address_parse(to, &asking.to, NULL) < 0 || udp_listen(&asking.udp, listen, NULL) < 0)
        fail(to);
    while (take_start(&asking) && asking.host.seen.mode != CIGI_OPERATE)
        put_answer(&asking, ways[0].lat_deg, 0);
    for (size_t way = 0; way < sizeof(ways) / sizeof(ways[0]); way++) {
        printf("%s\n", ways[way].name);
        for (int i = 0; i < LATE_FRAMES; i++) {
            if (ways[way].decoy_deg != 0.0)
                put_answer(&asking, ways[way].decoy_deg, 1);
            usleep(1000 * ways[way].after_ms);
            put_answer(&asking, ways[way].lat_deg, ways[way].echo);
            if (!take_start(&asking))
                fail("no Start of Frame for a second");
        }
    }
    udp_close(&asking.udp);
    printf("%llu gaps\n", (unsigned long long)asking.host.gaps);
    return 0;
}

static int swaps(const char *group, const char *interface, nsec_t from_ns)
{
    struct udp udp;
    struct datagram datagram;
    struct swap_message m;
    struct diag diag;
    uint8_t data[SWAP_MESSAGE_SIZE];
    setvbuf(stdout, NULL, _IOLBF, 0);
    alarm(0); /* the test ends it */
    if (udp_listen_group(&udp, group, interface, &diag) < 0) {
        fprintf(stderr, "%s\n", diag.text);
        return 1;
    }
    struct pollfd poll_fd = {.fd = udp.fd, .events = POLLIN};
    while (poll(&poll_fd, 1, SWAPS_SILENCE_MS) > 0)
        if (udp_receive(&udp, data, sizeof(data), &datagram) > 0 &&
            swap_message_decode(data, datagram.size, &m, NULL) == 0 && m.kind == SWAP_SHOW)
            printf("%u %u %s %.4f\n", m.label.number, m.channel,
                   m.label.base == SWAP_HOST ? "host" : "tick",
                   milliseconds_from_ns(m.realtime_ns - from_ns));
    udp_close(&udp);
    return 0;
}

/* RGB, of which the caller is the owner; ends the program where there is none. */
static png_bytep read_picture(const char *path, png_image *picture)
{
    *picture = (png_image){.version = PNG_IMAGE_VERSION};
    png_bytep pixels = NULL;
    if (png_image_begin_read_from_file(picture, path)) {
        picture->format = PNG_FORMAT_RGB;
        pixels = malloc(PNG_IMAGE_SIZE(*picture));
    }
    if (!pixels || !png_image_finish_read(picture, NULL, pixels, 0, NULL)) {
        fprintf(stderr, "%s: %s\n", path, picture->message);
        exit(66);
    }
    return pixels;
}

static int picture_differs(char **argv)
{
    png_image first, second;
    png_bytep a = read_picture(argv[0], &first), b = read_picture(argv[1], &second);
    if (first.width != second.width || first.height != second.height) {
        fputs("the pictures have two sizes\n", stderr);
        return 65;
    }
    size_t pixels = (size_t)first.width * first.height, differing = 0;
    for (size_t i = 0; i < pixels; i++) {
        int greatest = 0;
        for (size_t j = 3 * i; j < 3 * i + 3; j++)
            greatest = abs(a[j] - b[j]) > greatest ? abs(a[j] - b[j]) : greatest;
        differing += greatest > atoi(argv[2]);
    }
    printf("%zu\n", differing * 10000 / pixels);
    free(a);
    free(b);
    return 0;
}

int main(int argc, char **argv)
{
    const char *what = argc > 1 ? argv[1] : "";
    alarm(LIFE_S);
    if (strcmp(what, "free-port") == 0)
        return free_port();
    if (strcmp(what, "hold-port") == 0 && argc == 3)
        hold_port((unsigned)atoi(argv[2]));
    if (strcmp(what, "notify") == 0 && argc == 4)
        notify(argv[2], argv[3]);
    if (strcmp(what, "bad-input") == 0 && argc == 4)
        return bad_input((unsigned)atoi(argv[2]), argv[3]);
    if (strcmp(what, "cigi") == 0 && argc >= 4)
        return cigi((unsigned)atoi(argv[2]), argv[3], argc > 4 ? atoi(argv[4]) : 1);
    if (strcmp(what, "cigi-late") == 0 && argc == 4)
        return cigi_late(argv + 2);
    if (strcmp(what, "cigi-ask") == 0 && argc == 7)
        return cigi_ask(argv + 2);
    if (strcmp(what, "picture-differs") == 0 && argc == 5)
        return picture_differs(argv + 2);
    if (strcmp(what, "swaps") == 0 && argc == 5)
        return swaps(argv[2], argv[3], atoll(argv[4]) * NSEC_PER_SEC);
    fputs("usage: see the head of tests/system_tool.c\n", stderr);
    return 64;
}
