#include "io/modbus_client.h"
#include "io/modbus_server.h"
#include "tests/check.h"
#include "tests/modbus_fixture.h"

#include <errno.h>
#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

static void the_whole_map_is_read_in_one_go(void)
{
    struct modbus_server *server = open_plain();
    int fd = connect_client(server);
    uint8_t a[260];
    struct health health = {.state = HEALTH_RUNNING,
                            .frames_rendered = 0x00070009,
                            .pose_age_ns = -1,
                            .pose_valid = true,
                            .height_above_terrain_m = NAN};
    modbus_server_publish(server, &health);
    CHECK_INT(ASK(server, fd, a, 4, 0, 0, 0, 52), 2 + 104);
    CHECK_INT(a[1], 104);
    CHECK_INT(a[2] << 8 | a[3], 1);
    CHECK_INT(a[4] << 8 | a[5], 1);
    CHECK_INT(a[7], 7);
    CHECK_INT(a[9], 9);
    CHECK_INT(a[2 + 32] << 8 | a[2 + 33], 65535);
    CHECK_INT(a[2 + 90] << 8 | a[2 + 91], 1); /* this client */
    CHECK_INT(ASK(server, fd, a, 2, 0, 0, 0, 7), 3);
    CHECK_INT(a[2], 0x03);
    close(fd);
    modbus_server_close(server);
}

static void before_the_first_publication_the_map_reads_as_starting(void)
{
    struct modbus_server *server = open_plain();
    int fd = connect_client(server);
    uint8_t a[260];
    CHECK_INT(ASK(server, fd, a, 4, 0, 0, 0, 2), 6);
    CHECK_INT(a[3], 1);
    CHECK_INT(a[5], HEALTH_STARTING);
    close(fd);
    modbus_server_close(server);
}

static void each_wrong_request_has_the_exception_of_the_standard(void)
{
    struct modbus_server *server = open_plain();
    int fd = connect_client(server);
    CHECK_EXCEPTION(server, fd, 2, 4, 0, 52, 0, 1);      /* beyond the map */
    CHECK_EXCEPTION(server, fd, 2, 4, 0, 51, 0, 2);      /* running out of it */
    CHECK_EXCEPTION(server, fd, 2, 4, 0xff, 0xff, 0, 2); /* wrapping */
    CHECK_EXCEPTION(server, fd, 2, 2, 0, 7, 0, 1);
    CHECK_EXCEPTION(server, fd, 3, 4, 0, 0, 0, 0);        /* no quantity */
    CHECK_EXCEPTION(server, fd, 3, 4, 0, 0, 0, 126);      /* more than a PDU holds */
    CHECK_EXCEPTION(server, fd, 3, 2, 0, 0, 0x07, 0xd1);  /* 2001 bits */
    CHECK_EXCEPTION(server, fd, 3, 4, 0, 0, 0);           /* too short */
    CHECK_EXCEPTION(server, fd, 3, 4, 0, 0, 0, 1, 0);     /* too long */
    CHECK_EXCEPTION(server, fd, 1, 7, 0);                 /* read exception status */
    CHECK_EXCEPTION(server, fd, 1, 17, 0);                /* report server id */
    CHECK_EXCEPTION(server, fd, 1, 22, 0, 0, 0, 0, 0, 0); /* mask write */
    CHECK_EXCEPTION(server, fd, 1, 23, 0, 0, 0, 1, 0, 0, 0, 1, 2, 0, 0);
    CHECK_EXCEPTION(server, fd, 1, 99, 0);
    close(fd);
    modbus_server_close(server);
}

static void without_permission_there_is_nothing_to_control(void)
{
    struct modbus_server *server = open_plain();
    int fd = connect_client(server);
    CHECK_EXCEPTION(server, fd, 1, 1, 0, 0, 0, 1);
    CHECK_EXCEPTION(server, fd, 1, 3, 0, 0, 0, 1);
    CHECK_EXCEPTION(server, fd, 1, 5, 0, 0, 0xff, 0);
    CHECK_EXCEPTION(server, fd, 1, 6, 0, 0, 0, 1);
    CHECK_EXCEPTION(server, fd, 1, 15, 0, 0, 0, 1, 1, 1);
    CHECK_EXCEPTION(server, fd, 1, 16, 0, 0, 0, 1, 2, 0, 1);
    CHECK_INT(control_count, 0);
    close(fd);
    modbus_server_close(server);
}

