/* The smallest test harness that tells a stranger what failed: each test is a function with a human
 * title, each check prints the values it compared. */
#pragma once

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int check_failures;
static const char *check_title = "";

#define CHECK_FAIL(...)                                                                            \
    do {                                                                                           \
        check_failures++;                                                                          \
        fprintf(stderr, "FAIL %s\n  %s:%d: ", check_title, __FILE__, __LINE__);                    \
        fprintf(stderr, __VA_ARGS__);                                                              \
        fputc('\n', stderr);                                                                       \
    } while (0)

#define CHECK(condition)                                                                           \
    do {                                                                                           \
        if (!(condition))                                                                          \
            CHECK_FAIL("%s is false", #condition);                                                 \
    } while (0)

#define CHECK_INT(actual, expected)                                                                \
    do {                                                                                           \
        long long check_a = (long long)(actual), check_e = (long long)(expected);                  \
        if (check_a != check_e)                                                                    \
            CHECK_FAIL("%s is %lld, expected %lld", #actual, check_a, check_e);                    \
    } while (0)

#define CHECK_NEAR(actual, expected, tolerance)                                                    \
    do {                                                                                           \
        double check_a = (actual), check_e = (expected);                                           \
        if (!(fabs(check_a - check_e) <= (tolerance)))                                             \
            CHECK_FAIL("%s is %.17g, expected %.17g within %g", #actual, check_a, check_e,         \
                       (double)(tolerance));                                                       \
    } while (0)

#define CHECK_STRING(actual, expected)                                                             \
    do {                                                                                           \
        const char *check_a = (actual), *check_e = (expected);                                     \
        if (strcmp(check_a, check_e) != 0)                                                         \
            CHECK_FAIL("%s is \"%s\", expected \"%s\"", #actual, check_a, check_e);                \
    } while (0)

#define CHECK_CONTAINS(haystack, needle)                                                           \
    do {                                                                                           \
        const char *check_h = (haystack), *check_n = (needle);                                     \
        if (!strstr(check_h, check_n))                                                             \
            CHECK_FAIL("%s is \"%s\", which does not contain \"%s\"", #haystack, check_h,          \
                       check_n);                                                                   \
    } while (0)

/* How often a test interrupts something: as often as OTWD_KILLS says, which long runs set. */
static inline int check_kills(int by_default)
{
    const char *text = getenv("OTWD_KILLS");
    return text ? atoi(text) : by_default;
}

/* How often a test repeats what it does: `usually` times, or `short_run` times where OTWD_SHORT_RUN
 * is set, as in the builds with sanitizers of `./run test`: what those find they find as well in a
 * few rounds. */
static inline int check_rounds(int usually, int short_run)
{
    return getenv("OTWD_SHORT_RUN") ? short_run : usually;
}

struct check_test {
    const char *title;
    void (*run)(void);
    bool one_thread; /* and takes long: the thread sanitizer, which finds nothing there, passes it
                        over */
};

#ifdef __SANITIZE_THREAD__
#define CHECK_SKIPS_ONE_THREAD true
#else
#define CHECK_SKIPS_ONE_THREAD false
#endif

/* Runs all tests; the value is main's exit status. Every test runs even where one failed. */
static inline int check_main(const struct check_test *tests, size_t count)
{
    int failed = 0;
    setvbuf(stdout, NULL, _IOLBF, 0); /* where one hangs, what was before it is told */
    for (size_t i = 0; i < count; i++) {
        int before = check_failures;
        if (tests[i].one_thread && CHECK_SKIPS_ONE_THREAD) {
            printf("skip %s: one thread\n", tests[i].title);
            continue;
        }
        check_title = tests[i].title;
        tests[i].run();
        bool ok = check_failures == before;
        failed += !ok;
        printf("%s %s\n", ok ? "ok  " : "FAIL", tests[i].title);
    }
    return failed ? 1 : 0;
}

#define CHECK_MAIN(tests) check_main(tests, sizeof(tests) / sizeof((tests)[0]))
