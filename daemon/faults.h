/* Faults: stable codes for the log, the Modbus map and the crew (docs/faults.md). */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum fault_code {
    FAULT_NONE = 0,
#define FAULT(code, name, severity, raised, response, action) FAULT_##name = code,
#include "daemon/faults.def"
#undef FAULT
};

enum fault_severity {
    FAULT_SEVERITY_NOTICE,   /* the picture is as it should be */
    FAULT_SEVERITY_DEGRADED, /* it is worse */
    FAULT_SEVERITY_SEVERE,   /* it is wrong or absent */
};

struct fault_info {
    enum fault_code code;
    const char *name; /* "POSE_STALE" */
    enum fault_severity severity;
    const char *raised;   /* what raises it */
    const char *response; /* what the program does */
    const char *action;   /* what the crew should do */
};

/* All of them in order of their codes. */
const struct fault_info *fault_table(size_t *ret_count);

/* NULL for a code that does not exist. */
const struct fault_info *fault_find(unsigned code);

const char *fault_severity_name(enum fault_severity severity);

/* Which faults are active. Zeroed: none. One thread. */
struct fault_set {
    uint64_t active; /* one bit a row of the table */
};

/* True where that changed the set. An unknown code is our bug. */
bool fault_raise(struct fault_set *set, enum fault_code code);
bool fault_clear(struct fault_set *set, enum fault_code code);
bool fault_is_active(const struct fault_set *set, enum fault_code code);

/* The severest active one; among equals the one with the lowest code. FAULT_NONE where none is. */
enum fault_code fault_worst(const struct fault_set *set);
