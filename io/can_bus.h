/* A CAN bus: a real one ("can:can0", SocketCAN) or a simulated one ("sim:/run/otwd/bus") that
 * carries the same struct can_frame over a Unix seqpacket socket, for machines whose kernel has no
 * CAN. Non-blocking; one thread at a time.
 *
 * A bus that is down (no such interface, interface down, hub gone) stays open and comes back by
 * itself: can_bus_service() tries again with a growing pause. */
#pragma once

#include <linux/can.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/clock.h"
#include "base/diag.h"

/* The values of Modbus input register 23. */
enum can_state {
    CAN_STATE_NONE,
    CAN_STATE_ACTIVE,
    CAN_STATE_WARNING,
    CAN_STATE_PASSIVE,
    CAN_STATE_BUS_OFF,
};

#define CAN_BUS_IDS_MAX 80

struct can_bus_params {
    const uint32_t *ids; /* receive only these, of 29 bits with CAN_EFF_FLAG; copied; NULL = all */
    size_t id_count;     /* at most CAN_BUS_IDS_MAX */
    bool serve;          /* sim: become the hub where there is none; else only join one */
};

struct can_bus;

struct can_bus_ops {
    /* 0, or -errno with a sentence; leaves bus->fd to wait on. */
    int (*connect)(struct can_bus *bus, struct diag *diag);
    /* 1 with a frame, 0 where none waits, -errno: the bus is down. */
    int (*receive)(struct can_bus *bus, struct can_frame *ret_frame, nsec_t *ret_receive_ns);
    /* 0, -EAGAIN where the queue is full, other -errno: the bus is down. */
    int (*send)(struct can_bus *bus, const struct can_frame *frame);
    void (*disconnect)(struct can_bus *bus); /* legal when not connected */
    void (*destroy)(struct can_bus *bus);
};

/* Embedded first in each implementation; read only for users. */
struct can_bus {
    const struct can_bus_ops *ops;
    int fd;              /* readable when a frame may wait; changes when the bus comes back; -1 */
    unsigned generation; /* counts the changes of fd */
    char name[108];      /* interface or path */
    bool serve;
    uint32_t ids[CAN_BUS_IDS_MAX];
    size_t id_count;
    enum can_state state;
    uint64_t frames_received, error_frames;
    uint64_t frames_dropped; /* by our queue in the kernel, or by the controller */
    nsec_t retry_at_ns, retry_pause_ns;
};

#define CAN_BUS_DOWN 1

/* Returns 0; CAN_BUS_DOWN: the bus exists but is down, the sentence says why, and it will be tried
 * again; or -EINVAL, -ENOMEM. can_bus_destroy() frees it. */
int can_bus_create(const char *url, const struct can_bus_params *params, struct can_bus **ret_bus,
                   struct diag *diag);

/* Legal on NULL. */
void can_bus_destroy(struct can_bus *bus);

/* 1 with a frame, 0 where none waits; CAN_BUS_DOWN is never returned: -errno when the bus has just
 * gone down, with a sentence. Error frames are taken in here and only change `state`. */
int can_bus_receive(struct can_bus *bus, struct can_frame *ret_frame, nsec_t *ret_receive_ns,
                    struct diag *diag);

/* 0, -EAGAIN where the queue is full, -ENETDOWN where the bus is down, other -errno. */
int can_bus_send(struct can_bus *bus, const struct can_frame *frame);

/* Tries a bus that is down again where its pause is over. Returns 1 where it has just come up. */
int can_bus_service(struct can_bus *bus, nsec_t now_ns);

/* The two implementations' constructors. */
int can_socket_create(struct can_bus **ret_bus);
int can_sim_create(struct can_bus **ret_bus);
