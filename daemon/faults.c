#include "daemon/faults.h"

#include <assert.h>

#define FAULT(code, name, severity, raised, response, action)                                      \
    {code, #name, FAULT_SEVERITY_##severity, raised, response, action},

static const struct fault_info table[] = {
#include "daemon/faults.def"
};

#undef FAULT

#define COUNT (sizeof(table) / sizeof(table[0]))

_Static_assert(COUNT <= 64, "a fault_set has one bit a fault");

const struct fault_info *fault_table(size_t *ret_count)
{
    *ret_count = COUNT;
    return table;
}

const struct fault_info *fault_find(unsigned code)
{
    for (size_t i = 0; i < COUNT; i++)
        if (table[i].code == code)
            return &table[i];
    return NULL;
}

const char *fault_severity_name(enum fault_severity severity)
{
    static const char *const names[] = {"notice", "degraded", "severe"};
    return names[severity];
}

static uint64_t bit_of(enum fault_code code)
{
    const struct fault_info *info = fault_find(code);
    assert(info);
    return UINT64_C(1) << (info - table);
}

bool fault_raise(struct fault_set *set, enum fault_code code)
{
    uint64_t before = set->active;
    set->active |= bit_of(code);
    return set->active != before;
}

bool fault_clear(struct fault_set *set, enum fault_code code)
{
    uint64_t before = set->active;
    set->active &= ~bit_of(code);
    return set->active != before;
}

bool fault_is_active(const struct fault_set *set, enum fault_code code)
{
    return set->active & bit_of(code);
}

enum fault_code fault_worst(const struct fault_set *set)
{
    const struct fault_info *worst = NULL;
    for (size_t i = 0; i < COUNT; i++)
        if ((set->active >> i & 1) && (!worst || table[i].severity > worst->severity))
            worst = &table[i];
    return worst ? worst->code : FAULT_NONE;
}