static void check_control(unsigned index, enum modbus_control_kind kind, uint32_t value)
{
    CHECK(index < control_count);
    CHECK_INT(controls[index].kind, kind);
    CHECK_INT(controls[index].value, value);
}

static void with_permission_writes_reach_the_daemon_once(void)
{
    struct modbus_server *server =
        open_server((struct modbus_server_params){.unit = 1, .allow_control = true});
    int fd = connect_client(server);
    uint8_t a[260];
    struct health health = {.visibility_m = 40000, .utc_minutes = 720};
    modbus_server_publish(server, &health);
    CHECK_INT(ASK(server, fd, a, 3, 0, 0, 0, 2), 6);
    CHECK_INT(a[2] << 8 | a[3], 4000);
    CHECK_INT(a[4] << 8 | a[5], 720);
    CHECK_INT(ASK(server, fd, a, 5, 0, 0, 0xff, 0), 5);
    check_control(0, MODBUS_CONTROL_FREEZE, 1);
    CHECK_INT(ASK(server, fd, a, 15, 0, 0, 0, 3, 1, 0x06), 5);
    check_control(1, MODBUS_CONTROL_FREEZE, 0);
    check_control(2, MODBUS_CONTROL_SNAPSHOT, 1);
    check_control(3, MODBUS_CONTROL_RESET_COUNTERS, 1);
    CHECK_INT(ASK(server, fd, a, 1, 0, 0, 0, 3), 3);
    CHECK_INT(a[2], 0); /* push buttons spring back */
    CHECK_INT(ASK(server, fd, a, 6, 0, 0, 0x01, 0xf4), 5);
    check_control(4, MODBUS_CONTROL_VISIBILITY, 5000);
    CHECK_INT(ASK(server, fd, a, 16, 0, 0, 0, 2, 4, 0, 100, 0x05, 0x9f), 5);
    check_control(5, MODBUS_CONTROL_VISIBILITY, 1000);
    check_control(6, MODBUS_CONTROL_UTC_MINUTES, 1439);
    CHECK_INT(control_count, 7);
    close(fd);
    modbus_server_close(server);
}

static void impossible_writes_change_nothing(void)
{
    struct modbus_server *server =
        open_server((struct modbus_server_params){.unit = 1, .allow_control = true});
    int fd = connect_client(server);
    CHECK_EXCEPTION(server, fd, 3, 5, 0, 0, 0x12, 0x34); /* neither on nor off */
    CHECK_EXCEPTION(server, fd, 2, 5, 0, 3, 0xff, 0);    /* no such coil */
    CHECK_EXCEPTION(server, fd, 3, 6, 0, 0, 0, 0);       /* no visibility */
    CHECK_EXCEPTION(server, fd, 3, 6, 0, 1, 0x05, 0xa0); /* minute 1440 */
    CHECK_EXCEPTION(server, fd, 2, 6, 0, 2, 0, 1);       /* no such register */
    CHECK_EXCEPTION(server, fd, 3, 16, 0, 0, 0, 2, 4, 0, 9, 0x05, 0xa0);
    CHECK_EXCEPTION(server, fd, 2, 16, 0, 1, 0, 2, 4, 0, 9, 0, 9);
    CHECK_EXCEPTION(server, fd, 3, 16, 0, 0, 0, 2, 3, 0, 9, 0); /* bytes disagree */
    CHECK_EXCEPTION(server, fd, 3, 15, 0, 0, 0, 3, 2, 1, 1);
    CHECK_EXCEPTION(server, fd, 2, 15, 0, 0, 0, 4, 1, 1);
    CHECK_EXCEPTION(server, fd, 3, 16, 0, 0, 0, 0, 0);
    CHECK_INT(control_count, 0);
    close(fd);
    modbus_server_close(server);
}

