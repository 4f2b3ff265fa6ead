/* The thread that does jobs for another one. */
#include "base/worker.h"

#include <poll.h>
#include <semaphore.h>
#include <stdatomic.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#include "tests/check.h"

#define CAPACITY   100
#define PATIENCE_S 20

/* What the worker's thread and the test both see. */
struct bench {
    atomic_uint begun, done, rests;
    unsigned rests_most; /* `rest` has more to do until it was called so often */
    bool holds;          /* jobs wait for `go` */
    bool is_slow;
    sem_t go;
    atomic_int niceness;
};

static void sleep_ms(long ms)
{
    const struct timespec pause = {.tv_nsec = ms * NSEC_PER_MSEC};
    nanosleep(&pause, NULL);
}

static void square(void *user, const void *job, void *ret_answer)
{
    struct bench *bench = user;
    const unsigned *number = job;
    atomic_fetch_add(&bench->begun, 1);
    if (bench->holds)
        sem_wait(&bench->go);
    if (bench->is_slow)
        sleep_ms(10);
    atomic_store(&bench->niceness, getpriority(PRIO_PROCESS, (id_t)gettid()));
    *(unsigned *)ret_answer = *number * *number;
    atomic_fetch_add(&bench->done, 1);
}

static bool rest(void *user)
{
    struct bench *bench = user;
    return atomic_fetch_add(&bench->rests, 1) + 1 < bench->rests_most;
}

static struct worker *start(struct bench *bench, struct worker_params params)
{
    struct worker *worker = NULL;
    struct diag diag = {""};
    sem_init(&bench->go, 0, 0);
    params.name = "worker";
    params.job_size = params.answer_size = sizeof(unsigned);
    params.capacity = CAPACITY;
    params.work = square;
    params.user = bench;
    if (worker_start(&params, &worker, &diag) < 0)
        CHECK_FAIL("starting: %s", diag.text);
    return worker;
}

static bool is_ready(const struct worker *worker, int wait_ms)
{
    struct pollfd ready = {.fd = worker_fd(worker), .events = POLLIN};
    return poll(&ready, 1, wait_ms) > 0;
}

/* Waits for the next answer. */
static bool take(struct worker *worker, unsigned *ret_answer)
{
    nsec_t until_ns = clock_monotonic_ns() + PATIENCE_S * NSEC_PER_SEC;
    while (clock_monotonic_ns() < until_ns) {
        if (worker_take(worker, ret_answer))
            return true;
        is_ready(worker, 100);
    }
    CHECK_FAIL("no answer comes");
    return false;
}

static void wait_for(atomic_uint *count, unsigned goal)
{
    nsec_t until_ns = clock_monotonic_ns() + PATIENCE_S * NSEC_PER_SEC;
    while (atomic_load(count) < goal && clock_monotonic_ns() < until_ns)
        sleep_ms(1);
    CHECK(atomic_load(count) >= goal);
}

static void every_job_is_answered_in_order(void)
{
    struct bench bench = {0};
    struct worker *worker = start(&bench, (struct worker_params){.niceness = 5});
    int own = getpriority(PRIO_PROCESS, (id_t)gettid());
    unsigned asked = 0, answer;
    if (!worker)
        return;
    for (unsigned taken = 0; taken < 20 * CAPACITY; taken++) {
        while (asked < 20 * CAPACITY && worker_ask(worker, &asked))
            asked++;
        if (!take(worker, &answer))
            break;
        CHECK_INT(answer, taken * taken);
    }
    CHECK(!worker_take(worker, &answer));
    CHECK(!is_ready(worker, 0));
    CHECK_INT(atomic_load(&bench.niceness), 5);
    CHECK_INT(getpriority(PRIO_PROCESS, (id_t)gettid()), own);
    worker_stop(worker);
}

static void more_jobs_than_there_is_room_for_are_refused(void)
{
    struct bench bench = {0};
    struct worker *worker = start(&bench, (struct worker_params){0});
    unsigned asked = 0, answer;
    if (!worker)
        return;
    while (asked <= CAPACITY && worker_ask(worker, &asked))
        asked++;
    CHECK_INT(asked, CAPACITY);
    wait_for(&bench.done, CAPACITY);
    CHECK(!worker_ask(worker, &asked)); /* they are answered, but not taken */
    CHECK(take(worker, &answer));
    CHECK(worker_ask(worker, &asked));
    worker_stop(worker);
}

/* The one that takes long is told of before the next is done. */
static void a_slow_answer_is_told_of_at_once(void)
{
    struct bench bench = {.holds = true};
    struct worker *worker = start(&bench, (struct worker_params){0});
    const unsigned jobs[] = {3, 4};
    unsigned answer = 0;
    if (!worker)
        return;
    worker_ask(worker, &jobs[0]);
    worker_ask(worker, &jobs[1]);
    CHECK(!is_ready(worker, 0));
    wait_for(&bench.begun, 1);
    sleep_ms(2);
    sem_post(&bench.go);
    CHECK(is_ready(worker, PATIENCE_S * 1000));
    CHECK(worker_take(worker, &answer));
    CHECK_INT(answer, 9);
    sem_post(&bench.go);
    CHECK(take(worker, &answer));
    CHECK_INT(answer, 16);
    worker_stop(worker);
}

static unsigned done_after_stop(bool finishes)
{
    struct bench bench = {.is_slow = true};
    struct worker *worker = start(&bench, (struct worker_params){.finishes = finishes});
    if (!worker)
        return 0;
    for (unsigned i = 0; i < CAPACITY; i++)
        CHECK(worker_ask(worker, &i));
    wait_for(&bench.done, 1);
    worker_stop(worker);
    return atomic_load(&bench.done);
}

static void what_waits_at_the_end_is_done_or_dropped(void)
{
    CHECK_INT(done_after_stop(true), CAPACITY);
    CHECK(done_after_stop(false) < CAPACITY);
    worker_stop(NULL);
}

static void it_rests_once_nobody_has_asked_for_a_while(void)
{
    struct bench bench = {.rests_most = 3};
    struct worker *worker =
        start(&bench, (struct worker_params){.rest = rest, .quiet_ns = 20 * NSEC_PER_MSEC});
    const unsigned job = 2;
    unsigned answer;
    if (!worker)
        return;
    wait_for(&bench.rests, 3);
    sleep_ms(100);
    CHECK_INT(atomic_load(&bench.rests), 3); /* it had no more */
    CHECK(worker_ask(worker, &job));
    CHECK(take(worker, &answer));
    wait_for(&bench.rests, 4);
    sleep_ms(100);
    CHECK_INT(atomic_load(&bench.rests), 4);
    worker_stop(worker);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"every job is answered, in order", every_job_is_answered_in_order},
        {"more jobs than there is room for are refused",
         more_jobs_than_there_is_room_for_are_refused},
        {"a slow answer is told of at once", a_slow_answer_is_told_of_at_once},
        {"what waits at the end is done, or dropped", what_waits_at_the_end_is_done_or_dropped},
        {"it rests once nobody has asked for a while", it_rests_once_nobody_has_asked_for_a_while},
    };
    return check_main(tests, sizeof(tests) / sizeof(tests[0]));
}
