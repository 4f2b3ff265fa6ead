#include "daemon/query_thread.h"

#include <assert.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <sys/epoll.h>
#include <unistd.h>

#include "base/worker.h"
#include "daemon/terrain_setup.h"
#include "geo/geographic.h"
#include "terrain/database.h"
#include "terrain/query.h"

#define NICENESS 5 /* the picture comes first */

/* A view of the ground for one thread. */
struct ground {
    struct query *query;
    struct geoid *geoid; /* NULL: heights are above the ellipsoid */
};

struct job {
    unsigned asker;
    struct cigi_question question;
};

struct answerer {
    struct ground ground; /* its thread's */
    struct worker *worker;
};

struct query_thread {
    struct terrain_setup terrain;
    struct answerer answerers[QUERY_THREADS_MAX];
    unsigned count;
    unsigned taken_from; /* whose answers are taken: all that are there, before the next one's */
    int event_fd;        /* an epoll of theirs */
    struct ground loop;  /* the event loop's */
};

static double undulation_m(const struct ground *ground, double lat_deg, double lon_deg)
{
    return ground->geoid
               ? geoid_undulation_m(ground->geoid, lat_deg, longitude_normalised_deg(lon_deg))
               : 0.0;
}

static void take_details(const struct query_answer *found, struct cigi_answer *answer)
{
    for (int i = 0; i < 3; i++)
        answer->normal_enu[i] = (double)found->normal_enu[i];
    answer->material = found->material;
}

static void ask_ground(struct ground *ground, const struct cigi_question *question,
                       struct cigi_answer *answer)
{
    const struct geodetic *at = &question->from;
    struct query_answer found;
    if (query_height(ground->query, at->lat_deg, at->lon_deg, QUERY_NORMAL, &found) < 0 ||
        isnan(found.height_m))
        return;
    answer->known = true;
    answer->height_m = found.height_m + undulation_m(ground, at->lat_deg, at->lon_deg);
    take_details(&found, answer);
}

static void ask_sight(struct ground *ground, const struct cigi_question *question,
                      struct cigi_answer *answer)
{
    struct query_sight sight;
    unsigned flags = question->detailed ? QUERY_NORMAL : 0;
    if (query_sight(ground->query, &question->from, &question->to, flags, &sight) < 0)
        return;
    answer->known = true;
    answer->hit = sight.hit;
    answer->distance_m = sight.distance_m;
    answer->at = sight.at;
    if (sight.hit && question->detailed)
        take_details(&sight.ground, answer);
}

static void answer_job(void *user, const void *data, void *ret_reply)
{
    struct ground *ground = &((struct answerer *)user)->ground;
    const struct job *job = data;
    const struct cigi_question *question = &job->question;
    struct query_reply *reply = ret_reply;
    *reply = (struct query_reply){.asker = job->asker, .token = question->token};
    switch (question->ask) {
    case CIGI_ASK_GROUND:
        ask_ground(ground, question, &reply->answer);
        break;
    case CIGI_ASK_SIGHT:
        ask_sight(ground, question, &reply->answer);
        break;
    case CIGI_ASK_SEA:
        reply->answer.known = true;
        reply->answer.height_m =
            undulation_m(ground, question->from.lat_deg, question->from.lon_deg);
        break;
    }
}

/* Tiles that come are found there by the next question. */
static void on_arrival(void *user)
{
    (void)user;
}

static int open_ground(const struct terrain_setup *terrain, const char *geoid,
                       struct ground *ground, struct diag *diag)
{
    bool is_database = terrain->fallback;
    int r = geoid_setup_open(geoid, &ground->geoid, diag);
    struct query_params params = {.database = is_database ? terrain->source : NULL,
                                  .fallback = is_database ? terrain->fallback : terrain->source,
                                  .geoid = ground->geoid};
    if (r == 0 && query_create(&params, &ground->query) < 0)
        r = diag_set(diag, -ENOMEM, "no memory for questions about the ground");
    return r;
}

static void close_ground(struct ground *ground)
{
    query_destroy(ground->query);
    geoid_close(ground->geoid);
}

