#include "config/config.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "config/document.h"
#include "config/schema.h"

/* libcyaml's last words: the check of shapes should leave it nothing to complain about, but where
 * it does, its backtrace ("... (line: 3, column: 7)") is what the operator gets. */
struct backtrace {
    char text[512];
    unsigned line, column;
};

static void __attribute__((format(printf, 3, 0)))
take_log(cyaml_log_t level, void *context, const char *format, va_list args)
{
    struct backtrace *backtrace = context;
    char line[256];
    vsnprintf(line, sizeof(line), format, args);
    line[strcspn(line, "\n")] = '\0';
    size_t used = strlen(backtrace->text);
    snprintf(backtrace->text + used, sizeof(backtrace->text) - used, "%s%s", used ? "; " : "",
             line);
    const char *where = strstr(line, "line: ");
    if (where && !backtrace->line)
        sscanf(where, "line: %u, column: %u", &backtrace->line, &backtrace->column);
}

static int fill(struct document *document, struct config *config)
{
    struct backtrace backtrace = {0};
    const cyaml_config_t cyaml = {
        .log_fn = take_log,
        .log_ctx = &backtrace,
        .log_level = CYAML_LOG_WARNING,
        .mem_fn = cyaml_mem,
        .flags = CYAML_CFG_IGNORE_UNKNOWN_KEYS, /* the check of shapes has told of them */
    };
    struct config *loaded = NULL;
    cyaml_err_t error = cyaml_load_data((const uint8_t *)document->text, document->size, &cyaml,
                                        &config_schema, (cyaml_data_t **)&loaded, NULL);
    if (error == CYAML_ERR_OOM)
        return -ENOMEM;
    if (error != CYAML_OK) {
        document_complain_at(document, backtrace.line, backtrace.column, "%s: %s",
                             cyaml_strerror(error), backtrace.text);
        return -EBADMSG;
    }
    *config = *loaded;
    free(loaded);
    return 0;
}

static int compare_errors(const void *a, const void *b)
{
    const struct config_error *x = a, *y = b;
    if (x->line != y->line)
        return x->line < y->line ? -1 : 1;
    return (x->column > y->column) - (x->column < y->column);
}

static int build(struct document *document, struct config *config)
{
    const struct config_errors *errors = document->errors;
    document_check_shape(document, &config_schema);
    if (errors->count + errors->dropped > document->harmless)
        return -EBADMSG;
    int r = document_root(document) ? fill(document, config) : 0;
    if (r < 0)
        return r;
    document_apply_defaults(document, &config_schema, config);
    r = document_check_meaning(document, config);
    return r < 0 ? r : errors->count ? -EBADMSG : 0;
}

int config_load(const char *path, struct config *ret_config, struct config_errors *errors)
{
    struct config config = {0};
    struct document document = {.path = "(defaults)", .errors = errors};
    int r = path ? document_open(&document, path, errors) : 0;
    if (r == 0)
        r = build(&document, &config);
    document_close(&document);
    if (errors->count)
        qsort(errors->list, errors->count, sizeof(*errors->list), compare_errors);
    if (r == 0)
        *ret_config = config;
    else
        config_finish(&config);
    return r;
}

void config_finish(struct config *config)
{
    for (unsigned i = 0; i < config->sources_count; i++) {
        free(config->sources[i].allow);
        free(config->sources[i].fields);
    }
    free(config->sources);
    free(config->entities);
    *config = (struct config){0};
}

static bool same_bytes(const void *a, const void *b, size_t size)
{
    return size == 0 || memcmp(a, b, size) == 0;
}

/* Whatever keys there are: both were filled from zeroed memory, so bytes tell. */
bool config_source_same(const struct config_source *a, const struct config_source *b)
{
    struct config_source x, y;
    memcpy(&x, a, sizeof(x));
    memcpy(&y, b, sizeof(y));
    x.fields = y.fields = NULL;
    x.allow = y.allow = NULL;
    return same_bytes(&x, &y, sizeof(x)) &&
           same_bytes(a->fields, b->fields, a->fields_count * sizeof(*a->fields)) &&
           same_bytes(a->allow, b->allow, a->allow_count * sizeof(*a->allow));
}

struct can_table config_can_table(const struct config_source *source)
{
    struct can_table table = {.count = source->fields_count};
    for (unsigned i = 0; i < source->fields_count; i++)
        table.fields[i] = source->fields[i].wire;
    return table;
}

void config_errors_finish(struct config_errors *errors)
{
    for (size_t i = 0; i < errors->count; i++)
        free(errors->list[i].text);
    free(errors->list);
    *errors = (struct config_errors){0};
}
