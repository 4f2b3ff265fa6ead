/* A configuration file. What is wrong with it is told at a line of it; what is loaded says the same
 * as itself. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "config/config.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void check_errors(const struct config_errors *errors)
{
    for (size_t i = 0; i < errors->count; i++) {
        const struct config_error *error = &errors->list[i];
        if (!error->text[0] || (i > 0 && error->line < errors->list[i - 1].line))
            abort();
    }
}

/* Who is on the list that it was made from is let in, and the address comes back from its text. */
static void check_allow(const struct config_source *source)
{
    struct allow_list allowed = {0};
    union address listen, again;
    char text[ADDRESS_TEXT_MAX];
    for (unsigned i = 0; i < source->allow_count; i++)
        if (allow_list_add(&allowed, source->allow[i].range, NULL) < 0)
            abort();
    if (!source->listen[0])
        return;
    if (address_parse(source->listen, &listen, NULL) < 0)
        abort();
    address_format(&listen, text);
    if (address_parse(text, &again, NULL) < 0 || address_port(&again) != address_port(&listen) ||
        allow_list_admits(&allowed, &again) != allow_list_admits(&allowed, &listen))
        abort();
}

static void check_config(const struct config *config)
{
    if (config->sources_count > CONFIG_SOURCES_MAX || config->entities_count > CONFIG_ENTITIES_MAX)
        abort();
    for (unsigned i = 0; i < config->sources_count; i++) {
        const struct config_source *source = &config->sources[i];
        check_allow(source);
        if (!config_source_same(source, source) || !source->name[0] || !source->priority ||
            source->allow_count > CONFIG_ALLOW_MAX || !config_source_type_name(source->type) ||
            config_can_table(source).count > CAN_TABLE_MAX)
            abort();
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static char path[32];
    static int fd = -1;
    struct config config;
    struct config_errors errors = {0};
    if (fd < 0) {
        fd = memfd_create("config", MFD_CLOEXEC);
        snprintf(path, sizeof(path), "/proc/self/fd/%d", fd);
    }
    if (ftruncate(fd, 0) < 0 || pwrite(fd, data, size, 0) != (ssize_t)size)
        abort();
    int r = config_load(path, &config, &errors);
    check_errors(&errors);
    if ((r == 0) != (errors.count == 0))
        abort();
    if (r == 0) {
        check_config(&config);
        config_finish(&config);
    }
    config_errors_finish(&errors);
    return 0;
}
