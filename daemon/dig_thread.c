#include "daemon/dig_thread.h"

#include <errno.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/ring.h"
#include "terrain/dig_writer.h"

#define QUIET_S     1   /* without a request, before tiles are stored */
#define BEHIND_MOST 512 /* stamps that wait for that, however many come */
#define NICENESS    10  /* the picture comes first */

struct job {
    struct dig_asker asker;
    struct dig_message message; /* its body is owned */
};

struct dig_thread {
    struct dig_writer *writer;
    struct ring jobs, replies;
    unsigned waiting; /* jobs without a reply; the event loop's */
    sem_t woken;
    int event_fd;
    atomic_bool stopping;
    bool has_thread;
    unsigned behind; /* stamps since the last settling; the thread's */
    pthread_t thread;
};

/* Nothing about the request is wrong: the database is. */
static bool is_failure(int r)
{
    return r < 0 && r != -EINVAL && r != -EBADMSG && r != -EPROTONOSUPPORT && r != -E2BIG &&
           r != -ENOBUFS;
}

static int add(struct dig_thread *thread, const struct dig_message *request, int64_t number,
               int64_t *ret_id, struct diag *diag)
{
    struct stamp stamp;
    int r = stamp_decode(request->body, request->size, &stamp, diag);
    if (r < 0)
        return r;
    r = dig_writer_add(thread->writer, &stamp, number, ret_id, diag);
    stamp_finish(&stamp);
    return r;
}

static void do_job(struct dig_thread *thread, struct job *job)
{
    struct diag diag = {""};
    const struct dig_message *request = &job->message;
    struct dig_reply reply = {
        .asker = job->asker,
        .message = {.kind = DIG_ANSWER, .session = request->session, .request = request->request}};
    int64_t number = (int64_t)((uint64_t)request->session << 32 | request->request), id = 0;
    int r = request->kind == DIG_ADD
                ? add(thread, request, number, &id, &diag)
                : dig_writer_undo(thread->writer, request->count, number, &diag);
    if (r < 0) {
        reply.message.status = DIG_STATUS_REFUSED;
        snprintf(reply.message.text, sizeof(reply.message.text), "%.*s", DIG_TEXT_MAX - 1,
                 diag.text[0] ? diag.text : strerror(-r));
        reply.failed = is_failure(r);
    }
    reply.message.id = (uint64_t)id;
    thread->behind += r == 0;
    free((void *)request->body);
    uint64_t one = 1;
    ring_put(&thread->replies, &reply);
    if (write(thread->event_fd, &one, sizeof(one)) < 0)
        return; /* full: the loop will wake up all the same */
}

/* False after a while without a request. */
static bool wait_for_request(struct dig_thread *thread, bool forever)
{
    struct timespec until;
    int r;
    clock_gettime(CLOCK_REALTIME, &until);
    until.tv_sec += QUIET_S;
    do
        r = forever ? sem_wait(&thread->woken) : sem_timedwait(&thread->woken, &until);
    while (r < 0 && errno == EINTR);
    return r == 0;
}

/* Stores some tiles. False where all are, or where it cannot be done: it is tried again after the
 * next stamp, and what is seen is right meanwhile. */
static bool settle(struct dig_thread *thread)
{
    bool more = dig_writer_settle(thread->writer, NULL) > 0;
    thread->behind = more ? thread->behind : 0;
    return more;
}

static void *dig_main(void *data)
{
    struct dig_thread *thread = data;
    bool settled = false;
    setpriority(PRIO_PROCESS, (id_t)gettid(), NICENESS);
    for (;;) {
        struct job job;
        /* Whoever looked for a request while it stored tiles may have had what woke it. */
        bool asked = ring_count(&thread->jobs) > 0 || atomic_load(&thread->stopping) ||
                     wait_for_request(thread, settled);
        while (ring_take(&thread->jobs, &job)) {
            do_job(thread, &job);
            settled = false;
            if (thread->behind >= BEHIND_MOST)
                settle(thread);
        }
        if (atomic_load(&thread->stopping))
            return NULL;
        while (!asked && !settled && sem_trywait(&thread->woken) < 0)
            settled = !settle(thread);
    }
}

int dig_thread_start(const char *database, struct dig_thread **ret_thread, struct diag *diag)
{
    struct dig_thread *thread = calloc(1, sizeof(*thread));
    if (!thread)
        return diag_set(diag, -ENOMEM, "no memory for digging");
    sem_init(&thread->woken, 0, 0);
    thread->event_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    int r = thread->event_fd < 0 ? diag_set(diag, -errno, "no event descriptor") : 0;
    if (r == 0 && (ring_init(&thread->jobs, sizeof(struct job), DIG_REQUESTS_MAX) < 0 ||
                   ring_init(&thread->replies, sizeof(struct dig_reply), DIG_REQUESTS_MAX) < 0))
        r = diag_set(diag, -ENOMEM, "no memory for digging");
    if (r == 0)
        r = dig_writer_open(database, &thread->writer, diag);
    if (r == 0) {
        r = -pthread_create(&thread->thread, NULL, dig_main, thread);
        if (r < 0)
            diag_set(diag, r, "cannot start the thread that digs: %s", strerror(-r));
        thread->has_thread = r == 0;
    }
    if (r < 0) {
        dig_thread_stop(thread);
        return r;
    }
    pthread_setname_np(thread->thread, "otwd-dig");
    *ret_thread = thread;
    return 0;
}

void dig_thread_stop(struct dig_thread *thread)
{
    if (!thread)
        return;
    atomic_store(&thread->stopping, true);
    sem_post(&thread->woken);
    if (thread->has_thread)
        pthread_join(thread->thread, NULL);
    dig_writer_close(thread->writer);
    ring_finish(&thread->jobs);
    ring_finish(&thread->replies);
    sem_destroy(&thread->woken);
    if (thread->event_fd >= 0)
        close(thread->event_fd);
    free(thread);
}

struct dig *dig_thread_ground(struct dig_thread *thread)
{
    return dig_writer_ground(thread->writer);
}

bool dig_thread_ask(struct dig_thread *thread, const struct dig_message *request,
                    const struct dig_asker *asker)
{
    struct job job = {.asker = *asker, .message = *request};
    if (thread->waiting == DIG_REQUESTS_MAX)
        return false;
    uint8_t *body = malloc(request->size + 1);
    if (!body)
        return false;
    if (request->size)
        memcpy(body, request->body, request->size);
    job.message.body = body;
    ring_put(&thread->jobs, &job); /* there is room: no more than `waiting` are in it */
    thread->waiting++;
    sem_post(&thread->woken);
    return true;
}

int dig_thread_fd(const struct dig_thread *thread)
{
    return thread->event_fd;
}

bool dig_thread_take(struct dig_thread *thread, struct dig_reply *ret_reply)
{
    uint64_t count;
    if (read(thread->event_fd, &count, sizeof(count)) < 0 && errno != EAGAIN)
        return false;
    if (!ring_take(&thread->replies, ret_reply))
        return false;
    thread->waiting--;
    return true;
}
