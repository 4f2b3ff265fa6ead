/* `otwd import` hands over to otwd-import, the only program that links GDAL. */
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <sysexits.h>
#include <unistd.h>

#include "daemon/commands.h"
#include "daemon/import_exec.h"

/* otwd-import beside this program, so that a build folder works as an installation does. */
static void path_beside_us(char *ret_path, size_t size)
{
    char self[PATH_MAX];
    ssize_t length = readlink("/proc/self/exe", self, sizeof(self) - 1);
    self[length > 0 ? length : 0] = '\0';
    char *slash = strrchr(self, '/');
    snprintf(ret_path, size, "%.*sotwd-import", slash ? (int)(slash - self + 1) : 0, self);
}

int import_exec(char **argv)
{
    char path[PATH_MAX + 16];
    path_beside_us(path, sizeof(path));
    argv[0] = (char *)"otwd-import";
    execv(path, argv);
    execvp("otwd-import", argv);
    fprintf(stderr, "otwd: cannot run otwd-import: %s (it is built where GDAL is installed)\n",
            strerror(errno));
    return EX_UNAVAILABLE;
}

int import_main(int argc, char **argv)
{
    return import_exec(argv);
}
