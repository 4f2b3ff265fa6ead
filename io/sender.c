#include "io/sender.h"

#include <errno.h>
#include <stdio.h>
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

static int target_open(struct target *target, const char *url, enum pose_protocol protocol,
                       struct diag *diag)
{
    bool is_udp = strncmp(url, UDP_SCHEME, strlen(UDP_SCHEME)) == 0;
    if (!is_udp && strncmp(url, "can:", 4) != 0 && strncmp(url, "sim:", 4) != 0)
        return diag_set(diag, -EINVAL,
                        "\"%s\" is none of udp://HOST:PORT, can:INTERFACE and sim:PATH", url);
    if (is_udp == pose_protocol_is_can(protocol))
        return diag_set(diag, -EINVAL, "%s does not go over %s", pose_protocol_name(protocol), url);
    if (is_udp) {
        char text[ADDRESS_TEXT_MAX];
        union address address;
        int r = address_resolve(url + strlen(UDP_SCHEME), &address, diag);
        if (r < 0)
            return r;
        address_format(&address, text);
        return udp_connect(&target->udp, text, diag);
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
