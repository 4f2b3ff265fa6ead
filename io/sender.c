#include "io/sender.h"

#include <errno.h>
#include <netdb.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "io/can_bus.h"
#include "io/udp.h"

#define UDP_SCHEME    "udp://"
#define STOP_LOOK_NS  (100 * NSEC_PER_MSEC) /* how long a pause may go on after `stop` */
#define QUEUE_WAIT_NS NSEC_PER_MSEC
#define QUEUE_TRIES   100

struct target {
    struct udp udp;
    struct can_bus *bus; /* NULL for UDP */
};

/* A host's name into its number; a tool that sends may wait for that, a daemon may not. */
static int resolve(const char *host_port, char ret_text[ADDRESS_TEXT_MAX], struct diag *diag)
{
    char host[256];
    const char *colon = strrchr(host_port, ':');
    size_t length = colon ? (size_t)(colon - host_port) : 0;
    if (length == 0 || length >= sizeof(host))
        return diag_set(diag, -EINVAL, "\"udp://%s\" is not udp://HOST:PORT", host_port);
    char *end;
    unsigned long port = strtoul(colon + 1, &end, 10);
    if (end == colon + 1 || *end || port < 1 || port > 65535)
        return diag_set(diag, -EINVAL, "udp://%s: a port is a number from 1 to 65535", host_port);
    memcpy(host, host_port, length);
    host[length] = '\0';
    struct addrinfo hints = {.ai_family = AF_INET, .ai_socktype = SOCK_DGRAM}, *found = NULL;
    int r = getaddrinfo(host, colon + 1, &hints, &found);
    if (r != 0)
        return diag_set(diag, -EINVAL, "udp://%s: %s", host_port, gai_strerror(r));
    union address address = {0};
    memcpy(&address, found->ai_addr, found->ai_addrlen);
    freeaddrinfo(found);
    address_format(&address, ret_text);
    return 0;
}

static int target_open(struct target *target, const char *url, enum pose_protocol protocol,
                       struct diag *diag)
{
    bool is_udp = strncmp(url, UDP_SCHEME, strlen(UDP_SCHEME)) == 0;
    if (!is_udp && strncmp(url, "can:", 4) != 0 && strncmp(url, "sim:", 4) != 0)
        return diag_set(diag, -EINVAL,
                        "\"%s\" is none of udp://HOST:PORT, can:INTERFACE and sim:PATH", url);
    if (is_udp == (protocol == POSE_PROTOCOL_CANAEROSPACE))
        return diag_set(diag, -EINVAL, "%s does not go over %s", pose_protocol_name(protocol), url);
    if (is_udp) {
        const char *host_port = url + strlen(UDP_SCHEME);
        char text[ADDRESS_TEXT_MAX];
        union address address;
        if (address_parse(host_port, &address, NULL) == 0) /* already a number */
            return udp_connect(&target->udp, host_port, diag);
        int r = resolve(host_port, text, diag);
        return r < 0 ? r : udp_connect(&target->udp, text, diag);
    }
    int r = can_bus_create(url, &(struct can_bus_params){0}, &target->bus, diag);
    return r == CAN_BUS_DOWN ? -ENETDOWN : r;
}

static void target_close(struct target *target)
{
    can_bus_destroy(target->bus);
    udp_close(&target->udp);
}

/* A full queue is waited for: a bus has a rate of its own. */
static int target_send(struct target *target, const uint8_t *data, size_t size)
{
    if (!target->bus)
        return udp_send(&target->udp, data, size);
    struct can_frame frame, heard;
    nsec_t at_ns;
    memcpy(&frame, data, sizeof(frame));
    int r = -EAGAIN;
    for (int i = 0; r == -EAGAIN && i < QUEUE_TRIES; i++) {
        while (can_bus_receive(target->bus, &heard, &at_ns, NULL) > 0)
            ; /* what others say: a member that does not read would fill up */
        r = can_bus_send(target->bus, &frame);
        if (r == -EAGAIN)
            clock_sleep_until(clock_monotonic_ns() + QUEUE_WAIT_NS);
    }
    return r;
}

static bool stopped(const atomic_bool *stop)
{
    return stop && atomic_load(stop);
}

/* Returns false where it was stopped first. */
static bool wait_until(nsec_t until_ns, const atomic_bool *stop)
{
    while (!stopped(stop)) {
        nsec_t now_ns = clock_monotonic_ns();
        if (now_ns >= until_ns)
            return true;
        nsec_t look_ns = now_ns + STOP_LOOK_NS;
        clock_sleep_until(look_ns < until_ns ? look_ns : until_ns);
    }
    return false;
}

int send_run(const struct send_schedule *schedule, const char *url, enum pose_protocol protocol,
             const atomic_bool *stop, struct send_result *ret_result, struct diag *diag)
{
    struct target target = {.udp.fd = -1};
    struct send_result result = {0};
    int r = target_open(&target, url, protocol, diag);
    nsec_t start_ns = clock_monotonic_ns();
    for (size_t i = 0; r == 0 && i < schedule->count; i++) {
        const struct send_item *item = &schedule->items[i];
        if (!wait_until(start_ns + item->time_ns, stop))
            break;
        int sent = target_send(&target, schedule->bytes + item->offset, item->size);
        *(sent < 0 ? &result.failed : &result.sent) += 1;
        if (sent == -ENETDOWN || sent == -EPIPE || sent == -ENODEV)
            r = diag_set(diag, sent, "%s went down after %llu packets", url,
                         (unsigned long long)result.sent);
    }
    target_close(&target);
    if (r == 0)
        *ret_result = result;
    return r;
}
