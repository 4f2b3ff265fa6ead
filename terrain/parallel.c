#include "terrain/parallel.h"

#include <errno.h>
#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdlib.h>
#include <unistd.h>

#define JOBS_MAX 64

struct worker {
    struct crew *crew;
    unsigned index;
    pthread_t thread;
};

struct crew {
    /* The run at hand. */
    parallel_function function;
    void *user;
    unsigned count;
    _Atomic unsigned next;
    _Atomic int result;

    pthread_mutex_t lock; /* of the rest */
    pthread_cond_t begun, ended;
    unsigned runs;    /* begun so far */
    bool open;        /* the last one may be joined */
    unsigned working; /* threads that did */
    bool leaving;

    unsigned size; /* with the caller's own, workers[0] */
    struct worker workers[JOBS_MAX];
};

unsigned parallel_processors(void)
{
    cpu_set_t allowed;
    if (sched_getaffinity(0, sizeof(allowed), &allowed) == 0)
        return (unsigned)CPU_COUNT(&allowed);
    long online = sysconf(_SC_NPROCESSORS_ONLN); /* more than a set holds */
    return online > 0 ? (unsigned)online : 1;
}

static void work(struct crew *crew, unsigned worker)
{
    while (atomic_load(&crew->result) == 0) {
        unsigned item = atomic_fetch_add(&crew->next, 1);
        if (item >= crew->count)
            break;
        int r = crew->function(crew->user, worker, item), none = 0;
        if (r < 0)
            atomic_compare_exchange_strong(&crew->result, &none, r);
    }
}

static void *worker_main(void *argument)
{
    const struct worker *worker = argument;
    struct crew *crew = worker->crew;
    unsigned seen = 0;
    pthread_mutex_lock(&crew->lock);
    for (;;) {
        while (!crew->leaving && !(crew->open && crew->runs != seen))
            pthread_cond_wait(&crew->begun, &crew->lock);
        if (crew->leaving)
            break;
        seen = crew->runs;
        crew->working++;
        pthread_mutex_unlock(&crew->lock);
        work(crew, worker->index);
        pthread_mutex_lock(&crew->lock);
        if (--crew->working == 0)
            pthread_cond_signal(&crew->ended);
    }
    pthread_mutex_unlock(&crew->lock);
    return NULL;
}

int crew_create(unsigned jobs, const char *name, struct crew **ret_crew)
{
    struct crew *crew = calloc(1, sizeof(*crew));
    if (!crew)
        return -ENOMEM;
    pthread_mutex_init(&crew->lock, NULL);
    pthread_cond_init(&crew->begun, NULL);
    pthread_cond_init(&crew->ended, NULL);
    crew->size = 1;
    while (crew->size < jobs && crew->size < JOBS_MAX) {
        struct worker *worker = &crew->workers[crew->size];
        *worker = (struct worker){.crew = crew, .index = crew->size};
        if (pthread_create(&worker->thread, NULL, worker_main, worker) != 0)
            break; /* the others do its share */
        pthread_setname_np(worker->thread, name);
        crew->size++;
    }
    *ret_crew = crew;
    return 0;
}

void crew_destroy(struct crew *crew)
{
    if (!crew)
        return;
    pthread_mutex_lock(&crew->lock);
    crew->leaving = true;
    pthread_cond_broadcast(&crew->begun);
    pthread_mutex_unlock(&crew->lock);
    for (unsigned i = 1; i < crew->size; i++)
        pthread_join(crew->workers[i].thread, NULL);
    pthread_cond_destroy(&crew->begun);
    pthread_cond_destroy(&crew->ended);
    pthread_mutex_destroy(&crew->lock);
    free(crew);
}

unsigned crew_size(const struct crew *crew)
{
    return crew->size;
}

int crew_run(struct crew *crew, unsigned count, parallel_function function, void *user)
{
    crew->function = function;
    crew->user = user;
    crew->count = count;
    atomic_store(&crew->next, 0);
    atomic_store(&crew->result, 0);
    bool alone = crew->size == 1 || count <= 1;
    if (!alone) {
        pthread_mutex_lock(&crew->lock);
        crew->runs++;
        crew->open = true;
        pthread_cond_broadcast(&crew->begun);
        pthread_mutex_unlock(&crew->lock);
    }
    work(crew, 0);
    if (!alone) {
        pthread_mutex_lock(&crew->lock);
        crew->open = false; /* who is not awake by now is not waited for */
        while (crew->working > 0)
            pthread_cond_wait(&crew->ended, &crew->lock);
        pthread_mutex_unlock(&crew->lock);
    }
    return atomic_load(&crew->result);
}

int parallel_run(unsigned jobs, unsigned count, parallel_function function, void *user)
{
    struct crew *crew;
    int r = crew_create(jobs < count ? jobs : count, "otwd-worker", &crew);
    if (r < 0)
        return r;
    r = crew_run(crew, count, function, user);
    crew_destroy(crew);
    return r;
}
