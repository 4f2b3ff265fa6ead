#include "io/udp.h"

#include <arpa/inet.h>
#include <errno.h>
#include <string.h>
#include <unistd.h>

#include "io/stamp.h"

#define UDP_RECEIVE_BUFFER_BYTES (1 << 20)

static int udp_socket(struct udp *udp, const char *text, union address *ret_address,
                      struct diag *diag)
{
    *udp = (struct udp){.fd = -1};
    int r = address_parse(text, ret_address, diag);
    if (r < 0)
        return r;
    udp->fd = socket(ret_address->any.sa_family, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (udp->fd < 0)
        return diag_set(diag, -errno, "no UDP socket for %s: %s", text, strerror(errno));
    return 0;
}

/* Closes and passes the sentence on. */
static int udp_fail(struct udp *udp, int code, const char *verb, const char *text,
                    struct diag *diag)
{
    udp_close(udp);
    if (code == -EADDRINUSE)
        return diag_set(diag, code, "cannot listen on udp %s: another program has that port", text);
    return diag_set(diag, code, "cannot %s udp %s: %s", verb, text, strerror(-code));
}

static bool is_group(const union address *address)
{
    return address->any.sa_family == AF_INET && IN_MULTICAST(ntohl(address->v4.sin_addr.s_addr));
}

static int join(const struct udp *udp, const union address *group, struct in_addr interface)
{
    const struct ip_mreqn request = {.imr_multiaddr = group->v4.sin_addr, .imr_address = interface};
    if (setsockopt(udp->fd, IPPROTO_IP, IP_ADD_MEMBERSHIP, &request, sizeof(request)) < 0)
        return -errno;
    if (interface.s_addr != htonl(INADDR_ANY) &&
        setsockopt(udp->fd, IPPROTO_IP, IP_MULTICAST_IF, &request, sizeof(request)) < 0)
        return -errno;
    return 0;
}

static int listen_at(struct udp *udp, const char *listen, struct in_addr interface,
                     struct diag *diag)
{
    union address address;
    int r = udp_socket(udp, listen, &address, diag);
    if (r < 0)
        return r;
    int bytes = UDP_RECEIVE_BUFFER_BYTES;
    setsockopt(udp->fd, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof(bytes));
    stamp_enable(udp->fd);
    int shared = is_group(&address);
    setsockopt(udp->fd, SOL_SOCKET, SO_REUSEADDR, &shared, sizeof(shared));
    if (bind(udp->fd, &address.any, address_length(&address)) < 0)
        return udp_fail(udp, -errno, "listen on", listen, diag);
    socklen_t length = sizeof(udp->local);
    if (getsockname(udp->fd, &udp->local.any, &length) < 0)
        return udp_fail(udp, -errno, "listen on", listen, diag);
    r = is_group(&address) ? join(udp, &address, interface) : 0;
    return r < 0 ? udp_fail(udp, r, "join the group of", listen, diag) : 0;
}

int udp_listen(struct udp *udp, const char *listen, struct diag *diag)
{
    return listen_at(udp, listen, (struct in_addr){.s_addr = htonl(INADDR_ANY)}, diag);
}

int udp_listen_group(struct udp *udp, const char *group, const char *interface, struct diag *diag)
{
    struct in_addr at;
    *udp = (struct udp){.fd = -1};
    if (inet_pton(AF_INET, interface, &at) != 1)
        return diag_set(diag, -EINVAL, "'%s' is no address of an interface", interface);
    return listen_at(udp, group, at, diag);
}

int udp_connect(struct udp *udp, const char *peer, struct diag *diag)
{
    union address address;
    int r = udp_socket(udp, peer, &address, diag);
    if (r < 0)
        return r;
    if (connect(udp->fd, &address.any, address_length(&address)) < 0)
        return udp_fail(udp, -errno, "send to", peer, diag);
    return 0;
}

void udp_close(struct udp *udp)
{
    if (udp->fd >= 0)
        close(udp->fd);
    udp->fd = -1;
}

int udp_receive(struct udp *udp, void *buffer, size_t capacity, struct datagram *ret_datagram)
{
    _Alignas(struct cmsghdr) char control[STAMP_CONTROL_MAX];
    struct datagram datagram = {0};
    struct iovec vec = {.iov_base = buffer, .iov_len = capacity};
    struct msghdr message = {.msg_name = &datagram.sender,
                             .msg_namelen = sizeof(datagram.sender),
                             .msg_iov = &vec,
                             .msg_iovlen = 1,
                             .msg_control = control,
                             .msg_controllen = sizeof(control)};
    ssize_t n;
    do
        n = recvmsg(udp->fd, &message, MSG_DONTWAIT);
    while (n < 0 && (errno == EINTR || errno == ECONNREFUSED));
    if (n < 0)
        return errno == EAGAIN || errno == EWOULDBLOCK ? 0 : -errno;
    struct stamp stamp = stamp_of_message(&message);
    if (stamp.has_dropped) {
        udp->kernel_drops += stamp.dropped - udp->drops_seen; /* the kernel's count wraps */
        udp->drops_seen = stamp.dropped;
    }
    datagram.size = (size_t)n;
    datagram.truncated = message.msg_flags & MSG_TRUNC;
    datagram.receive_ns = stamp.receive_ns;
    *ret_datagram = datagram;
    return 1;
}

int udp_send(struct udp *udp, const void *data, size_t size)
{
    ssize_t n;
    do
        n = send(udp->fd, data, size, MSG_DONTWAIT | MSG_NOSIGNAL);
    while (n < 0 && errno == EINTR);
    return n < 0 ? -errno : 0;
}

int udp_send_to(struct udp *udp, const union address *peer, const void *data, size_t size)
{
    ssize_t n;
    do
        n = sendto(udp->fd, data, size, MSG_DONTWAIT | MSG_NOSIGNAL, (const struct sockaddr *)peer,
                   address_length(peer));
    while (n < 0 && errno == EINTR);
    return n < 0 ? -errno : 0;
}
