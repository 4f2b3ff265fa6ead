/* How Modbus' server comes to its socket, and what keeps it from one. */
#include <dirent.h>
#include <errno.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include "io/modbus_server.h"
#include "tests/check.h"

static int open_descriptors(void)
{
    DIR *dir = opendir("/proc/self/fd");
    int count = 0;
    while (readdir(dir))
        count++;
    closedir(dir);
    return count;
}

/* With room for so many more descriptors, until it opens. */
static void without_descriptors_it_says_so_and_keeps_none(void)
{
    const struct modbus_server_params params = {.listen = "127.0.0.1:0"};
    struct modbus_server *server = NULL;
    struct rlimit limit;
    int r = -EMFILE, room = 0, before = open_descriptors(), next = dup(0);
    close(next);
    getrlimit(RLIMIT_NOFILE, &limit);
    for (; r < 0 && room < 20; room++) {
        const struct rlimit tight = {(rlim_t)(next + room), limit.rlim_max};
        struct diag diag = {""};
        CHECK_INT(setrlimit(RLIMIT_NOFILE, &tight), 0);
        r = modbus_server_open(&params, &server, &diag);
        CHECK_INT(setrlimit(RLIMIT_NOFILE, &limit), 0);
        if (r < 0) {
            CHECK_INT(r, -EMFILE);
            CHECK_STRING(diag.text, "127.0.0.1:0: Too many open files");
            CHECK_INT(open_descriptors(), before);
        }
    }
    CHECK_INT(r, 0);
    CHECK(room > 3);
    modbus_server_close(server);
    CHECK_INT(open_descriptors(), before);
}

static void an_inherited_descriptor_must_listen(void)
{
    struct modbus_server *server = NULL;
    struct diag diag;
    int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const struct modbus_server_params params = {.listen_fd = fd};
    CHECK_INT(modbus_server_open(&params, &server, &diag), -EINVAL);
    CHECK_CONTAINS(diag.text, "is no listening socket");
    CHECK_INT(listen(fd, 1), 0);
    CHECK_INT(modbus_server_open(&params, &server, &diag), 0);
    modbus_server_close(server);
    close(fd);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"without descriptors it says so and keeps none",
         without_descriptors_it_says_so_and_keeps_none},
        {"an inherited descriptor must listen", an_inherited_descriptor_must_listen},
    };
    return CHECK_MAIN(tests);
}
