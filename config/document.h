/* A YAML document in memory that knows at which line and column each node stands.
 *
 * libcyaml fills structs but stops at the first error and forgets positions; the document is what
 * the other checks use to report every error, each at its place. Private to config/. */
#pragma once

#include <stdbool.h>
#include <stddef.h>

#include <cyaml/cyaml.h>
#include <yaml.h>

#include "config/config.h"

struct document {
    const char *path; /* for the sentences */
    char *text;       /* the file, owned */
    size_t size;
    yaml_document_t yaml;
    bool loaded;                  /* yaml is to be deleted */
    struct config_errors *errors; /* borrowed */
    size_t harmless; /* of the errors: unknown keys and limits, which do not hinder loading */
};

/* Reads and parses; a syntax error or a second document is reported. `path` and `errors` must
 * outlive the document. Returns 0, -EBADMSG, -ENOMEM or the -errno of the file. */
int document_open(struct document *document, const char *path, struct config_errors *errors);
void document_close(struct document *document);

/* The root, or NULL where the file is empty. */
yaml_node_t *document_root(struct document *document);

/* The value (or, where `ret_key` is not NULL, also the key) of `key` in a mapping; NULL where
 * `mapping` is NULL, no mapping, or has no such key. */
yaml_node_t *document_get(struct document *document, yaml_node_t *mapping, const char *key,
                          yaml_node_t **ret_key);

/* Item `index` of a sequence, or NULL. */
yaml_node_t *document_item(struct document *document, yaml_node_t *sequence, size_t index);

/* Reports "path:line:column: sentence" at `node` (NULL: at the file). */
void document_complain(struct document *document, const yaml_node_t *node, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* The same at a line and column counted from 1. */
void document_complain_at(struct document *document, unsigned line, unsigned column,
                          const char *format, ...) __attribute__((format(printf, 4, 5)));

/* Checks every node against the schema and the limits of config/keys.c: unknown and repeated keys,
 * kinds, words, numbers, lengths. Reports all it finds. (config/shape.c) */
void document_check_shape(struct document *document, const cyaml_schema_value_t *schema);

/* Writes the defaults of all keys that the document does not have over `data`, which is laid out
 * by `schema`. (config/defaults.c) */
void document_apply_defaults(struct document *document, const cyaml_schema_value_t *schema,
                             void *data);

/* What no single key shows: relations, duplicates, addresses, what this version does not support.
 * Also settles defaults that depend on other keys. Returns 0 or -ENOMEM. (config/check.c) */
int document_check_meaning(struct document *document, struct config *config);

/* Of the list of entities; settles their sizes. (config/check_entities.c) */
void document_check_entities(struct document *document, struct config *config);
