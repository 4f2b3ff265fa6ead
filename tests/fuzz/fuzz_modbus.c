/* The Modbus server as two clients see it. A byte: whether control is allowed; then pieces, each
 * behind a byte of its length, whose highest bit says whose it is, with 127 for a client that goes
 * away. Every answer is whole and to a request of that client's, and without control nothing is
 * ever written. */
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "io/modbus_reply.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#define GOES 127

struct peer {
    int fd;
    size_t size; /* bytes of the answer that has not all come yet */
    uint8_t answer[MODBUS_ADU_MAX];
};

static bool control_allowed;
static struct sockaddr_un place; /* of the listening socket: a name without a file */
static socklen_t place_size;

static void take_control(void *context, const struct modbus_control *control)
{
    bool flag = control->kind <= MODBUS_CONTROL_RESET_COUNTERS;
    if (!control_allowed || control->kind > MODBUS_CONTROL_UTC_MINUTES ||
        (flag && control->value > 1) ||
        (control->kind == MODBUS_CONTROL_UTC_MINUTES && control->value > 1439) ||
        (control->kind == MODBUS_CONTROL_VISIBILITY && control->value < 10))
        abort();
}

static int listener(void)
{
    static int fd = -1;
    if (fd >= 0)
        return fd;
    place.sun_family = AF_UNIX;
    place_size = sizeof(place);
    fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (bind(fd, (struct sockaddr *)&place, sizeof(sa_family_t)) < 0 || listen(fd, 4) < 0 ||
        getsockname(fd, (struct sockaddr *)&place, &place_size) < 0)
        abort();
    return fd;
}

static void take_answers(struct peer *peer)
{
    ssize_t got;
    while ((got = recv(peer->fd, peer->answer + peer->size, sizeof(peer->answer) - peer->size,
                       MSG_DONTWAIT)) > 0) {
        peer->size += (size_t)got;
        while (peer->size >= 6) {
            const uint8_t *answer = peer->answer;
            size_t whole = 6 + (size_t)(answer[4] << 8 | answer[5]);
            if (answer[2] || answer[3] || whole < 9 || whole > MODBUS_ADU_MAX)
                abort();
            if (peer->size < whole)
                break;
            if (answer[7] & 0x80 && (whole != 9 || answer[8] < 1 || answer[8] > 11))
                abort();
            peer->size -= whole;
            memmove(peer->answer, peer->answer + whole, peer->size);
        }
    }
}

static void leave(struct peer *peer)
{
    if (peer->fd >= 0)
        close(peer->fd);
    *peer = (struct peer){.fd = -1};
}

static void put(struct modbus_server *server, struct peer *peer, const uint8_t *data, size_t size)
{
    if (peer->fd < 0) {
        peer->fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
        if (connect(peer->fd, (struct sockaddr *)&place, place_size) < 0)
            abort();
    }
    if (send(peer->fd, data, size, MSG_NOSIGNAL | MSG_DONTWAIT) < 0)
        leave(peer);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct peer peers[2] = {{.fd = -1}, {.fd = -1}};
    struct modbus_server *server;
    nsec_t now_ns = clock_monotonic_ns();
    if (size < 1)
        return 0;
    control_allowed = data[0] & 1;
    const struct modbus_server_params params = {.listen_fd = listener(),
                                                .allow_control = control_allowed,
                                                .max_clients = data[0] & 2 ? 1 : 2,
                                                .control = take_control};
    if (modbus_server_open(&params, &server, NULL) < 0)
        abort();
    for (data++, size--; size > 0;) {
        struct peer *peer = &peers[data[0] >> 7];
        size_t length = data[0] & 0x7f;
        data++;
        size--;
        if (length == GOES) {
            leave(peer);
            length = 0;
        } else {
            length = length < size ? length : size;
            put(server, peer, data, length);
        }
        for (int i = 0; i < 4; i++)
            modbus_server_dispatch(server, now_ns += 100 * NSEC_PER_MSEC);
        for (int i = 0; i < 2; i++)
            if (peers[i].fd >= 0)
                take_answers(&peers[i]);
        data += length;
        size -= length;
    }
    if (modbus_server_clients(server) > 2)
        abort();
    leave(&peers[0]);
    leave(&peers[1]);
    modbus_server_close(server);
    return 0;
}
