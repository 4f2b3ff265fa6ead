#include "daemon/query_thread.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "base/worker.h"
#include "daemon/terrain_setup.h"
#include "geo/geographic.h"
#include "terrain/database.h"
#include "terrain/query.h"

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
    struct ground own;  /* the worker's */
    struct ground loop; /* the event loop's */
    struct worker *worker;
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
    struct query_thread *thread = user;
    const struct job *job = data;
    const struct cigi_question *question = &job->question;
    struct query_reply *reply = ret_reply;
    *reply = (struct query_reply){.asker = job->asker, .token = question->token};
    switch (question->ask) {
    case CIGI_ASK_GROUND:
        ask_ground(&thread->own, question, &reply->answer);
        break;
    case CIGI_ASK_SIGHT:
        ask_sight(&thread->own, question, &reply->answer);
        break;
    case CIGI_ASK_SEA:
        reply->answer.known = true;
        reply->answer.height_m =
            undulation_m(&thread->own, question->from.lat_deg, question->from.lon_deg);
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
    if (r == 0)
        r = open_ground(&thread->terrain, params->geoid, &thread->own, diag);
    if (r == 0)
        r = open_ground(&thread->terrain, params->geoid, &thread->loop, diag);
    return r;
}

int query_thread_start(const struct query_thread_params *params, struct query_thread **ret_thread,
                       struct diag *diag)
{
    struct query_thread *thread = calloc(1, sizeof(*thread));
    if (!thread)
        return diag_set(diag, -ENOMEM, "no memory for questions about the ground");
    const struct worker_params worker = {.name = "otwd-query",
                                         .job_size = sizeof(struct job),
                                         .answer_size = sizeof(struct query_reply),
                                         .capacity = QUERY_WAITING_MAX,
                                         .work = answer_job,
                                         .user = thread};
    int r = open_terrain(thread, params, diag);
    if (r == 0)
        r = worker_start(&worker, &thread->worker, diag);
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
    worker_stop(thread->worker);
    close_ground(&thread->own);
    close_ground(&thread->loop);
    terrain_setup_close(&thread->terrain);
    free(thread);
}

bool query_thread_ask(struct query_thread *thread, unsigned asker,
                      const struct cigi_question *question)
{
    return worker_ask(thread->worker, &(struct job){.asker = asker, .question = *question});
}

int query_thread_fd(const struct query_thread *thread)
{
    return worker_fd(thread->worker);
}

bool query_thread_take(struct query_thread *thread, struct query_reply *ret_reply)
{
    return worker_take(thread->worker, ret_reply);
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
