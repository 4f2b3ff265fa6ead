/* The simulated bus. Whoever serves listens at the path and is the hub; others join. A frame that
 * one sends reaches the hub and all others, as on a wire; a member that does not read loses frames,
 * the others do not wait for it. The file of a hub that died is taken over. */
#include "io/can_bus.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#define MEMBERS_MAX 16

struct can_sim {
    struct can_bus bus; /* bus.fd: the member's socket, or the hub's epoll */
    int listener;       /* -1 where not the hub */
    int members[MEMBERS_MAX];
    unsigned next; /* whose turn it is to be read */
};

static int new_socket(void)
{
    return socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
}

static int watch(struct can_sim *self, int fd)
{
    struct epoll_event event = {.events = EPOLLIN, .data.fd = fd};
    return epoll_ctl(self->bus.fd, EPOLL_CTL_ADD, fd, &event) < 0 ? -errno : 0;
}

static int become_hub(struct can_sim *self, const struct sockaddr_un *address, struct diag *diag)
{
    self->listener = new_socket();
    self->bus.fd = epoll_create1(EPOLL_CLOEXEC);
    bool ok = self->listener >= 0 && self->bus.fd >= 0;
    bool bound =
        ok && bind(self->listener, (const struct sockaddr *)address, sizeof(*address)) == 0;
    if (bound && listen(self->listener, MEMBERS_MAX) == 0 && watch(self, self->listener) == 0)
        return 0;
    int error = errno;
    if (!bound && self->listener >= 0) { /* the path is not ours to remove */
        close(self->listener);
        self->listener = -1;
    }
    return diag_set(diag, -error, "sim:%s: cannot serve the bus there: %s", self->bus.name,
                    strerror(error));
}

static int sim_connect(struct can_bus *bus, struct diag *diag)
{
    struct can_sim *self = (struct can_sim *)bus;
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    _Static_assert(sizeof(address.sun_path) >= sizeof(bus->name), "a name is a path");
    memcpy(address.sun_path, bus->name, sizeof(bus->name));
    bus->fd = new_socket();
    if (bus->fd < 0)
        return diag_set(diag, -errno, "sim:%s: %s", bus->name, strerror(errno));
    if (connect(bus->fd, (struct sockaddr *)&address, sizeof(address)) == 0)
        return 0;
    int error = errno;
    close(bus->fd);
    bus->fd = -1;
    if (!bus->serve || (error != ENOENT && error != ECONNREFUSED))
        return diag_set(diag, -error, "sim:%s: nobody serves a bus there: %s", bus->name,
                        strerror(error));
    if (error == ECONNREFUSED)
        unlink(bus->name);
    return become_hub(self, &address, diag);
}

static void drop_member(struct can_sim *self, unsigned i)
{
    close(self->members[i]);
    self->members[i] = -1;
}

/* 0, or -errno where one that waits to join cannot be taken: he goes on waiting, and the bus would
 * be readable for ever. */
static int accept_members(struct can_sim *self)
{
    int fd;
    while ((fd = accept4(self->listener, NULL, NULL, SOCK_CLOEXEC | SOCK_NONBLOCK)) >= 0) {
        unsigned i = 0;
        while (i < MEMBERS_MAX && self->members[i] >= 0)
            i++;
        if (i == MEMBERS_MAX || watch(self, fd) < 0)
            close(fd);
        else
            self->members[i] = fd;
    }
    return errno == EAGAIN || errno == EINTR || errno == ECONNABORTED ? 0 : -errno;
}

static bool wanted(const struct can_bus *bus, const struct can_frame *frame)
{
    if (bus->id_count == 0)
        return true;
    for (size_t i = 0; i < bus->id_count; i++)
        if (frame->can_id == bus->ids[i])
            return true;
    return false;
}

/* To every member but `from`. One that cannot take it has lost it. */
static void forward(struct can_sim *self, const struct can_frame *frame, unsigned from)
{
    for (unsigned i = 0; i < MEMBERS_MAX; i++)
        if (i != from && self->members[i] >= 0)
            send(self->members[i], frame, sizeof(*frame), MSG_DONTWAIT | MSG_NOSIGNAL);
}

