/* The thread that draws: it owns the channel and with it the GL context, and finishes a frame at
 * every tick of display.rate_hz.
 *
 * What it needs comes through a latest-value cell (struct render_input), each pose besides through
 * a ring, from which it makes the motion that it shows; what it did goes out through another ring
 * (struct frame_sample). Between two frames it does nothing but sleep: its loop allocates nothing,
 * takes no lock, does not log. Where a host leads (synchronous CIGI) a frame begins with a wait for
 * it, which is bounded; where there are several channels in step it ends with a wait for the
 * others, which is bounded, too. docs/threads.md draws it. */
#pragma once

#include "base/diag.h"
#include "daemon/channel.h"
#include "daemon/entities.h"
#include "daemon/notify.h"
#include "daemon/swap_link.h"
#include "geo/motion.h"

/* What the event loop wants to be drawn: always whole, always the newest. */
struct render_input {
    struct pose pose; /* the newest that drives; the start position before any has come */
    bool live;        /* a source is */
    int source;       /* whose it is */
    unsigned cuts;    /* how often the eye was put on something else, which is no motion */
    struct motion_params motion;
    bool frozen; /* the picture stays as it is */
    double visibility_m;
    nsec_t utc_offset_ns; /* UTC since 1970 minus monotonic time */
    uint64_t snapshot;    /* where it has changed: write this frame as frame-SNAPSHOT.png */
    struct channel_geometry geometry;
    bool tells_begin;    /* render_thread_begin_fd() is wanted */
    nsec_t wait_ns;      /* for render_thread_go(), once that was told; 0 = not at all */
    uint32_t host_frame; /* of the host that is waited for: what it said last belongs to it */
};

/* One finished frame. */
struct frame_sample {
    uint64_t frame;  /* from 1 */
    uint64_t missed; /* ticks since the start that no frame was finished for in time */
    nsec_t finished_ns;
    double frame_ms, cpu_ms, gpu_ms;
    nsec_t transport_ns; /* receive stamp of the newest pose that it is the first to reach, to the
                          * finished frame; -1: it reaches none that was not reached before */
    struct geodetic position;
    struct attitude attitude;
    double height_above_terrain_m;
    bool late;     /* it was not finished by its own deadline */
    bool complete; /* the terrain was all there */
    unsigned tiles_resident, tiles_pending;
    uint64_t terrain_errors;
    int gpu_mib;             /* 0 = unknown */
    double pixel_error;      /* that the frame was drawn for */
    bool reduced;            /* that is more than was asked, for want of time */
    struct swap_status swap; /* zeroed where there is no lock */
};

struct render_params {
    struct channel_params channel; /* the strings and the window outlive the thread */
    double rate_hz;
    double pixel_error_most; /* up to which the error may grow before a deadline is missed */
    struct render_input first;
    const char *snapshot_directory;   /* NULL = none */
    struct notify *notify;            /* one beat a frame */
    struct entity_types entity_types; /* the list outlives the thread */
    struct swap_link_params swap;
};

struct render_thread;

/* Starts the thread, which makes its channel by itself. -errno with a sentence. */
int render_thread_start(const struct render_params *params, struct render_thread **ret_thread,
                        struct diag *diag);

/* Ends the thread, waits for it and frees it. Returns 0, or -errno with a sentence where a snapshot
 * could not be written. Legal on NULL. */
int render_thread_stop(struct render_thread *thread, struct diag *diag);

/* Readable once the channel runs, and when the thread has failed. */
int render_thread_fd(const struct render_thread *thread);

enum render_state {
    RENDER_STARTING,
    RENDER_RUNNING,
    RENDER_FAILED, /* the thread has ended */
    RENDER_LOST,   /* likewise, because the GPU was reset or ran out of memory: worth another try */
};

/* Clears the descriptor. Where the thread has ended `ret_diag` says why. */
enum render_state render_thread_state(struct render_thread *thread, struct diag *ret_diag);

/* Readable when a frame begins, where the input wants it. render_thread_begun() clears it and says
 * when the newest one will be seen. Event loop. */
int render_thread_begin_fd(const struct render_thread *thread);
nsec_t render_thread_begun(struct render_thread *thread);

/* Whether this channel is the one of those in step that speaks to the host; one alone always is. */
bool render_thread_speaks(const struct render_thread *thread);

/* What the frame that begins waits for has been published. Event loop. */
void render_thread_go(struct render_thread *thread);

/* Once it runs; does not change. */
const struct gl_facts *render_thread_gl(const struct render_thread *thread);

/* The same: channel_note(). */
const char *render_thread_note(const struct render_thread *thread);

/* A pose of the source that drives, before it is published with the rest. Where the ring is full it
 * is the newest in `input` that counts. `source` and `cuts` as there. Event loop. */
void render_thread_pose(struct render_thread *thread, int source, unsigned cuts,
                        const struct pose *pose);

/* Event loop. No lock on either side. */
void render_thread_publish(struct render_thread *thread, const struct render_input *input);

/* The same, for the entities that a host moves: they change with every frame, or not at all. */
void render_thread_publish_traffic(struct render_thread *thread, const struct traffic *traffic);

/* The oldest sample not yet taken; false where there is none. Samples that nobody takes are lost
 * after RENDER_SAMPLES. Event loop. */
bool render_thread_take(struct render_thread *thread, struct frame_sample *ret_sample);

#define RENDER_SAMPLES 2048
#define RENDER_POSES   1024
