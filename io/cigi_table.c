#include "io/cigi_table.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

int cigi_table_init(struct cigi_table *table, size_t item_size, size_t limit)
{
    char *items = calloc(limit, item_size);
    if (!items)
        return -ENOMEM;
    *table = (struct cigi_table){.items = items, .item_size = item_size, .limit = limit};
    return 0;
}

void cigi_table_finish(struct cigi_table *table)
{
    free(table->items);
    *table = (struct cigi_table){.items = NULL};
}

void *cigi_table_at(const struct cigi_table *table, size_t index)
{
    return table->items + index * table->item_size;
}

static uint64_t number_at(const struct cigi_table *table, size_t index)
{
    return *(const uint64_t *)cigi_table_at(table, index);
}

size_t cigi_table_place(const struct cigi_table *table, uint64_t number)
{
    size_t low = 0, high = table->count;
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        if (number_at(table, middle) < number)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

void *cigi_table_find(const struct cigi_table *table, uint64_t number)
{
    size_t place = cigi_table_place(table, number);
    return place < table->count && number_at(table, place) == number ? cigi_table_at(table, place)
                                                                     : NULL;
}

void *cigi_table_put(struct cigi_table *table, uint64_t number)
{
    size_t place = cigi_table_place(table, number);
    char *item = cigi_table_at(table, place);
    if (place < table->count && number_at(table, place) == number)
        return item;
    if (table->count == table->limit)
        return NULL;
    memmove(item + table->item_size, item, (table->count - place) * table->item_size);
    memset(item, 0, table->item_size);
    *(uint64_t *)(void *)item = number;
    table->count++;
    return item;
}

void cigi_table_drop(struct cigi_table *table, uint64_t first, uint64_t last)
{
    size_t from = cigi_table_place(table, first);
    size_t to = last == UINT64_MAX ? table->count : cigi_table_place(table, last + 1);
    if (from == to)
        return; /* a table that never held anything has no memory either */
    memmove(cigi_table_at(table, from), cigi_table_at(table, to),
            (table->count - to) * table->item_size);
    table->count -= to - from;
}
