/* soak OTWD SECONDS SEED DIRECTORY: runs the daemon `OTWD` (tests/soak/otwd_soak) at 60 Hz for so
 * long, with four hosts, and does to it what the seed says: hosts fall silent, send nonsense, come
 * from where they may not or leave numbers out; the daemon is stopped, flooded, reconfigured, and
 * asked over Modbus by clients that misbehave. docs/soak.md. */
#include <errno.h>
#include <fcntl.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/soak/soak.h"
#include "tests/soak/verdict.h"

#define TICK_NS   (NSEC_PER_SEC / SOAK_RATE_HZ)
#define START_S   30   /* until the first frame */
#define SETTLE_S  10   /* from the first frame to the first event */
#define RATTLE_S  6    /* after an event, until all has to be as before */
#define FLOOD     3500 /* datagrams: more than a queue holds, less than what counts as a new start */
#define CLIENTS   80
#define PORT_BASE 20000

struct soak {
    const char *program, *directory;
    char config[512], other_config[512], log[512], csv[512], modbus[32], bus[600];
    struct hosts_ports ports;
    unsigned modbus_port, taken_port;
    uint64_t random;
    nsec_t end_ns;
    uint64_t tick;
    struct hosts hosts;
    struct watch watch;
    /* the event now going on */
    const struct event *event;
    char event_text[64];
    nsec_t event_end_ns, next_event_ns, look_ns;
    unsigned raised_before, cleared_before;
    int source;
    struct udp taken;
    int clients[CLIENTS];
    struct verdict verdict;
};

static uint32_t draw(struct soak *soak, uint32_t below)
{
    soak->random = soak->random * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (uint32_t)(soak->random >> 33) % below;
}

static void fail(const char *what)
{
    perror(what);
    exit(1);
}

/* ---- the daemon */

static void write_config(const struct soak *soak, const char *path, unsigned dis_port)
{
    FILE *out = fopen(path, "w");
    if (!out)
        fail(path);
    fprintf(out,
            "display: {width: 64, height: 64, rate_hz: %d}\n"
            "terrain: {pixel_error: 4, cache_mib: 16}\n"
            "sources:\n"
            "  - {name: host, type: cigi, listen: \"127.0.0.1:%u\", reply: \"127.0.0.1:%u\",\n"
            "     allow: [127.0.0.1], timeout_ms: 1000, priority: 1}\n"
            "  - {name: native, type: native, listen: \"127.0.0.1:%u\", allow: [127.0.0.1],\n"
            "     timeout_ms: 1000, priority: 2}\n"
            "  - {name: dis, type: dis, listen: \"127.0.0.1:%u\", timeout_ms: 1000, priority: 3}\n"
            "  - {name: bus, type: canaerospace, interface: \"%s\", altitude: ellipsoid,\n"
            "     timeout_ms: 1000, priority: 4}\n"
            "health: {modbus: {listen: \"%s\"}}\n"
            "record: {directory: \"%s/record\", max_mib: 16}\n",
            SOAK_RATE_HZ, soak->ports.cigi, soak->ports.reply, soak->ports.native, dis_port,
            soak->bus, soak->modbus, soak->directory);
    if (fclose(out) != 0)
        fail(path);
}

static void write_to(const char *path, const char *text)
{
    int fd = open(path, O_WRONLY | O_CLOEXEC);
    if (fd < 0 || write(fd, text, strlen(text)) < 0)
        fail(path);
    close(fd);
}

/* The monotonic clock of children stands shortly before 2^32 ms (time_namespaces(7)). */
static void set_clock_ahead(void)
{
    char text[64];
    unsigned uid = geteuid();
    nsec_t ahead_s = SOAK_ROLL_MONOTONIC_S - SOAK_MONOTONIC_S - clock_monotonic_ns() / NSEC_PER_SEC;
    if (unshare(uid ? CLONE_NEWUSER | CLONE_NEWTIME : CLONE_NEWTIME) < 0)
        fail("no time namespace");
    if (uid) {
        snprintf(text, sizeof(text), "%u %u 1", uid, uid);
        write_to("/proc/self/uid_map", text);
    }
    snprintf(text, sizeof(text), "monotonic %lld 0", (long long)ahead_s);
    write_to("/proc/self/timens_offsets", text);
}

