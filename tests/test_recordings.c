/* Recordings as files among others: those of earlier runs give way, nobody else's do; and one that
 * shrinks while it is read harms nobody. */
#include <errno.h>
#include <fcntl.h>
#include <glob.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "io/flight.h"
#include "io/otwlog.h"
#include "io/otwlog_room.h"
#include "tests/check.h"

#define KIB 1024

static char directory[] = "/tmp/otwd-recordings-XXXXXX";

static const char *path_of(const char *name)
{
    static char path[512];
    snprintf(path, sizeof(path), "%s/%s", directory, name);
    return path;
}

static void put_file(const char *name, const char *start, int size_kib)
{
    FILE *file = fopen(path_of(name), "w");
    CHECK(file && fputs(start, file) >= 0 && fclose(file) == 0);
    CHECK_INT(truncate(path_of(name), (off_t)size_kib * KIB), 0);
}

static bool is_there(const char *name)
{
    return access(path_of(name), F_OK) == 0;
}

static void the_oldest_give_way(void)
{
    const char *const names[] = {
        "otwd-20240101T000000Z-002.otwlog", "otwd-20240101T000000Z-010.otwlog",
        "otwd-20240101T000000Z-999.otwlog", "otwd-20240101T000000Z-1000.otwlog",
        "otwd-20240102T000000Z-001.otwlog",
    };
    const int count = sizeof(names) / sizeof(names[0]);
    for (int i = count - 1; i >= 0; i--)
        put_file(names[i], "OTWLOG\r\n", 100);
    CHECK_INT(otwlog_make_room(directory, 500 * KIB), 0);
    for (int gone = 1; gone <= count; gone++) {
        CHECK_INT(otwlog_make_room(directory, (uint64_t)(500 - 100 * gone) * KIB), 1);
        for (int i = 0; i < count; i++)
            CHECK_INT(is_there(names[i]), i >= gone);
    }
    CHECK_INT(otwlog_make_room("/no/such/directory", 0), -ENOENT);
}

static void what_is_not_ours_stays(void)
{
    const char *const others[] = {
        "frame-20240101T000000Z.png",           "otwd-20240101T000000Z-001.otwlog.bak",
        "otwd-20240101T000000Z-01.otwlog",      "keep-20240101T000000Z-001.otwlog",
        "otwd-2024010XT000000Z-001.otwlog",     "otwd-20240101T000000Z-.otwlog",
        "otwd-20240101T000000Z-1234567.otwlog",
    };
    for (size_t i = 0; i < sizeof(others) / sizeof(others[0]); i++)
        put_file(others[i], "OTWLOG\r\n", 10);
    put_file("otwd-20240101T000000Z-003.otwlog", "a letter", 10); /* by name only */
    CHECK_INT(mkdir(path_of("otwd-20240101T000000Z-004.otwlog"), 0700), 0);
    CHECK_INT(mkfifo(path_of("otwd-20240101T000000Z-005.otwlog"), 0600), 0);
    char target[512];
    snprintf(target, sizeof(target), "%s", path_of(others[0]));
    CHECK_INT(symlink(target, path_of("otwd-20240101T000000Z-006.otwlog")), 0);
    put_file("otwd-20240101T000000Z-007.otwlog", "", 0); /* killed before its head */
    put_file("otwd-20240101T000000Z-008.otwlog", "OTWLOG\r\n", 10);
    CHECK_INT(otwlog_make_room(directory, 0), 2);
    for (size_t i = 0; i < sizeof(others) / sizeof(others[0]); i++)
        CHECK(is_there(others[i]));
    for (int i = 3; i <= 8; i++) {
        char name[64];
        snprintf(name, sizeof(name), "otwd-20240101T000000Z-%03d.otwlog", i);
        CHECK_INT(is_there(name), i < 7);
        (void)(unlink(path_of(name)) == 0 || rmdir(path_of(name)) == 0);
    }
    for (size_t i = 0; i < sizeof(others) / sizeof(others[0]); i++)
        unlink(path_of(others[i]));
}

static void what_somebody_writes_stays(void)
{
    const char *name = "otwd-20240101T000000Z-001.otwlog";
    put_file(name, "OTWLOG\r\n", 100);
    int fd = open(path_of(name), O_WRONLY | O_APPEND | O_CLOEXEC);
    CHECK_INT(otwlog_hold(fd), 0);
    CHECK_INT(otwlog_make_room(directory, 0), 0);
    CHECK(is_there(name));
    int second = open(path_of(name), O_WRONLY | O_CLOEXEC);
    CHECK_INT(otwlog_hold(second), -ESTALE);
    close(fd);
    CHECK_INT(otwlog_make_room(directory, 0), 1);
    CHECK_INT(otwlog_hold(second), -ESTALE); /* removed before it was held */
    close(second);
}

static size_t bytes_there(void)
{
    char pattern[512];
    glob_t found;
    struct stat status;
    size_t bytes = 0;
    snprintf(pattern, sizeof(pattern), "%s", path_of("otwd-*.otwlog"));
    CHECK_INT(glob(pattern, 0, NULL, &found), 0);
    for (size_t i = 0; i < found.gl_pathc; i++)
        bytes += stat(found.gl_pathv[i], &status) == 0 ? (size_t)status.st_size : 0;
    globfree(&found);
    return bytes;
}

