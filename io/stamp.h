/* The kernel's receive stamps, brought to the clock that poses are timed by. */
#pragma once

#include <sys/socket.h>
#include <time.h>

#include "base/clock.h"

/* Asks the kernel for SO_TIMESTAMPNS and SO_RXQ_OVFL; what it does not know it leaves out. */
void stamp_enable(int fd);

/* What a received message's control data says. */
struct stamp {
    nsec_t receive_ns; /* monotonic; now where the kernel gave no stamp */
    unsigned dropped;  /* the socket's own count of messages lost for want of room */
    int has_dropped;
};

#define STAMP_CONTROL_MAX 256

/* Reads the control messages of `message`, just received. A stamp in the future, or more than ten
 * seconds old (the wall clock was set), counts as now. */
struct stamp stamp_of_message(const struct msghdr *message);
