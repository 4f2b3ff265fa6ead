#include "io/modbus_server.h"

#include <assert.h>
#include <errno.h>
#include <fcntl.h>
#include <netinet/tcp.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include "io/modbus_reply.h"

#define CLIENTS_MAX     64
#define IDLE_USUAL_MS   60000
#define EVENTS_A_CALL   16
#define REQUESTS_A_TURN 8 /* of one client before the others have theirs */
#define SWEEP_PERIOD_MS 250
#define EVICT_AFTER_NS  (2 * NSEC_PER_SEC)
#define EVICT_MUTE_NS   (250 * NSEC_PER_MSEC)

struct client {
    int fd;            /* -1 where free */
    bool asked;        /* a whole request has come */
    nsec_t request_ns; /* when it connected or its last whole request came */
    size_t in_size;    /* bytes of `in` that are filled */
    size_t out_size;   /* bytes of `out` that are still to be sent, */
    size_t out_offset; /* from here */
    uint32_t events;   /* what epoll watches for */
    uint8_t in[2 * MODBUS_ADU_MAX];
    uint8_t out[MODBUS_ADU_MAX];
};

struct modbus_server {
    struct modbus_replier replier;
    char *version, *channel;
    int epoll_fd, listen_fd, timer_fd;
    nsec_t idle_ns, now_ns;
    unsigned max_clients, count;
    bool deaf; /* no descriptor was left to accept with: rest until the next sweep */
    struct client clients[CLIENTS_MAX];
};

/* What an epoll event is about. */
#define TOKEN_LISTEN UINT32_MAX
#define TOKEN_TIMER  (UINT32_MAX - 1)

static int watch(struct modbus_server *server, int operation, int fd, uint32_t events,
                 uint32_t token)
{
    struct epoll_event event = {.events = events, .data = {.u32 = token}};
    return epoll_ctl(server->epoll_fd, operation, fd, &event) < 0 ? -errno : 0;
}

static void set_timer(struct modbus_server *server)
{
    long period_ns = server->count || server->deaf ? SWEEP_PERIOD_MS * NSEC_PER_MSEC : 0;
    struct itimerspec spec = {.it_interval = {.tv_nsec = period_ns},
                              .it_value = {.tv_nsec = period_ns}};
    timerfd_settime(server->timer_fd, 0, &spec, NULL);
}

static void client_drop(struct modbus_server *server, struct client *client)
{
    close(client->fd);
    *client = (struct client){.fd = -1};
    server->count--;
    set_timer(server);
    modbus_replier_publish_clients(&server->replier, server->count);
}

/* Whether a client is to give way before another: one that never asked anything before one that
 * did, then the one that has been silent for longer. */
static bool gives_way_before(const struct client *a, const struct client *b)
{
    return a->asked != b->asked ? b->asked : a->request_ns < b->request_ns;
}

/* Frees a place, where somebody has been silent for long enough: clients that hang must not lock
 * others out, nor push those out that work. */
static struct client *evict(struct modbus_server *server)
{
    const struct modbus_server_params *params = &server->replier.params;
    struct client *first = &server->clients[0];
    for (unsigned i = 1; i < server->max_clients; i++)
        if (gives_way_before(&server->clients[i], first))
            first = &server->clients[i];
    nsec_t idle_ns = server->now_ns - first->request_ns;
    if (idle_ns < (first->asked ? EVICT_AFTER_NS : EVICT_MUTE_NS))
        return NULL;
    union address address = {0};
    socklen_t length = sizeof(address);
    getpeername(first->fd, &address.any, &length);
    client_drop(server, first);
    if (params->evicted)
        params->evicted(params->context, &address, idle_ns);
    return first;
}

static struct client *free_client(struct modbus_server *server)
{
    for (unsigned i = 0; i < server->max_clients; i++)
        if (server->clients[i].fd < 0)
            return &server->clients[i];
    return evict(server);
}

static void client_take(struct modbus_server *server, int fd)
{
    struct client *client = free_client(server);
    uint32_t token = client ? (uint32_t)(client - server->clients) : 0;
    if (!client || watch(server, EPOLL_CTL_ADD, fd, EPOLLIN, token) < 0) {
        close(fd);
        return;
    }
    int on = 1;
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
    setsockopt(fd, SOL_SOCKET, SO_KEEPALIVE, &on, sizeof(on));
    client->fd = fd;
    client->events = EPOLLIN;
    client->request_ns = server->now_ns;
    server->count++;
    set_timer(server);
    modbus_replier_publish_clients(&server->replier, server->count);
}

static void accept_clients(struct modbus_server *server)
{
    for (unsigned i = 0; i < CLIENTS_MAX; i++) {
        int fd = accept4(server->listen_fd, NULL, NULL, SOCK_CLOEXEC | SOCK_NONBLOCK);
        if (fd >= 0) {
            client_take(server, fd);
        } else if (errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM) {
            server->deaf = true;
            watch(server, EPOLL_CTL_MOD, server->listen_fd, 0, TOKEN_LISTEN);
            set_timer(server);
            return;
        } else if (errno != ECONNABORTED && errno != EINTR) {
            return;
        }
    }
}

