/* Requests to dig: their bytes, the thread that answers them, what is said twice. */
#include <errno.h>
#include <poll.h>

#include "base/clock.h"
#include "daemon/dig_thread.h"
#include "terrain/dig_store.h"
#include "terrain/dig_writer.h"
#include "tests/database_fixture.h"

static uint8_t datagram[DIG_MESSAGE_MAX];

static void test_bytes(void)
{
    uint8_t body[3] = {7, 8, 9};
    struct dig_message message = {
        .kind = DIG_ADD, .session = 0x0badcafe, .request = 42, .body = body, .size = sizeof(body)};
    static const uint8_t expected[35] = {
        0x4f, 0x54, 0x57, 0x44, 1, 0, 0, 35, 0x0b, 0xad, 0xca, 0xfe, 0, 0, 0, 42, 1, 0,
        0,    0,    0,    0,    0, 0, 0, 0,  0,    0,    0,    0,    0, 0, 7, 8,  9};
    struct dig_message back;
    CHECK_INT(dig_message_encode(&message, datagram), sizeof(expected));
    CHECK(memcmp(datagram, expected, sizeof(expected)) == 0);
    CHECK(dig_message_recognises(datagram, sizeof(expected)));
    CHECK_INT(dig_message_decode(datagram, sizeof(expected), &back, NULL), 0);
    CHECK(back.kind == DIG_ADD && back.session == 0x0badcafe && back.request == 42);
    CHECK(back.size == 3 && back.body[2] == 9);
    struct dig_message answer = {.kind = DIG_ANSWER,
                                 .session = 5,
                                 .request = 6,
                                 .status = DIG_STATUS_REFUSED,
                                 .id = 1,
                                 .text = "no"};
    size_t size = dig_message_encode(&answer, datagram);
    CHECK_INT(size, DIG_HEAD + 2);
    CHECK_INT(dig_message_decode(datagram, size, &back, NULL), 0);
    CHECK_STRING(back.text, "no");
    CHECK(back.status == DIG_STATUS_REFUSED && back.id == 1);
}

static void test_refused(void)
{
    struct diag diag;
    struct dig_message back, message = {.kind = DIG_UNDO, .session = 1, .request = 1, .count = 3};
    size_t size = dig_message_encode(&message, datagram);
    CHECK_INT(dig_message_decode(datagram, size, &back, NULL), 0);
    CHECK_INT(back.count, 3);
    CHECK_INT(dig_message_decode(datagram, size - 1, &back, &diag), -EBADMSG);
    CHECK_INT(dig_message_decode(datagram, 3, &back, &diag), -EBADMSG);
    CHECK(!dig_message_recognises(datagram, 3));
    datagram[4] = 2;
    CHECK_INT(dig_message_decode(datagram, size, &back, &diag), -EPROTONOSUPPORT);
    datagram[4] = 1;
    datagram[16] = 9;
    CHECK_INT(dig_message_decode(datagram, size, &back, &diag), -EBADMSG);
    CHECK_CONTAINS(diag.text, "9 is no kind");
    datagram[16] = DIG_UNDO;
    datagram[23] = 0;
    CHECK_INT(dig_message_decode(datagram, size, &back, &diag), -EBADMSG);
    datagram[23] = 3;
    datagram[8] = 0x80;
    CHECK_INT(dig_message_decode(datagram, size, &back, &diag), -EBADMSG);
    CHECK_CONTAINS(diag.text, "session");
    datagram[8] = 0;
    datagram[11] = 0;
    CHECK_INT(dig_message_decode(datagram, size, &back, &diag), -EBADMSG);
}

static struct dig_thread *open_thread(const char *path)
{
    struct diag diag = {""};
    struct dig_thread *thread = NULL;
    if (dig_thread_start(path, &thread, &diag) < 0)
        CHECK_FAIL("starting: %s", diag.text);
    return thread;
}

static struct dig_message wait_for(struct dig_thread *thread)
{
    struct dig_reply reply = {.message.kind = 0};
    for (int i = 0; i < 100 && !dig_thread_take(thread, &reply); i++) {
        struct pollfd poll_fd = {.fd = dig_thread_fd(thread), .events = POLLIN};
        poll(&poll_fd, 1, 100);
    }
    CHECK_INT(reply.message.kind, DIG_ANSWER);
    CHECK_INT(reply.asker.slot, 3);
    return reply.message;
}

static struct dig_message ask(struct dig_thread *thread, const struct dig_message *message)
{
    const struct dig_asker asker = {.slot = 3};
    CHECK(dig_thread_ask(thread, message, &asker));
    return wait_for(thread);
}

static size_t crater_bytes(double lat_deg, uint8_t *ret_bytes)
{
    struct stamp stamp = {.kind = STAMP_CRATER,
                          .lat_deg = lat_deg,
                          .lon_deg = -22.0,
                          .crater = {30.0, 5.0, 1.0, 10.0}};
    CHECK_INT(stamp_prepare(&stamp, NULL), 0);
    return stamp_encode(&stamp, ret_bytes);
}

