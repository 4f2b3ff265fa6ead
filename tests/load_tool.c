/* Floods a daemon, and says what becomes of its frames, its memory and its other clients:
 *
 *   load_tool MODBUS-PORT POSE-PORT SIM-BUS PID ROUNDS
 *
 * A round is a quiet phase and a loud one, PHASE_MS each, so that whatever else the machine does
 * falls on both. In the loud ones come 100 000 datagrams a second, a third each of them sound,
 * malformed and from 127.0.0.9; as many CAN frames as a bus of 1 Mbit/s carries; and 60 Modbus
 * clients that are silent within a request, slow, or lie about its length. Four more ask as they
 * should, always.
 *
 * Prints "NAME QUIET LOUD" a line. */
#include <arpa/inet.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/stats.h"
#include "io/can_bus.h"
#include "io/canaerospace.h"
#include "io/native.h"

#define LIFE_S           120 /* an orphan ends by itself */
#define PHASE_MS         2200
#define ROUNDS_MOST      16
#define DATAGRAMS_A_MS   100
#define CAN_FRAMES_A_MS  8 /* 8 bytes and a standard identifier: 111 bits and stuffing */
#define BAD_CLIENTS      60
#define GOOD_CLIENTS     4
#define ASK_EVERY_MS     20
#define ANSWERS_MOST     10000
#define REQUEST_SIZE     12
#define REGISTERS        52
#define HEALTH_FRAME_P99 9
#define HEALTH_FRAMES    2

enum phase { QUIET, LOUD, PHASES };

static atomic_int phase;
static atomic_bool over;
static atomic_ulong sent[PHASES];
static unsigned modbus_port, pose_port;
static const char *bus_url;

static void fail(const char *what)
{
    perror(what);
    exit(1);
}

static struct sockaddr_in at(uint32_t address, unsigned port)
{
    return (struct sockaddr_in){.sin_family = AF_INET,
                                .sin_port = htons((uint16_t)port),
                                .sin_addr.s_addr = htonl(address)};
}

static int sender(uint32_t from)
{
    struct sockaddr_in own = at(from, 0), peer = at(INADDR_LOOPBACK, pose_port);
    int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (fd < 0 || bind(fd, (struct sockaddr *)&own, sizeof(own)) < 0 ||
        connect(fd, (struct sockaddr *)&peer, sizeof(peer)) < 0)
        fail("the sender of datagrams");
    return fd;
}

/* Sound ones, each later than the one before, or malformed. */
static void send_many(int fd, bool sound, unsigned count)
{
    static struct pose_sample sample = {
        .pose = {.valid = POSE_POSITION | POSE_ATTITUDE, .position = {46.5, 7.9, 4000.0}},
        .has_sequence = true};
    static uint8_t data[DATAGRAMS_A_MS][NATIVE_SIZE];
    struct mmsghdr messages[DATAGRAMS_A_MS];
    struct iovec vecs[DATAGRAMS_A_MS];
    for (unsigned i = 0; i < count; i++) {
        sample.sequence++;
        native_encode(&sample, data[i]);
        data[i][4] = sound ? data[i][4] : 0xff;
        vecs[i] = (struct iovec){data[i], NATIVE_SIZE};
        messages[i] = (struct mmsghdr){.msg_hdr = {.msg_iov = &vecs[i], .msg_iovlen = 1}};
    }
    int done = sendmmsg(fd, messages, count, 0);
    if (done > 0)
        sent[phase] += (unsigned long)done;
}

static double sender_ms; /* CPU of the thread below */

/* A sound pose every 16 ms, in loud phases among 1600 others. */
static void *flood(void *unused)
{
    int allowed = sender(INADDR_LOOPBACK), other = sender(0x7f000009);
    nsec_t next_ns = clock_monotonic_ns();
    for (unsigned i = 0; !over; i++) {
        if (phase == LOUD) {
            send_many(allowed, true, DATAGRAMS_A_MS / 3);
            send_many(allowed, false, DATAGRAMS_A_MS / 3);
            send_many(other, true, DATAGRAMS_A_MS - 2 * (DATAGRAMS_A_MS / 3));
        } else if (i % 16 == 0) {
            send_many(allowed, true, 1);
        }
        clock_sleep_until(next_ns += NSEC_PER_MSEC);
    }
    sender_ms = milliseconds_from_ns(clock_thread_cpu_ns());
    close(allowed);
    close(other);
    return NULL;
}

