/* A UDP socket that poses arrive at, or leave from. Non-blocking; one thread at a time. */
#pragma once

#include "base/clock.h"
#include "io/address.h"

struct udp {
    int fd;                /* -1 where closed; readable when a datagram waits */
    union address local;   /* with the port that the kernel chose, where 0 was asked for */
    uint64_t kernel_drops; /* datagrams lost because nobody read in time */
    unsigned drops_seen;
};

struct datagram {
    size_t size;       /* bytes in the buffer */
    bool truncated;    /* the datagram was longer than the buffer */
    nsec_t receive_ns; /* monotonic, from the kernel's stamp */
    union address sender;
};

/* Binds "ADDRESS:PORT". Returns 0, or -EINVAL, -EADDRINUSE, -EACCES and others with a sentence that
 * names address and port; `udp` is then closed. */
int udp_listen(struct udp *udp, const char *listen, struct diag *diag);

/* The same for a multicast group of IPv4, joined at the interface that has the address `interface`,
 * through which it also sends (udp_send_to() the group), no farther than the next router.
 * udp_listen() joins such a group, too, where the routes lead. Others on the machine may join it.
 */
int udp_listen_group(struct udp *udp, const char *group, const char *interface, struct diag *diag);

/* A socket that sends to "ADDRESS:PORT". */
int udp_connect(struct udp *udp, const char *peer, struct diag *diag);

/* Legal on a closed one. */
void udp_close(struct udp *udp);

/* Takes one datagram. Returns 1, 0 where none waits, or -errno. What a connected socket hears of an
 * unreachable peer is passed over. */
int udp_receive(struct udp *udp, void *buffer, size_t capacity, struct datagram *ret_datagram);

/* Sends one datagram to the connected peer. Returns 0 or -errno; -ECONNREFUSED means that a former
 * one found nobody listening. */
int udp_send(struct udp *udp, const void *data, size_t size);
/* The same to any peer, from a socket that listens. */
int udp_send_to(struct udp *udp, const union address *peer, const void *data, size_t size);