static void test_thread(void)
{
    static uint8_t body[STAMP_BYTES_MAX];
    char path[256];
    snprintf(path, sizeof(path), "%s", path_of("thread.db"));
    build_exact(path);
    struct dig_thread *thread = open_thread(path);
    struct dig_message message = {.kind = DIG_ADD, .session = 9, .request = 1, .body = body};
    message.size = crater_bytes(60.0, body);
    struct dig_message first = ask(thread, &message), again = ask(thread, &message);
    CHECK(first.status == DIG_STATUS_DONE && first.id == 1);
    CHECK(again.status == DIG_STATUS_DONE && again.id == 1 && again.request == 1);
    message.request = 2;
    message.size--;
    struct dig_message bad = ask(thread, &message);
    CHECK(bad.status == DIG_STATUS_REFUSED);
    CHECK_CONTAINS(bad.text, "cut short");
    struct dig_message undo = {.kind = DIG_UNDO, .session = 9, .request = 3, .count = 5};
    CHECK(ask(thread, &undo).status == DIG_STATUS_REFUSED);
    dig_thread_stop(thread);
    thread = open_thread(path); /* what was answered is known after a restart */
    message.request = 1;
    message.size++;
    CHECK(ask(thread, &message).id == 1);
    CHECK_INT(dig_index_of(dig_thread_ground(thread))->stamp_count, 1);
    dig_thread_stop(thread);
}

static void test_full(void)
{
    static uint8_t body[STAMP_BYTES_MAX];
    char path[256];
    snprintf(path, sizeof(path), "%s", path_of("busy.db"));
    build_exact(path);
    struct dig_thread *thread = open_thread(path);
    struct dig_message message = {.kind = DIG_ADD, .session = 9, .body = body};
    const struct dig_asker asker = {.slot = 3};
    uint32_t taken = 0, done = 0;
    for (uint32_t i = 0; i < 2 * DIG_REQUESTS_MAX; i++) {
        message.request = i;
        message.size = crater_bytes(60.0 + 1e-4 * i, body);
        taken += dig_thread_ask(thread, &message, &asker);
    }
    CHECK_INT(taken, DIG_REQUESTS_MAX); /* answers that nobody took count, too */
    for (uint32_t i = 0; i < taken; i++)
        done += wait_for(thread).status == DIG_STATUS_DONE;
    CHECK_INT(done, taken);
    CHECK(dig_thread_ask(thread, &message, &asker));
    CHECK_INT(wait_for(thread).status, DIG_STATUS_DONE); /* a stop drops what has not begun */
    dig_thread_stop(thread);
    struct dig *dig = NULL;
    CHECK_INT(dig_open(path, &dig, NULL), 0);
    CHECK_INT(dig_index_of(dig)->stamp_count, DIG_REQUESTS_MAX + 1);
    dig_close(dig);
}

static uint64_t tiles_stored(const char *path)
{
    struct diag diag = {""};
    struct database *database = NULL;
    struct dig_counts counts = {.tiles = 0};
    if (database_open(path, &database, &diag) < 0 || dig_store_count(database, &counts, &diag) < 0)
        CHECK_FAIL("counting: %s", diag.text);
    database_close(database);
    return counts.tiles;
}

static double until_more_are_stored_s(const char *path)
{
    nsec_t begin_ns = clock_monotonic_ns();
    uint64_t before = tiles_stored(path);
    do
        poll(NULL, 0, 1);
    while (tiles_stored(path) == before && clock_monotonic_ns() - begin_ns < 20 * NSEC_PER_SEC);
    return seconds_from_ns(clock_monotonic_ns() - begin_ns);
}

/* True where it takes no longer than the tiles that are being stored. */
static bool stops_at_once(struct dig_thread *thread, const char *path)
{
    until_more_are_stored_s(path);
    double some_s = until_more_are_stored_s(path);
    nsec_t begin_ns = clock_monotonic_ns();
    dig_thread_stop(thread);
    return seconds_from_ns(clock_monotonic_ns() - begin_ns) < some_s + 0.7;
}

/* A strip of four thousand tiles, 64 of which are stored at a time. */
static void test_stop(void)
{
    static uint8_t body[STAMP_BYTES_MAX];
    char path[256];
    struct stamp strip = {.kind = STAMP_FLATTEN,
                          .lat_deg = 60.5,
                          .lon_deg = -22.2,
                          .flatten = {45.0, 15000.0, 500.0, 50.0, 60.0, 20.0}};
    struct dig_message message = {.kind = DIG_ADD, .session = 9, .request = 1, .body = body};
    bool at_once = false;
    snprintf(path, sizeof(path), "%s", path_of("stop.db"));
    build_exact(path);
    CHECK_INT(stamp_prepare(&strip, NULL), 0);
    message.size = stamp_encode(&strip, body);
    for (int i = 0; i < 3 && !at_once; i++) { /* the machine may be busy */
        struct dig_thread *thread = open_thread(path);
        CHECK(ask(thread, &message).status == DIG_STATUS_DONE);
        at_once = stops_at_once(thread, path);
    }
    CHECK(at_once);
    struct dig *dig = NULL;
    CHECK_INT(dig_open(path, &dig, NULL), 0);
    CHECK(tiles_stored(path) < dig_index_of(dig)->tile_count / 2); /* it was in the midst of it */
    dig_close(dig);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"a request and its answer are the bytes of the document", test_bytes},
        {"what is no request is refused by name", test_refused},
        {"a request is answered when it is on the disk, and done once", test_thread},
        {"the next request to many is not taken", test_full},
        {"it stops in the midst of storing tiles", test_stop},
    };
    return database_tests_main(tests, sizeof(tests) / sizeof(tests[0]));
}
