/* Digging that is killed, rots, runs out of disk or of rights: what was acknowledged is there. */
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>

#include "terrain/dig_writer.h"
#include "tests/database_fixture.h"
#include "tests/sample_grid.h"

#define NOBODY 65534

static uint32_t seed = 5;

static double chance(void)
{
    seed = seed * 1664525u + 1013904223u;
    return (double)(seed >> 8) / (1 << 24);
}

static struct stamp some_stamp(void)
{
    struct stamp stamp = {.kind = STAMP_CRATER,
                          .lat_deg = 60.0 + 0.02 * (chance() - 0.5),
                          .lon_deg = -22.0 + 0.04 * (chance() - 0.5),
                          .crater = {20.0 + 80.0 * chance(), 5.0, 1.0, 20.0}};
    if (stamp_prepare(&stamp, NULL) < 0)
        CHECK_FAIL("a crater is refused");
    return stamp;
}

static struct dig_writer *open_writer(const char *path)
{
    struct diag diag = {""};
    struct dig_writer *writer = NULL;
    if (dig_writer_open(path, &writer, &diag) < 0)
        CHECK_FAIL("opening for digging: %s", diag.text);
    return writer;
}

static void dig(const char *path, int count, bool settled)
{
    struct diag diag = {""};
    struct dig_writer *writer = open_writer(path);
    for (int i = 0; i < count; i++) {
        struct stamp stamp = some_stamp();
        int64_t id;
        if (dig_writer_add(writer, &stamp, 0, &id, &diag) != 0)
            CHECK_FAIL("digging: %s", diag.text);
    }
    while (settled && dig_writer_settle(writer, &diag) > 0)
        ;
    dig_writer_close(writer);
}

static bool print_fault(void *user, const struct database_fault *fault, uint64_t done,
                        uint64_t total)
{
    if (fault)
        CHECK_FAIL("verify: %s", fault->text);
    return false;
}

static uint64_t faults_of(const char *path, database_verify_function function)
{
    struct diag diag = {""};
    struct database *database = NULL;
    struct database_verify_report report = {0};
    int r = database_open(path, &database, &diag);
    if (r == 0)
        r = database_verify(database, function, NULL, &report, &diag);
    database_close(database);
    return r < 0 ? 1 : report.faults;
}

/* Digs, settles and undoes until it is killed; tells how many stamps there are after each change
 * that was acknowledged, the id of the newest with it. */
static void dig_until_killed(const char *path, int out)
{
    struct dig_writer *writer = NULL;
    struct diag diag;
    if (dig_writer_open(path, &writer, &diag) < 0)
        _exit(1);
    for (;;) {
        int64_t told[2] = {0, 0};
        double what = chance();
        if (what < 0.3) {
            if (dig_writer_settle(writer, &diag) < 0)
                _exit(2);
            continue;
        }
        if (what < 0.4 && dig_writer_index(writer)->stamp_count > 3) {
            if (dig_writer_undo(writer, 2, 0, &diag) < 0)
                _exit(3);
        } else {
            struct stamp stamp = some_stamp();
            if (dig_writer_add(writer, &stamp, 0, &told[1], &diag) < 0)
                _exit(4);
        }
        told[0] = dig_writer_index(writer)->stamp_count;
        if (write(out, told, sizeof(told)) != sizeof(told))
            _exit(5);
    }
}

/* What a writer told of: how many stamps there are, and the newest id that it gave. */
struct told {
    int64_t stamps, newest;
};

/* Reads what one more change gave; false when its writer is dead. */
static bool hear(int in, struct told *told)
{
    int64_t last[2];
    if (read(in, last, sizeof(last)) != sizeof(last))
        return false;
    told->stamps = last[0];
    told->newest = last[1] ? last[1] : told->newest;
    return true;
}

/* The state must be what was told last before the end, or one change further. */
static void check_survived(const char *path, const struct told *told)
{
    struct dig_writer *writer = open_writer(path);
    int64_t count = dig_writer_index(writer)->stamp_count;
    if (count != told->stamps && count != told->stamps + 1 && count != told->stamps - 2)
        CHECK_FAIL("%lld stamps were told of, and %lld are there", (long long)told->stamps,
                   (long long)count);
    struct stamp stamp = some_stamp();
    int64_t id = 0;
    CHECK_INT(dig_writer_add(writer, &stamp, 0, &id, NULL), 0);
    CHECK(id > told->newest); /* none is given twice, so none was lost */
    dig_writer_close(writer);
}

