/* libcyaml without memory: each of its requests fails in turn. */
#include "tests/config_fixture.h"

#include <cyaml/cyaml.h>

static long requests_left;

/* In place of the library's own. */
void *cyaml_mem(void *context, void *memory, size_t size)
{
    if (size == 0) {
        free(memory);
        return NULL;
    }
    return requests_left-- > 0 ? realloc(memory, size) : NULL;
}

static void each_request_that_fails_is_told(void)
{
    static const char text[] = "channel: {name: left}\n"
                               "sources:\n"
                               "- {name: host, type: flightgear, allow: [10.0.0.0/8, 10.0.0.1]}\n"
                               "- {name: bus, type: canaerospace, interface: \"sim:/tmp/bus\"}\n";
    struct config config;
    struct config_errors errors;
    int r = -ENOMEM;
    long most = -1;
    while (r == -ENOMEM) {
        requests_left = ++most;
        r = load(text, &config, &errors);
        if (r < 0)
            CHECK_INT(config.sources_count, 0);
        for (size_t i = 0; i < errors.count; i++)
            CHECK_FAIL("after %ld requests: %s", most, errors.list[i].text);
        config_errors_finish(&errors);
    }
    printf("     %ld requests\n", most);
    CHECK_INT(r, 0);
    CHECK(most > 5);
    CHECK_INT(config.sources_count, 2);
    if (config.sources_count == 2)
        CHECK_STRING(config.sources[0].allow[1].range, "10.0.0.1");
    config_finish(&config);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"each request for memory that fails is told", each_request_that_fails_is_told},
    };
    int fd = mkstemp(file_path);
    if (fd < 0)
        return 1;
    close(fd);
    int status = CHECK_MAIN(tests);
    unlink(file_path);
    return status;
}
