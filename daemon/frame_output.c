#include "daemon/frame_output.h"

#include <errno.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/ring.h"
#include "daemon/image_file.h"
#include "daemon/video_pipe.h"
#include "render/geo_pixels.h"
#include "render/readback.h"

#define JOBS        6
#define WRITER_NICE 10 /* pictures wait for the picture that is being drawn */

struct job {
    uint64_t frame;
    bool last; /* no frame: the writer ends */
    struct view view;
    uint8_t *rgba;
    float *depth;
};

struct frame_output {
    struct frame_output_params params;
    struct readback *colour, *depth;
    struct video_pipe *video;
    double *geo; /* [height][width][3], the writer's */
    struct job jobs[JOBS];
    struct ring waiting, free; /* of struct job * */
    sem_t waits, freed;
    struct view views[READBACK_SLOTS]; /* of the frames being read back */
    unsigned started, passed;          /* read-backs; modulo READBACK_SLOTS they index views */
    bool has_thread;
    pthread_t thread;
    atomic_int error; /* the writer's first; `diag` is read after it has ended */
    struct diag diag;
};

static bool pictured(const struct frame_output *output, uint64_t frame)
{
    return (output->params.frames_dir || output->params.geo_dir) &&
           frame % output->params.every == 0;
}

static bool in_report(const struct frame_output *output, uint64_t frame)
{
    return output->params.report_dir && frame % output->params.report_every == 0;
}

static int write_png(struct frame_output *output, const struct job *job, const char *directory)
{
    char path[4096];
    snprintf(path, sizeof(path), "%s/frame-%06llu.png", directory, (unsigned long long)job->frame);
    return image_write_png(path, output->params.width, output->params.height, job->rgba,
                           &output->diag);
}

static int write_pictures(struct frame_output *output, const struct job *job)
{
    const struct frame_output_params *params = &output->params;
    char path[4096];
    int r = 0;
    if (params->frames_dir)
        r = write_png(output, job, params->frames_dir);
    if (r == 0 && params->geo_dir) {
        geo_pixels_from_depth(&job->view, job->depth, params->width, params->height, output->geo);
        snprintf(path, sizeof(path), "%s/frame-%06llu.tif", params->geo_dir,
                 (unsigned long long)job->frame);
        r = image_write_geo(path, params->width, params->height, output->geo, &output->diag);
    }
    return r;
}

static void *writer_main(void *data)
{
    struct frame_output *output = data;
    setpriority(PRIO_PROCESS, (id_t)gettid(), WRITER_NICE);
    for (;;) {
        struct job *job = NULL;
        while (sem_wait(&output->waits) < 0 && errno == EINTR)
            ;
        if (!ring_take(&output->waiting, &job) || job->last)
            return NULL;
        if (output->error == 0 && pictured(output, job->frame))
            output->error = write_pictures(output, job);
        if (output->error == 0 && in_report(output, job->frame))
            output->error = write_png(output, job, output->params.report_dir);
        if (output->error == 0 && output->video)
            output->error = video_pipe_write(output->video, job->rgba, &output->diag);
        ring_put(&output->free, &job);
        sem_post(&output->freed);
    }
}

static struct job *free_job(struct frame_output *output)
{
    struct job *job = NULL;
    while (sem_wait(&output->freed) < 0 && errno == EINTR)
        ;
    ring_take(&output->free, &job);
    return job;
}

static void hand_over(struct frame_output *output, struct job *job)
{
    ring_put(&output->waiting, &job);
    sem_post(&output->waits);
}

static int make_directory(const char *path, struct diag *diag)
{
    struct stat status;
    if (!path || mkdir(path, 0777) == 0)
        return 0;
    if (errno == EEXIST && stat(path, &status) == 0 && S_ISDIR(status.st_mode))
        return 0;
    return diag_set(diag, -errno, "%s: cannot make the directory: %s", path, strerror(errno));
}

static int allocate(struct frame_output *output, struct diag *diag)
{
    const struct frame_output_params *params = &output->params;
    size_t pixels = (size_t)params->width * (size_t)params->height;
    int r = ring_init(&output->waiting, sizeof(struct job *), JOBS + 1);
    if (r == 0)
        r = ring_init(&output->free, sizeof(struct job *), JOBS);
    for (int i = 0; i < JOBS && r == 0; i++) {
        struct job *job = &output->jobs[i];
        job->rgba = malloc(pixels * 4);
        job->depth = params->geo_dir ? malloc(pixels * sizeof(float)) : NULL;
        if (!job->rgba || (params->geo_dir && !job->depth))
            r = -ENOMEM;
        ring_put(&output->free, &job);
        sem_post(&output->freed);
    }
    if (r == 0 && params->geo_dir && !(output->geo = malloc(pixels * 3 * sizeof(double))))
        r = -ENOMEM;
    return r < 0 ? diag_set(diag, r, "no memory for writing frames") : 0;
}

