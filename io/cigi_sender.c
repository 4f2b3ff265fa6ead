#include "io/cigi_sender.h"

#include <errno.h>
#include <poll.h>
#include <string.h>

#include "io/udp.h"

#define UDP_SCHEME     "udp://"
#define LISTEN_DEFAULT "127.0.0.1:8005"
#define OWN_SHIP       0
#define TYPE           1
#define LOOK_NS        (100 * NSEC_PER_MSEC) /* how long a pause may go on after `stop` */
#define PATIENCE_NS    (10 * NSEC_PER_SEC)

struct sending {
    const struct flight *flight;
    const struct cigi_send_params *params;
    struct udp udp;
    union address target;
    struct cigi_host host;
    struct cigi_send_result result;
    uint64_t flown; /* frames of the flight */
    nsec_t heard_ns;
    uint8_t data[CIGI_MESSAGE_MAX];
};

static bool operates(const struct sending *sending)
{
    const struct cigi_host *host = &sending->host;
    return host->has_seen && host->seen.mode == CIGI_OPERATE &&
           (host->database == 0 || host->seen.database == (int)host->database);
}

static nsec_t flight_time_ns(const struct sending *sending)
{
    const struct cigi_send_params *params = sending->params;
    double rate_hz = params->rate_hz > 0.0 ? params->rate_hz : 60.0;
    double speed = params->speed > 0.0 ? params->speed : 1.0;
    return ns_from_seconds((double)sending->flown * speed / rate_hz);
}

/* The next message: with own-ship, once the image generator is in Operate. */
static void send_frame(struct sending *sending)
{
    struct cigi_writer writer;
    struct pose pose;
    cigi_host_begin(&sending->host, clock_monotonic_ns(), sending->data, &writer);
    if (operates(sending)) {
        flight_sample(sending->flight, flight_time_ns(sending), &pose);
        cigi_host_put_pose(&sending->host, &writer, OWN_SHIP, TYPE, &pose);
        sending->flown++;
    }
    int r = udp_send_to(&sending->udp, &sending->target, sending->data, writer.size);
    *(r < 0 ? &sending->result.failed : &sending->result.sent) += 1;
}

/* Takes one Start of Frame; in synchronous operation it is answered. Returns whether one waited. */
static bool take_start(struct sending *sending)
{
    struct datagram datagram;
    uint32_t last_sent = sending->host.frame - 1;
    bool operated = operates(sending);
    if (udp_receive(&sending->udp, sending->data, sizeof(sending->data), &datagram) <= 0)
        return false;
    if (cigi_host_receive(&sending->host, sending->data, datagram.size, NULL, NULL) < 0) {
        sending->result.refused++;
        if (sending->params->synchronous && !sending->host.has_seen)
            send_frame(
                sending); /* an image generator may speak another version until it has heard */
        return true;
    }
    sending->heard_ns = datagram.receive_ns;
    sending->result.starts++;
    if (!sending->params->synchronous)
        return true;
    sending->result.unheld += operated && sending->host.seen.host_frame != last_sent;
    send_frame(sending);
    return true;
}

static int wait_for_start(struct sending *sending, nsec_t until_ns, struct diag *diag)
{
    struct pollfd poll_fd = {.fd = sending->udp.fd, .events = POLLIN};
    nsec_t now_ns = clock_monotonic_ns();
    nsec_t wait_ns = until_ns - now_ns < LOOK_NS ? until_ns - now_ns : LOOK_NS;
    const struct timespec wait = {.tv_nsec = wait_ns > 0 ? wait_ns : 0};
    if (ppoll(&poll_fd, 1, &wait, NULL) > 0)
        take_start(sending);
    if (now_ns - sending->heard_ns > PATIENCE_NS)
        return diag_set(diag, -ETIMEDOUT, "no Start of Frame has come to %s for 10 s",
                        sending->params->listen ? sending->params->listen : LISTEN_DEFAULT);
    return 0;
}

static int open_target(struct sending *sending, const char *url, struct diag *diag)
{
    const char *listen = sending->params->listen;
    if (strncmp(url, UDP_SCHEME, strlen(UDP_SCHEME)) != 0)
        return diag_set(diag, -EINVAL, "CIGI does not go over %s, but to udp://HOST:PORT", url);
    int r = address_resolve(url + strlen(UDP_SCHEME), &sending->target, diag);
    if (r < 0)
        return r;
    return udp_listen(&sending->udp, listen ? listen : LISTEN_DEFAULT, diag);
}

static int play(struct sending *sending, const atomic_bool *stop, struct diag *diag)
{
    const struct cigi_send_params *params = sending->params;
    nsec_t period_ns = ns_from_seconds(1.0 / (params->rate_hz > 0.0 ? params->rate_hz : 60.0));
    nsec_t next_ns = clock_monotonic_ns(), end_ns = flight_duration_ns(sending->flight);
    int r = 0;
    sending->heard_ns = next_ns;
    while (r == 0 && flight_time_ns(sending) <= end_ns && !(stop && atomic_load(stop))) {
        if (params->synchronous) {
            r = wait_for_start(sending, clock_monotonic_ns() + LOOK_NS, diag);
            continue;
        }
        r = wait_for_start(sending, next_ns, diag);
        if (clock_monotonic_ns() < next_ns)
            continue;
        send_frame(sending);
        next_ns += period_ns;
    }
    return r;
}

int cigi_send_run(const struct flight *flight, const char *url,
                  const struct cigi_send_params *params, const atomic_bool *stop,
                  struct cigi_send_result *ret_result, struct diag *diag)
{
    struct sending sending = {
        .flight = flight,
        .params = params,
        .udp.fd = -1,
        .host = {.format = params->format, .database = params->database, .frame = 1}};
    int r = open_target(&sending, url, diag);
    if (r == 0)
        r = play(&sending, stop, diag);
    udp_close(&sending.udp);
    sending.result.gaps = sending.host.gaps;
    *ret_result = sending.result;
    return r;
}
