/* The tables that say what a configuration file may hold. Private to config/. */
#pragma once

#include <cyaml/cyaml.h>

/* The top-level mapping, laid over struct config. */
extern const cyaml_schema_value_t config_schema;

/* A leaf key: its default as it would stand in the file, and its limits where it is a number. */
struct config_key {
    const char *path;     /* "display.width", "sources[].priority" */
    const char *fallback; /* NULL: empty or zero, settled after loading */
    double min, max;      /* inclusive; both 0: any */
    const char *unit;     /* for the sentence; NULL where it is a bare number */
};

/* The row of `path`, or NULL where the schema has no such leaf. */
const struct config_key *config_key_find(const char *path);
