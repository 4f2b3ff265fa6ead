#include "config/document.h"

#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define NESTING_MAX 32

static void add_error(struct config_errors *errors, struct config_error error)
{
    if (!error.text)
        return;
    struct config_error *list = NULL;
    if (errors->count < CONFIG_ERRORS_MAX)
        list = reallocarray(errors->list, errors->count + 1, sizeof(*list));
    if (!list) {
        errors->dropped++;
        free(error.text);
        return;
    }
    errors->list = list;
    errors->list[errors->count++] = error;
}

static void __attribute__((format(printf, 4, 0)))
complain(struct document *document, unsigned line, unsigned column, const char *format,
         va_list args)
{
    char *sentence, *text;
    if (vasprintf(&sentence, format, args) < 0)
        return;
    int length = line ? asprintf(&text, "%s:%u:%u: %s", document->path, line, column, sentence)
                      : asprintf(&text, "%s: %s", document->path, sentence);
    free(sentence);
    if (length >= 0)
        add_error(document->errors,
                  (struct config_error){.line = line, .column = column, .text = text});
}

void document_complain(struct document *document, const yaml_node_t *node, const char *format, ...)
{
    unsigned line = node ? (unsigned)node->start_mark.line + 1 : 0;
    unsigned column = node ? (unsigned)node->start_mark.column + 1 : 0;
    va_list args;
    va_start(args, format);
    complain(document, line, column, format, args);
    va_end(args);
}

void document_complain_at(struct document *document, unsigned line, unsigned column,
                          const char *format, ...)
{
    va_list args;
    va_start(args, format);
    complain(document, line, column, format, args);
    va_end(args);
}

static int read_all(struct document *document)
{
    int fd = open(document->path, O_RDONLY | O_CLOEXEC);
    if (fd < 0)
        return -errno;
    char *text = malloc(CONFIG_FILE_MAX + 1);
    size_t size = 0;
    ssize_t got = text ? 1 : -1;
    while (text && size <= CONFIG_FILE_MAX &&
           (got = read(fd, text + size, CONFIG_FILE_MAX + 1 - size)) > 0)
        size += (size_t)got;
    int r = !text ? -ENOMEM : got < 0 ? -errno : size > CONFIG_FILE_MAX ? -EFBIG : 0;
    close(fd);
    document->text = text;
    document->size = size;
    return r;
}

/* The slip that libyaml has the least helpful words for. `line` counts from 0, by more kinds of
 * line break than are looked for here. */
static bool is_indented_by_tab(const struct document *document, size_t line)
{
    const char *at = document->text, *end = at + document->size;
    for (; at && line > 0; line--) {
        const char *line_end = memchr(at, '\n', (size_t)(end - at));
        at = line_end ? line_end + 1 : NULL;
    }
    while (at && at < end && *at == ' ')
        at++;
    return at && at < end && *at == '\t';
}

static void complain_syntax(struct document *document, const yaml_parser_t *parser)
{
    unsigned line = (unsigned)parser->problem_mark.line + 1;
    unsigned column = (unsigned)parser->problem_mark.column + 1;
    const char *problem = parser->problem ? parser->problem : "not YAML";
    if (parser->error == YAML_READER_ERROR)
        document_complain(document, NULL, "%s, at byte %zu", problem, parser->problem_offset);
    else if (strstr(problem, "cannot start any token") &&
             is_indented_by_tab(document, parser->problem_mark.line))
        document_complain_at(document, line, column, "a tab: lines are indented by spaces");
    else if (parser->context)
        document_complain_at(document, line, column, "%s %s", problem, parser->context);
    else
        document_complain_at(document, line, column, "%s", problem);
}

/* libyaml needs time that grows with the square of the nesting: look before it builds a tree.
 * What else is wrong with the text is parse()'s to say. */
