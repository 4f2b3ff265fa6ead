/* The tables of what was dug: `stamps`, the journal, and `dug_tiles`, what was made of it.
 * docs/terrain-database.md specifies both. A database that nobody has dug has neither.
 *
 * Functions here are steps: where several belong together the caller has begun a transaction. One
 * thread at a time. */
#pragma once

#include "terrain/dig_index.h"

/* Opens a finished database for digging: as database_open, and -EACCES where it cannot be written,
 * -EBUSY where another program has it for itself. Changes nothing yet. */
int dig_store_open(const char *path, struct database **ret_database, struct diag *diag);

/* 1 = the database has been dug, 0 = not, or -errno. */
int dig_store_exists(struct database *database, struct diag *diag);

/* Makes the tables where there are none, and brings the file to WAL mode; not in a transaction. */
int dig_store_create(struct database *database, struct diag *diag);
/* Makes it one file again, where no other program has it open. */
void dig_store_fold(struct database *database);

/* A row of the journal. `body` lives as long as the call. */
struct dig_row {
    int64_t id;
    const uint8_t *body;
    size_t size;
    int64_t request; /* of whom asked for it; 0: nobody who would ask again */
    int64_t undone;  /* 0: it counts; else the request that undid it, or 1 */
    bool sound;      /* its checksum is right */
};

/* Returns 0 to go on, else what dig_store_list_stamps then returns. */
typedef int (*dig_row_function)(void *user, const struct dig_row *row, struct diag *diag);

/* All rows in order of the id. 0 where the database has not been dug. */
int dig_store_list_stamps(struct database *database, dig_row_function function, void *user,
                          struct diag *diag);

/* Appends a stamp. */
int dig_store_add(struct database *database, const uint8_t *body, size_t size, int64_t request,
                  int64_t *ret_id, struct diag *diag);
/* Marks a stamp as undone. */
int dig_store_undo(struct database *database, int64_t id, int64_t undone, struct diag *diag);
/* The stamp that a request made, or the first that it undid; 0 where it has done neither. */
int dig_store_find_request(struct database *database, int64_t request, int64_t *ret_id,
                           struct diag *diag);
/* The highest id that was ever given. */
int dig_store_last(struct database *database, int64_t *ret_id, struct diag *diag);

/* A dug tile as it is stored. */
struct dig_record {
    struct tile_id id; /* as the index counts levels */
    int64_t stamp;     /* the last that is in it */
    float min_m, max_m;
    uint32_t posts;   /* as in struct tile_record */
    uint8_t *payload; /* owned; coded without a parent */
    size_t size;
};

/* Legal on zeros. */
void dig_record_finish(struct dig_record *record);
int dig_record_encode(struct dig_record *record, const struct dig_grid *grid,
                      const float *heights_m);
/* 0, -EBADMSG. */
int dig_record_decode(const struct dig_record *record, const struct dig_grid *grid,
                      float *ret_heights_m);

int dig_store_write_tile(struct database *database, const struct dig_grid *grid,
                         const struct dig_record *record, struct diag *diag);
/* 0, DATABASE_ABSENT, -EBADMSG where its checksum is wrong; the caller finishes the record. */
int dig_store_read_tile(struct database *database, const struct dig_grid *grid, struct tile_id id,
                        struct dig_record *ret_record, struct diag *diag);
/* Where the stamp of this id, or a later one, is in it. */
int dig_store_drop_tile(struct database *database, const struct dig_grid *grid, struct tile_id id,
                        int64_t stamp, struct diag *diag);

typedef void (*dig_tile_function)(void *user, struct tile_id id, int64_t stamp);

/* All tiles in order of the key. */
int dig_store_list_tiles(struct database *database, const struct dig_grid *grid,
                         dig_tile_function function, void *user, struct diag *diag);

struct dig_counts {
    uint64_t stamps, undone; /* that count; that were taken back */
    uint64_t tiles, bytes;   /* of dug tiles; of these and of the stamps */
};

/* Zeros where the database has not been dug. */
int dig_store_count(struct database *database, struct dig_counts *ret_counts, struct diag *diag);

/* Makes the journal of `from` that of `to`, whose transaction is open; its tiles are left behind:
 * they are made again. */
int dig_store_copy(struct database *to, struct database *from, struct diag *diag);