/* 1 with a frame, 0 where none waits, -EPIPE where the peer is gone, -EMSGSIZE: no frame. */
static int read_frame(int fd, struct can_frame *ret_frame)
{
    struct can_frame frame;
    ssize_t n;
    do
        n = recv(fd, &frame, sizeof(frame), MSG_DONTWAIT | MSG_TRUNC);
    while (n < 0 && errno == EINTR);
    if (n < 0)
        return errno == EAGAIN || errno == EWOULDBLOCK ? 0 : -errno;
    if (n == 0)
        return -EPIPE;
    if (n != sizeof(frame) || frame.can_dlc > CAN_MAX_DLEN)
        return -EMSGSIZE;
    *ret_frame = frame;
    return 1;
}

static int hub_receive(struct can_sim *self, struct can_frame *ret_frame)
{
    int accepted = accept_members(self);
    if (accepted < 0)
        return accepted;
    for (unsigned k = 0; k < MEMBERS_MAX; k++) {
        unsigned i = (self->next + k) % MEMBERS_MAX;
        if (self->members[i] < 0)
            continue;
        int r = read_frame(self->members[i], ret_frame);
        if (r > 0) {
            forward(self, ret_frame, i);
            self->next = (i + 1) % MEMBERS_MAX;
            return 1;
        }
        if (r < 0)
            drop_member(self, i); /* gone, or does not speak CAN */
    }
    return 0;
}

static int sim_receive(struct can_bus *bus, struct can_frame *ret_frame, nsec_t *ret_receive_ns)
{
    struct can_sim *self = (struct can_sim *)bus;
    for (;;) {
        struct can_frame frame;
        int r = self->listener >= 0 ? hub_receive(self, &frame) : read_frame(bus->fd, &frame);
        if (r == -EPIPE || r == -ECONNRESET)
            return -ENETDOWN;
        if (r <= 0)
            return r;
        if (!wanted(bus, &frame))
            continue;
        *ret_frame = frame;
        *ret_receive_ns = clock_monotonic_ns();
        return 1;
    }
}

static int sim_send(struct can_bus *bus, const struct can_frame *frame)
{
    struct can_sim *self = (struct can_sim *)bus;
    if (self->listener >= 0) {
        accept_members(self);
        forward(self, frame, MEMBERS_MAX);
        return 0;
    }
    ssize_t n = send(bus->fd, frame, sizeof(*frame), MSG_DONTWAIT | MSG_NOSIGNAL);
    if (n < 0)
        return errno == EWOULDBLOCK || errno == ENOBUFS ? -EAGAIN : -errno;
    return 0;
}

static void sim_disconnect(struct can_bus *bus)
{
    struct can_sim *self = (struct can_sim *)bus;
    for (unsigned i = 0; i < MEMBERS_MAX; i++)
        if (self->members[i] >= 0)
            drop_member(self, i);
    if (self->listener >= 0) {
        close(self->listener);
        unlink(bus->name);
    }
    self->listener = -1;
    if (bus->fd >= 0)
        close(bus->fd);
    bus->fd = -1;
}

static void sim_destroy(struct can_bus *bus)
{
    free(bus);
}

static const struct can_bus_ops sim_ops = {
    .connect = sim_connect,
    .receive = sim_receive,
    .send = sim_send,
    .disconnect = sim_disconnect,
    .destroy = sim_destroy,
};

int can_sim_create(struct can_bus **ret_bus)
{
    struct can_sim *self = calloc(1, sizeof(*self));
    if (!self)
        return -ENOMEM;
    self->bus = (struct can_bus){.ops = &sim_ops, .fd = -1};
    self->listener = -1;
    for (unsigned i = 0; i < MEMBERS_MAX; i++)
        self->members[i] = -1;
    *ret_bus = &self->bus;
    return 0;
}
