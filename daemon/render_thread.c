#include "daemon/render_thread.h"

#include <errno.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <time.h>
#include <unistd.h>

#include "base/latest.h"
#include "base/ring.h"
#include "daemon/frame_output.h"
#include "daemon/governor.h"

#define GPU_MEMORY_EVERY_S 10.0
#define WARM_UP_FRAMES     4

struct render_thread {
    struct render_params params;
    struct latest input;   /* struct render_input, written by the event loop */
    struct latest traffic; /* struct traffic, likewise */
    struct ring poses;     /* struct arrived, likewise */
    struct ring samples;   /* struct frame_sample, read by the event loop */
    int event_fd;
    int begin_fd;
    _Atomic nsec_t begun_ns; /* when the frame that was told last will be seen */
    atomic_bool speaks;
    sem_t go;
    _Atomic int
        state; /* enum render_state; the release that makes `gl`, `note` and `diag` visible */
    atomic_bool stopping;
    bool has_thread;
    pthread_t thread;
    struct gl_facts gl;
    char note[160];
    struct diag diag; /* why it failed */
    int output_error; /* read after the thread has ended */
    struct diag output_diag;
};

struct arrived {
    int source;
    unsigned cuts;
    struct pose pose;
};

/* What the frame loop carries from frame to frame. */
struct frame_loop {
    struct render_thread *thread;
    struct channel *channel;
    struct frame_output *output; /* NULL where no snapshots can be written */
    nsec_t period_ns;
    uint64_t gpu_memory_every;
    struct render_input input;
    struct pose shown;
    nsec_t shown_utc_ns;
    struct motion motion;
    unsigned cuts;     /* of the eye, that the motion knows of */
    nsec_t reached_ns; /* receive stamp of the newest pose that a frame has reached */
    uint64_t snapshot;
    struct frame_sample sample;
    struct governor governor;
    struct swap_link *swap; /* NULL where the channel stands alone */
    struct traffic traffic; /* what is drawn beside the terrain */
    struct render_entity entities[TRAFFIC_MAX];
};

static void announce(struct render_thread *thread, enum render_state state)
{
    uint64_t one = 1;
    atomic_store(&thread->state, (int)state);
    if (write(thread->event_fd, &one, sizeof(one)) < 0)
        return; /* the loop looks at the state each tick all the same */
}

/* The ring and the input are not of one instant: of what was before a cut nothing counts after it.
 */
static void put_pose(struct frame_loop *loop, int source, unsigned cuts, const struct pose *pose)
{
    if ((int)(cuts - loop->cuts) < 0)
        return;
    if (cuts != loop->cuts)
        motion_cut(&loop->motion);
    loop->cuts = cuts;
    motion_put(&loop->motion, source, pose);
}

/* The newest pose comes with the input, too: the ring may have been full. */
static void take_input(struct frame_loop *loop)
{
    struct arrived arrived;
    while (ring_take(&loop->thread->poses, &arrived))
        put_pose(loop, arrived.source, arrived.cuts, &arrived.pose);
    if (!latest_take(&loop->thread->input, &loop->input))
        return;
    motion_set_params(&loop->motion, &loop->input.motion);
    motion_set_live(&loop->motion, loop->input.live);
    if (loop->input.pose.receive_ns)
        put_pose(loop, loop->input.source, loop->input.cuts, &loop->input.pose);
    channel_set_visibility(loop->channel, loop->input.visibility_m);
    channel_set_geometry(loop->channel, &loop->input.geometry);
}

static void take_traffic(struct frame_loop *loop, nsec_t frame_ns)
{
    if (loop->input.frozen ||
        (!latest_take(&loop->thread->traffic, &loop->traffic) && loop->traffic.count == 0))
        return;
    entities_from_traffic(&loop->traffic, &loop->thread->params.entity_types, frame_ns,
                          loop->entities);
    renderer_set_entities(channel_renderer(loop->channel), loop->entities, loop->traffic.count);
}

/* False where time is up. */
static bool wait_for_host(struct render_thread *thread, nsec_t until_ns)
{
    const struct timespec until = {.tv_sec = until_ns / NSEC_PER_SEC,
                                   .tv_nsec = until_ns % NSEC_PER_SEC};
    int r;
    do
        r = sem_clockwait(&thread->go, CLOCK_MONOTONIC, &until);
    while (r < 0 && errno == EINTR);
    return r == 0;
}

/* What the picture that is drawn next is of: the host's frame, or a tick. */
static struct swap_label label_of(const struct frame_loop *loop, nsec_t frame_ns)
{
    struct swap_label label = {SWAP_HOST, loop->input.host_frame};
    if (loop->input.wait_ns > 0)
        return label;
    label.base = SWAP_TICKS;
    clock_tick_near(frame_ns, clock_monotonic_ns(), clock_realtime_ns(), loop->period_ns,
                    &label.number);
    return label;
}

