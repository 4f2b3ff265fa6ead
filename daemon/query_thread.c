#include "daemon/query_thread.h"

#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "base/ring.h"
#include "daemon/terrain_setup.h"
#include "geo/geographic.h"
#include "terrain/database.h"
#include "terrain/query.h"

#define ANSWERS_TOLD 32 /* at once: those behind a line of sight need not wait for all others */

/* A view of the ground for one thread. */
struct ground {
    struct query *query;
    struct geoid *geoid; /* NULL: heights are above the ellipsoid */
};

struct job {
    unsigned asker;
    struct cigi_question question;
};

struct query_thread {
    struct terrain_setup terrain;
    struct ground own;  /* the thread's */
    struct ground loop; /* the event loop's */
    struct ring jobs, replies;
    unsigned waiting; /* jobs without a reply; the event loop's */
    sem_t woken;
    int event_fd;
    atomic_bool stopping;
    bool has_thread;
    pthread_t thread;
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

static void answer_job(struct query_thread *thread, const struct job *job)
{
    const struct cigi_question *question = &job->question;
    struct query_reply reply = {.asker = job->asker, .token = question->token};
    switch (question->ask) {
    case CIGI_ASK_GROUND:
        ask_ground(&thread->own, question, &reply.answer);
        break;
    case CIGI_ASK_SIGHT:
        ask_sight(&thread->own, question, &reply.answer);
        break;
    case CIGI_ASK_SEA:
        reply.answer.known = true;
        reply.answer.height_m =
            undulation_m(&thread->own, question->from.lat_deg, question->from.lon_deg);
        break;
    }
    ring_put(&thread->replies, &reply); /* there is room: no more than `waiting` are in it */
}

/* Answers a few jobs. False where there are none. */
static bool answer_some(struct query_thread *thread)
{
    struct job job;
    unsigned count = 0;
    while (count < ANSWERS_TOLD && ring_take(&thread->jobs, &job)) {
        answer_job(thread, &job);
        count++;
    }
    if (count > 0)
        eventfd_write(thread->event_fd, 1);
    return count > 0;
}

static void *query_main(void *data)
{
    struct query_thread *thread = data;
    while (!atomic_load(&thread->stopping))
        if (!answer_some(thread))
            while (sem_wait(&thread->woken) < 0 && errno == EINTR)
                ;
    return NULL;
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
    if (r == 0)
        r = open_ground(&thread->terrain, params->geoid, &thread->own, diag);
    if (r == 0)
        r = open_ground(&thread->terrain, params->geoid, &thread->loop, diag);
    return r;
}

static int start(struct query_thread *thread, const struct query_thread_params *params,
                 struct diag *diag)
{
    sem_init(&thread->woken, 0, 0);
    thread->event_fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (thread->event_fd < 0)
        return diag_set(diag, -errno, "no event descriptor");
    if (ring_init(&thread->jobs, sizeof(struct job), QUERY_WAITING_MAX) < 0 ||
        ring_init(&thread->replies, sizeof(struct query_reply), QUERY_WAITING_MAX) < 0)
        return diag_set(diag, -ENOMEM, "no memory for questions about the ground");
    int r = open_terrain(thread, params, diag);
    if (r < 0)
        return r;
    r = -pthread_create(&thread->thread, NULL, query_main, thread);
    thread->has_thread = r == 0;
    return r < 0 ? diag_set(diag, r, "cannot start the thread for questions: %s", strerror(-r)) : 0;
}

int query_thread_start(const struct query_thread_params *params, struct query_thread **ret_thread,
                       struct diag *diag)
{
    struct query_thread *thread = calloc(1, sizeof(*thread));
    if (!thread)
        return diag_set(diag, -ENOMEM, "no memory for questions about the ground");
    int r = start(thread, params, diag);
    if (r < 0) {
        query_thread_stop(thread);
        return r;
    }
    pthread_setname_np(thread->thread, "otwd-query");
    *ret_thread = thread;
    return 0;
}

void query_thread_stop(struct query_thread *thread)
{
    if (!thread)
        return;
    atomic_store(&thread->stopping, true);
    sem_post(&thread->woken);
    if (thread->has_thread)
        pthread_join(thread->thread, NULL);
    close_ground(&thread->own);
    close_ground(&thread->loop);
    terrain_setup_close(&thread->terrain);
    ring_finish(&thread->jobs);
    ring_finish(&thread->replies);
    sem_destroy(&thread->woken);
    if (thread->event_fd >= 0)
        close(thread->event_fd);
    free(thread);
}

bool query_thread_ask(struct query_thread *thread, unsigned asker,
                      const struct cigi_question *question)
{
    const struct job job = {.asker = asker, .question = *question};
    if (thread->waiting == QUERY_WAITING_MAX)
        return false;
    ring_put(&thread->jobs, &job); /* there is room: no more than `waiting` are in it */
    thread->waiting++;
    sem_post(&thread->woken);
    return true;
}

int query_thread_fd(const struct query_thread *thread)
{
    return thread->event_fd;
}

bool query_thread_take(struct query_thread *thread, struct query_reply *ret_reply)
{
    eventfd_t count;
    if (!ring_take(&thread->replies, ret_reply)) {
        eventfd_read(thread->event_fd, &count);
        /* One may have come before it was cleared. */
        if (!ring_take(&thread->replies, ret_reply))
            return false;
    }
    thread->waiting--;
    return true;
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