int frame_output_open(const struct frame_output_params *params, struct frame_output **ret_output,
                      struct diag *diag)
{
    struct frame_output *output = calloc(1, sizeof(*output));
    if (!output)
        return diag_set(diag, -ENOMEM, "no memory for writing frames");
    output->params = *params;
    if (output->params.every == 0)
        output->params.every = 1;
    if (output->params.report_every == 0)
        output->params.report_every = 1;
    sem_init(&output->waits, 0, 0);
    sem_init(&output->freed, 0, 0);
    int r = make_directory(params->frames_dir, diag);
    if (r == 0)
        r = make_directory(params->geo_dir, diag);
    if (r == 0)
        r = make_directory(params->report_dir, diag);
    if (r == 0)
        r = allocate(output, diag);
    if (r == 0)
        r = readback_create(params->width, params->height, READBACK_COLOUR, &output->colour, diag);
    if (r == 0 && params->geo_dir)
        r = readback_create(params->width, params->height, READBACK_DEPTH, &output->depth, diag);
    if (r == 0 && params->video_path)
        r = video_pipe_open(params->video_path, params->width, params->height,
                            params->video_rate_hz, &output->video, diag);
    if (r == 0) {
        r = -pthread_create(&output->thread, NULL, writer_main, output);
        output->has_thread = r == 0;
        if (r < 0)
            diag_set(diag, r, "cannot start the frame writer: %s", strerror(-r));
        else
            pthread_setname_np(output->thread, "otwd-frames");
    }
    if (r < 0) {
        frame_output_close(output, NULL);
        return r;
    }
    *ret_output = output;
    return 0;
}

/* Moves the oldest finished read-back to the writer; false where there is none. */
static bool pass_on(struct frame_output *output, bool wait)
{
    uint64_t frame, depth_frame;
    const void *rgba = readback_take(output->colour, wait, &frame);
    if (!rgba)
        return false;
    size_t bytes = (size_t)output->params.width * (size_t)output->params.height * 4;
    struct job *job = free_job(output);
    job->frame = frame;
    job->view = output->views[output->passed++ % READBACK_SLOTS];
    memcpy(job->rgba, rgba, bytes);
    readback_release(output->colour);
    if (output->depth && pictured(output, frame)) {
        const void *depth = readback_take(output->depth, true, &depth_frame);
        if (depth) {
            memcpy(job->depth, depth, bytes);
            readback_release(output->depth);
        }
    }
    hand_over(output, job);
    return true;
}

void frame_output_take(struct frame_output *output, struct renderer *renderer, uint64_t frame,
                       const struct view *view)
{
    while (pass_on(output, false))
        ;
    if (!pictured(output, frame) && !in_report(output, frame) && !output->video)
        return;
    while (!readback_start(output->colour, renderer_framebuffer(renderer), frame))
        pass_on(output, true);
    output->views[output->started++ % READBACK_SLOTS] = *view;
    if (output->depth && pictured(output, frame))
        readback_start(output->depth, renderer_depth_framebuffer(renderer), frame);
}

bool frame_output_offer(struct frame_output *output, struct renderer *renderer, uint64_t frame,
                        const struct view *view)
{
    while (ring_count(&output->free) > 0 && pass_on(output, false))
        ;
    if (!renderer)
        return true;
    if (!readback_start(output->colour, renderer_framebuffer(renderer), frame))
        return false;
    output->views[output->started++ % READBACK_SLOTS] = *view;
    return true;
}

int frame_output_error(const struct frame_output *output)
{
    return atomic_load(&output->error);
}

int frame_output_close(struct frame_output *output, struct diag *diag)
{
    if (!output)
        return 0;
    if (output->has_thread) {
        while (pass_on(output, true))
            ;
        struct job last = {.last = true};
        hand_over(output, &last);
        pthread_join(output->thread, NULL);
    }
    int r = video_pipe_close(output->video, &output->diag);
    if (output->error < 0)
        r = output->error;
    if (r < 0)
        diag_set(diag, r, "%s", output->diag.text);
    readback_destroy(output->colour);
    readback_destroy(output->depth);
    for (int i = 0; i < JOBS; i++) {
        free(output->jobs[i].rgba);
        free(output->jobs[i].depth);
    }
    ring_finish(&output->waiting);
    ring_finish(&output->free);
    sem_destroy(&output->waits);
    sem_destroy(&output->freed);
    free(output->geo);
    free(output);
    return r;
}