static int check_nesting(struct document *document)
{
    yaml_parser_t parser;
    yaml_event_t event;
    int depth = 0, r = 0;
    if (!yaml_parser_initialize(&parser))
        return -ENOMEM;
    yaml_parser_set_input_string(&parser, (const unsigned char *)document->text, document->size);
    for (bool more = true; more && r == 0 && yaml_parser_parse(&parser, &event);) {
        more = event.type != YAML_STREAM_END_EVENT;
        depth += event.type == YAML_SEQUENCE_START_EVENT || event.type == YAML_MAPPING_START_EVENT;
        depth -= event.type == YAML_SEQUENCE_END_EVENT || event.type == YAML_MAPPING_END_EVENT;
        if (depth > NESTING_MAX) {
            document_complain_at(document, (unsigned)event.start_mark.line + 1,
                                 (unsigned)event.start_mark.column + 1, "nested more than %d deep",
                                 NESTING_MAX);
            r = -EBADMSG;
        }
        yaml_event_delete(&event);
    }
    yaml_parser_delete(&parser);
    return r;
}

static int parse(struct document *document)
{
    yaml_parser_t parser;
    yaml_document_t extra;
    if (!yaml_parser_initialize(&parser))
        return -ENOMEM;
    yaml_parser_set_input_string(&parser, (const unsigned char *)document->text, document->size);
    document->loaded = yaml_parser_load(&parser, &document->yaml);
    bool ok = document->loaded;
    if (ok && yaml_document_get_root_node(&document->yaml)) {
        ok = yaml_parser_load(&parser, &extra);
        yaml_node_t *root = ok ? yaml_document_get_root_node(&extra) : NULL;
        if (root)
            document_complain(document, root, "a second document; the file may hold only one");
        if (ok)
            yaml_document_delete(&extra);
    }
    if (!ok && parser.error != YAML_MEMORY_ERROR)
        complain_syntax(document, &parser);
    int r = ok ? 0 : parser.error == YAML_MEMORY_ERROR ? -ENOMEM : -EBADMSG;
    yaml_parser_delete(&parser);
    return r;
}

int document_open(struct document *document, const char *path, struct config_errors *errors)
{
    *document = (struct document){.path = path, .errors = errors};
    int r = read_all(document);
    if (r == -EFBIG)
        document_complain(document, NULL, "larger than %d bytes", CONFIG_FILE_MAX);
    else if (r < 0 && r != -ENOMEM)
        document_complain(document, NULL, "cannot be read: %s", strerror(-r));
    if (r == 0)
        r = check_nesting(document);
    return r < 0 ? r : parse(document);
}

void document_close(struct document *document)
{
    if (document->loaded)
        yaml_document_delete(&document->yaml);
    free(document->text);
    *document = (struct document){0};
}

yaml_node_t *document_root(struct document *document)
{
    return document->loaded ? yaml_document_get_root_node(&document->yaml) : NULL;
}

yaml_node_t *document_get(struct document *document, yaml_node_t *mapping, const char *key,
                          yaml_node_t **ret_key)
{
    if (!mapping || mapping->type != YAML_MAPPING_NODE)
        return NULL;
    for (yaml_node_pair_t *pair = mapping->data.mapping.pairs.start;
         pair < mapping->data.mapping.pairs.top; pair++) {
        yaml_node_t *name = yaml_document_get_node(&document->yaml, pair->key);
        if (name->type != YAML_SCALAR_NODE ||
            strcmp((const char *)name->data.scalar.value, key) != 0)
            continue;
        if (ret_key)
            *ret_key = name;
        return yaml_document_get_node(&document->yaml, pair->value);
    }
    return NULL;
}

yaml_node_t *document_item(struct document *document, yaml_node_t *sequence, size_t index)
{
    if (!sequence || sequence->type != YAML_SEQUENCE_NODE ||
        index >= (size_t)(sequence->data.sequence.items.top - sequence->data.sequence.items.start))
        return NULL;
    return yaml_document_get_node(&document->yaml, sequence->data.sequence.items.start[index]);
}
