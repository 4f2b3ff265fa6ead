#include "daemon/dig_client.h"

#include <errno.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>

#include "io/udp.h"

#define TRIES     10
#define TRY_AGAIN (NSEC_PER_SEC / 2)

/* 1: the answer to it has come. */
static int wait_for_answer(struct udp *udp, const struct dig_message *request, uint8_t *buffer,
                           struct dig_message *ret_answer)
{
    nsec_t until_ns = clock_monotonic_ns() + TRY_AGAIN;
    for (nsec_t left_ns = TRY_AGAIN; left_ns > 0; left_ns = until_ns - clock_monotonic_ns()) {
        struct pollfd poll_fd = {.fd = udp->fd, .events = POLLIN};
        struct datagram datagram;
        if (poll(&poll_fd, 1, (int)(left_ns / NSEC_PER_MSEC) + 1) < 0 && errno != EINTR)
            return -errno;
        int r = udp_receive(udp, buffer, DIG_MESSAGE_MAX, &datagram);
        if (r < 0)
            return r;
        if (r > 0 && dig_message_decode(buffer, datagram.size, ret_answer, NULL) == 0 &&
            ret_answer->kind == DIG_ANSWER && ret_answer->session == request->session &&
            ret_answer->request == request->request && ret_answer->status != DIG_STATUS_BUSY)
            return 1;
    }
    return 0;
}

int dig_client_ask(const char *url, struct dig_message *request, struct dig_message *ret_answer,
                   struct diag *diag)
{
    struct udp udp = {.fd = -1};
    uint8_t *bytes = malloc(DIG_MESSAGE_MAX), *answer = malloc(DIG_MESSAGE_MAX);
    int r = bytes && answer ? 0 : -ENOMEM;
    request->request = 1;
    do
        if (getrandom(&request->session, sizeof(request->session), 0) < 0)
            r = -errno;
    while ((request->session &= DIG_SESSION_MAX) == 0 && r == 0);
    size_t size = r == 0 ? dig_message_encode(request, bytes) : 0;
    if (r == 0 && size == 0)
        r = diag_set(diag, -EFBIG, "the raster is too large for a datagram: at most 127 x 127");
    if (r == 0)
        r = udp_connect(&udp, url + strlen("udp://"), diag);
    for (int i = 0; r == 0 && i < TRIES; i++) {
        r = udp_send(&udp, bytes, size);
        if (r == 0 || r == -ECONNREFUSED)
            r = wait_for_answer(&udp, request, answer, ret_answer);
    }
    if (r == 0)
        diag_set(diag, -ETIMEDOUT, "%s does not answer (is digging allowed there?)", url);
    else if (r < 0 && !diag->text[0])
        diag_set(diag, r, "%s: %s", url, strerror(-r));
    udp_close(&udp);
    free(bytes);
    free(answer);
    return r > 0 ? 0 : r == 0 ? -ETIMEDOUT : r;
}