/* What a killed writer left beside it goes with the old one. */
static void start_anew(const char *path)
{
    char command[900];
    snprintf(command, sizeof(command), "rm -f '%s' '%s-wal' '%s-shm'", path, path, path);
    CHECK_INT(system(command), 0);
    build_exact(path);
}

static void test_killed(void)
{
    char path[256];
    int kills = check_kills(check_rounds(44, 12)), alive = 0;
    int64_t total = 0;
    snprintf(path, sizeof(path), "%s", path_of("killed.db"));
    for (int round = 0; round < kills; round++) {
        int pipes[2], status;
        if (round % 22 == 0)
            start_anew(path);
        struct dig_writer *writer = open_writer(path);
        struct told told = {dig_writer_index(writer)->stamp_count, 0};
        total += told.stamps;
        dig_writer_close(writer);
        CHECK_INT(pipe(pipes), 0);
        pid_t child = fork();
        if (child == 0) {
            seed += (uint32_t)round * 7919u;
            dig_until_killed(path, pipes[1]);
        }
        close(pipes[1]);
        /* After some changes, however long they take there, and anywhere in the next ones. */
        for (int i = (int)(8.0 * chance()); i > 0 && hear(pipes[0], &told); i--)
            ;
        usleep((useconds_t)(20000.0 * chance()));
        kill(child, SIGKILL);
        waitpid(child, &status, 0);
        alive += WIFSIGNALED(status);
        while (hear(pipes[0], &told))
            ;
        close(pipes[0]);
        check_survived(path, &told);
        if (round % 11 == 10)
            CHECK_INT(faults_of(path, print_fault), 0);
    }
    printf("     %d programs killed, %.0f stamps on the ground on average\n", alive,
           (double)total / kills);
    CHECK_INT(alive, kills);
    CHECK(total > kills * 5);
}

/* A sum over all that a reader gets of dug ground. */
static bool content_of(const char *path, uint64_t *ret_sum)
{
    struct diag diag;
    struct terrain_source *source = NULL;
    uint64_t sum = 0;
    if (database_source_open(path, 64, &source, &diag) < 0)
        return false;
    for (int g = 0; g < 7; g++) {
        static float heights_m[96 * 96];
        double step_deg = ldexp(1.0 / 120.0, 2 - 2 * g);
        struct terrain_grid grid = {step_deg,
                                    2.0 * step_deg,
                                    (int64_t)floor(60.0 / step_deg) - 48,
                                    (int64_t)floor(-22.0 / step_deg / 2.0) - 48,
                                    96,
                                    96};
        sample_grid(source, &grid, heights_m);
        for (int i = 0; i < 96 * 96; i++)
            sum = sum * 31 +
                  (uint64_t)(isnan(heights_m[i]) ? 77777 : llrintf(heights_m[i] * 1000.0f));
    }
    terrain_source_destroy(source);
    *ret_sum = sum;
    return true;
}

static void flip(const char *path, off_t at, int bit)
{
    uint8_t byte = 0;
    int file = open(path, O_RDWR);
    CHECK(file >= 0 && pread(file, &byte, 1, at) == 1);
    byte ^= (uint8_t)(1u << bit);
    CHECK(pwrite(file, &byte, 1, at) == 1);
    close(file);
}

/* In what digging added to the file. */
static void test_rot(void)
{
    char path[256];
    struct stat undug, dug;
    uint64_t good = 0, bad = 0;
    int found = 0, flips = check_rounds(60, 15);
    snprintf(path, sizeof(path), "%s", path_of("rot.db"));
    build_exact(path);
    CHECK_INT(stat(path, &undug), 0);
    dig(path, 12, true);
    dig(path, 3, false);
    CHECK_INT(stat(path, &dug), 0);
    CHECK_INT(faults_of(path, print_fault), 0);
    CHECK(content_of(path, &good));
    for (int n = 0; n < flips; n++) {
        off_t at = undug.st_size + (off_t)(chance() * (double)(dug.st_size - undug.st_size));
        flip(path, at, n % 8);
        bool survived = content_of(path, &bad);
        if (faults_of(path, NULL) > 0)
            found++;
        else if (!survived || bad != good)
            CHECK_FAIL("bit %d of byte %lld changes what is read, and is not found", n % 8,
                       (long long)at);
        flip(path, at, n % 8);
    }
    printf("     %d flips in %lld bytes: %d found\n", flips,
           (long long)(dug.st_size - undug.st_size), found);
    CHECK(found > flips * 6 / 10);
    CHECK_INT(faults_of(path, print_fault), 0);
}