static atomic_ulong can_sent;

static void *fill_bus(void *unused)
{
    struct canaerospace_encoder encoder = {.node = 1};
    struct can_frame frames[CANAEROSPACE_FRAMES_MAX];
    struct can_bus *bus = NULL;
    const struct pose pose = {.valid = POSE_POSITION | POSE_ATTITUDE,
                              .position = {46.5, 7.9, 4000.0}};
    size_t count = canaerospace_encode(&encoder, &pose, frames), next = 0;
    if (can_bus_create(bus_url, &(struct can_bus_params){.ids = NULL}, &bus, NULL) != 0)
        fail(bus_url);
    for (nsec_t next_ns = clock_monotonic_ns(); !over; clock_sleep_until(next_ns)) {
        for (int i = 0; phase == LOUD && i < CAN_FRAMES_A_MS; i++, next = (next + 1) % count)
            can_sent += can_bus_send(bus, &frames[next]) == 0;
        next_ns += NSEC_PER_MSEC;
    }
    can_bus_destroy(bus);
    return NULL;
}

static int connect_modbus(bool waits)
{
    struct sockaddr_in peer = at(INADDR_LOOPBACK, modbus_port);
    struct timeval limit = {.tv_sec = 2};
    int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd < 0 || connect(fd, (struct sockaddr *)&peer, sizeof(peer)) < 0)
        fail("a Modbus client");
    setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof(limit));
    if (!waits)
        fcntl(fd, F_SETFL, O_NONBLOCK);
    return fd;
}

/* All input registers. */
static const uint8_t request[REQUEST_SIZE] = {0, 1, 0, 0, 0, 6, 1, 4, 0, 0, 0, REGISTERS};

/* One of three kinds, ten times a second; whoever is closed comes again. */
static void be_bad(int *fd, unsigned which, unsigned turn)
{
    static const uint8_t lies[][8] = {{0, 1, 0, 0, 0xff, 0xff, 1, 4},
                                      {0, 1, 0, 0, 0, 0, 1, 4},
                                      {0, 1, 0, 0, 0, 254, 1, 4},
                                      {0x47, 0x45, 0x54, 0x20, 0x2f, 0x20, 0x48, 0x54}};
    uint8_t byte;
    if (*fd < 0)
        *fd = connect_modbus(false);
    if (which % 3 == 0 && turn == 0)
        (void)!send(*fd, request, REQUEST_SIZE - 3, MSG_NOSIGNAL);
    else if (which % 3 == 1)
        (void)!send(*fd, request + turn % REQUEST_SIZE, 1, MSG_NOSIGNAL);
    else if (which % 3 == 2)
        (void)!send(*fd, lies[(which + turn) % 4], 8, MSG_NOSIGNAL);
    while (recv(*fd, &byte, 1, 0) > 0)
        ;
    if (recv(*fd, &byte, 1, 0) == 0 || (which % 3 == 2 && turn % 4 == 3)) {
        close(*fd);
        *fd = -1;
    }
}

static void *be_many(void *unused)
{
    int fds[BAD_CLIENTS];
    unsigned turn = 0;
    memset(fds, 0xff, sizeof(fds));
    for (nsec_t next_ns = clock_monotonic_ns(); !over; clock_sleep_until(next_ns)) {
        for (unsigned i = 0; i < BAD_CLIENTS; i++)
            if (phase == LOUD) {
                be_bad(&fds[i], i, turn);
            } else if (fds[i] >= 0) {
                close(fds[i]);
                fds[i] = -1;
            }
        turn = phase == LOUD ? turn + 1 : 0;
        next_ns += 100 * NSEC_PER_MSEC;
    }
    return NULL;
}

