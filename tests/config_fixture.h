/* A configuration from a string, and what is complained of in it: for the tests of config/. */
#pragma once

#include <errno.h>
#include <unistd.h>

#include "config/config.h"
#include "tests/check.h"

static char file_path[] = "/tmp/otwd-config-XXXXXX";

static inline void write_file(const char *text, size_t size)
{
    FILE *file = fopen(file_path, "w");
    if (!file || fwrite(text, 1, size, file) != size || fclose(file) != 0) {
        perror(file_path);
        exit(1);
    }
}

static inline int load(const char *text, struct config *config, struct config_errors *errors)
{
    write_file(text, strlen(text));
    *errors = (struct config_errors){0};
    *config = (struct config){0};
    return config_load(file_path, config, errors);
}

/* The complaints about `text`, one a line, each without the leading file name. */
static inline const char *complaints(const char *text)
{
    static char out[16384];
    struct config config;
    struct config_errors errors;
    int r = load(text, &config, &errors);
    out[0] = '\0';
    for (size_t i = 0; i < errors.count; i++) {
        const char *line = errors.list[i].text;
        CHECK(strncmp(line, file_path, strlen(file_path)) == 0);
        strcat(strcat(out, i ? "\n" : ""), line + strlen(file_path) + 1);
    }
    CHECK_INT(r, errors.count ? -EBADMSG : 0);
    config_finish(&config);
    config_errors_finish(&errors);
    return out;
}

struct bad {
    const char *text, *expected;
};

static inline void check_bad(const struct bad *bad, size_t count)
{
    for (size_t i = 0; i < count; i++)
        CHECK_STRING(complaints(bad[i].text), bad[i].expected);
}