/* A row of the journal that is no stamp any more. */
static void test_damaged_stamp(void)
{
    char path[256];
    struct diag diag = {""};
    struct dig_writer *writer = NULL;
    snprintf(path, sizeof(path), "%s", path_of("damaged.db"));
    build_exact(path);
    dig(path, 3, false);
    run_sql(path, "UPDATE stamps SET checksum = checksum + 1 WHERE id = 2");
    CHECK_INT(dig_writer_open(path, &writer, &diag), -EBADMSG);
    CHECK_CONTAINS(diag.text, "stamp 2 is damaged");
    struct terrain_source *source = open_source(path); /* readers go on, and count it */
    point_m(source, 60.0, -22.0);
    CHECK_INT(terrain_source_counts(source).read_errors, 1);
    terrain_source_destroy(source);
    CHECK_INT(faults_of(path, NULL), 1);
    run_sql(path, "DELETE FROM stamps WHERE id = 2");
    CHECK_INT(faults_of(path, NULL), 1);
}

static void test_damaged_tile(void)
{
    char path[256];
    uint64_t good = 0, bad = 0;
    snprintf(path, sizeof(path), "%s", path_of("tile.db"));
    build_exact(path);
    dig(path, 3, false);
    CHECK(content_of(path, &good));
    dig(path, 0, true);
    CHECK_INT(faults_of(path, print_fault), 0);
    run_sql(path, "UPDATE dug_tiles SET payload = substr(payload, 1, length(payload) - 1)");
    CHECK(faults_of(path, NULL) > 0);
    CHECK(content_of(path, &bad)); /* made from the stamps again */
    CHECK(bad == good);
}

static void test_full_disk(void)
{
    char path[256];
    struct diag diag = {""};
    struct rlimit old;
    struct stat status;
    int64_t id = 0;
    snprintf(path, sizeof(path), "%s", path_of("full.db"));
    build_exact(path);
    dig(path, 2, true);
    struct dig_writer *writer = open_writer(path);
    struct stamp stamp = some_stamp();
    CHECK_INT(stat(path, &status), 0);
    CHECK_INT(getrlimit(RLIMIT_FSIZE, &old), 0);
    signal(SIGXFSZ, SIG_IGN);
    struct rlimit tight = {1024, old.rlim_max};
    CHECK_INT(setrlimit(RLIMIT_FSIZE, &tight), 0);
    int r = dig_writer_add(writer, &stamp, 0, &id, &diag);
    CHECK_INT(setrlimit(RLIMIT_FSIZE, &old), 0);
    CHECK(r == -EIO || r == -ENOSPC);
    CHECK_CONTAINS(diag.text, "full.db");
    CHECK_INT(dig_writer_index(writer)->stamp_count, 2);
    CHECK_INT(dig_writer_add(writer, &stamp, 0, &id, &diag), 0);
    CHECK_INT(id, 3);
    dig_writer_close(writer);
    CHECK_INT(faults_of(path, print_fault), 0);
}

