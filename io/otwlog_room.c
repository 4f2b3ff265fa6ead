/* A recording that is being written is locked (flock) by who writes it; the kernel lets go of the
 * lock when that one ends, however it ends. So what cannot be locked is never removed. */
#include "io/otwlog_room.h"

#include <ctype.h>
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "io/otwlog_format.h"

/* Digits stand for themselves, 0 for any. The number follows, of three digits or more. */
#define STEM   "otwd-00000000T000000Z-"
#define SUFFIX ".otwlog"

static bool is_name(const char *name)
{
    size_t at = 0;
    for (; STEM[at]; at++)
        if (STEM[at] == '0' ? !isdigit((unsigned char)name[at]) : name[at] != STEM[at])
            return false;
    size_t digits = strspn(name + at, "0123456789");
    return digits >= 3 && digits <= 6 && strcmp(name + at + digits, SUFFIX) == 0;
}

static int choose(const struct dirent *entry)
{
    return is_name(entry->d_name);
}

/* By the second of the run's beginning, then by the number, which outgrows its three digits. */
static int by_age(const struct dirent **a, const struct dirent **b)
{
    size_t stem = strlen(STEM);
    int order = strncmp((*a)->d_name, (*b)->d_name, stem);
    long number_a = strtol((*a)->d_name + stem, NULL, 10);
    long number_b = strtol((*b)->d_name + stem, NULL, 10);
    return order ? order : (number_a > number_b) - (number_a < number_b);
}

static uint64_t bytes_of(int directory, const char *name)
{
    struct stat status;
    if (fstatat(directory, name, &status, AT_SYMLINK_NOFOLLOW) < 0 || !S_ISREG(status.st_mode))
        return 0;
    return (uint64_t)status.st_size;
}

/* It begins as a recording does, as far as it goes: a program may have been killed before that. */
static bool is_recording(int fd)
{
    char magic[sizeof(OTWLOG_MAGIC) - 1];
    ssize_t n = pread(fd, magic, sizeof(magic), 0);
    return n >= 0 && memcmp(magic, OTWLOG_MAGIC, (size_t)n) == 0;
}

static bool remove_one(int directory, const char *name)
{
    /* Not blocking: a pipe may bear the name. */
    int fd = openat(directory, name, O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
    struct stat status;
    bool ok = fd >= 0 && fstat(fd, &status) == 0 && S_ISREG(status.st_mode) && is_recording(fd) &&
              flock(fd, LOCK_EX | LOCK_NB) == 0 && unlinkat(directory, name, 0) == 0;
    if (fd >= 0)
        close(fd);
    return ok;
}

int otwlog_hold(int fd)
{
    struct stat status;
    if (flock(fd, LOCK_EX | LOCK_NB) < 0)
        return errno == EWOULDBLOCK ? -ESTALE : 0;
    return fstat(fd, &status) == 0 && status.st_nlink == 0 ? -ESTALE : 0;
}

int otwlog_make_room(const char *directory, uint64_t keep_bytes)
{
    struct dirent **list = NULL;
    uint64_t total = 0;
    int fd = open(directory, O_RDONLY | O_DIRECTORY | O_CLOEXEC), removed = 0;
    if (fd < 0)
        return -errno;
    int count = scandir(directory, &list, choose, by_age), error = errno;
    for (int i = 0; i < count; i++)
        total += bytes_of(fd, list[i]->d_name);
    for (int i = 0; i < count; i++) {
        uint64_t bytes = total > keep_bytes ? bytes_of(fd, list[i]->d_name) : 0;
        if (total > keep_bytes && remove_one(fd, list[i]->d_name)) {
            total -= bytes;
            removed++;
        }
        free(list[i]);
    }
    free(list);
    close(fd);
    return count < 0 ? -error : removed;
}
