#include "base/cache.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static int path_fits(int written, size_t size, struct diag *diag)
{
    if (written < 0 || (size_t)written >= size)
        return diag_set(diag, -ENAMETOOLONG, "the cache's path has more than %zu bytes", size);
    return 0;
}

int cache_directory(char *ret_path, size_t size, struct diag *diag)
{
    const char *systemd = getenv("CACHE_DIRECTORY"), *xdg = getenv("XDG_CACHE_HOME");
    const char *home = getenv("HOME");
    if (systemd && *systemd)
        return path_fits(snprintf(ret_path, size, "%.*s", (int)strcspn(systemd, ":"), systemd),
                         size, diag);
    if (xdg && *xdg == '/')
        return path_fits(snprintf(ret_path, size, "%s/otwd", xdg), size, diag);
    if (home && *home == '/')
        return path_fits(snprintf(ret_path, size, "%s/.cache/otwd", home), size, diag);
    return diag_set(diag, -ENOENT,
                    "cache: none of CACHE_DIRECTORY, XDG_CACHE_HOME and HOME names a "
                    "directory");
}

int cache_make_directories(char *path, struct diag *diag)
{
    for (char *slash = path;;) {
        slash = strchr(slash + 1, '/');
        if (slash)
            *slash = '\0';
        int r = mkdir(path, 0755) < 0 && errno != EEXIST ? -errno : 0;
        if (r < 0)
            diag_set(diag, r, "cache %s: %s", path, strerror(-r));
        if (slash)
            *slash = '/';
        if (r < 0 || !slash)
            return r;
    }
}

static int write_all(int fd, const char *bytes, size_t size)
{
    for (size_t done = 0; done < size;) {
        ssize_t n = write(fd, bytes + done, size - done);
        if (n < 0 && errno == EINTR)
            continue;
        if (n < 0)
            return -errno;
        done += (size_t)n;
    }
    return fsync(fd) < 0 ? -errno : 0;
}

/* Into a temporary file beside the target, then renamed over it. */
int cache_write(const char *path, const void *bytes, size_t size, struct diag *diag)
{
    char *temporary;
    if (asprintf(&temporary, "%s.XXXXXX", path) < 0)
        return -ENOMEM;
    int fd = mkstemp(temporary);
    int r = fd < 0 ? -errno : 0;
    if (r == 0) {
        r = write_all(fd, bytes, size);
        if (r == 0 && fchmod(fd, 0644) < 0)
            r = -errno;
        if (close(fd) < 0 && r == 0)
            r = -errno;
        if (r == 0 && rename(temporary, path) < 0)
            r = -errno;
        if (r < 0)
            unlink(temporary);
    }
    free(temporary);
    return r < 0 ? diag_set(diag, r, "cache %s: %s", path, strerror(-r)) : 0;
}