/* Channels in step hear one host, not all of them as the one that it answers: what counts is that
 * it has said something that they have not shown. */
static void wait_in_step(struct frame_loop *loop, nsec_t frame_ns, nsec_t until_ns)
{
    do
        take_input(loop);
    while (swap_lock_was_shown(&loop->swap->lock, label_of(loop, frame_ns)) &&
           wait_for_host(loop->thread, until_ns));
}

/* This channel answers the host, and what the host said last has not been shown: it is a frame
 * ahead, and would stay so, and channels would differ in which of two frames they find, if it were
 * asked for another. */
static bool host_is_ahead(const struct frame_loop *loop, nsec_t frame_ns)
{
    return loop->swap && loop->input.wait_ns > 0 && swap_lock_speaks(&loop->swap->lock) &&
           !swap_lock_was_shown(&loop->swap->lock, label_of(loop, frame_ns));
}

/* Tells the event loop that a frame begins, and waits for the host that leads, if one does. */
static void begin_frame(struct frame_loop *loop, nsec_t frame_ns)
{
    struct render_thread *thread = loop->thread;
    if (!loop->input.tells_begin || host_is_ahead(loop, frame_ns))
        return;
    while (sem_trywait(&thread->go) == 0)
        ; /* an answer that came after its time */
    atomic_store(&thread->begun_ns, frame_ns);
    atomic_store(&thread->speaks, !loop->swap || swap_lock_speaks(&loop->swap->lock));
    if (eventfd_write(thread->begin_fd, 1) < 0 || loop->input.wait_ns == 0)
        return;
    nsec_t until_ns = clock_monotonic_ns() + loop->input.wait_ns;
    if (loop->swap) {
        wait_in_step(loop, frame_ns, until_ns);
    } else {
        wait_for_host(thread, until_ns);
        take_input(loop);
    }
}

/* Deadlines and the transport delay go by what is seen, the governor by what it can govern. Returns
 * by how many ticks that is later with which others wait for this channel; else 0. */
static unsigned show_in_step(struct frame_loop *loop, nsec_t frame_ns, struct channel_frame *frame)
{
    if (!loop->swap)
        return 0;
    swap_link_show(loop->swap, label_of(loop, frame_ns));
    channel_show(loop->channel);
    frame->finished_ns = clock_monotonic_ns();
    loop->sample.swap = swap_link_status(loop->swap);
    return loop->input.wait_ns > 0 ? 0 : swap_lock_ahead(&loop->swap->lock);
}

static void choose_pose(struct frame_loop *loop, nsec_t frame_ns)
{
    if (loop->input.frozen && loop->sample.frame > 0)
        return;
    if (!motion_show(&loop->motion, frame_ns, &loop->shown))
        loop->shown = loop->input.pose;
    loop->shown_utc_ns = frame_ns + loop->input.utc_offset_ns;
}

static void take_snapshot(struct frame_loop *loop, const struct view *view)
{
    if (!loop->output)
        return;
    bool wanted = loop->input.snapshot != loop->snapshot;
    if (frame_output_offer(loop->output, wanted ? channel_renderer(loop->channel) : NULL,
                           loop->input.snapshot, view))
        loop->snapshot = loop->input.snapshot;
}

/* `ticks`: to the next one that is drawn. */
static void fill_sample(struct frame_loop *loop, const struct channel_frame *frame, nsec_t tick_ns,
                        uint64_t ticks)
{
    struct frame_sample *sample = &loop->sample;
    struct loader_counts counts;
    struct image_loader_counts images;
    renderer_loader_counts(channel_renderer(loop->channel), &counts);
    renderer_image_counts(channel_renderer(loop->channel), &images);
    nsec_t reached_ns = loop->shown.receive_ns;
    bool first = reached_ns && reached_ns != loop->reached_ns;
    sample->frame++;
    sample->missed += ticks - 1;
    sample->late = frame->finished_ns - tick_ns >= loop->period_ns;
    sample->finished_ns = frame->finished_ns;
    sample->frame_ms = frame->frame_ms;
    sample->cpu_ms = frame->cpu_ms;
    sample->gpu_ms = frame->renderer.gpu_ms;
    sample->pixel_error = frame->renderer.pixel_error;
    sample->reduced = governor_trades(&loop->governor);
    sample->transport_ns = first ? frame->finished_ns - reached_ns : -1;
    sample->position = loop->shown.position;
    sample->attitude = loop->shown.attitude;
    sample->height_above_terrain_m = frame->renderer.height_above_terrain_m;
    sample->complete = frame->renderer.complete;
    sample->tiles_resident = (unsigned)counts.tiles_resident;
    sample->tiles_pending = (unsigned)counts.tiles_pending;
    sample->terrain_errors = counts.read_errors + images.read_errors;
    if (sample->frame % loop->gpu_memory_every == 1)
        sample->gpu_mib = gl_memory_used_mib(channel_gl(loop->channel));
    if (first)
        loop->reached_ns = reached_ns;
}