/* Milliseconds until each answer. */
static struct {
    double ms[ANSWERS_MOST];
    size_t count;
} answers[PHASES];
static unsigned lost; /* answers that did not come within two seconds, or connections */

static uint16_t registers[REGISTERS];

static double ask(int fd)
{
    uint8_t answer[9 + 2 * REGISTERS];
    size_t size = 0;
    nsec_t begin_ns = clock_monotonic_ns();
    if (send(fd, request, sizeof(request), MSG_NOSIGNAL) != sizeof(request))
        lost++;
    while (size < sizeof(answer)) {
        ssize_t got = recv(fd, answer + size, sizeof(answer) - size, 0);
        if (got <= 0) {
            lost++;
            break;
        }
        size += (size_t)got;
    }
    for (size_t i = 0; size == sizeof(answer) && i < REGISTERS; i++)
        registers[i] = (uint16_t)(answer[9 + 2 * i] << 8 | answer[10 + 2 * i]);
    return seconds_from_ns(clock_monotonic_ns() - begin_ns) * 1e3;
}

static unsigned long register_u32(unsigned i)
{
    return (unsigned long)registers[i] << 16 | registers[i + 1];
}

/* CPU time of the thread that draws, and the process's memory. */
static double render_cpu_ms(const char *pid)
{
    char command[256];
    double ns = 0.0;
    snprintf(command, sizeof(command),
             "for t in /proc/%s/task/*; do [ $(cat $t/comm) = otwd-render ] && "
             "cut -d' ' -f1 $t/schedstat; done",
             pid);
    FILE *file = popen(command, "re");
    if (!file || fscanf(file, "%lf", &ns) != 1)
        fail("the drawing thread's time");
    pclose(file);
    return ns / 1e6;
}

/* Of the process's first thread, which is the event loop. */
static double loop_cpu_ms(const char *pid)
{
    char name[64];
    double ns = 0.0;
    snprintf(name, sizeof(name), "/proc/%s/schedstat", pid);
    FILE *file = fopen(name, "re");
    if (!file || fscanf(file, "%lf", &ns) != 1)
        fail(name);
    fclose(file);
    return ns / 1e6;
}

/* The number in a line of the process's status. */
static unsigned long status_of(const char *pid, const char *key)
{
    char name[64], line[128];
    unsigned long value = 0;
    snprintf(name, sizeof(name), "/proc/%s/status", pid);
    FILE *file = fopen(name, "re");
    while (file && fgets(line, sizeof(line), file))
        if (strncmp(line, key, strlen(key)) == 0)
            value = strtoul(line + strlen(key), NULL, 10);
    if (!file || !value)
        fail(name);
    fclose(file);
    return value;
}

static unsigned long resident_kib(const char *pid)
{
    return status_of(pid, "VmRSS:");
}

/* How often the event loop went to sleep: so often it was woken. */
static unsigned long wakes(const char *pid)
{
    return status_of(pid, "voluntary_ctxt_switches:");
}

static double frame_p99_ms[PHASES][ROUNDS_MOST], cpu_ms[PHASES][ROUNDS_MOST];
static double loop_ms[PHASES];
static unsigned long woken[PHASES];

static void run_phase(int fds[GOOD_CLIENTS], const char *pid, enum phase now, unsigned round)
{
    phase = now;
    nsec_t begin_ns = clock_monotonic_ns(), next_ns = begin_ns;
    ask(fds[0]);
    double before_ms = render_cpu_ms(pid), loop_before_ms = loop_cpu_ms(pid);
    unsigned long woken_before = wakes(pid);
    unsigned long frames = register_u32(HEALTH_FRAMES);
    for (unsigned i = 0; clock_monotonic_ns() < begin_ns + PHASE_MS * NSEC_PER_MSEC; i++) {
        double ms = ask(fds[i % GOOD_CLIENTS]);
        if (answers[now].count < ANSWERS_MOST)
            answers[now].ms[answers[now].count++] = ms;
        clock_sleep_until(next_ns += ASK_EVERY_MS * NSEC_PER_MSEC);
    }
    ask(fds[0]);
    frames = register_u32(HEALTH_FRAMES) - frames;
    loop_ms[now] += loop_cpu_ms(pid) - loop_before_ms;
    woken[now] += wakes(pid) - woken_before;
    cpu_ms[now][round] = (render_cpu_ms(pid) - before_ms) / (double)(frames ? frames : 1);
    frame_p99_ms[now][round] = (double)register_u32(HEALTH_FRAME_P99) / 1e3;
}