/* False where the client is lost. */
static bool client_send(struct client *client)
{
    while (client->out_size) {
        ssize_t sent = send(client->fd, client->out + client->out_offset, client->out_size,
                            MSG_NOSIGNAL | MSG_DONTWAIT);
        if (sent < 0)
            return errno == EAGAIN || errno == EINTR;
        client->out_offset += (size_t)sent;
        client->out_size -= (size_t)sent;
    }
    client->out_offset = 0;
    return true;
}

/* Bytes of the request at the start of `in`, 0 where it has not all come yet, or -EPROTO where no
 * request begins there (and none could be found again). */
static int request_size(const struct client *client)
{
    const uint8_t *in = client->in;
    if (client->in_size < 6)
        return 0;
    unsigned length = (unsigned)in[4] << 8 | in[5];
    if (in[2] || in[3] || length < 2 || length > MODBUS_ADU_MAX - 6)
        return -EPROTO;
    return client->in_size >= 6 + length ? (int)(6 + length) : 0;
}

static bool client_receive(struct client *client)
{
    size_t room = sizeof(client->in) - client->in_size;
    if (room == 0)
        return true;
    ssize_t got = recv(client->fd, client->in + client->in_size, room, MSG_DONTWAIT);
    if (got < 0)
        return errno == EAGAIN || errno == EINTR;
    client->in_size += (size_t)got;
    return got > 0;
}

/* Answers what `in` holds, as long as the client takes the answers. */
static bool client_answer(struct modbus_server *server, struct client *client)
{
    for (unsigned i = 0; i < REQUESTS_A_TURN && client->out_size == 0; i++) {
        int size = request_size(client);
        if (size <= 0)
            return size == 0;
        int answer = modbus_replier_answer(&server->replier, client->in, (size_t)size, client->out);
        if (answer < 0)
            return false;
        client->out_size = (size_t)answer;
        client->in_size -= (size_t)size;
        memmove(client->in, client->in + size, client->in_size);
        client->asked = true;
        client->request_ns = server->now_ns;
        if (!client_send(client))
            return false;
    }
    return true;
}

/* While answers wait to be sent, or requests to be answered, the client's further input can wait
 * in its own buffers; a whole request that waits makes the socket's writability the wake-up. */
static bool client_serve(struct modbus_server *server, struct client *client, uint32_t ready)
{
    if (!client_send(client))
        return false;
    if (client->out_size == 0 && !client_answer(server, client))
        return false;
    if ((ready & ~(uint32_t)EPOLLOUT) && client->out_size == 0 &&
        (!client_receive(client) || !client_answer(server, client)))
        return false;
    uint32_t events = client->out_size || request_size(client) != 0 ? EPOLLOUT : EPOLLIN;
    uint32_t token = (uint32_t)(client - server->clients);
    if (events == client->events)
        return true;
    client->events = events;
    return watch(server, EPOLL_CTL_MOD, client->fd, events, token) == 0;
}

static void sweep(struct modbus_server *server)
{
    uint64_t expirations;
    if (read(server->timer_fd, &expirations, sizeof(expirations)) < 0 && errno != EAGAIN)
        return;
    for (unsigned i = 0; i < server->max_clients; i++) {
        struct client *client = &server->clients[i];
        if (client->fd >= 0 && server->now_ns - client->request_ns >= server->idle_ns)
            client_drop(server, client);
    }
    if (server->deaf && watch(server, EPOLL_CTL_MOD, server->listen_fd, EPOLLIN, TOKEN_LISTEN) == 0)
        server->deaf = false;
    set_timer(server);
}

int modbus_server_dispatch(struct modbus_server *server, nsec_t now_ns)
{
    struct epoll_event events[EVENTS_A_CALL];
    server->now_ns = now_ns;
    int count = epoll_wait(server->epoll_fd, events, EVENTS_A_CALL, 0);
    if (count < 0)
        return errno == EINTR ? 0 : -errno;
    for (int i = 0; i < count; i++) {
        uint32_t token = events[i].data.u32;
        if (token == TOKEN_LISTEN) {
            accept_clients(server);
        } else if (token == TOKEN_TIMER) {
            sweep(server);
        } else {
            struct client *client = &server->clients[token];
            if (client->fd >= 0 && !client_serve(server, client, events[i].events))
                client_drop(server, client);
        }
    }
    return 0;
}

void modbus_server_publish(struct modbus_server *server, const struct health *health)
{
    modbus_replier_publish(&server->replier, health);
}

