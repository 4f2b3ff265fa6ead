/* Imports that do not come through in one go: killed, spread over several machines, out of disk. */
#include <errno.h>
#include <gdal.h>
#include <sys/resource.h>

#include "base/clock.h"
#include "tests/import_fixture.h"

static double whole_s; /* that an import of big.tif takes */

static void test_rasters(void)
{
    struct made fine = {1201, 801, 10.0, 46.0, 1 / 3600.0, -1 / 3600.0, 4326, GDT_Int16, NAN, 0.0};
    struct made utm = {300, 300, 500000.0, 5230000.0, 100.0, -100.0, 32632, GDT_Float32, NAN, 0.0};
    char command[1200];
    make_raster(in("hills.tif"), &ten_east, hills);
    make_raster(in("big.tif"), &fine, hills);
    make_raster(in("utm.tif"), &utm, slope_utm);
    snprintf(command, sizeof(command), "head -c 60000 '%s' > '%s'", in("hills.tif"), in("cut.tif"));
    CHECK_INT(system(command), 0);
    nsec_t begun_ns = clock_monotonic_ns();
    check_run(run("'%s' -o '%s' -q -j 2", in("big.tif"), in("whole.db")), 0);
    whole_s = seconds_from_ns(clock_monotonic_ns() - begun_ns);
    CHECK_INT(verify(in("whole.db")), 0);
}

static void test_same_bytes(void)
{
    check_run(run("'%s' -o '%s' -q --jobs 1", in("hills.tif"), in("one.db")), 0);
    check_run(run("'%s' -o '%s' -q --jobs 4", in("hills.tif"), in("four.db")), 0);
    CHECK(same_bytes(in("one.db"), in("four.db")));
}

/* Shards, in any order, are one import. */
static void test_shards(void)
{
    const char *otwd = getenv("OTWD");
    char command[3000];
    check_run(run("'%s' '%s' '%s' -o '%s' -q", in("big.tif"), in("utm.tif"), in("hills.tif"),
                  in("single.db")),
              0);
    for (int i = 1; i <= 3; i++)
        check_run(run("'%s' '%s' '%s' -o '%s/shard%d.db' -q --shard %d/3 -j %d", in("big.tif"),
                      in("utm.tif"), in("hills.tif"), directory, i, i, i),
                  0);
    snprintf(command, sizeof(command), "'%s' merge -q '%s' '%s' '%s' '%s'", otwd, in("merged.db"),
             in("shard2.db"), in("shard3.db"), in("shard1.db"));
    CHECK_INT(system(command), 0);
    CHECK(same_bytes(in("single.db"), in("merged.db")));
    CHECK_INT(verify(in("merged.db")), 0);
    for (int i = 0; i < 2; i++) {
        snprintf(command, sizeof(command),
                 i ? "'%s' merge -q '%s/m.db' '%s/shard1.db' '%s/single.db' 2> '%s/log'"
                   : "'%s' merge -q '%s/m.db' '%s/shard1.db' '%s/shard2.db' 2> '%s/log'",
                 otwd, directory, directory, directory, directory);
        CHECK_INT(WEXITSTATUS(system(command)), 64);
        CHECK(access(in("m.db"), F_OK) != 0);
    }
    check_run(run("'%s' -o '%s' --shard 4/3", in("hills.tif"), in("m.db")), 64);
}

static void remove_part(const char *path)
{
    char command[1200];
    snprintf(command, sizeof(command), "rm -f '%s' '%s'.part '%s'.part-wal '%s'.new", path, path,
             path, path);
    CHECK_INT(system(command), 0);
}

static bool kill_big_after(double seconds)
{
    const char *options[] = {in("big.tif"), "-o", in("resumed.db"), "-q", "-j", "2", NULL};
    return kill_after(seconds, options);
}

/* Killed at random times until it comes through: the bytes are those of one run. */
static void test_resume(void)
{
    struct diag diag = {""};
    struct database *database = NULL;
    uint32_t seed = 7;
    int kills = check_kills(check_rounds(50, 8)), killed = 0, refused = 0;
    for (int round = 0; round < check_rounds(8, 2) || killed < kills; round++) {
        remove_part(in("resumed.db"));
        for (int attempt = 0; attempt < 100; attempt++) {
            seed = seed * 1664525u + 1013904223u;
            nsec_t begun_ns = clock_monotonic_ns();
            bool was_killed = kill_big_after(0.005 + 1.1 * whole_s * (seed >> 8) / (1 << 24));
            double took_s = seconds_from_ns(clock_monotonic_ns() - begun_ns);
            if (attempt == 0) /* the machine may be more or less busy now */
                whole_s = was_killed ? fmax(whole_s, took_s) : took_s;
            if (!was_killed)
                break;
            killed++;
            int r = database_open(in("resumed.db"), &database, &diag);
            refused += r == -EBUSY;
            CHECK(r == 0 || r == -EBUSY || r == -ENOENT);
            database_close(r == 0 ? database : NULL);
        }
        check_run(run("'%s' -o '%s' -q", in("big.tif"), in("resumed.db")), 0);
        CHECK(same_bytes(in("whole.db"), in("resumed.db")));
        if (round == 40 + kills)
            break;
    }
    printf("     killed %d times, refused by readers %d times\n", killed, refused);
    CHECK(killed >= kills && refused > check_rounds(10, 2));
    CHECK_INT(verify(in("resumed.db")), 0);
    remove_part(in("resumed.db"));
    /* However fast the machine is: later and later, until there is something to go on with. */
    for (double seconds = 0.05; seconds < 5.0; seconds += 0.025) {
        if (kill_big_after(seconds) && access(in("resumed.db.part"), F_OK) == 0)
            break;
        remove_part(in("resumed.db"));
    }
    check_run(run("'%s' -o '%s' -q", in("hills.tif"), in("resumed.db")), 64);
    CHECK_CONTAINS(output, "unfinished import");
    CHECK_INT(database_open(in("resumed.db"), &database, &diag), -EBUSY);
    CHECK_CONTAINS(diag.text, "not complete");
}