/* Draws the frame of the tick at `tick_ns`, which is to be seen one period later. Returns the tick
 * to draw at next: the ticks that have passed meanwhile are missed, not made up for, unless other
 * channels wait with one of them. */
static nsec_t draw_frame(struct frame_loop *loop, nsec_t tick_ns, bool *ret_failed)
{
    struct channel_frame frame;
    nsec_t frame_ns = tick_ns + loop->period_ns;
    take_input(loop);
    begin_frame(loop, frame_ns);
    take_traffic(loop, frame_ns);
    choose_pose(loop, frame_ns);
    struct pose next = loop->shown;
    if (!loop->input.frozen)
        motion_at(&loop->motion, frame_ns + loop->period_ns, &next);
    channel_draw(loop->channel, &loop->shown, &next, loop->shown_utc_ns, false, &frame);
    uint64_t ticks = show_in_step(loop, frame_ns, &frame);
    if (ticks == 0)
        ticks = 1 + (uint64_t)((frame.finished_ns - tick_ns) / loop->period_ns);
    renderer_set_pixel_error(
        channel_renderer(loop->channel),
        governor_next(&loop->governor, frame.frame_ms, frame.renderer.pixel_error));
    take_snapshot(loop, &frame.view);
    fill_sample(loop, &frame, tick_ns, ticks);
    *ret_failed = frame.renderer.failed;
    return tick_ns + (nsec_t)ticks * loop->period_ns;
}

/* Channels whose system clocks agree draw at the same ticks, also where nothing else joins them. */
static nsec_t tick_near(const struct frame_loop *loop, nsec_t time_ns)
{
    return clock_tick_near(time_ns, clock_monotonic_ns(), clock_realtime_ns(), loop->period_ns,
                           NULL);
}

static bool run_frames(struct frame_loop *loop)
{
    struct render_thread *thread = loop->thread;
    bool failed = false;
    nsec_t tick_ns = tick_near(loop, clock_monotonic_ns());
    while (!failed && !atomic_load_explicit(&thread->stopping, memory_order_relaxed)) {
        clock_sleep_until(tick_ns);
        tick_ns = tick_near(loop, draw_frame(loop, tick_ns, &failed));
        ring_put(&thread->samples, &loop->sample);
        notify_beat(thread->params.notify);
    }
    return failed;
}

/* Frames before time is taken: the driver compiles shaders, the terrain of the start position is
 * loaded. */
static void warm_up(struct frame_loop *loop)
{
    struct channel_frame frame;
    nsec_t utc_ns = clock_monotonic_ns() + loop->input.utc_offset_ns;
    for (int i = 0; i < WARM_UP_FRAMES; i++)
        channel_draw(loop->channel, &loop->input.pose, NULL, utc_ns, true, &frame);
}

static int open_output(struct frame_loop *loop)
{
    const struct render_params *params = &loop->thread->params;
    struct frame_output_params output = {.width = params->channel.width,
                                         .height = params->channel.height,
                                         .frames_dir = params->snapshot_directory,
                                         .every = 1};
    if (!params->snapshot_directory)
        return 0;
    return frame_output_open(&output, &loop->output, &loop->thread->output_diag);
}

static void *render_main(void *data)
{
    struct render_thread *thread = data;
    const char *group = thread->params.swap.group;
    struct swap_link swap;
    struct frame_loop loop = {.thread = thread,
                              .period_ns = ns_from_seconds(1.0 / thread->params.rate_hz),
                              .gpu_memory_every =
                                  2 + (uint64_t)(GPU_MEMORY_EVERY_S * thread->params.rate_hz),
                              .input = thread->params.first,
                              .cuts = thread->params.first.cuts};
    thread->params.channel.holds = group && group[0];
    if (channel_create(&thread->params.channel, &loop.channel, &thread->diag) < 0) {
        announce(thread, RENDER_FAILED);
        return NULL;
    }
    motion_init(&loop.motion, &loop.input.motion);
    if (loop.input.pose.receive_ns)
        motion_put(&loop.motion, loop.input.source, &loop.input.pose);
    governor_init(&loop.governor, thread->params.channel.pixel_error,
                  thread->params.pixel_error_most, (double)loop.period_ns * 1e-6);
    thread->gl = *channel_gl(loop.channel);
    snprintf(thread->note, sizeof(thread->note), "%s", channel_note(loop.channel));
    thread->output_error = open_output(&loop);
    warm_up(&loop);
    announce(thread, RENDER_RUNNING);
    if (thread->params.channel.holds) {
        loop.swap = &swap;
        swap_link_open(loop.swap, &thread->params.swap);
    }
    bool failed = run_frames(&loop);
    if (loop.swap)
        swap_link_close(loop.swap);
    int r = frame_output_close(loop.output, &thread->output_diag);
    if (r < 0)
        thread->output_error = r;
    channel_destroy(loop.channel);
    if (failed) {
        diag_set(&thread->diag, -EIO, CHANNEL_LOST);
        announce(thread, RENDER_LOST);
    }
    return NULL;
}

