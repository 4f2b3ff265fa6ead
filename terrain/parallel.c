#include "terrain/parallel.h"

#include <pthread.h>
#include <stdatomic.h>

#define JOBS_MAX 64

struct parallel {
    parallel_function function;
    void *user;
    unsigned count;
    _Atomic unsigned next;
    _Atomic int result;
};

struct worker {
    struct parallel *parallel;
    unsigned index;
    pthread_t thread;
};

static void *work(void *argument)
{
    struct worker *worker = argument;
    struct parallel *parallel = worker->parallel;
    while (atomic_load(&parallel->result) == 0) {
        unsigned item = atomic_fetch_add(&parallel->next, 1);
        if (item >= parallel->count)
            break;
        int r = parallel->function(parallel->user, worker->index, item), none = 0;
        if (r < 0)
            atomic_compare_exchange_strong(&parallel->result, &none, r);
    }
    return NULL;
}

int parallel_run(unsigned jobs, unsigned count, parallel_function function, void *user)
{
    struct parallel parallel = {.function = function, .user = user, .count = count};
    struct worker workers[JOBS_MAX];
    unsigned started = 1;
    if (jobs > JOBS_MAX)
        jobs = JOBS_MAX;
    if (jobs > count)
        jobs = count;
    workers[0] = (struct worker){.parallel = &parallel};
    /* A thread that cannot be had is no failure: the others do its share. */
    while (started < jobs) {
        workers[started] = (struct worker){.parallel = &parallel, .index = started};
        if (pthread_create(&workers[started].thread, NULL, work, &workers[started]) != 0)
            break;
        started++;
    }
    work(&workers[0]);
    for (unsigned i = 1; i < started; i++)
        pthread_join(workers[i].thread, NULL);
    return atomic_load(&parallel.result);
}
