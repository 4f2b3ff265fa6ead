/* The swap lock: the channels of one simulator show the same frame at the same time, without a
 * master and without genlock. Each tells the others when a frame is ready and when it shows it
 * (docs/wire.md has the datagram, docs/decisions/0019-swap-lock.md why it is so).
 *
 * A state machine without sockets and without a clock; one thread. For each frame:
 *   swap_lock_begin()    it is finished: SWAP_READY goes to the others
 *   swap_lock_take()     each message of the others, also between frames
 *   swap_lock_may_show() asked after each message and at swap_lock_next_ns()
 *   swap_lock_show()     it is shown now: SWAP_SHOW goes to the others
 * or, where there is nothing newer to show than before, SWAP_PASS goes to them. A channel that does
 * not become ready within the time-out is not waited for again until its frames are in time. */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/clock.h"
#include "io/decode.h"

#define SWAP_CHANNELS_MAX 16
#define SWAP_MESSAGE_SIZE 32
#define SWAP_MAGIC        0x4F545753u /* "OTWS" */
#define SWAP_HISTORY      64          /* frames that are remembered */

enum swap_kind {
    SWAP_READY = 1, /* the frame can be shown */
    SWAP_SHOW = 2,  /* it is shown now */
    SWAP_PASS = 3,  /* there is nothing newer than this frame, which was shown before */
    SWAP_LEAVE = 4, /* the channel ends */
};

/* What frames are counted by. */
enum swap_base {
    SWAP_TICKS, /* of the shared clock: periods since 1970 */
    SWAP_HOST,  /* frames of the host */
};

/* Which frame; the number wraps. */
struct swap_label {
    enum swap_base base;
    uint32_t number;
};

struct swap_message {
    enum swap_kind kind;
    struct swap_label label;
    unsigned channel, channels; /* from 1; of how many */
    uint32_t session;           /* another number each time that the channel starts */
    nsec_t realtime_ns;         /* SWAP_SHOW: when it is shown; else when it was sent */
};

/* Pure. */
void swap_message_encode(const struct swap_message *message, uint8_t ret_data[SWAP_MESSAGE_SIZE]);
/* Returns 0, or -EBADMSG with the reason: short, length, magic, version, field. */
int swap_message_decode(const void *data, size_t size, struct swap_message *ret_message,
                        struct rejection *ret_rejection);

/* All since the beginning, but for `present`. */
struct swap_counts {
    uint64_t frames;      /* shown by the lock */
    uint64_t timeouts;    /* of them, after a wait in vain */
    uint64_t out_of_step; /* of them, while another channel stood at neither this frame nor the one
                           * shown before it */
    uint64_t strangers;   /* messages of another number of channels, or of a number beyond it */
    uint64_t namesakes;   /* messages of another channel with our number */
    nsec_t skew_worst_ns; /* between our showing a frame and another's, by the shared clock */
    unsigned present;     /* channels that are in step, this one included */
};

struct swap_params {
    unsigned channel, channels; /* from 1; 2 to SWAP_CHANNELS_MAX */
    uint32_t session;
    nsec_t timeout_ns;
};

struct swap_peer {
    bool in;    /* is waited for */
    bool heard; /* since it last left or was given up */
    bool has_ready, has_shown;
    bool passes; /* has nothing newer for the frame that is to be shown */
    uint32_t session;
    nsec_t heard_ns;
    struct swap_label ready, shown; /* last */
    nsec_t shown_realtime_ns;
};

struct swap_shown {
    struct swap_label label;
    nsec_t monotonic_ns, realtime_ns;
};

struct swap_lock {
    struct swap_params params;
    struct swap_peer peers[SWAP_CHANNELS_MAX]; /* by channel - 1; our own is not used */
    struct swap_label label;                   /* of the frame that is ready, or was shown last */
    nsec_t since_ns;                           /* when it became ready */
    nsec_t told_ns;                            /* when the others were last told so */
    struct swap_shown history[SWAP_HISTORY];   /* ring of what was shown */
    uint64_t shown;                            /* entries ever put into it */
    bool may_speak;
    struct swap_counts counts;
};

void swap_lock_init(struct swap_lock *lock, const struct swap_params *params);

/* A message of the group; our own, which multicast brings back, are passed over. */
void swap_lock_take(struct swap_lock *lock, const struct swap_message *message, nsec_t now_ns);

/* Whether this frame was shown last: there is nothing to wait for, but the others may be. */
bool swap_lock_was_shown(const struct swap_lock *lock, struct swap_label label);

void swap_lock_begin(struct swap_lock *lock, struct swap_label label, nsec_t now_ns);

/* All others are ready or not waited for, one shows the frame already, or time is up. */
bool swap_lock_may_show(const struct swap_lock *lock, nsec_t now_ns);

/* When to ask again, message or not. Where swap_lock_retell() is true then, SWAP_READY goes out
 * once more: the first may have been lost. */
nsec_t swap_lock_next_ns(const struct swap_lock *lock);
bool swap_lock_retell(struct swap_lock *lock, nsec_t now_ns);

/* The frame is shown, at `realtime_ns` of the shared clock. */
void swap_lock_show(struct swap_lock *lock, nsec_t now_ns, nsec_t realtime_ns);

/* The frame that was shown last stays. Who has been silent for the time-out is not waited for
 * again. */
void swap_lock_pass(struct swap_lock *lock, nsec_t now_ns);

/* By how many frames the latest with which a channel in step waits is later than what we showed
 * last; 0 where none is. Who chooses his frames by the clock takes that one next: else channels
 * that are released at different times would each go on with a frame of its own. */
unsigned swap_lock_ahead(const struct swap_lock *lock);

/* Whether this is the channel that speaks to the host for all: the first of those in step. */
bool swap_lock_speaks(const struct swap_lock *lock);

/* What is to be sent. */
struct swap_message swap_lock_message(const struct swap_lock *lock, enum swap_kind kind,
                                      nsec_t realtime_ns);
