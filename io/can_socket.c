/* SocketCAN. Filters live in the kernel; error frames tell the controller's state. Recovery from
 * bus-off belongs to the interface (`ip link set can0 type can restart-ms 100`). */
#include "io/can_bus.h"

#include <errno.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "io/stamp.h"

#define RECEIVE_BUFFER_BYTES (1 << 20)

struct can_socket {
    struct can_bus bus;
    unsigned drops_seen;
};

/* Exactly the wanted identifiers: the flags in the mask keep the other length and remote frames
 * out. */
static int set_filters(struct can_bus *bus)
{
    struct can_filter filters[CAN_BUS_IDS_MAX];
    for (size_t i = 0; i < bus->id_count; i++)
        filters[i] = (struct can_filter){
            .can_id = bus->ids[i],
            .can_mask = (bus->ids[i] & CAN_EFF_FLAG ? CAN_EFF_MASK : CAN_SFF_MASK) | CAN_EFF_FLAG |
                        CAN_RTR_FLAG};
    can_err_mask_t errors = CAN_ERR_TX_TIMEOUT | CAN_ERR_CRTL | CAN_ERR_BUSOFF | CAN_ERR_RESTARTED;
    if (setsockopt(bus->fd, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof(errors)) < 0)
        return -errno;
    if (bus->id_count && setsockopt(bus->fd, SOL_CAN_RAW, CAN_RAW_FILTER, filters,
                                    (socklen_t)(bus->id_count * sizeof(filters[0]))) < 0)
        return -errno;
    return 0;
}

/* A socket may be bound to an interface that is down; it would hear nothing and give one error. */
static bool is_up(const struct can_bus *bus)
{
    struct ifreq request = {0};
    memcpy(request.ifr_name, bus->name, IFNAMSIZ - 1);
    return ioctl(bus->fd, SIOCGIFFLAGS, &request) == 0 && request.ifr_flags & IFF_UP;
}

static int socket_connect(struct can_bus *bus, struct diag *diag)
{
    bus->fd = socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, CAN_RAW);
    if (bus->fd < 0)
        return diag_set(diag, -errno, "can:%s: this kernel gives no CAN socket: %s", bus->name,
                        strerror(errno));
    ((struct can_socket *)bus)->drops_seen = 0;
    unsigned index = if_nametoindex(bus->name);
    if (index == 0)
        return diag_set(diag, -ENODEV, "can:%s: there is no such interface", bus->name);
    int bytes = RECEIVE_BUFFER_BYTES;
    setsockopt(bus->fd, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof(bytes));
    stamp_enable(bus->fd);
    int r = set_filters(bus);
    if (r < 0)
        return diag_set(diag, r, "can:%s: its filters cannot be set: %s", bus->name, strerror(-r));
    struct sockaddr_can address = {.can_family = AF_CAN, .can_ifindex = (int)index};
    if (bind(bus->fd, (struct sockaddr *)&address, sizeof(address)) < 0)
        return diag_set(diag, -errno, "can:%s: %s", bus->name,
                        errno == ENODEV ? "it is not a CAN interface" : strerror(errno));
    if (!is_up(bus))
        return diag_set(diag, -ENETDOWN, "can:%s: the interface is down", bus->name);
    return 0;
}

/* linux/can/error.h: class in the identifier, the controller's state in data[1]. */
static void take_error_frame(struct can_bus *bus, const struct can_frame *frame)
{
    bus->error_frames++;
    if (frame->can_id & CAN_ERR_BUSOFF)
        bus->state = CAN_STATE_BUS_OFF;
    else if (frame->can_id & CAN_ERR_RESTARTED)
        bus->state = CAN_STATE_ACTIVE;
    else if (frame->can_id & CAN_ERR_CRTL) {
        uint8_t bits = frame->data[1];
        bus->frames_dropped += (bits & CAN_ERR_CRTL_RX_OVERFLOW) != 0; /* at least one */
        if (bits & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE))
            bus->state = CAN_STATE_PASSIVE;
        else if (bits & (CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING))
            bus->state = CAN_STATE_WARNING;
        else if (bits & CAN_ERR_CRTL_ACTIVE)
            bus->state = CAN_STATE_ACTIVE;
    }
}

static int receive_any(struct can_bus *bus, struct can_frame *ret_frame, nsec_t *ret_receive_ns)
{
    _Alignas(struct cmsghdr) char control[STAMP_CONTROL_MAX];
    struct iovec vec = {.iov_base = ret_frame, .iov_len = sizeof(*ret_frame)};
    struct msghdr message = {.msg_iov = &vec,
                             .msg_iovlen = 1,
                             .msg_control = control,
                             .msg_controllen = sizeof(control)};
    ssize_t n;
    do
        n = recvmsg(bus->fd, &message, MSG_DONTWAIT);
    while (n < 0 && errno == EINTR);
    if (n < 0)
        return errno == EAGAIN || errno == EWOULDBLOCK ? 0 : -errno;
    if (n != sizeof(*ret_frame))
        return -EIO;
    struct stamp stamp = stamp_of_message(&message);
    if (stamp.has_dropped) {
        struct can_socket *self = (struct can_socket *)bus;
        bus->frames_dropped += stamp.dropped - self->drops_seen;
        self->drops_seen = stamp.dropped;
    }
    *ret_receive_ns = stamp.receive_ns;
    return 1;
}

static int socket_receive(struct can_bus *bus, struct can_frame *ret_frame, nsec_t *ret_receive_ns)
{
    for (;;) {
        int r = receive_any(bus, ret_frame, ret_receive_ns);
        if (r <= 0 || !(ret_frame->can_id & CAN_ERR_FLAG))
            return r;
        take_error_frame(bus, ret_frame);
    }
}

static int socket_send(struct can_bus *bus, const struct can_frame *frame)
{
    ssize_t n;
    do
        n = write(bus->fd, frame, sizeof(*frame));
    while (n < 0 && errno == EINTR);
    if (n < 0)
        return errno == ENOBUFS || errno == EWOULDBLOCK ? -EAGAIN : -errno;
    return 0;
}

static void socket_disconnect(struct can_bus *bus)
{
    if (bus->fd >= 0)
        close(bus->fd);
    bus->fd = -1;
}

static void socket_destroy(struct can_bus *bus)
{
    free(bus);
}

static const struct can_bus_ops socket_ops = {
    .connect = socket_connect,
    .receive = socket_receive,
    .send = socket_send,
    .disconnect = socket_disconnect,
    .destroy = socket_destroy,
};

int can_socket_create(struct can_bus **ret_bus)
{
    struct can_socket *self = calloc(1, sizeof(*self));
    if (!self)
        return -ENOMEM;
    self->bus = (struct can_bus){.ops = &socket_ops, .fd = -1};
    *ret_bus = &self->bus;
    return 0;
}
