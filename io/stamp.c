#include "io/stamp.h"

#include <string.h>

#define STAMP_OLDEST_NS (10 * NSEC_PER_SEC)

void stamp_enable(int fd)
{
    int on = 1;
    setsockopt(fd, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof(on));
    setsockopt(fd, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof(on));
}

struct stamp stamp_of_message(const struct msghdr *message)
{
    struct stamp stamp = {.receive_ns = clock_monotonic_ns()};
    nsec_t realtime_ns = clock_realtime_ns();
    for (const struct cmsghdr *c = CMSG_FIRSTHDR(message); c;
         c = CMSG_NXTHDR((struct msghdr *)message, (struct cmsghdr *)c)) {
        if (c->cmsg_level != SOL_SOCKET)
            continue;
        if (c->cmsg_type == SO_TIMESTAMPNS) {
            struct timespec at;
            memcpy(&at, CMSG_DATA(c), sizeof(at));
            nsec_t age_ns = realtime_ns - ((nsec_t)at.tv_sec * NSEC_PER_SEC + at.tv_nsec);
            if (age_ns > 0 && age_ns < STAMP_OLDEST_NS)
                stamp.receive_ns -= age_ns;
        } else if (c->cmsg_type == SO_RXQ_OVFL) {
            memcpy(&stamp.dropped, CMSG_DATA(c), sizeof(stamp.dropped));
            stamp.has_dropped = 1;
        }
    }
    return stamp;
}