static void the_device_identifies_itself(void)
{
    struct modbus_server *server = open_plain();
    int fd = connect_client(server);
    uint8_t a[260];
    static const uint8_t basic[] = {0x2b, 0x0e, 1,   0x82, 0,   0,   3, 0, 4,   'o', 't', 'w', 'd',
                                    1,    4,    'o', 't',  'w', 'd', 2, 5, '1', '.', '2', '.', '3'};
    CHECK_INT(ASK(server, fd, a, 0x2b, 0x0e, 1, 0), sizeof(basic));
    CHECK_INT(memcmp(a, basic, sizeof(basic)), 0);
    CHECK_INT(ASK(server, fd, a, 0x2b, 0x0e, 4, 6), 7 + 2 + 4);
    CHECK_INT(memcmp(a + 7, "\x06\x04left", 6), 0);
    CHECK(ASK(server, fd, a, 0x2b, 0x0e, 2, 0) > (int)sizeof(basic));
    CHECK_INT(a[6], 5);
    CHECK(ASK(server, fd, a, 0x2b, 0x0e, 1, 77) == (int)sizeof(basic)); /* starts over */
    CHECK_EXCEPTION(server, fd, 2, 0x2b, 0x0e, 4, 5);
    CHECK_EXCEPTION(server, fd, 2, 0x2b, 0x0e, 4, 0x80); /* there is no swap lock */
    modbus_server_publish(server, &(struct health){.swap = {3, 2}});
    CHECK_INT(ASK(server, fd, a, 0x2b, 0x0e, 4, 0x80),
              7 + 2 + sizeof("2 of 3 in step, 0 frames, 0 time-outs, 0 out of step, skew 0 us") -
                  1);
    CHECK_INT(ASK(server, fd, a, 0x2b, 0x0e, 1, 0), sizeof(basic)); /* it is not in the streams */
    CHECK_EXCEPTION(server, fd, 3, 0x2b, 0x0e, 5, 0);
    CHECK_EXCEPTION(server, fd, 3, 0x2b, 0x0e, 1);
    CHECK_EXCEPTION(server, fd, 1, 0x2b, 0x0d, 1, 0);
    close(fd);
    modbus_server_close(server);
}

static void only_its_own_unit_and_the_direct_ones_are_answered(void)
{
    struct modbus_server *server = open_server((struct modbus_server_params){.unit = 7});
    int fd = connect_client(server);
    static const uint8_t pdu[] = {4, 0, 0, 0, 1};
    uint8_t a[260];
    CHECK_INT(ask_unit(server, fd, 7, pdu, 5, a), 4);
    CHECK_INT(ask_unit(server, fd, 0, pdu, 5, a), 4);
    CHECK_INT(ask_unit(server, fd, 255, pdu, 5, a), 4);
    CHECK_INT(ask_unit(server, fd, 1, pdu, 5, a), 2);
    CHECK_INT(a[1], 0x0b);
    close(fd);
    modbus_server_close(server);
}

static void a_client_stuck_in_a_frame_delays_nobody(void)
{
    static const uint8_t whole[] = {0, 1, 0, 0, 0, 6, 1, 4, 0, 0, 0, 1};
    struct modbus_server *server = open_plain();
    int slow = connect_client(server), quick = connect_client(server);
    uint8_t a[260];
    for (size_t i = 0; i < sizeof(whole); i++) {
        put(slow, whole + i, 1);
        nsec_t start = clock_monotonic_ns();
        CHECK_INT(ASK(server, quick, a, 4, 0, 0, 0, 52), 106);
        CHECK_EXCEPTION(server, quick, 3, 4, 0, 0, 0, 126); /* libmodbus would sleep here */
        CHECK_NEAR(milliseconds_from_ns(clock_monotonic_ns() - start), 0, 100);
    }
    CHECK(serve_until_readable(server, slow, 1000));
    CHECK_INT(recv(slow, a, sizeof(a), 0), 11);
    close(slow);
    close(quick);
    modbus_server_close(server);
}

static void many_requests_in_one_packet_are_all_answered_in_order(void)
{
    struct modbus_server *server = open_plain();
    int fd = connect_client(server);
    uint8_t requests[50 * 12], a[260];
    for (unsigned i = 0; i < 50; i++) {
        const uint8_t one[] = {0, (uint8_t)i, 0, 0, 0, 6, 1, 4, 0, 0, 0, 1};
        memcpy(requests + 12 * i, one, 12);
    }
    put(fd, requests, sizeof(requests));
    for (unsigned i = 0; i < 50; i++) {
        CHECK(serve_until_readable(server, fd, 1000));
        CHECK_INT(recv(fd, a, 11, MSG_WAITALL), 11);
        CHECK_INT(a[1], i);
    }
    close(fd);
    modbus_server_close(server);
}

