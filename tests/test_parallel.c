#include "terrain/parallel.h"

#include <errno.h>
#include <sched.h>
#include <stdatomic.h>

#include "tests/check.h"

#define ITEMS 1000

struct count {
    _Atomic int done[ITEMS], by_worker[8];
    _Atomic int wrong_worker;
    unsigned fails_at;
};

static int count_item(void *user, unsigned worker, unsigned item)
{
    struct count *count = user;
    atomic_fetch_add(&count->done[item], 1);
    if (worker < 8)
        atomic_fetch_add(&count->by_worker[worker], 1);
    else
        atomic_store(&count->wrong_worker, 1);
    if (item % 64 == 0)
        sched_yield();
    return item + 1 == count->fails_at ? -EIO : 0;
}

static void check_each_once(const struct count *count, unsigned items)
{
    int wrong = 0;
    for (unsigned i = 0; i < ITEMS; i++)
        wrong += count->done[i] != (i < items);
    CHECK_INT(wrong, 0);
    CHECK_INT(count->wrong_worker, 0);
}

static void every_item_is_done_once(void)
{
    for (unsigned jobs = 0; jobs <= 8; jobs++) {
        struct count count = {{0}};
        CHECK_INT(parallel_run(jobs, ITEMS, count_item, &count), 0);
        check_each_once(&count, ITEMS);
    }
}

static void a_crew_does_run_after_run(void)
{
    struct crew *crew = NULL;
    CHECK_INT(crew_create(5, "otwd-test", &crew), 0);
    CHECK_INT(crew_size(crew), 5);
    for (unsigned run = 0; run < 2000; run++) {
        struct count count = {{0}};
        unsigned items = run % 7 == 0 ? ITEMS : run % 20;
        CHECK_INT(crew_run(crew, items, count_item, &count), 0);
        check_each_once(&count, items);
    }
    crew_destroy(crew);
}

static int meet(void *user, unsigned worker, unsigned item)
{
    (void)worker, (void)item;
    _Atomic int *here = user;
    atomic_fetch_add(here, 1);
    while (atomic_load(here) < 4)
        sched_yield();
    return 0;
}

static void its_threads_work_at_the_same_time(void)
{
    struct crew *crew = NULL;
    _Atomic int here = 0;
    CHECK_INT(crew_create(4, "otwd-test", &crew), 0);
    CHECK_INT(crew_run(crew, 4, meet, (void *)&here), 0);
    CHECK_INT(here, 4);
    crew_destroy(crew);
}

static void a_failure_ends_the_run_and_is_returned(void)
{
    struct crew *crew = NULL;
    struct count failing = {.fails_at = 3}, well = {{0}};
    CHECK_INT(crew_create(1, "otwd-test", &crew), 0);
    CHECK_INT(crew_run(crew, ITEMS, count_item, &failing), -EIO);
    check_each_once(&failing, 3);
    CHECK_INT(crew_run(crew, ITEMS, count_item, &well), 0);
    check_each_once(&well, ITEMS);
    crew_destroy(crew);
    crew_destroy(NULL);
}

static const struct check_test tests[] = {
    {"every item is done once, on any number of threads", every_item_is_done_once},
    {"a crew does run after run", a_crew_does_run_after_run},
    {"its threads work at the same time", its_threads_work_at_the_same_time},
    {"a failure ends the run and is returned", a_failure_ends_the_run_and_is_returned},
};

int main(void)
{
    return CHECK_MAIN(tests);
}
