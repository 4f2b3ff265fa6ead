#include "base/worker.h"

#include <errno.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#include "base/ring.h"

#define TOLD_AFTER_NS                                                                              \
    (500 * 1000) /* waking the asker for each would cost more than quick jobs do */

struct worker {
    struct worker_params params;
    struct ring jobs, answers;
    void *job, *answer; /* the thread's; owned */
    unsigned waiting;   /* jobs whose answer was not taken; the asker's */
    sem_t woken;
    int event_fd;
    atomic_bool stopping;
    bool has_thread;
    pthread_t thread;
};

static bool is_dropped(struct worker *worker)
{
    return !worker->params.finishes && atomic_load(&worker->stopping);
}

/* Does what waits. False where nothing did. */
static bool do_jobs(struct worker *worker)
{
    const struct worker_params *params = &worker->params;
    nsec_t untold_ns = clock_monotonic_ns();
    bool untold = false, any = false;
    while (!is_dropped(worker) && ring_take(&worker->jobs, worker->job)) {
        params->work(params->user, worker->job, worker->answer);
        ring_put(&worker->answers, worker->answer); /* there is room: no more than `waiting` */
        any = untold = true;
        nsec_t now_ns = clock_monotonic_ns();
        if (now_ns - untold_ns < TOLD_AFTER_NS)
            continue;
        eventfd_write(worker->event_fd, 1);
        untold = false;
        untold_ns = now_ns;
    }
    if (untold)
        eventfd_write(worker->event_fd, 1);
    return any;
}

/* True where somebody has woken it, false after that time; 0 = for ever. */
static bool wait_for_job(struct worker *worker, nsec_t wait_ns)
{
    nsec_t until_ns = clock_monotonic_ns() + wait_ns;
    const struct timespec until = {.tv_sec = until_ns / NSEC_PER_SEC,
                                   .tv_nsec = until_ns % NSEC_PER_SEC};
    int r;
    do
        r = wait_ns > 0 ? sem_clockwait(&worker->woken, CLOCK_MONOTONIC, &until)
                        : sem_wait(&worker->woken);
    while (r < 0 && errno == EINTR);
    return r == 0;
}

static void *worker_main(void *data)
{
    struct worker *worker = data;
    const struct worker_params *params = &worker->params;
    bool rests = params->rest;
    if (params->niceness)
        setpriority(PRIO_PROCESS, (id_t)gettid(), params->niceness);
    for (;;) {
        if (do_jobs(worker))
            rests = params->rest;
        if (atomic_load(&worker->stopping))
            return NULL;
        bool asked = wait_for_job(worker, rests ? params->quiet_ns : 0);
        while (!asked && rests && sem_trywait(&worker->woken) < 0)
            rests = params->rest(params->user);
    }
}

static int start(struct worker *worker, struct diag *diag)
{
    const struct worker_params *params = &worker->params;
    sem_init(&worker->woken, 0, 0);
    worker->event_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (worker->event_fd < 0)
        return diag_set(diag, -errno, "no event descriptor");
    worker->job = malloc(params->job_size);
    worker->answer = malloc(params->answer_size);
    if (!worker->job || !worker->answer ||
        ring_init(&worker->jobs, params->job_size, params->capacity) < 0 ||
        ring_init(&worker->answers, params->answer_size, params->capacity) < 0)
        return diag_set(diag, -ENOMEM, "no memory for the thread %s", params->name);
    int r = -pthread_create(&worker->thread, NULL, worker_main, worker);
    worker->has_thread = r == 0;
    if (r < 0)
        return diag_set(diag, r, "cannot start the thread %s: %s", params->name, strerror(-r));
    pthread_setname_np(worker->thread, params->name);
    return 0;
}

int worker_start(const struct worker_params *params, struct worker **ret_worker, struct diag *diag)
{
    struct worker *worker = calloc(1, sizeof(*worker));
    if (!worker)
        return diag_set(diag, -ENOMEM, "no memory for the thread %s", params->name);
    worker->params = *params;
    int r = start(worker, diag);
    if (r < 0) {
        worker_stop(worker);
        return r;
    }
    *ret_worker = worker;
    return 0;
}

void worker_stop(struct worker *worker)
{
    if (!worker)
        return;
    atomic_store(&worker->stopping, true);
    sem_post(&worker->woken);
    if (worker->has_thread)
        pthread_join(worker->thread, NULL);
    ring_finish(&worker->jobs);
    ring_finish(&worker->answers);
    free(worker->job);
    free(worker->answer);
    sem_destroy(&worker->woken);
    if (worker->event_fd >= 0)
        close(worker->event_fd);
    free(worker);
}

bool worker_ask(struct worker *worker, const void *job)
{
    if (worker->waiting == worker->params.capacity)
        return false;
    ring_put(&worker->jobs, job); /* there is room: no more than `waiting` are in it */
    worker->waiting++;
    sem_post(&worker->woken);
    return true;
}

unsigned worker_waiting(const struct worker *worker)
{
    return worker->waiting;
}

int worker_fd(const struct worker *worker)
{
    return worker->event_fd;
}

bool worker_take(struct worker *worker, void *ret_answer)
{
    eventfd_t count;
    if (!ring_take(&worker->answers, ret_answer)) {
        eventfd_read(worker->event_fd, &count);
        /* One may have come before it was cleared. */
        if (!ring_take(&worker->answers, ret_answer))
            return false;
    }
    worker->waiting--;
    return true;
}