static void a_client_that_never_reads_is_held_back_and_the_others_served(void)
{
    static const uint8_t one[] = {0, 1, 0, 0, 0, 6, 1, 4, 0, 0, 0, 52};
    uint8_t hundred[100 * sizeof(one)];
    for (unsigned i = 0; i < 100; i++)
        memcpy(hundred + i * sizeof(one), one, sizeof(one));
    struct modbus_server *server = open_plain();
    int deaf = connect_client(server), other = connect_client(server);
    uint8_t a[260];
    ssize_t sent = sizeof(hundred);
    size_t total = 0, answered = 0, got;
    unsigned rounds = 0;
    for (; rounds < 100000 && sent == sizeof(hundred); rounds++) {
        sent = send(deaf, hundred, sizeof(hundred), MSG_DONTWAIT | MSG_NOSIGNAL);
        total += sent > 0 ? (size_t)sent : 0;
        struct pollfd fd = {modbus_server_fd(server), POLLIN, 0};
        while (poll(&fd, 1, 0) > 0)
            modbus_server_dispatch(server, clock_monotonic_ns());
    }
    CHECK(rounds > 1 && rounds < 100000); /* both directions are full: we keep no more for it */
    CHECK_INT(ASK(server, other, a, 4, 0, 0, 0, 1), 4);
    CHECK_INT(modbus_server_clients(server), 2);
    /* Once it reads, it gets the answer to every whole request, cut nowhere. */
    while (answered < total / sizeof(one) * 113 && serve_until_readable(server, deaf, 1000) &&
           (got = (size_t)recv(deaf, a, 113, MSG_WAITALL)) == 113) {
        CHECK(memcmp(a, "\0\1\0\0\0\x6b\1\4\x68", 9) == 0);
        answered += got;
    }
    CHECK_INT(answered, total / sizeof(one) * 113);
    close(deaf);
    close(other);
    modbus_server_close(server);
}

static bool is_closed(struct modbus_server *server, int fd)
{
    uint8_t byte;
    return serve_until_readable(server, fd, 1000) && recv(fd, &byte, 1, 0) <= 0;
}

static void a_stream_that_is_no_modbus_is_closed(void)
{
    static const uint8_t bad[][8] = {
        {0, 1, 0, 0, 0, 0, 1, 4},    /* no length */
        {0, 1, 0, 0, 0, 1, 1, 4},    /* no function */
        {0, 1, 0, 0, 0, 255, 1, 4},  /* longer than any request */
        {0, 1, 0, 0, 0xff, 6, 1, 4}, /* likewise */
        {0, 1, 0, 1, 0, 6, 1, 4},    /* another protocol */
        {'G', 'E', 'T', ' ', '/', ' ', 'H', 'T'},
    };
    struct modbus_server *server = open_plain();
    for (size_t i = 0; i < sizeof(bad) / sizeof(bad[0]); i++) {
        int fd = connect_client(server);
        put(fd, bad[i], sizeof(bad[i]));
        if (!is_closed(server, fd))
            CHECK_FAIL("stream %zu was not closed", i);
        close(fd);
    }
    CHECK_INT(modbus_server_clients(server), 0);
    modbus_server_close(server);
}

static void clients_beyond_the_limit_are_turned_away(void)
{
    struct modbus_server *server =
        open_server((struct modbus_server_params){.unit = 1, .max_clients = 2});
    uint8_t a[260];
    int first = connect_client(server), second = connect_client(server);
    CHECK_INT(ASK(server, first, a, 4, 0, 45, 0, 1), 4);
    int third = connect_client(server);
    CHECK(is_closed(server, third));
    CHECK_INT(ASK(server, second, a, 4, 0, 45, 0, 1), 4);
    CHECK_INT(a[3], 2);
    close(first);
    CHECK_INT(ASK(server, second, a, 4, 0, 45, 0, 1), 4);
    int fourth = connect_client(server);
    CHECK_INT(ASK(server, fourth, a, 4, 0, 45, 0, 1), 4);
    CHECK_INT(a[3], 2);
    close(second);
    close(third);
    close(fourth);
    modbus_server_close(server);
}

