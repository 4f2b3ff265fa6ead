/* SIGINT and SIGTERM as a wish that a command end soon, its files whole. */
#pragma once

#include <stdatomic.h>
#include <stdbool.h>

/* From here on. A second signal of the kind ends the program at once. Returns what stop_asked()
 * looks at. */
const atomic_bool *stop_on_signals(void);

/* Any thread. */
bool stop_asked(void);
