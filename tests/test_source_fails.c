/* Sources whose descriptors fail, as they do without memory: that is told, and they come back. */
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <sys/resource.h>
#include <unistd.h>

#include "io/native.h"
#include "io/source.h"
#include "io/udp.h"
#include "tests/check.h"

static unsigned poses;

static void count_pose(void *context, struct pose_source *source, const struct pose *pose)
{
    poses++;
}

static const struct pose_source_events events = {.pose = count_pose};

static double no_undulation_m(void *context, double lat_deg, double lon_deg)
{
    return 0.0;
}

static struct pose_source *open_source(enum pose_protocol protocol)
{
    struct pose_source *source = NULL;
    struct pose_source_params params = {
        .name = "host",
        .endpoint = "127.0.0.1:0",
        .intake = {.protocol = protocol, .geoid = {.undulation_m = no_undulation_m}}};
    CHECK_INT(pose_source_open(&params, &source, NULL), 0);
    if (!source)
        exit(1);
    return source;
}

/* Waits up to two seconds for something, then takes all that is there. */
static void dispatch(struct pose_source *source)
{
    struct pollfd wait = {.fd = pose_source_fd(source), .events = POLLIN};
    for (int timeout_ms = 2000; poll(&wait, 1, timeout_ms) > 0; timeout_ms = 0)
        CHECK_INT(pose_source_dispatch(source, clock_monotonic_ns(), &events), 0);
}

static struct udp connected_to(const struct pose_source *source)
{
    struct udp udp;
    char peer[32];
    snprintf(peer, sizeof(peer), "127.0.0.1:%u", pose_source_port(source));
    CHECK_INT(udp_connect(&udp, peer, NULL), 0);
    return udp;
}

static void send_native(struct udp *udp, uint32_t sequence)
{
    uint8_t data[NATIVE_SIZE];
    struct pose_sample sample = {.datum = ALTITUDE_ELLIPSOID,
                                 .session = 1,
                                 .sequence = sequence,
                                 .pose = {.valid = POSE_POSITION, .position = {10, 20, 100}}};
    native_encode(&sample, data);
    CHECK_INT(udp_send(udp, data, sizeof(data)), 0);
}

/* The descriptor behind a source that the kernel calls by this name, or -1. */
static int part_of(const struct pose_source *source, const char *name)
{
    char path[64], line[128], target[128];
    int fd, found = -1;
    snprintf(path, sizeof(path), "/proc/self/fdinfo/%d", pose_source_fd(source));
    FILE *in = fopen(path, "r");
    while (in && fgets(line, sizeof(line), in)) {
        if (sscanf(line, "tfd: %d", &fd) != 1)
            continue;
        snprintf(path, sizeof(path), "/proc/self/fd/%d", fd);
        ssize_t length = readlink(path, target, sizeof(target) - 1);
        target[length > 0 ? length : 0] = 0;
        if (strstr(target, name))
            found = fd;
    }
    if (in)
        fclose(in);
    return found;
}

/* What is neither a socket nor can be read. */
static void break_part(int fd)
{
    int folder = open("/", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    CHECK(fd >= 0 && dup2(folder, fd) == fd);
    close(folder);
}

static void a_socket_that_cannot_be_read_is_opened_anew(void)
{
    struct pose_source *source = open_source(POSE_PROTOCOL_NATIVE);
    struct udp udp = connected_to(source);
    unsigned port = pose_source_port(source);
    send_native(&udp, 1);
    dispatch(source);
    break_part(part_of(source, "socket"));
    CHECK_INT(pose_source_dispatch(source, clock_monotonic_ns(), &events), -ENOTSOCK);
    CHECK_INT(pose_source_reopen(source, NULL), 0);
    CHECK_INT(pose_source_port(source), port);
    send_native(&udp, 2);
    send_native(&udp, 1);
    dispatch(source);
    CHECK_INT(poses, 2);
    CHECK_INT(pose_source_counters(source)->accepted, 2);
    CHECK_INT(pose_source_counters(source)->rejected[REJECT_LATE], 1); /* it knows what it had */

    /* Its port is taken meanwhile. */
    char listen[32];
    struct udp thief;
    struct diag diag;
    snprintf(listen, sizeof(listen), "127.0.0.1:%u", port);
    break_part(part_of(source, "socket"));
    CHECK_INT(udp_listen(&thief, listen, NULL), 0);
    CHECK_INT(pose_source_reopen(source, &diag), -EADDRINUSE);
    CHECK_CONTAINS(diag.text, "source host: ");
    CHECK_CONTAINS(diag.text, listen);
    udp_close(&thief);
    CHECK_INT(pose_source_reopen(source, &diag), 0);
    send_native(&udp, 3);
    dispatch(source);
    CHECK_INT(poses, 3);
    udp_close(&udp);
    pose_source_close(source);
}

static void a_timer_that_cannot_be_read_is_told(void)
{
    struct pose_source *source = open_source(POSE_PROTOCOL_DIS);
    CHECK_INT(pose_source_dispatch(source, clock_monotonic_ns(), &events), 0);
    break_part(part_of(source, "timerfd"));
    CHECK_INT(pose_source_dispatch(source, clock_monotonic_ns(), &events), -EISDIR);
    pose_source_close(source);
}

/* Who waits to join would keep it readable for ever. */
static void a_hub_that_cannot_take_a_member_goes_down_and_comes_back(void)
{
    struct can_bus *hub = NULL, *member = NULL;
    struct can_frame frame;
    nsec_t at_ns;
    struct rlimit limit, none;
    char folder[] = "/tmp/otwd-bus-XXXXXX", url[64];
    CHECK(mkdtemp(folder) != NULL);
    snprintf(url, sizeof(url), "sim:%s/bus", folder);
    CHECK_INT(can_bus_create(url, &(struct can_bus_params){.serve = true}, &hub, NULL), 0);
    CHECK_INT(can_bus_create(url, &(struct can_bus_params){0}, &member, NULL), 0);
    CHECK_INT(getrlimit(RLIMIT_NOFILE, &limit), 0);
    none = limit;
    none.rlim_cur = 0;
    CHECK_INT(setrlimit(RLIMIT_NOFILE, &none), 0);
    CHECK_INT(can_bus_receive(hub, &frame, &at_ns, NULL), -EMFILE);
    CHECK_INT(can_bus_receive(hub, &frame, &at_ns, NULL), 0);
    CHECK_INT(hub->state, CAN_STATE_NONE);
    CHECK_INT(setrlimit(RLIMIT_NOFILE, &limit), 0);
    nsec_t later_ns = clock_monotonic_ns() + 10 * NSEC_PER_SEC;
    CHECK_INT(can_bus_service(hub, later_ns), 1);
    CHECK_INT(can_bus_receive(member, &frame, &at_ns, NULL), -ENETDOWN);
    CHECK_INT(can_bus_service(member, later_ns), 1);
    CHECK_INT(can_bus_receive(hub, &frame, &at_ns, NULL), 0);
    can_bus_destroy(member);
    can_bus_destroy(hub);
    CHECK_INT(rmdir(folder), 0);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"a socket that cannot be read is opened anew",
         a_socket_that_cannot_be_read_is_opened_anew},
        {"a timer that cannot be read is told", a_timer_that_cannot_be_read_is_told},
        {"a hub that cannot take a member goes down and comes back",
         a_hub_that_cannot_take_a_member_goes_down_and_comes_back},
    };
    return CHECK_MAIN(tests);
}