static void a_hung_client_gives_way_to_a_further_one(void)
{
    struct modbus_server *server =
        open_server((struct modbus_server_params){.unit = 1, .max_clients = 2});
    uint8_t a[260];
    int hung = connect_client(server), busy = connect_client(server);
    CHECK_INT(ASK(server, busy, a, 4, 0, 45, 0, 1), 4);
    int further = connect_client(server);
    CHECK_INT(modbus_server_dispatch(server, clock_monotonic_ns() + 3 * NSEC_PER_SEC), 0);
    CHECK_INT(evicted_count, 1);
    CHECK(is_closed(server, hung));
    CHECK_INT(ASK(server, further, a, 4, 0, 45, 0, 1), 4);
    CHECK_INT(ASK(server, busy, a, 4, 0, 45, 0, 1), 4);
    close(hung);
    close(busy);
    close(further);
    modbus_server_close(server);
}

/* 64 that are silent in the middle of a request, and more of them again and again, beside one that
 * asks every few seconds and one that comes late. */
static void slow_clients_keep_nobody_out_who_asks(void)
{
    enum { SLOW = 64, WAVES = 3 };
    int slow[WAVES][SLOW];
    uint8_t a[260];
    struct modbus_server *server = open_plain();
    int working = connect_client(server);
    nsec_t now_ns = clock_monotonic_ns();
    evicted_count = 0;
    CHECK_INT(ASK(server, working, a, 4, 0, 45, 0, 1), 4);
    for (int wave = 0; wave < WAVES; wave++) {
        for (int i = 0; i < SLOW; i++) {
            slow[wave][i] = connect_client(server);
            put(slow[wave][i], (const uint8_t[]){0, 1, 0}, 3);
            CHECK_INT(modbus_server_dispatch(server, now_ns), 0);
        }
        for (int i = 0; i < SLOW; i++)
            CHECK_INT(modbus_server_dispatch(server, now_ns), 0);
        CHECK_INT(modbus_server_clients(server), 64);
        now_ns += 5 * NSEC_PER_SEC;
    }
    CHECK_INT(evicted_count, (WAVES - 1) * (SLOW - 1)); /* the last of a wave finds none */
    int late = connect_client(server);
    CHECK_INT(modbus_server_dispatch(server, now_ns), 0);
    CHECK_INT(ASK(server, late, a, 4, 0, 45, 0, 1), 4);
    CHECK_INT(a[3], 64);
    CHECK_INT(ASK(server, working, a, 4, 0, 45, 0, 1), 4);
    for (int i = 0; i < WAVES * SLOW; i++)
        close(slow[i / SLOW][i % SLOW]);
    close(working);
    close(late);
    modbus_server_close(server);
}

static void idle_clients_are_closed_and_dripping_bytes_do_not_count(void)
{
    struct modbus_server *server =
        open_server((struct modbus_server_params){.unit = 1, .idle_timeout_ms = 300});
    int idle = connect_client(server), drip = connect_client(server);
    uint8_t a[260];
    put(drip, (const uint8_t[]){0}, 1);
    serve_until_readable(server, idle, 150);
    CHECK_INT(modbus_server_clients(server), 2);
    send(drip, "\0", 1, MSG_NOSIGNAL);
    int busy = connect_client(server);
    CHECK_INT(ASK(server, busy, a, 4, 0, 0, 0, 1), 4);
    CHECK(is_closed(server, idle));
    CHECK(is_closed(server, drip));
    close(idle);
    close(drip);
    close(busy);
    modbus_server_close(server);
}

static void descriptors_beyond_1023_are_served(void)
{
    struct rlimit limit;
    getrlimit(RLIMIT_NOFILE, &limit);
    limit.rlim_cur = limit.rlim_max < 2048 ? limit.rlim_max : 2048;
    setrlimit(RLIMIT_NOFILE, &limit);
    struct modbus_server *server = open_plain();
    int fds[1100], count = 0, fd = connect_client(server);
    while (count < 1100 && (fds[count] = dup(0)) >= 0 && fds[count] < 1100)
        count++;
    CHECK(count > 0 && fds[count - 1] >= 1024);
    uint8_t a[260];
    CHECK_INT(ASK(server, fd, a, 4, 0, 0, 0, 1), 4);
    while (count >= 0)
        close(fds[count--]);
    close(fd);
    modbus_server_close(server);
}

