#include "daemon/dig_thread.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/worker.h"
#include "terrain/dig_writer.h"

#define QUIET_NS    NSEC_PER_SEC /* without a request, before tiles are stored */
#define BEHIND_MOST 512          /* stamps that wait for that, however many come */
#define NICENESS    10           /* the picture comes first */

struct job {
    struct dig_asker asker;
    struct dig_message message; /* its body is owned */
};

struct dig_thread {
    struct dig_writer *writer;
    struct worker *worker;
    unsigned behind; /* stamps since the last settling; the worker's */
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

/* Stores some tiles. False where all are, or where it cannot be done: it is tried again after the
 * next stamp, and what is seen is right meanwhile. */
static bool settle(void *user)
{
    struct dig_thread *thread = user;
    bool more = dig_writer_settle(thread->writer, NULL) > 0;
    thread->behind = more ? thread->behind : 0;
    return more;
}

static void do_job(void *user, const void *data, void *ret_reply)
{
    struct dig_thread *thread = user;
    const struct job *job = data;
    struct dig_reply *reply = ret_reply;
    struct diag diag = {""};
    const struct dig_message *request = &job->message;
    int64_t number = (int64_t)((uint64_t)request->session << 32 | request->request), id = 0;
    int r = request->kind == DIG_ADD
                ? add(thread, request, number, &id, &diag)
                : dig_writer_undo(thread->writer, request->count, number, &diag);
    *reply = (struct dig_reply){.asker = job->asker,
                                .message = {.kind = DIG_ANSWER,
                                            .session = request->session,
                                            .request = request->request,
                                            .id = (uint64_t)id}};
    if (r < 0) {
        reply->message.status = DIG_STATUS_REFUSED;
        snprintf(reply->message.text, sizeof(reply->message.text), "%.*s", DIG_TEXT_MAX - 1,
                 diag.text[0] ? diag.text : strerror(-r));
        reply->failed = is_failure(r);
    }
    free((void *)request->body);
    thread->behind += r == 0;
    if (thread->behind >= BEHIND_MOST)
        settle(thread);
}

int dig_thread_start(const char *database, struct dig_thread **ret_thread, struct diag *diag)
{
    struct dig_thread *thread = calloc(1, sizeof(*thread));
    if (!thread)
        return diag_set(diag, -ENOMEM, "no memory for digging");
    const struct worker_params params = {.name = "otwd-dig",
                                         .job_size = sizeof(struct job),
                                         .answer_size = sizeof(struct dig_reply),
                                         .capacity = DIG_REQUESTS_MAX,
                                         .niceness = NICENESS,
                                         .finishes = true,
                                         .work = do_job,
                                         .rest = settle,
                                         .quiet_ns = QUIET_NS,
                                         .user = thread};
    int r = dig_writer_open(database, &thread->writer, diag);
    if (r == 0)
        r = worker_start(&params, &thread->worker, diag);
    if (r < 0) {
        dig_thread_stop(thread);
        return r;
    }
    *ret_thread = thread;
    return 0;
}

void dig_thread_stop(struct dig_thread *thread)
{
    if (!thread)
        return;
    worker_stop(thread->worker);
    dig_writer_close(thread->writer);
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
    uint8_t *body = malloc(request->size + 1);
    if (!body)
        return false;
    if (request->size)
        memcpy(body, request->body, request->size);
    job.message.body = body;
    bool asked = worker_ask(thread->worker, &job);
    if (!asked)
        free(body);
    return asked;
}

int dig_thread_fd(const struct dig_thread *thread)
{
    return worker_fd(thread->worker);
}

bool dig_thread_take(struct dig_thread *thread, struct dig_reply *ret_reply)
{
    return worker_take(thread->worker, ret_reply);
}
