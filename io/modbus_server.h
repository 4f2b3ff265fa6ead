/* The health of the daemon over Modbus/TCP, for an event loop.
 *
 * Sockets and framing are ours, requests are answered by libmodbus. The library's own server
 * blocks for half a second on a client that sends half a request, sleeps as long on a malformed
 * one, leaves some function codes unanswered and cannot take descriptors of 1024 and more. Here
 * nothing blocks: whatever a client does delays that client alone.
 *
 * The answers follow "MODBUS Application Protocol Specification V1.1b3" and "MODBUS Messaging on
 * TCP/IP Implementation Guide V1.0b". The map is docs/modbus.md. One thread. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#include "base/clock.h"
#include "base/diag.h"
#include "io/address.h"
#include "io/health.h"

enum modbus_control_kind {
    MODBUS_CONTROL_FREEZE,         /* value 0 or 1 */
    MODBUS_CONTROL_SNAPSHOT,       /* value 1 */
    MODBUS_CONTROL_RESET_COUNTERS, /* value 1 */
    MODBUS_CONTROL_VISIBILITY,     /* value in metres, 10..655350 */
    MODBUS_CONTROL_UTC_MINUTES,    /* value in minutes of the day, 0..1439 */
};

struct modbus_control {
    enum modbus_control_kind kind;
    uint32_t value;
};

struct modbus_server_params {
    const char *listen;   /* "ADDRESS:PORT"; port 0: the kernel chooses */
    int listen_fd;        /* a listening socket instead of `listen`, duplicated; 0: none */
    unsigned unit;        /* answered besides 0 and 255; 0: 1 */
    bool allow_control;   /* else functions 1, 3, 5, 6, 15 and 16 do not exist */
    unsigned max_clients; /* 0: 64, and at most. A further one takes the place of whoever has been
                             silent for longest: of those that never asked, for 250 ms; where
                             all have, for two seconds; else it is closed at once */
    unsigned idle_timeout_ms; /* without a whole request; 0: 60 000 */
    const char *version;      /* for function 43; NULL: "" */
    const char *channel;      /* for function 43; NULL: "" */
    /* Both are called from modbus_server_dispatch(). For each thing written; NULL where
     * allow_control is false. */
    void (*control)(void *context, const struct modbus_control *control);
    /* A client that asked nothing for `idle_ns` had to give way to a further one. May be NULL. */
    void (*evicted)(void *context, const union address *client, nsec_t idle_ns);
    void *context;
};

struct modbus_server;

/* Opens the listening socket. What `params` points to is copied. Returns 0, -EINVAL for an address
 * that is none, else -errno (-EADDRINUSE, -EACCES, -ENOMEM); `diag` names the address. */
int modbus_server_open(const struct modbus_server_params *params, struct modbus_server **ret_server,
                       struct diag *diag);

/* Legal on NULL. */
void modbus_server_close(struct modbus_server *server);

/* A descriptor that is readable while there is something to dispatch. */
int modbus_server_fd(const struct modbus_server *server);

/* Serves whatever is ready and closes the idle; never blocks. Returns 0 or -errno where the server
 * itself is broken. */
int modbus_server_dispatch(struct modbus_server *server, nsec_t now_ns);

/* All registers at once: a later read sees this snapshot whole. */
void modbus_server_publish(struct modbus_server *server, const struct health *health);

unsigned modbus_server_clients(const struct modbus_server *server);

/* The address listened at, with the port that the kernel chose. */
void modbus_server_address(const struct modbus_server *server, union address *ret_address);
