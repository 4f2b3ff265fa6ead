/* A Modbus server and a client in one thread, for the tests of the server. */
#pragma once

#include <errno.h>
#include <poll.h>
#include <sys/socket.h>

#include "io/modbus_server.h"
#include "tests/check.h"

static struct modbus_control controls[16];
static unsigned control_count;

static void note_control(void *context, const struct modbus_control *control)
{
    CHECK(context == controls);
    if (control_count < 16)
        controls[control_count++] = *control;
}

static unsigned evicted_count;

static void note_evicted(void *context, const union address *client, nsec_t idle_ns)
{
    CHECK(context == controls && address_port(client) != 0 && idle_ns >= NSEC_PER_SEC / 4);
    evicted_count++;
}

static struct modbus_server *open_server(struct modbus_server_params params)
{
    struct modbus_server *server = NULL;
    struct diag diag = {0};
    params.listen = "127.0.0.1:0";
    params.version = "1.2.3";
    params.channel = "left";
    params.control = note_control;
    params.evicted = note_evicted;
    params.context = controls;
    control_count = 0;
    if (modbus_server_open(&params, &server, &diag) < 0) {
        fprintf(stderr, "%s\n", diag.text);
        exit(1);
    }
    return server;
}

static struct modbus_server *open_plain(void)
{
    return open_server((struct modbus_server_params){.unit = 1});
}

static int connect_client(struct modbus_server *server)
{
    union address address;
    modbus_server_address(server, &address);
    int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd < 0 || connect(fd, &address.any, address_length(&address)) < 0)
        CHECK_FAIL("cannot connect: %s", strerror(errno));
    return fd;
}

/* Lets the server work until `fd` is readable or `timeout_ms` have passed. */
static bool serve_until_readable(struct modbus_server *server, int fd, int timeout_ms)
{
    nsec_t end = clock_monotonic_ns() + timeout_ms * NSEC_PER_MSEC;
    for (;;) {
        nsec_t now = clock_monotonic_ns();
        struct pollfd fds[2] = {{modbus_server_fd(server), POLLIN, 0}, {fd, POLLIN, 0}};
        if (now >= end)
            return false;
        poll(fds, 2, (int)((end - now) / NSEC_PER_MSEC) + 1);
        if (fds[1].revents)
            return true;
        CHECK_INT(modbus_server_dispatch(server, clock_monotonic_ns()), 0);
    }
}

static void put(int fd, const uint8_t *bytes, size_t size)
{
    CHECK_INT(send(fd, bytes, size, MSG_NOSIGNAL), (ssize_t)size);
}

/* Sends the PDU as transaction 0x1234 and returns the answer's PDU size; the header is checked. */
static int ask_unit(struct modbus_server *server, int fd, uint8_t unit, const uint8_t *pdu,
                    size_t size, uint8_t answer[260])
{
    uint8_t adu[260] = {0x12, 0x34, 0, 0, (uint8_t)((size + 1) >> 8), (uint8_t)(size + 1), unit};
    memcpy(adu + 7, pdu, size);
    put(fd, adu, size + 7);
    if (!serve_until_readable(server, fd, 2000)) {
        CHECK_FAIL("no answer to function %u", pdu[0]);
        return -1;
    }
    ssize_t got = recv(fd, adu, sizeof(adu), 0);
    if (got < 8)
        return (int)got - 7;
    CHECK_INT(adu[0] << 8 | adu[1], 0x1234);
    CHECK_INT(adu[2] << 8 | adu[3], 0);
    CHECK_INT(adu[4] << 8 | adu[5], got - 6);
    CHECK_INT(adu[6], unit);
    memcpy(answer, adu + 7, (size_t)got - 7);
    return (int)got - 7;
}

#define ASK(server, fd, answer, ...)                                                               \
    ask_unit(server, fd, 1, (const uint8_t[]){__VA_ARGS__},                                        \
             sizeof((const uint8_t[]){__VA_ARGS__}), answer)

#define CHECK_EXCEPTION(server, fd, exception, function, ...)                                      \
    do {                                                                                           \
        uint8_t check_x[260] = {0};                                                                \
        CHECK_INT(ASK(server, fd, check_x, function, __VA_ARGS__), 2);                             \
        CHECK_INT(check_x[0], (function) | 0x80);                                                  \
        CHECK_INT(check_x[1], exception);                                                          \
    } while (0)
