#include "terrain/database_lock.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "terrain/database.h"

#define SUFFIX ".lock"

struct database_lock {
    int descriptor;
    char path[DATABASE_NAME_MAX + sizeof(SUFFIX)];
};

static int refuse(const char *database, int descriptor, struct diag *diag)
{
    char text[32] = "";
    ssize_t size = pread(descriptor, text, sizeof(text) - 1, 0);
    long process = size > 0 ? strtol(text, NULL, 10) : 0;
    if (process > 0)
        return diag_set(diag, -EBUSY, "%s is being written by process %ld: wait for it, or stop it",
                        database, process);
    return diag_set(diag, -EBUSY, "%s is being written by another process", database);
}

/* 0 where the locked file still has its name, 1 where its last holder has removed it, or -errno. */
static int check_name(const struct database_lock *lock)
{
    struct stat ours, named;
    if (fstat(lock->descriptor, &ours) < 0)
        return -errno;
    if (stat(lock->path, &named) < 0)
        return errno == ENOENT ? 1 : -errno;
    return ours.st_ino != named.st_ino || ours.st_dev != named.st_dev;
}

/* 0, 1 to be tried again, or -errno. */
static int try_lock(struct database_lock *lock, const char *database, struct diag *diag)
{
    lock->descriptor = open(lock->path, O_CREAT | O_RDWR | O_CLOEXEC, 0666);
    if (lock->descriptor < 0) /* a folder that is missing is no missing source */
        return diag_set(diag, errno == ENOSPC ? -ENOSPC : -EIO, "%s: %s", lock->path,
                        strerror(errno));
    int r = flock(lock->descriptor, LOCK_EX | LOCK_NB) == 0 ? check_name(lock) : -errno;
    if (r == 0)
        return 0;
    if (r == -EWOULDBLOCK)
        r = refuse(database, lock->descriptor, diag);
    else if (r < 0)
        r = diag_set(diag, -EIO, "%s: %s", lock->path, strerror(-r));
    close(lock->descriptor);
    return r;
}

int database_lock_take(const char *database, struct database_lock **ret_lock, struct diag *diag)
{
    struct database_lock *lock = calloc(1, sizeof(*lock));
    if (!lock)
        return -ENOMEM;
    int written = snprintf(lock->path, sizeof(lock->path), "%s" SUFFIX, database);
    int r = written < (int)sizeof(lock->path)
                ? 1
                : diag_set(diag, -ENAMETOOLONG, "%s: the name is too long", database);
    while (r == 1)
        r = try_lock(lock, database, diag);
    if (r < 0) {
        free(lock);
        return r;
    }
    /* For people; where there is no room for it the lock holds all the same. */
    if (ftruncate(lock->descriptor, 0) == 0)
        (void)dprintf(lock->descriptor, "%ld\n", (long)getpid());
    *ret_lock = lock;
    return 0;
}

void database_lock_release(struct database_lock *lock)
{
    if (!lock)
        return;
    unlink(lock->path);
    close(lock->descriptor);
    free(lock);
}