static int open_terrain(struct query_thread *thread, const struct query_thread_params *params,
                        struct diag *diag)
{
    struct terrain_source *source;
    int r =
        terrain_setup_open(params->terrain_path, "none", params->cache_mib, &thread->terrain, diag);
    if (r < 0)
        return r;
    source = thread->terrain.source;
    if (params->dig && dig_of_source(source))
        database_source_share_dig(source, params->dig);
    if (source->ops->stream)
        r = source->ops->stream(source, on_arrival, NULL, diag);
    return r < 0 ? r : open_ground(&thread->terrain, params->geoid, &thread->loop, diag);
}

static int start_answerer(struct query_thread *thread, const char *geoid, struct diag *diag)
{
    struct answerer *answerer = &thread->answerers[thread->count++];
    const struct worker_params params = {.name = "otwd-query",
                                         .job_size = sizeof(struct job),
                                         .answer_size = sizeof(struct query_reply),
                                         .capacity = QUERY_WAITING_MAX,
                                         .niceness = NICENESS,
                                         .work = answer_job,
                                         .user = answerer};
    struct epoll_event event = {.events = EPOLLIN};
    int r = open_ground(&thread->terrain, geoid, &answerer->ground, diag);
    if (r == 0)
        r = worker_start(&params, &answerer->worker, diag);
    if (r == 0 &&
        epoll_ctl(thread->event_fd, EPOLL_CTL_ADD, worker_fd(answerer->worker), &event) < 0)
        r = diag_set(diag, -errno, "no event descriptor");
    return r;
}

int query_thread_start(const struct query_thread_params *params, struct query_thread **ret_thread,
                       struct diag *diag)
{
    struct query_thread *thread = calloc(1, sizeof(*thread));
    if (!thread)
        return diag_set(diag, -ENOMEM, "no memory for questions about the ground");
    assert(params->threads <= QUERY_THREADS_MAX);
    thread->event_fd = epoll_create1(EPOLL_CLOEXEC);
    int r = thread->event_fd < 0 ? diag_set(diag, -errno, "no event descriptor")
                                 : open_terrain(thread, params, diag);
    for (unsigned i = 0; r == 0 && i < (params->threads ? params->threads : 1); i++)
        r = start_answerer(thread, params->geoid, diag);
    if (r < 0) {
        query_thread_stop(thread);
        return r;
    }
    *ret_thread = thread;
    return 0;
}

void query_thread_stop(struct query_thread *thread)
{
    if (!thread)
        return;
    for (unsigned i = 0; i < thread->count; i++) {
        worker_stop(thread->answerers[i].worker);
        close_ground(&thread->answerers[i].ground);
    }
    close_ground(&thread->loop);
    terrain_setup_close(&thread->terrain);
    if (thread->event_fd >= 0)
        close(thread->event_fd);
    free(thread);
}

bool query_thread_ask(struct query_thread *thread, unsigned asker,
                      const struct cigi_question *question)
{
    const struct job job = {.asker = asker, .question = *question};
    struct worker *idlest = thread->answerers[0].worker;
    for (unsigned i = 1; i < thread->count; i++)
        if (worker_waiting(thread->answerers[i].worker) < worker_waiting(idlest))
            idlest = thread->answerers[i].worker;
    return worker_ask(idlest, &job);
}

int query_thread_fd(const struct query_thread *thread)
{
    return thread->event_fd;
}

bool query_thread_take(struct query_thread *thread, struct query_reply *ret_reply)
{
    for (unsigned i = 0; i < thread->count; i++) {
        if (worker_take(thread->answerers[thread->taken_from].worker, ret_reply))
            return true;
        thread->taken_from = (thread->taken_from + 1) % thread->count;
    }
    return false;
}

int query_thread_ground_at(void *data, double lat_deg, double lon_deg, double *ret_height_m,
                           double ret_normal_enu[3])
{
    const struct query_thread *thread = data;
    struct query_answer found;
    int r =
        query_height(thread->loop.query, lat_deg, lon_deg, QUERY_NORMAL | QUERY_NO_WAIT, &found);
    if (r < 0)
        return r;
    if (isnan(found.height_m))
        return -ENODATA;
    *ret_height_m = found.height_m + undulation_m(&thread->loop, lat_deg, lon_deg);
    for (int i = 0; i < 3; i++)
        ret_normal_enu[i] = (double)found.normal_enu[i];
    return 0;
}
