/* Things with numbers, up to a limit, kept in the order of their numbers in memory that is taken
 * once. A thing is a struct that begins with its number, a uint64_t. */
#pragma once

#include <stddef.h>
#include <stdint.h>

struct cigi_table {
    char *items;
    size_t item_size, count, limit;
};

/* Returns 0 or -ENOMEM. */
int cigi_table_init(struct cigi_table *table, size_t item_size, size_t limit);
/* Legal on a table of zeros. */
void cigi_table_finish(struct cigi_table *table);

/* The thing in the place `index` < count. */
void *cigi_table_at(const struct cigi_table *table, size_t index);

/* The place of the first thing whose number is not less. */
size_t cigi_table_place(const struct cigi_table *table, uint64_t number);

/* NULL where there is none. Pointers live until the next put or drop. */
void *cigi_table_find(const struct cigi_table *table, uint64_t number);

/* The thing of that number, of zeros but for it where it is new; NULL where the table is full. */
void *cigi_table_put(struct cigi_table *table, uint64_t number);

/* Forgets all whose numbers are first .. last. */
void cigi_table_drop(struct cigi_table *table, uint64_t first, uint64_t last);
