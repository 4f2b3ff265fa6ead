/* The lock of a database, also where its file cannot be looked up. */
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

#include "terrain/database_lock.h"
#include "tests/check.h"

static char database[64], lock_path[80];
static int fails; /* the errno of all look-ups, or 0 */
static unsigned looked_up;

/* In the place of the C library's. */
int stat(const char *restrict path, struct stat *restrict ret_stat)
{
    looked_up++;
    errno = fails;
    return fails ? -1 : fstatat(AT_FDCWD, path, ret_stat, 0);
}

int fstat(int fd, struct stat *ret_stat)
{
    looked_up++;
    errno = fails;
    return fails ? -1 : fstatat(fd, "", ret_stat, AT_EMPTY_PATH);
}

static void one_has_it_at_a_time(void)
{
    struct database_lock *lock = NULL, *other = NULL;
    struct diag diag;
    char owner[64];
    CHECK_INT(database_lock_take(database, &lock, &diag), 0);
    CHECK(looked_up >= 2); /* by what stands in for the C library's */
    CHECK_INT(database_lock_take(database, &other, &diag), -EBUSY);
    snprintf(owner, sizeof(owner), "is being written by process %ld:", (long)getpid());
    CHECK_CONTAINS(diag.text, owner);
    database_lock_release(lock);
    CHECK(access(lock_path, F_OK) != 0);
    CHECK_INT(database_lock_take(database, &other, &diag), 0);
    database_lock_release(other);
    database_lock_release(NULL);
}

static void a_name_that_cannot_be_looked_up_is_an_error(void)
{
    struct database_lock *lock = NULL;
    struct diag diag = {""};
    fails = EIO;
    alarm(20); /* it may try for ever */
    CHECK_INT(database_lock_take(database, &lock, &diag), -EIO);
    alarm(0);
    fails = 0;
    CHECK_CONTAINS(diag.text, lock_path);
    CHECK(!lock);
    CHECK_INT(database_lock_take(database, &lock, &diag), 0); /* the one before has let go */
    database_lock_release(lock);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"one has it at a time", one_has_it_at_a_time},
        {"a name that cannot be looked up is an error",
         a_name_that_cannot_be_looked_up_is_an_error},
    };
    char folder[] = "/tmp/otwd-lock-XXXXXX";
    if (!mkdtemp(folder))
        return 1;
    snprintf(database, sizeof(database), "%s/some.db", folder);
    snprintf(lock_path, sizeof(lock_path), "%s.lock", database);
    int failed = CHECK_MAIN(tests);
    rmdir(folder);
    return failed;
}
