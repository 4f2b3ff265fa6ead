#include "base/bytes.h"
#include "base/clock.h"
#include "base/diag.h"
#include "base/latest.h"
#include "base/ring.h"
#include "base/stats.h"
#include "tests/check.h"

#include <errno.h>
#include <pthread.h>

struct pair {
    uint64_t a, b, c[30];
};

#define PUBLICATIONS 200000

static void *publish_pairs(void *cell)
{
    for (uint64_t i = 1; i <= PUBLICATIONS; i++) {
        struct pair pair = {.a = i, .b = ~i};
        for (size_t k = 0; k < 30; k++)
            pair.c[k] = i + k;
        latest_publish(cell, &pair);
    }
    return NULL;
}

static void latest_values_are_whole_and_never_go_back(void)
{
    struct latest cell;
    CHECK_INT(latest_init(&cell, sizeof(struct pair)), 0);
    struct pair seen;
    CHECK(!latest_take(&cell, &seen));
    pthread_t writer;
    pthread_create(&writer, NULL, publish_pairs, &cell);
    uint64_t last = 0, torn = 0, backwards = 0;
    while (last < PUBLICATIONS) {
        if (!latest_take(&cell, &seen))
            continue;
        torn += seen.b != ~seen.a || seen.c[29] != seen.a + 29;
        backwards += seen.a <= last;
        last = seen.a;
    }
    pthread_join(writer, NULL);
    CHECK_INT(torn, 0);
    CHECK_INT(backwards, 0);
    CHECK(!latest_take(&cell, &seen));
    latest_finish(&cell);
}

static void *put_numbers(void *ring)
{
    for (uint32_t i = 0; i < PUBLICATIONS; i++)
        while (!ring_put(ring, &i))
            ;
    return NULL;
}

static void a_ring_hands_over_everything_in_order(void)
{
    struct ring ring;
    CHECK_INT(ring_init(&ring, sizeof(uint32_t), 5), 0);
    CHECK_INT(ring.capacity, 8);
    pthread_t producer;
    pthread_create(&producer, NULL, put_numbers, &ring);
    uint32_t wrong = 0;
    for (uint32_t expected = 0; expected < PUBLICATIONS; expected++) {
        uint32_t value;
        while (!ring_take(&ring, &value))
            ;
        wrong += value != expected;
    }
    pthread_join(producer, NULL);
    CHECK_INT(wrong, 0);
    CHECK_INT(ring_count(&ring), 0);
    ring_finish(&ring);
}

static void a_full_ring_refuses(void)
{
    struct ring ring;
    CHECK_INT(ring_init(&ring, 1, 2), 0);
    CHECK(ring_put(&ring, "a"));
    CHECK(ring_put(&ring, "b"));
    CHECK(!ring_put(&ring, "c"));
    CHECK_INT(ring_count(&ring), 2);
    ring_finish(&ring);
}

static void percentiles_follow_the_nearest_rank(void)
{
    struct samples samples;
    CHECK_INT(samples_init(&samples, 1000), 0);
    for (int i = 1000; i >= 1; i--)
        samples_add(&samples, i);
    samples_add(&samples, 5000); /* beyond the room: dropped */
    struct distribution d;
    CHECK_INT(samples_distribution(&samples, &d), 0);
    CHECK_NEAR(d.min, 1, 0);
    CHECK_NEAR(d.p50, 500, 0);
    CHECK_NEAR(d.p99, 990, 0);
    CHECK_NEAR(d.p999, 999, 0);
    CHECK_NEAR(d.max, 1000, 0);
    samples_finish(&samples);
}

static void a_byte_reader_stops_at_its_end(void)
{
    const uint8_t bytes[] = {0x01, 0x02, 0x03, 0x04, 0x05, 0x06};
    struct byte_reader r = byte_reader_over(bytes, sizeof(bytes));
    CHECK_INT(read_u16be(&r), 0x0102);
    CHECK_INT(read_u16le(&r), 0x0403);
    CHECK_INT(read_u32be(&r), 0);
    CHECK(r.overrun);
    CHECK_INT(read_u16be(&r), 0);
    CHECK_INT(r.offset, 4);
}

static void a_diagnostic_is_prefixed_and_cut(void)
{
    struct diag diag;
    CHECK_INT(diag_set(&diag, -EINVAL, "latitude %g", 91.0), -EINVAL);
    diag_prefix(&diag, "source %s", "host");
    CHECK_STRING(diag.text, "source host: latitude 91");
    char longer[2 * DIAG_TEXT_MAX];
    memset(longer, 'x', sizeof(longer) - 1);
    longer[sizeof(longer) - 1] = '\0';
    diag_prefix(&diag, "%s", longer);
    CHECK_INT(strlen(diag.text), DIAG_TEXT_MAX - 1);
    CHECK_INT(diag_set(NULL, -ENOENT, "nowhere"), -ENOENT);
}

static void utc_is_parsed_strictly(void)
{
    nsec_t t = 7;
    CHECK_INT(clock_parse_utc("2000-01-01T00:00:01Z", &t), 0);
    CHECK_INT(t, 946684801 * NSEC_PER_SEC);
    CHECK_INT(clock_parse_utc("2000-01-01 00:00", &t), -EINVAL);
    CHECK_INT(clock_parse_utc("", &t), -EINVAL);
    CHECK_INT(clock_parse_utc("0024-06-21T12:00:00Z", &t), -EINVAL);
    CHECK_INT(clock_parse_utc("9999-06-21T12:00:00Z", &t), -EINVAL);
    CHECK_INT(clock_parse_utc("2000-01-01T00:00:01Zx", &t), -EINVAL);
}

static void machines_whose_system_clocks_agree_have_the_same_ticks(void)
{
    const nsec_t period_ns = 16666667, realtime_ns = INT64_C(1790000000123456789);
    static const nsec_t booted_ns[] = {5, 77 * NSEC_PER_SEC, 123456789012345};
    for (int step = 0; step < 1000; step++) {
        uint32_t first = 0, number;
        for (size_t i = 0; i < sizeof(booted_ns) / sizeof(booted_ns[0]); i++) {
            nsec_t now_ns = booted_ns[i] + step * 1234567;
            nsec_t tick_ns =
                clock_tick_near(now_ns, now_ns, realtime_ns + step * 1234567, period_ns, &number);
            nsec_t shared_ns = tick_ns + realtime_ns - booted_ns[i];
            CHECK_INT(shared_ns % period_ns, 0);
            CHECK_INT((uint32_t)(shared_ns / period_ns), number);
            CHECK(llabs(tick_ns - now_ns) <= period_ns / 2 + 1);
            first = i == 0 ? number : first;
            CHECK_INT(number, first);
        }
    }
}

int main(void)
{
    static const struct check_test tests[] = {
        {"latest values are whole and never go back", latest_values_are_whole_and_never_go_back},
        {"a ring hands over everything in order", a_ring_hands_over_everything_in_order},
        {"a full ring refuses", a_full_ring_refuses},
        {"percentiles follow the nearest rank", percentiles_follow_the_nearest_rank},
        {"a byte reader stops at its end", a_byte_reader_stops_at_its_end},
        {"a diagnostic is prefixed and cut", a_diagnostic_is_prefixed_and_cut},
        {"UTC is parsed strictly", utc_is_parsed_strictly},
        {"machines whose system clocks agree have the same ticks",
         machines_whose_system_clocks_agree_have_the_same_ticks},
    };
    return CHECK_MAIN(tests);
}