static int start(struct render_thread *thread)
{
    sem_init(&thread->go, 0, 0);
    thread->event_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    thread->begin_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (thread->event_fd < 0 || thread->begin_fd < 0)
        return -errno;
    int r = latest_init(&thread->input, sizeof(struct render_input));
    if (r == 0)
        r = ring_init(&thread->poses, sizeof(struct arrived), RENDER_POSES);
    if (r == 0)
        r = latest_init(&thread->traffic, sizeof(struct traffic));
    if (r == 0)
        r = ring_init(&thread->samples, sizeof(struct frame_sample), RENDER_SAMPLES);
    if (r == 0)
        r = -pthread_create(&thread->thread, NULL, render_main, thread);
    thread->has_thread = r == 0;
    if (r == 0)
        pthread_setname_np(thread->thread, "otwd-render");
    return r;
}

int render_thread_start(const struct render_params *params, struct render_thread **ret_thread,
                        struct diag *diag)
{
    struct render_thread *thread = calloc(1, sizeof(*thread));
    if (!thread)
        return diag_set(diag, -ENOMEM, "no memory for the render thread");
    thread->params = *params;
    thread->event_fd = thread->begin_fd = -1;
    int r = start(thread);
    if (r < 0) {
        diag_set(diag, r, "cannot start the render thread: %s", strerror(-r));
        render_thread_stop(thread, NULL);
        return r;
    }
    *ret_thread = thread;
    return 0;
}

int render_thread_stop(struct render_thread *thread, struct diag *diag)
{
    if (!thread)
        return 0;
    atomic_store(&thread->stopping, true);
    sem_post(&thread->go);
    if (thread->has_thread)
        pthread_join(thread->thread, NULL);
    int r = thread->output_error;
    if (r < 0)
        diag_set(diag, r, "%s", thread->output_diag.text);
    latest_finish(&thread->input);
    ring_finish(&thread->poses);
    latest_finish(&thread->traffic);
    ring_finish(&thread->samples);
    if (thread->event_fd >= 0)
        close(thread->event_fd);
    if (thread->begin_fd >= 0)
        close(thread->begin_fd);
    sem_destroy(&thread->go);
    free(thread);
    return r;
}

int render_thread_fd(const struct render_thread *thread)
{
    return thread->event_fd;
}

enum render_state render_thread_state(struct render_thread *thread, struct diag *ret_diag)
{
    uint64_t count;
    if (read(thread->event_fd, &count, sizeof(count)) < 0 && errno != EAGAIN)
        diag_set(ret_diag, -errno, "the render thread cannot be heard: %s", strerror(errno));
    enum render_state state = (enum render_state)atomic_load(&thread->state);
    if (state == RENDER_FAILED || state == RENDER_LOST)
        *ret_diag = thread->diag;
    return state;
}

int render_thread_begin_fd(const struct render_thread *thread)
{
    return thread->begin_fd;
}

nsec_t render_thread_begun(struct render_thread *thread)
{
    eventfd_t count;
    eventfd_read(thread->begin_fd, &count);
    return atomic_load(&thread->begun_ns);
}

bool render_thread_speaks(const struct render_thread *thread)
{
    return atomic_load(&thread->speaks);
}

void render_thread_go(struct render_thread *thread)
{
    sem_post(&thread->go);
}

const struct gl_facts *render_thread_gl(const struct render_thread *thread)
{
    return &thread->gl;
}

const char *render_thread_note(const struct render_thread *thread)
{
    return thread->note;
}

void render_thread_pose(struct render_thread *thread, int source, unsigned cuts,
                        const struct pose *pose)
{
    struct arrived arrived = {.source = source, .cuts = cuts, .pose = *pose};
    ring_put(&thread->poses, &arrived);
}

void render_thread_publish(struct render_thread *thread, const struct render_input *input)
{
    latest_publish(&thread->input, input);
}

void render_thread_publish_traffic(struct render_thread *thread, const struct traffic *traffic)
{
    latest_publish(&thread->traffic, traffic);
}

bool render_thread_take(struct render_thread *thread, struct frame_sample *ret_sample)
{
    return ring_take(&thread->samples, ret_sample);
}
