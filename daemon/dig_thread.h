/* The thread "otwd-dig": it owns the writable handle on the terrain database, takes requests to dig
 * from the event loop through a bounded ring, and gives back an answer for each once it is on the
 * disk. While nobody asks it settles what was dug. docs/threads.md draws it. */
#pragma once

#include "base/diag.h"
#include "io/address.h"
#include "io/dig_message.h"

#define DIG_REQUESTS_MAX 64 /* that wait: one more is refused as busy */

struct dig;
struct dig_thread;

/* Whom an answer goes to. */
struct dig_asker {
    unsigned slot; /* the source's */
    union address sender;
};

struct dig_reply {
    struct dig_asker asker;
    struct dig_message message; /* an answer */
    bool failed;                /* refused because the database cannot be written */
};

/* Opens the database for digging. Failures as dig_writer_open, with a sentence. */
int dig_thread_start(const char *database, struct dig_thread **ret_thread, struct diag *diag);
/* Does what waits, ends the thread and waits for it. Nobody may use its ground any more. Legal
 * on NULL. */
void dig_thread_stop(struct dig_thread *thread);

/* The ground that the picture shows; borrowed. */
struct dig *dig_thread_ground(struct dig_thread *thread);

/* Copies a request in. False where the ring is full. Event loop. */
bool dig_thread_ask(struct dig_thread *thread, const struct dig_message *request,
                    const struct dig_asker *asker);

/* Readable when there are answers; clears it and takes the oldest. Event loop. */
int dig_thread_fd(const struct dig_thread *thread);
bool dig_thread_take(struct dig_thread *thread, struct dig_reply *ret_reply);
