/* Waiting for the GPU without the grain of the driver's own wait, which on NVIDIA's looks again a
 * third of a millisecond later (docs/performance.md, "The wait"). The thread that holds the GL
 * context; nothing is allocated. */
#pragma once

#include "base/clock.h"

/* Waits for the result of a query that was flushed: sleeps until the monotonic time `until_ns`,
 * then looks at it again and again, for some milliseconds; where it takes longer the rest of the
 * wait is the driver's. */
void query_wait(unsigned query, nsec_t until_ns);
