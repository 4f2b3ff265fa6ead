#include "daemon/swap_link.h"

#include <errno.h>
#include <poll.h>
#include <sys/random.h>

#define RETRY_NS     NSEC_PER_SEC
#define HEAR_AT_ONCE 256 /* datagrams, of whatever kind, between two looks at the clock */

static void join(struct swap_link *link)
{
    link->retry_ns = clock_monotonic_ns() + RETRY_NS;
    link->status.error =
        udp_listen_group(&link->udp, link->params.group, link->params.interface, NULL);
}

void swap_link_open(struct swap_link *link, const struct swap_link_params *params)
{
    struct swap_params lock = {.channel = params->channel,
                               .channels = params->channels,
                               .session = (uint32_t)clock_realtime_ns(),
                               .timeout_ns = params->timeout_ns};
    *link = (struct swap_link){.params = *params, .udp.fd = -1};
    if (getrandom(&lock.session, sizeof(lock.session), GRND_NONBLOCK) < 0)
        lock.session ^= params->channel;
    swap_lock_init(&link->lock, &lock);
    address_parse(params->group, &link->group, NULL);
    join(link);
}

static void tell(struct swap_link *link, enum swap_kind kind)
{
    uint8_t data[SWAP_MESSAGE_SIZE];
    const struct swap_message message = swap_lock_message(&link->lock, kind, clock_realtime_ns());
    swap_message_encode(&message, data);
    if (link->udp.fd >= 0 && udp_send_to(&link->udp, &link->group, data, sizeof(data)) < 0)
        link->status.unsent++;
}

void swap_link_close(struct swap_link *link)
{
    tell(link, SWAP_LEAVE);
    udp_close(&link->udp);
}

static void hear(struct swap_link *link)
{
    uint8_t data[SWAP_MESSAGE_SIZE + 1];
    struct datagram datagram;
    struct swap_message message;
    for (int i = 0; i < HEAR_AT_ONCE; i++) {
        if (link->udp.fd < 0 || udp_receive(&link->udp, data, sizeof(data), &datagram) <= 0)
            return;
        if (swap_message_decode(data, datagram.size, &message, NULL) == 0)
            swap_lock_take(&link->lock, &message, datagram.receive_ns);
        else
            link->status.refused++;
    }
}

static void wait_for_message(const struct swap_link *link)
{
    nsec_t wait_ns = swap_lock_next_ns(&link->lock) - clock_monotonic_ns();
    struct pollfd poll_fd = {.fd = link->udp.fd, .events = POLLIN};
    const struct timespec wait = {.tv_sec = wait_ns / NSEC_PER_SEC,
                                  .tv_nsec = wait_ns % NSEC_PER_SEC};
    if (wait_ns > 0)
        ppoll(&poll_fd, 1, &wait, NULL);
}

void swap_link_show(struct swap_link *link, struct swap_label label)
{
    if (link->udp.fd < 0 && clock_monotonic_ns() >= link->retry_ns)
        join(link);
    hear(link);
    if (swap_lock_was_shown(&link->lock, label)) {
        swap_lock_pass(&link->lock, clock_monotonic_ns());
        tell(link, SWAP_PASS);
        return;
    }
    swap_lock_begin(&link->lock, label, clock_monotonic_ns());
    tell(link, SWAP_READY);
    hear(link);
    while (!swap_lock_may_show(&link->lock, clock_monotonic_ns())) {
        wait_for_message(link);
        if (swap_lock_retell(&link->lock, clock_monotonic_ns()))
            tell(link, SWAP_READY);
        hear(link);
    }
    swap_lock_show(&link->lock, clock_monotonic_ns(), clock_realtime_ns());
    tell(link, SWAP_SHOW);
}

struct swap_status swap_link_status(const struct swap_link *link)
{
    struct swap_status status = link->status;
    status.counts = link->lock.counts;
    return status;
}
