/* What a CIGI host asks of the ground, answered by the thread that does so. */
#include "daemon/query_thread.h"

#include <poll.h>

#include "base/clock.h"
#include "base/stats.h"
#include "daemon/terrain_setup.h"
#include "geo/geographic.h"
#include "terrain/dig_writer.h"
#include "terrain/query.h"
#include "tests/database_fixture.h"

#define A_FRAME    1000 /* requests */
#define FRAMES     120
#define PATIENCE_S 20

static struct query_thread *start(const char *path, struct dig *dig, unsigned threads)
{
    struct query_thread *thread = NULL;
    struct diag diag = {""};
    struct query_thread_params params = {
        .terrain_path = path, .geoid = "egm96", .cache_mib = 32, .threads = threads, .dig = dig};
    if (query_thread_start(&params, &thread, &diag) < 0)
        CHECK_FAIL("starting: %s", diag.text);
    return thread;
}

/* Takes `count` replies; the answers by token, which are 1 .. count. */
static void take(struct query_thread *thread, unsigned count, struct cigi_answer *ret_answers)
{
    nsec_t until_ns = clock_monotonic_ns() + PATIENCE_S * NSEC_PER_SEC;
    struct query_reply reply;
    for (unsigned taken = 0; taken < count && clock_monotonic_ns() < until_ns;) {
        struct pollfd ready = {.fd = query_thread_fd(thread), .events = POLLIN};
        poll(&ready, 1, 100);
        for (; query_thread_take(thread, &reply); taken++) {
            CHECK_INT(reply.asker, 7);
            CHECK(reply.token >= 1 && reply.token <= count);
            if (ret_answers && reply.token >= 1 && reply.token <= count)
                ret_answers[reply.token - 1] = reply.answer;
        }
        if (taken == count)
            return;
    }
    CHECK_FAIL("%u answers have not come", count);
}

static void answers_are_those_of_the_ground_above_the_ellipsoid(void)
{
    struct query_thread *thread = start(path_of("iceland"), NULL, 1);
    struct geoid *geoid = NULL;
    struct diag diag;
    struct cigi_answer answers[4];
    const struct cigi_question questions[] = {
        {.token = 1, .ask = CIGI_ASK_GROUND, .detailed = true, .from = {60.3, -22.1, 0.0}},
        {.token = 2, .ask = CIGI_ASK_SEA, .from = {60.3, -22.1, 0.0}},
        {.token = 3,
         .ask = CIGI_ASK_SIGHT,
         .detailed = true,
         .from = {60.3, -22.1, 9000.0},
         .to = {60.3, -22.1, -9000.0}},
        {.token = 4,
         .ask = CIGI_ASK_SIGHT,
         .from = {60.3, -22.1, 9000.0},
         .to = {60.4, -22.1, 9e3}},
    };
    if (!thread || geoid_setup_open("egm96", &geoid, &diag) < 0)
        return;
    for (int i = 0; i < 4; i++)
        CHECK(query_thread_ask(thread, 7, &questions[i]));
    take(thread, 4, answers);
    double undulation_m = geoid_undulation_m(geoid, 60.3, -22.1);
    double ground_m = (double)surface_m(60.3, -22.1) + undulation_m;
    for (int i = 0; i < 4; i++)
        CHECK(answers[i].known);
    CHECK_NEAR(answers[0].height_m, ground_m, 2.0);
    CHECK(answers[0].normal_enu[2] > 0.5 && answers[0].normal_enu[2] <= 1.0);
    CHECK_INT(answers[0].material, QUERY_LAND);
    CHECK_NEAR(answers[1].height_m, undulation_m, 1e-9);
    CHECK(answers[2].hit);
    CHECK_NEAR(answers[2].distance_m, 9000.0 - answers[0].height_m, 0.05);
    CHECK_NEAR(answers[2].at.height_m, answers[0].height_m, 0.05);
    CHECK(!answers[3].hit);
    /* What an entity stands on is the same ground. */
    double height_m = 0.0, normal[3];
    CHECK_INT(query_thread_ground_at(thread, 60.3, -22.1, &height_m, normal), 0);
    CHECK_NEAR(height_m, answers[0].height_m, 1e-9);
    CHECK_NEAR(normal[2], answers[0].normal_enu[2], 0.0);
    CHECK(query_thread_ground_at(thread, NAN, 0.0, &height_m, normal) < 0);
    query_thread_stop(thread);
    geoid_close(geoid);
}