static struct distribution summary(double *values, size_t count)
{
    struct distribution d = {0};
    distribution_of_values(values, count, &d);
    return d;
}

int main(int argc, char **argv)
{
    pthread_t threads[3];
    void *(*const work[3])(void *) = {flood, fill_bus, be_many};
    int fds[GOOD_CLIENTS];
    alarm(LIFE_S);
    if (argc != 6)
        return 64;
    modbus_port = (unsigned)atoi(argv[1]);
    pose_port = (unsigned)atoi(argv[2]);
    bus_url = argv[3];
    unsigned rounds = (unsigned)atoi(argv[5]);
    rounds = rounds < ROUNDS_MOST ? rounds : ROUNDS_MOST;
    for (int i = 0; i < GOOD_CLIENTS; i++)
        fds[i] = connect_modbus(true);
    for (int i = 0; i < 3; i++)
        pthread_create(&threads[i], NULL, work[i], NULL);
    unsigned long kib = 0;
    for (unsigned i = 0; i < rounds; i++) {
        run_phase(fds, argv[4], QUIET, i);
        run_phase(fds, argv[4], LOUD, i);
        kib = i == 0 ? resident_kib(argv[4]) : kib;
    }
    over = true;
    for (int i = 0; i < 3; i++)
        pthread_join(threads[i], NULL);
    double ms[PHASES] = {rounds * PHASE_MS, rounds * PHASE_MS};
    printf("datagrams_per_s %.0f %.0f\n", (double)sent[QUIET] / ms[QUIET] * 1e3,
           (double)sent[LOUD] / ms[LOUD] * 1e3);
    printf("sender_cpu_ms_per_s 0 %.0f\n", sender_ms / ms[LOUD] * 1e3);
    printf("can_per_s 0 %.0f\n", (double)can_sent / ms[LOUD] * 1e3);
    printf("frame_p99_ms %.3f %.3f\n", summary(frame_p99_ms[QUIET], rounds).p50,
           summary(frame_p99_ms[LOUD], rounds).p50);
    printf("render_cpu_ms %.4f %.4f\n", summary(cpu_ms[QUIET], rounds).p50,
           summary(cpu_ms[LOUD], rounds).p50);
    printf("loop_cpu_ms_per_s %.2f %.2f\n", loop_ms[QUIET] / ms[QUIET] * 1e3,
           loop_ms[LOUD] / ms[LOUD] * 1e3);
    printf("loop_wakes_per_s %.0f %.0f\n", (double)woken[QUIET] / ms[QUIET] * 1e3,
           (double)woken[LOUD] / ms[LOUD] * 1e3);
    for (int percent = 50; percent <= 100; percent += 49) {
        double worst[PHASES];
        for (int i = 0; i < PHASES; i++) {
            struct distribution d = summary(answers[i].ms, answers[i].count);
            worst[i] = percent == 50 ? d.p50 : d.p99;
        }
        printf("answer_p%d_ms %.3f %.3f\n", percent, worst[QUIET], worst[LOUD]);
    }
    printf("answer_max_ms %.3f %.3f\n", summary(answers[QUIET].ms, answers[QUIET].count).max,
           summary(answers[LOUD].ms, answers[LOUD].count).max);
    printf("answers_lost 0 %u\n", lost);
    printf("resident_kib %lu %lu\n", kib, resident_kib(argv[4]));
    return 0;
}