static int listen_at(struct modbus_server *server, const char *listen_text, struct diag *diag)
{
    union address address;
    int on = 1;
    if (address_parse(listen_text, &address, diag) < 0)
        return -EINVAL;
    server->listen_fd =
        socket(address.any.sa_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (server->listen_fd < 0)
        return diag_set(diag, -errno, "%s: %s", listen_text, strerror(errno));
    setsockopt(server->listen_fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on));
    if (bind(server->listen_fd, &address.any, address_length(&address)) < 0 ||
        listen(server->listen_fd, 16) < 0)
        return diag_set(diag, -errno, "%s: %s", listen_text, strerror(errno));
    return 0;
}

/* A socket that somebody else opened may block and may not even listen. */
static int adopt(struct modbus_server *server, int fd, struct diag *diag)
{
    int listens = 0;
    socklen_t length = sizeof(listens);
    if (getsockopt(fd, SOL_SOCKET, SO_ACCEPTCONN, &listens, &length) < 0 || !listens)
        return diag_set(diag, -EINVAL, "the inherited descriptor %d is no listening socket", fd);
    server->listen_fd = fcntl(fd, F_DUPFD_CLOEXEC, 3);
    if (server->listen_fd < 0 || fcntl(server->listen_fd, F_SETFL, O_NONBLOCK) < 0)
        return diag_set(diag, -errno, "the inherited descriptor %d: %s", fd, strerror(errno));
    return 0;
}

static int make_loop(struct modbus_server *server)
{
    server->epoll_fd = epoll_create1(EPOLL_CLOEXEC);
    server->timer_fd = timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC | TFD_NONBLOCK);
    if (server->epoll_fd < 0 || server->timer_fd < 0)
        return -errno;
    int r = watch(server, EPOLL_CTL_ADD, server->listen_fd, EPOLLIN, TOKEN_LISTEN);
    return r < 0 ? r : watch(server, EPOLL_CTL_ADD, server->timer_fd, EPOLLIN, TOKEN_TIMER);
}

static int open_parts(struct modbus_server *server, const struct modbus_server_params *params,
                      struct diag *diag)
{
    struct modbus_server_params own = *params;
    server->version = strdup(params->version ? params->version : "");
    server->channel = strdup(params->channel ? params->channel : "");
    if (!server->version || !server->channel)
        return diag_set(diag, -ENOMEM, "%s: out of memory", params->listen);
    own.version = server->version;
    own.channel = server->channel;
    own.listen = NULL;
    own.unit = params->unit ? params->unit : 1;
    int r = modbus_replier_init(&server->replier, &own);
    if (r == 0)
        r = params->listen_fd ? adopt(server, params->listen_fd, diag)
                              : listen_at(server, params->listen, diag);
    else
        diag_set(diag, r, "%s: %s", params->listen, strerror(-r));
    if (r == 0 && (r = make_loop(server)) < 0)
        diag_set(diag, r, "%s: %s", params->listen, strerror(-r));
    return r;
}

int modbus_server_open(const struct modbus_server_params *params, struct modbus_server **ret_server,
                       struct diag *diag)
{
    assert(params->max_clients <= CLIENTS_MAX);
    struct modbus_server *server = calloc(1, sizeof(*server));
    if (!server)
        return diag_set(diag, -ENOMEM, "%s: out of memory", params->listen);
    server->epoll_fd = server->listen_fd = server->timer_fd = -1;
    server->replier.pair[0] = server->replier.pair[1] = -1;
    server->max_clients = params->max_clients ? params->max_clients : CLIENTS_MAX;
    server->idle_ns =
        (params->idle_timeout_ms ? params->idle_timeout_ms : IDLE_USUAL_MS) * NSEC_PER_MSEC;
    server->now_ns = clock_monotonic_ns();
    for (unsigned i = 0; i < CLIENTS_MAX; i++)
        server->clients[i].fd = -1;
    int r = open_parts(server, params, diag);
    if (r < 0) {
        modbus_server_close(server);
        return r;
    }
    *ret_server = server;
    return 0;
}

void modbus_server_close(struct modbus_server *server)
{
    if (!server)
        return;
    for (unsigned i = 0; i < CLIENTS_MAX; i++)
        if (server->clients[i].fd >= 0)
            close(server->clients[i].fd);
    const int fds[] = {server->listen_fd, server->timer_fd, server->epoll_fd};
    for (unsigned i = 0; i < 3; i++)
        if (fds[i] >= 0)
            close(fds[i]);
    modbus_replier_finish(&server->replier);
    free(server->version);
    free(server->channel);
    free(server);
}

int modbus_server_fd(const struct modbus_server *server)
{
    return server->epoll_fd;
}

unsigned modbus_server_clients(const struct modbus_server *server)
{
    return server->count;
}

void modbus_server_address(const struct modbus_server *server, union address *ret_address)
{
    union address address = {0};
    socklen_t length = sizeof(address);
    getsockname(server->listen_fd, &address.any, &length);
    *ret_address = address;
}