/* What another thread digs counts from the next question on, by either way of asking. */
static void ground_that_is_dug_meanwhile_counts(void)
{
    struct stamp crater = {.kind = STAMP_CRATER,
                           .lat_deg = 60.3,
                           .lon_deg = -22.1,
                           .crater = {400.0, 60.0, 12.0, 200.0}};
    const struct cigi_question question = {
        .token = 1, .ask = CIGI_ASK_GROUND, .from = {60.3, -22.1, 0.0}};
    struct dig_writer *writer = NULL;
    struct diag diag = {""};
    struct cigi_answer before, after;
    double loop_m[2], normal[3];
    int64_t id;
    if (dig_writer_open(path_of("iceland"), &writer, &diag) < 0)
        CHECK_FAIL("opening: %s", diag.text);
    if (!writer)
        return;
    struct query_thread *thread = start(path_of("iceland"), dig_writer_ground(writer), 2);
    CHECK(query_thread_ask(thread, 7, &question));
    take(thread, 1, &before);
    CHECK_INT(query_thread_ground_at(thread, 60.3, -22.1, &loop_m[0], normal), 0);
    CHECK_INT(stamp_prepare(&crater, &diag), 0);
    CHECK_INT(dig_writer_add(writer, &crater, 0, &id, &diag), 0);
    CHECK(query_thread_ask(thread, 7, &question));
    take(thread, 1, &after);
    CHECK_INT(query_thread_ground_at(thread, 60.3, -22.1, &loop_m[1], normal), 0);
    CHECK(before.known && after.known);
    CHECK_NEAR(before.height_m - after.height_m, 60.0, 2.0);
    CHECK_NEAR(loop_m[0], before.height_m, 1e-9);
    CHECK_NEAR(loop_m[1], after.height_m, 1e-9);
    query_thread_stop(thread);
    CHECK_INT(dig_writer_undo(writer, 1, 0, &diag), 0);
    dig_writer_close(writer);
}

static void more_questions_than_may_wait_are_refused(void)
{
    struct query_thread *thread = start("", NULL, 1);
    const struct cigi_question question = {
        .token = 1, .ask = CIGI_ASK_SIGHT, .from = {46, 8, 9e3}, .to = {46, 9, 9e3}};
    unsigned asked = 0;
    if (!thread)
        return;
    while (asked <= QUERY_WAITING_MAX && query_thread_ask(thread, 7, &question))
        asked++;
    CHECK_INT(asked, QUERY_WAITING_MAX);
    query_thread_stop(thread); /* what waits is not answered, and holds nobody up */
    query_thread_stop(NULL);
}

/* Around an aircraft: heights, and every so many-th question a line of sight of 20 km. */
static void measure(const char *path, unsigned every, unsigned threads)
{
    static struct cigi_answer answers[A_FRAME];
    double ms[FRAMES];
    struct distribution d;
    unsigned known = 0;
    struct query_thread *thread = start(path, NULL, threads);
    if (!thread)
        return;
    for (unsigned frame = 0; frame < FRAMES; frame++) {
        double lat_deg = 60.2 + 1e-4 * frame;
        nsec_t start_ns = clock_monotonic_ns();
        for (unsigned i = 0; i < A_FRAME; i++) {
            double turn = (double)i * 0.618, far_deg = 0.05 * (i % 50) / 50.0;
            struct geodetic at = {lat_deg + far_deg * sin(turn), -22.2 + far_deg * cos(turn), 4e3};
            struct cigi_question question = {
                .token = i + 1, .detailed = i % 2, .from = at, .to = at};
            question.ask = i % every ? CIGI_ASK_GROUND : CIGI_ASK_SIGHT;
            question.to.lat_deg += 0.156;
            question.to.height_m = -6e3;
            CHECK(query_thread_ask(thread, 7, &question));
        }
        take(thread, A_FRAME, answers);
        ms[frame] = milliseconds_from_ns(clock_monotonic_ns() - start_ns);
        for (unsigned i = 0; i < A_FRAME; i++)
            known += answers[i].known;
    }
    distribution_of_values(ms, FRAMES, &d);
    printf(
        "     %s, one of %u a line of sight, %u threads: %d in p50 %.2f, p99 %.2f, max %.2f ms\n",
        path[0] ? "database" : "planet", every, threads, A_FRAME, d.p50, d.p99, d.max);
    CHECK_INT(known, A_FRAME * FRAMES);
    /* A frame at 60 Hz, where nothing else has the processors; sanitizers cost much more. */
    CHECK(d.min < (getenv("OTWD_TESTS_ARE_SLOW") ? 500.0 : 16.7));
    query_thread_stop(thread);
}

static void a_thousand_requests_take_less_than_a_frame(void)
{
    for (unsigned threads = 1; threads <= QUERY_THREADS_MAX; threads++) {
        measure(path_of("iceland"), 10, threads);
        measure(path_of("iceland"), 1, threads);
        measure("", 10, threads);
        measure("", 1, threads);
    }
}

int main(void)
{
    static const struct check_test tests[] = {
        {"answers are those of the ground, above the ellipsoid",
         answers_are_those_of_the_ground_above_the_ellipsoid},
        {"ground that is dug meanwhile counts", ground_that_is_dug_meanwhile_counts},
        {"more questions than may wait are refused", more_questions_than_may_wait_are_refused},
        {"a thousand requests take less than a frame", a_thousand_requests_take_less_than_a_frame},
    };
    if (!mkdtemp(directory))
        return 1;
    build_exact(path_of("iceland"));
    int status = check_main(tests, sizeof(tests) / sizeof(tests[0]));
    unlink(path_of("iceland"));
    rmdir(directory);
    return status;
}