/* Begins an import of big.tif, which holds the lock when this returns. */
static pid_t begin_import(const char *database)
{
    char lock[600];
    pid_t child = fork();
    if (child == 0) {
        execl(getenv("OTWD_IMPORT"), "otwd-import", in("big.tif"), "-o", database, "-q", "-j", "1",
              (char *)NULL);
        _exit(127);
    }
    snprintf(lock, sizeof(lock), "%s.lock", database);
    for (int i = 0; i < 20000 && access(lock, F_OK) != 0; i++)
        usleep(1000);
    CHECK(access(lock, F_OK) == 0);
    return child;
}

/* The second is refused at once, while the first reads its source and while it stores. The first is
 * stopped meanwhile, however fast it is. */
static void test_race(void)
{
    char expected[64];
    int status = -1;
    pid_t first = begin_import(in("raced.db"));
    snprintf(expected, sizeof(expected), "being written by process %ld", (long)first);
    kill(first, SIGSTOP);
    check_run(run("'%s' -o '%s' -q", in("hills.tif"), in("raced.db")), 75);
    CHECK_CONTAINS(output, "raced.db is being written by");
    kill(first, SIGCONT);
    for (int i = 0; i < 20000 && access(in("raced.db.part"), F_OK) != 0; i++)
        usleep(1000);
    kill(first, SIGSTOP);
    CHECK(access(in("raced.db.part"), F_OK) == 0);
    check_run(run("'%s' -o '%s' -q", in("hills.tif"), in("raced.db")), 75);
    CHECK_CONTAINS(output, expected);
    kill(first, SIGCONT);
    waitpid(first, &status, 0);
    CHECK(WIFEXITED(status) && WEXITSTATUS(status) == 0);
    CHECK(same_bytes(in("raced.db"), in("whole.db")));
    CHECK(access(in("raced.db.lock"), F_OK) != 0);
}

/* What a killed import leaves of its lock is a name; nobody has to remove it. */
static void test_killed_lock(void)
{
    remove_part(in("locked.db"));
    pid_t child = begin_import(in("locked.db"));
    kill(child, SIGKILL);
    waitpid(child, NULL, 0);
    CHECK(access(in("locked.db.lock"), F_OK) == 0);
    check_run(run("'%s' -o '%s' -q", in("big.tif"), in("locked.db")), 0);
    CHECK(same_bytes(in("locked.db"), in("whole.db")));
    CHECK(access(in("locked.db.lock"), F_OK) != 0);
}

/* As `run`, where no file may grow beyond so many bytes: what a full disk does, without one. */
static int run_with_limit(rlim_t bytes, const char *source, const char *database)
{
    struct rlimit old;
    CHECK_INT(getrlimit(RLIMIT_FSIZE, &old), 0);
    struct rlimit limit = {bytes, old.rlim_max};
    CHECK_INT(setrlimit(RLIMIT_FSIZE, &limit), 0);
    int status = run("'%s' -o '%s' -q", in(source), in(database));
    CHECK_INT(setrlimit(RLIMIT_FSIZE, &old), 0);
    return status;
}

static void test_failed_addition(void)
{
    struct made made = ten_east;
    made.west += 1.0;
    make_raster(in("beside.tif"), &made, hills);
    check_run(run("'%s' -o '%s' -q", in("hills.tif"), in("added.db")), 0);
    check_run(run("'%s' -o '%s'", in("cut.tif"), in("added.db")), 65);
    CHECK_CONTAINS(output, "cut.tif cannot be read");
    CHECK_INT(verify(in("added.db")), 0);
    check_run(run_with_limit(44 << 10, "beside.tif", "added.db"), 74); /* among the tiles */
    CHECK_CONTAINS(output, "added.db.part: File too large after ");
    CHECK_CONTAINS(output, " bytes free beside it");
    CHECK(access(in("added.db.part"), F_OK) == 0);
    CHECK_INT(verify(in("added.db")), 0);
    check_run(run("'%s' -o '%s' -q", in("hills.tif"), in("added.db")), 64);
    CHECK_CONTAINS(output, "unfinished import");
    check_run(run("'%s' -o '%s' -q", in("beside.tif"), in("added.db")), 0);
    CHECK_INT(verify(in("added.db")), 0);
    CHECK_NEAR(compare(in("beside.tif"), in("added.db"), 3).worst_m, 0.0, 0.0);
}

static const struct check_test tests[] = {
    {"one import, in one go", test_rasters},
    {"the bytes do not depend on the number of threads", test_same_bytes},
    {"shards make the database of a single import", test_shards},
    {"an import that is killed anywhere ends in the same bytes", test_resume},
    {"of two imports into one database the second is refused", test_race},
    {"the lock of a killed import does not stay", test_killed_lock},
    {"a failed addition leaves the database as it was, and goes on", test_failed_addition},
};

int main(void)
{
    return import_tests_main(tests, sizeof(tests) / sizeof(tests[0]));
}