static pid_t start_daemon(const struct soak *soak)
{
    set_clock_ahead();
    pid_t pid = fork();
    if (pid != 0)
        return pid;
    int log = open(soak->log, O_WRONLY | O_CREAT | O_TRUNC | O_APPEND, 0644);
    if (log < 0 || dup2(log, STDERR_FILENO) < 0 || dup2(log, STDOUT_FILENO) < 0)
        _exit(1);
    execl(soak->program, "otwd", "run", "-c", soak->config, (char *)NULL);
    _exit(127);
}

static bool log_has(const struct soak *soak, const char *text)
{
    char line[1200];
    bool found = false;
    FILE *file = fopen(soak->log, "re");
    while (file && !found && fgets(line, sizeof(line), file))
        found = strstr(line, text);
    if (file)
        fclose(file);
    return found;
}

static void wait_for_frames(struct soak *soak)
{
    for (int i = 0; i < START_S * 10 && !log_has(soak, "the first frame is out"); i++)
        usleep(100000);
    if (!log_has(soak, "the first frame is out")) {
        fprintf(stderr, "soak: no frame after %d s: see %s\n", START_S, soak->log);
        kill(soak->watch.pid, SIGKILL);
        exit(1);
    }
}

/* ---- what is done to it */

struct event {
    const char *name;
    unsigned code; /* that has to be raised, 0: none */
    bool told;     /* its end has to be in the log */
    unsigned least_s, more_s;
    void (*begin)(struct soak *soak);
    void (*end)(struct soak *soak); /* NULL: nothing to be done */
};

static void begin_silence(struct soak *soak)
{
    soak->source = (int)draw(soak, SOAK_SOURCES);
    soak->hosts.silent[soak->source] = true;
}

static void end_silence(struct soak *soak)
{
    memset(soak->hosts.silent, 0, sizeof(soak->hosts.silent));
}

static void begin_all_silent(struct soak *soak)
{
    memset(soak->hosts.silent, 1, sizeof(soak->hosts.silent));
}

static void begin_nonsense(struct soak *soak)
{
    for (unsigned n = 1 + draw(soak, 8); n > 0; n--)
        hosts_bad(&soak->hosts, draw(soak, 5));
}

static void begin_noise(struct soak *soak)
{
    for (unsigned n = 1 + draw(soak, 60); n > 0; n--)
        hosts_noise(&soak->hosts);
}

static void begin_gap(struct soak *soak)
{
    uint32_t native = 1 + draw(soak, 40), cigi = 1 + draw(soak, 40);
    soak->hosts.native_next += native;
    soak->hosts.host.frame += cigi;
}

static void stop_daemon_for_a_while(struct soak *soak)
{
    kill(soak->watch.pid, SIGSTOP);
}

static void let_go_on(struct soak *soak)
{
    kill(soak->watch.pid, SIGCONT);
}

static void begin_flood(struct soak *soak)
{
    stop_daemon_for_a_while(soak);
    for (int i = 0; i < FLOOD; i++)
        hosts_native(&soak->hosts, clock_monotonic_ns());
}

/* Another configuration, in which one source's port is taken. */
static void begin_taken(struct soak *soak)
{
    char text[32];
    struct diag diag;
    snprintf(text, sizeof(text), "127.0.0.1:%u", soak->taken_port);
    if (udp_listen(&soak->taken, text, &diag) < 0)
        fail(diag.text);
    write_config(soak, soak->config, soak->taken_port);
    kill(soak->watch.pid, SIGHUP);
}

static void end_taken(struct soak *soak)
{
    if (draw(soak, 2)) { /* the port is freed, found so within a second, then left again */
        udp_close(&soak->taken);
        usleep(1500000);
    }
    write_config(soak, soak->config, soak->ports.dis);
    kill(soak->watch.pid, SIGHUP);
    usleep(100000);
    udp_close(&soak->taken);
}