static void without_descriptors_it_rests_and_comes_back(void)
{
    if (getenv("OTWD_VALGRIND")) /* it keeps the limit itself: accepts, and then closes */
        return;
    struct rlimit limit;
    struct modbus_server *server = open_plain();
    int fd = connect_client(server), next = dup(0); /* the kernel has accepted it, we have not */
    uint8_t a[260];
    close(next);
    getrlimit(RLIMIT_NOFILE, &limit);
    const struct rlimit tight = {.rlim_cur = (rlim_t)next, .rlim_max = limit.rlim_max};
    CHECK_INT(setrlimit(RLIMIT_NOFILE, &tight), 0);
    CHECK_INT(modbus_server_dispatch(server, clock_monotonic_ns()), 0);
    CHECK_INT(modbus_server_clients(server), 0);
    CHECK_INT(poll(&(struct pollfd){modbus_server_fd(server), POLLIN, 0}, 1, 0), 0);
    CHECK_INT(setrlimit(RLIMIT_NOFILE, &limit), 0);
    CHECK_INT(ASK(server, fd, a, 4, 0, 0, 0, 1), 4);
    close(fd);
    modbus_server_close(server);
}

static void a_connection_that_is_reset_is_given_up(void)
{
    const struct linger at_once = {.l_onoff = 1};
    struct modbus_server *server = open_plain();
    int fd = connect_client(server), other = connect_client(server);
    uint8_t a[260];
    CHECK_INT(ASK(server, fd, a, 4, 0, 45, 0, 1), 4);
    CHECK_INT(ASK(server, other, a, 4, 0, 45, 0, 1), 4);
    CHECK_INT(a[3], 2);
    CHECK_INT(setsockopt(fd, SOL_SOCKET, SO_LINGER, &at_once, sizeof(at_once)), 0);
    close(fd);
    CHECK_INT(modbus_server_dispatch(server, clock_monotonic_ns()), 0);
    CHECK_INT(ASK(server, other, a, 4, 0, 45, 0, 1), 4);
    CHECK_INT(a[3], 1);
    close(other);
    modbus_server_close(server);
}

static void an_address_in_use_is_named(void)
{
    struct modbus_server *server = open_plain(), *second = NULL;
    union address address;
    char text[ADDRESS_TEXT_MAX];
    struct diag diag;
    modbus_server_address(server, &address);
    address_format(&address, text);
    struct modbus_server_params params = {.listen = text};
    CHECK_INT(modbus_server_open(&params, &second, &diag), -EADDRINUSE);
    CHECK_CONTAINS(diag.text, text);
    CHECK_CONTAINS(diag.text, "Address already in use");
    params.listen = "nonsense";
    CHECK_INT(modbus_server_open(&params, &second, &diag), -EINVAL);
    modbus_server_close(server);
    modbus_server_close(NULL);
}

struct background {
    struct modbus_server *server;
    pthread_t thread;
    atomic_bool stop;
};

static void *serve(void *argument)
{
    struct background *background = argument;
    while (!atomic_load(&background->stop)) {
        struct pollfd fd = {modbus_server_fd(background->server), POLLIN, 0};
        poll(&fd, 1, 20);
        modbus_server_dispatch(background->server, clock_monotonic_ns());
    }
    return NULL;
}

static void start_background(struct background *background, struct modbus_server *server)
{
    background->server = server;
    atomic_init(&background->stop, false);
    pthread_create(&background->thread, NULL, serve, background);
}

static void stop_background(struct background *background)
{
    atomic_store(&background->stop, true);
    pthread_join(background->thread, NULL);
}