/* In a process of somebody who may write nothing: the exit status says what came of it. */
static int as_nobody(const char *path)
{
    int status;
    pid_t child = fork();
    if (child == 0) {
        struct diag diag = {""};
        struct terrain_source *source = NULL;
        double height_m = NAN;
        if (geteuid() == 0 && (setgid(NOBODY) < 0 || setuid(NOBODY) < 0))
            _exit(10);
        int r = database_source_open(path, 64, &source, &diag);
        if (r == 0)
            r = source->ops->sample_point(source, 60.0, -22.0, &height_m);
        if (r < 0)
            _exit(r == -EACCES && strstr(diag.text, "-wal") ? 11 : 12);
        _exit(isnan(height_m) ? 13 : height_m < -1000.0 ? 0 : 14);
    }
    waitpid(child, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

/* A strip far below the ground, so that one height tells whether it is there. */
static void test_read_only(void)
{
    char folder[200], path[220], wal[240], kept[240];
    struct diag diag = {""};
    int64_t id;
    snprintf(folder, sizeof(folder), "%s/closed", directory);
    snprintf(path, sizeof(path), "%s/dug.db", folder);
    snprintf(wal, sizeof(wal), "%s-wal", path);
    snprintf(kept, sizeof(kept), "%s/killed.db", folder);
    CHECK_INT(mkdir(folder, 0755), 0);
    CHECK_INT(chmod(directory, 0755), 0);
    build_exact(path);
    struct dig_writer *writer = open_writer(path);
    struct stamp strip = {.kind = STAMP_FLATTEN,
                          .lat_deg = 60.0,
                          .lon_deg = -22.0,
                          .flatten = {0.0, 100.0, 100.0, -2000.0, -2000.0, 50.0}};
    CHECK_INT(stamp_prepare(&strip, NULL), 0);
    CHECK_INT(dig_writer_add(writer, &strip, 0, &id, &diag), 0);
    copy_file(path, kept); /* as if its writer were killed now */
    snprintf(kept, sizeof(kept), "%s/killed.db-wal", folder);
    copy_file(wal, kept);
    snprintf(kept, sizeof(kept), "%s/killed.db", folder);
    dig_writer_close(writer);
    CHECK(access(wal, F_OK) != 0); /* one file again */
    CHECK_INT(chmod(path, 0444), 0);
    CHECK_INT(chmod(folder, 0555), 0);
    CHECK_INT(as_nobody(path), 0);
    CHECK_INT(as_nobody(kept), 11);
    CHECK_INT(chmod(folder, 0755), 0);
}

/* What an import does: the database is made anew and takes the old one's place. */
static void test_composed(void)
{
    char path[256];
    struct diag diag = {""};
    struct database *old = NULL;
    struct database_info info;
    uint64_t before = 0, after = 0;
    snprintf(path, sizeof(path), "%s", path_of("composed.db"));
    build_exact(path);
    dig(path, 5, false);
    CHECK(content_of(path, &before));
    dig(path, 0, true);
    struct dig_writer *writer = open_writer(path);
    struct stamp far = some_stamp();
    int64_t id = 0;
    far.lat_deg = 61.5;
    CHECK_INT(stamp_prepare(&far, NULL), 0);
    CHECK_INT(dig_writer_add(writer, &far, 0, &id, &diag), 0);
    CHECK_INT(database_open_old(path, &old, &diag), -EBUSY);
    CHECK_CONTAINS(diag.text, "open in another program");
    dig_writer_close(writer);
    CHECK_INT(database_open_old(path, &old, &diag), 0);
    CHECK_INT(database_compose(path, &old, 1, &diag), 0);
    database_close(old);
    CHECK(content_of(path, &after));
    CHECK(before == after);
    CHECK_INT(faults_of(path, print_fault), 0);
    CHECK_INT(database_open(path, &old, &diag), 0);
    CHECK_INT(database_info(old, &info, &diag), 0);
    CHECK_INT(info.stamps, 6);
    CHECK_INT(info.dug_tiles, 0);
    database_info_finish(&info);
    database_close(old);
    dig(path, 1, true);
    CHECK_INT(faults_of(path, print_fault), 0);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"a program that is killed while it digs loses nothing that it told of", test_killed,
         .one_thread = true},
        {"every flipped bit of what was dug is found, or nobody reads it", test_rot,
         .one_thread = true},
        {"a stamp that is damaged or gone is named", test_damaged_stamp},
        {"a damaged tile is made anew", test_damaged_tile},
        {"a full disk refuses a stamp, and nothing else is lost", test_full_disk},
        {"what was dug is read where nothing can be written", test_read_only},
        {"a database that is made anew keeps what was dug", test_composed},
    };
    return database_tests_main(tests, sizeof(tests) / sizeof(tests[0]));
}