static void begin_clients(struct soak *soak)
{
    static const uint8_t half[9] = {0, 1, 0, 0, 0xff, 0xff, 1, 4, 0};
    for (int i = 0; i < CLIENTS; i++) {
        struct sockaddr_in to = {.sin_family = AF_INET,
                                 .sin_port = htons((uint16_t)soak->modbus_port),
                                 .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
        soak->clients[i] = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
        if (connect(soak->clients[i], (struct sockaddr *)&to, sizeof(to)) == 0)
            send(soak->clients[i], half, draw(soak, sizeof(half)) + 1, MSG_NOSIGNAL);
    }
}

static void end_clients(struct soak *soak)
{
    for (int i = 0; i < CLIENTS; i++)
        close(soak->clients[i]);
}

static void begin_reload(struct soak *soak)
{
    kill(soak->watch.pid, SIGHUP);
}

/* Names that begin with "stopped" say to watch.c why deadlines are missed. */
static const struct event events[] = {
    {"a host is silent", FAULT_SOURCE_LOST, true, 3, 20, begin_silence, end_silence},
    {"all hosts are silent", FAULT_POSE_STALE, true, 3, 10, begin_all_silent, end_silence},
    {"nonsense", FAULT_POSE_REJECTED, false, 3, 2, begin_nonsense, NULL},
    {"noise", FAULT_POSE_REJECTED, false, 3, 2, begin_noise, NULL},
    {"numbers are left out", 0, false, 2, 2, begin_gap, NULL},
    {"stopped", FAULT_DEADLINE_MISSED, false, 1, 2, stop_daemon_for_a_while, let_go_on},
    {"stopped and flooded", FAULT_SOURCE_OVERRUN, false, 1, 1, begin_flood, let_go_on},
    {"a port is taken", FAULT_SOURCE_FAILED, true, 4, 6, begin_taken, end_taken},
    {"clients misbehave", 0, false, 2, 6, begin_clients, end_clients},
    {"reloaded", 0, false, 2, 2, begin_reload, NULL},
};

#define EVENTS (sizeof(events) / sizeof(events[0]))

static void begin_event(struct soak *soak, nsec_t now_ns)
{
    const struct event *event = soak->event = &events[draw(soak, EVENTS)];
    soak->raised_before = atomic_load(&soak->watch.raised[event->code]);
    soak->cleared_before = atomic_load(&soak->watch.cleared[event->code]);
    atomic_store(&soak->watch.quiet, false);
    atomic_store(&soak->watch.expected, 0);
    atomic_store(&soak->watch.event, event->name);
    soak->source = SOAK_SOURCES;
    event->begin(soak);
    soak->event_end_ns = now_ns + (event->least_s + draw(soak, event->more_s)) * NSEC_PER_SEC;
    soak->look_ns = soak->event_end_ns + RATTLE_S * NSEC_PER_SEC;
    soak->verdict.events[event - events]++;
}

static void end_event(struct soak *soak)
{
    if (soak->event->end)
        soak->event->end(soak);
    atomic_store(&soak->watch.event, "");
}

/* Some time after an event: was its fault told, and is it over? On a loaded machine deadlines are
 * missed before and after. */
static void judge_event(struct soak *soak, nsec_t now_ns)
{
    const struct event *event = soak->event;
    unsigned code = event->code;
    bool told = atomic_load(&soak->watch.raised[code]) > soak->raised_before;
    bool over = atomic_load(&soak->watch.cleared[code]) > soak->cleared_before;
    unsigned now = atomic_load(&soak->watch.code);
    if (code && code != FAULT_DEADLINE_MISSED && (!told || (event->told && !over) || now == code)) {
        soak->verdict.faults_amiss++;
        fprintf(stderr, "soak: %.1f s: after \"%s\" fault %u is %s, %s; the worst is %u\n",
                seconds_from_ns(now_ns - soak->watch.start_ns), event->name, code,
                told ? "told" : "not told", over ? "over" : "not over", now);
    }
    soak->verdict.faults_told += code && told;
    soak->event = NULL;
    soak->next_event_ns = now_ns + (2 + draw(soak, 8)) * NSEC_PER_SEC;
    atomic_store(&soak->watch.quiet, true);
    atomic_store(&soak->watch.expected, 1);
}

static void step_events(struct soak *soak, nsec_t now_ns)
{
    if (!soak->event && now_ns >= soak->next_event_ns && now_ns < soak->end_ns - 60 * NSEC_PER_SEC)
        begin_event(soak, now_ns);
    else if (soak->event && soak->event_end_ns && now_ns >= soak->event_end_ns) {
        end_event(soak);
        soak->event_end_ns = 0;
    } else if (soak->event && !soak->event_end_ns && now_ns >= soak->look_ns)
        judge_event(soak, now_ns);
}

static void run(struct soak *soak)
{
    nsec_t next_ns = clock_monotonic_ns();
    soak->hosts.start_ns = next_ns;
    soak->next_event_ns = next_ns + SETTLE_S * NSEC_PER_SEC;
    while (next_ns < soak->end_ns) {
        clock_sleep_until(next_ns);
        nsec_t now_ns = clock_monotonic_ns();
        hosts_tick(&soak->hosts, soak->tick++, now_ns);
        step_events(soak, now_ns);
        next_ns += TICK_NS;
        if (now_ns - next_ns > NSEC_PER_SEC) /* held up: what was not sent is not sent at once */
            next_ns = now_ns;
        if (waitpid(soak->watch.pid, NULL, WNOHANG) != 0) {
            fprintf(stderr, "soak: the daemon has ended by itself: see %s\n", soak->log);
            exit(1);
        }
    }
}

/* Lets what is under way arrive, then ends all. */
static void finish(struct soak *soak)
{
    int status = -1;
    atomic_store(&soak->watch.expected, 0);
    atomic_store(&soak->watch.event, "the end");
    atomic_store(&soak->watch.quiet, false);
    usleep(4000000);
    watch_stop(&soak->watch);
    kill(soak->watch.pid, SIGTERM);
    waitpid(soak->watch.pid, &status, 0);
    watch_log(&soak->watch);
    soak->verdict.status = status;
    hosts_close(&soak->hosts);
}

static void choose_places(struct soak *soak, unsigned seed)
{
    unsigned base = PORT_BASE + 16 * (seed % 1000);
    soak->ports = (struct hosts_ports){base, base + 1, base + 2, base + 3, soak->bus};
    soak->modbus_port = base + 4;
    soak->taken_port = base + 5;
    snprintf(soak->modbus, sizeof(soak->modbus), "127.0.0.1:%u", soak->modbus_port);
    snprintf(soak->config, sizeof(soak->config), "%s/otwd.yaml", soak->directory);
    snprintf(soak->log, sizeof(soak->log), "%s/otwd.log", soak->directory);
    snprintf(soak->csv, sizeof(soak->csv), "%s/soak.csv", soak->directory);
    snprintf(soak->bus, sizeof(soak->bus), "sim:%s/bus", soak->directory);
    if (mkdir(soak->directory, 0755) < 0 && errno != EEXIST)
        fail(soak->directory);
    unlink(soak->bus + 4);
}

int main(int argc, char **argv)
{
    static struct soak soak = {.taken.fd = -1};
    if (argc != 5) {
        fputs("usage: soak OTWD SECONDS SEED DIRECTORY\n", stderr);
        return 64;
    }
    setvbuf(stdout, NULL, _IOLBF, 0);
    signal(SIGPIPE, SIG_IGN);
    soak.program = argv[1];
    soak.directory = argv[4];
    soak.random = strtoull(argv[3], NULL, 10);
    choose_places(&soak, (unsigned)soak.random);
    write_config(&soak, soak.config, soak.ports.dis);
    hosts_open(&soak.hosts, &soak.ports);
    soak.watch.log_path = soak.log;
    soak.watch.csv_path = soak.csv;
    soak.watch.modbus = soak.modbus;
    soak.watch.event = "";
    soak.watch.quiet = true;
    soak.watch.pid = start_daemon(&soak);
    wait_for_frames(&soak);
    hosts_join_bus(&soak.hosts, soak.bus);
    soak.watch.start_ns = clock_monotonic_ns();
    soak.end_ns = soak.watch.start_ns + strtoll(argv[2], NULL, 10) * NSEC_PER_SEC;
    watch_start(&soak.watch);
    run(&soak);
    finish(&soak);
    for (size_t i = 0; i < EVENTS; i++)
        printf("%4u times: %s\n", soak.verdict.events[i], events[i].name);
    return verdict_print(&soak.verdict, &soak.watch, &soak.hosts) ? 0 : 1;
}