/* A program started again and again: each run records a quarter of what the directory may take. */
static void runs_share_one_limit(void)
{
    static const uint8_t packet[4000];
    const struct otwlog_params params = {.directory = directory, .max_mib = 1};
    uint64_t removed = 0;
    for (int run = 0; run < 12; run++) {
        struct otwlog_writer *writer = NULL;
        struct diag diag = {""};
        CHECK_INT(otwlog_create(&params, &writer, &diag), 0);
        if (!writer)
            return;
        for (int i = 0; i < 64; i++)
            CHECK(otwlog_add_packet(writer, 0, packet, sizeof(packet), i));
        CHECK_INT(otwlog_flush(writer, &diag), 0);
        CHECK_INT(otwlog_dropped(writer), 0);
        removed += otwlog_removed(writer);
        otwlog_destroy(writer);
        size_t bytes = bytes_there();
        CHECK(bytes <= 1 << 20);
        CHECK(run < 6 || bytes > 700 << 10); /* and not more than needed is removed */
    }
    CHECK(removed >= 12);
    CHECK(otwlog_make_room(directory, 0) > 0);
}

/* Loads the file again and again while it is cut to nothing and grows again. */
static void load_for_a_while(const char *path)
{
    static const struct flight_params params = {.geoid = {.undulation_m = NULL}};
    for (int i = 0; i < 300; i++) {
        struct flight *flight = NULL;
        if (flight_load(path, &params, &flight, NULL) == 0)
            flight_destroy(flight);
    }
    _exit(0);
}

static void a_file_that_shrinks_while_it_is_read_harms_nobody(void)
{
    static const uint8_t packet[4000];
    const struct otwlog_params params = {.directory = directory, .max_mib = 64};
    struct otwlog_writer *writer = NULL;
    char path[4096];
    int status = 0;
    CHECK_INT(otwlog_create(&params, &writer, NULL), 0);
    if (!writer)
        return;
    for (int i = 0; i < 900; i++)
        CHECK(otwlog_add_packet(writer, 0, packet, sizeof(packet), i));
    CHECK_INT(otwlog_flush(writer, NULL), 0);
    snprintf(path, sizeof(path), "%s", otwlog_path(writer));
    otwlog_destroy(writer);
    struct stat whole;
    CHECK_INT(stat(path, &whole), 0);
    pid_t child = fork();
    if (child == 0)
        load_for_a_while(path);
    while (waitpid(child, &status, WNOHANG) == 0) {
        /* The head stays, so that it goes on being a recording. */
        CHECK_INT(truncate(path, 4096 + 64), 0);
        usleep(200);
        CHECK_INT(truncate(path, whole.st_size), 0);
        usleep(200);
    }
    CHECK(WIFEXITED(status) && WEXITSTATUS(status) == 0);
    unlink(path);
}

/* A file that is too large, and two of the kernel's, which say 4096 bytes: one has fewer, reading
 * the other fails. */
static void files_that_lie_about_their_size_are_told(void)
{
    static const char fewer[] = "/sys/devices/system/cpu/online",
                      fails[] = "/sys/class/net/lo/speed";
    const struct flight_params params = {.force_protocol = false};
    struct flight *flight = NULL;
    struct diag diag;
    char byte;
    put_file("vast.otwlog", "OTWLOG", 8 * KIB * KIB);
    CHECK_INT(truncate(path_of("vast.otwlog"), (INT64_C(8) << 30) + 1), 0);
    CHECK_INT(flight_load(path_of("vast.otwlog"), &params, &flight, &diag), -EFBIG);
    CHECK_CONTAINS(diag.text, "vast.otwlog: File too large");
    CHECK_INT(unlink(path_of("vast.otwlog")), 0);
    if (access(fewer, R_OK) == 0) {
        CHECK_INT(flight_load(fewer, &params, &flight, &diag), -EBADMSG);
        CHECK_CONTAINS(diag.text, "not a flight");
    }
    int fd = open(fails, O_RDONLY | O_CLOEXEC);
    if (fd >= 0 && read(fd, &byte, 1) < 0) {
        CHECK_INT(flight_load(fails, &params, &flight, &diag), -EINVAL);
        CHECK_CONTAINS(diag.text, "/sys/class/net/lo/speed: ");
    }
    close(fd);
}

static const struct check_test tests[] = {
    {"the oldest recordings give way", the_oldest_give_way},
    {"what is not a recording stays", what_is_not_ours_stays},
    {"what somebody writes stays", what_somebody_writes_stays},
    {"runs share one limit", runs_share_one_limit},
    {"a file that shrinks while it is read harms nobody",
     a_file_that_shrinks_while_it_is_read_harms_nobody},
    {"files that lie about their size are told", files_that_lie_about_their_size_are_told},
};

int main(void)
{
    if (!mkdtemp(directory))
        return 1;
    int failed = CHECK_MAIN(tests);
    rmdir(directory);
    return failed;
}