static void our_client_reads_what_our_server_publishes(void)
{
    struct modbus_server *server = open_plain();
    union address address;
    char text[ADDRESS_TEXT_MAX];
    struct background background;
    struct health read;
    struct diag diag;
    struct health health = {.state = HEALTH_DEGRADED,
                            .frames_rendered = 123456,
                            .position = {64.13, -21.94, 1000},
                            .fault_code = 201,
                            .swap = {3, 2, UINT64_C(5000000000), 1, 22, 5193 * NSEC_PER_USEC}};
    modbus_server_publish(server, &health);
    modbus_server_address(server, &address);
    address_format(&address, text);
    start_background(&background, server);
    CHECK_INT(modbus_client_read(text, 1, 2000, &read, &diag), 0);
    stop_background(&background);
    CHECK_INT(memcmp(&read.swap, &health.swap, sizeof(read.swap)), 0);
    CHECK_INT(read.state, HEALTH_DEGRADED);
    CHECK_INT(read.frames_rendered, 123456);
    CHECK_NEAR(read.position.lon_deg, -21.94, 1e-7);
    CHECK_INT(read.fault_code, 201);
    CHECK_INT(read.modbus_clients, 1);
    CHECK(read.any_fault);
    modbus_server_close(server);
    CHECK_INT(modbus_client_read(text, 1, 500, &read, &diag), -ECONNREFUSED);
    CHECK_CONTAINS(diag.text, text);
    CHECK_INT(modbus_client_read("nowhere", 1, 500, &read, &diag), -EINVAL);
}

static void mbpoll_reads_the_map(void)
{
    if (system("command -v mbpoll >/dev/null 2>&1") != 0) {
        printf("skip mbpoll is not installed\n");
        return;
    }
    struct modbus_server *server = open_plain();
    union address address;
    struct background background;
    char command[256], line[256], all[4096] = "";
    struct health health = {.state = HEALTH_RUNNING, .frames_rendered = 0x0001e240};
    modbus_server_publish(server, &health);
    modbus_server_address(server, &address);
    start_background(&background, server);
    snprintf(command, sizeof(command),
             "mbpoll -m tcp -p %u -a 1 -0 -t 3:int -B -r 2 -c 1 -1 127.0.0.1 2>&1",
             address_port(&address));
    FILE *out = popen(command, "r");
    while (out && fgets(line, sizeof(line), out))
        strncat(all, line, sizeof(all) - strlen(all) - 1);
    CHECK(out && pclose(out) == 0);
    stop_background(&background);
    CHECK_CONTAINS(all, "[2]: \t123456");
    modbus_server_close(server);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"the whole map is read in one go", the_whole_map_is_read_in_one_go},
        {"before the first publication the map reads as starting",
         before_the_first_publication_the_map_reads_as_starting},
        {"each wrong request has the exception of the standard",
         each_wrong_request_has_the_exception_of_the_standard},
        {"without permission there is nothing to control",
         without_permission_there_is_nothing_to_control},
        {"with permission writes reach the daemon once",
         with_permission_writes_reach_the_daemon_once},
        {"impossible writes change nothing", impossible_writes_change_nothing},
        {"the device identifies itself", the_device_identifies_itself},
        {"only its own unit and the direct ones are answered",
         only_its_own_unit_and_the_direct_ones_are_answered},
        {"a client stuck in a frame delays nobody", a_client_stuck_in_a_frame_delays_nobody},
        {"many requests in one packet are all answered in order",
         many_requests_in_one_packet_are_all_answered_in_order},
        {"a client that never reads is held back and the others served",
         a_client_that_never_reads_is_held_back_and_the_others_served},
        {"a stream that is no Modbus is closed", a_stream_that_is_no_modbus_is_closed},
        {"clients beyond the limit are turned away", clients_beyond_the_limit_are_turned_away},
        {"a hung client gives way to a further one", a_hung_client_gives_way_to_a_further_one},
        {"slow clients keep nobody out who asks", slow_clients_keep_nobody_out_who_asks},
        {"idle clients are closed and dripping bytes do not count",
         idle_clients_are_closed_and_dripping_bytes_do_not_count},
        {"descriptors beyond 1023 are served", descriptors_beyond_1023_are_served},
        {"without descriptors it rests and comes back",
         without_descriptors_it_rests_and_comes_back},
        {"a connection that is reset is given up", a_connection_that_is_reset_is_given_up},
        {"an address in use is named", an_address_in_use_is_named},
        {"our client reads what our server publishes", our_client_reads_what_our_server_publishes},
        {"mbpoll reads the map", mbpoll_reads_the_map},
    };
    return CHECK_MAIN(tests);
}
