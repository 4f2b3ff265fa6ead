/* Digging in a database: stamps that last, and the tiles that are made of them.
 *
 * A stamp is a row of the file's journal; once dig_writer_add has returned it is on the disk,
 * whatever happens next, and it is seen. Settling makes and stores the tiles that stamps changed,
 * a few dozen in a transaction; a crash leaves some unsettled, and nothing else.
 *
 * One program at a time digs in a database, or imports into it (terrain/database_lock.h); others
 * read. One thread at a time. */
#pragma once

#include "terrain/dig.h"

struct dig_writer;

/* -ENOENT, -EACCES (it cannot be written), -EBADMSG (also where a stamp of the journal is damaged),
 * -EBUSY (another program writes it), -EIO, -ENOMEM. Nothing is changed before the first stamp. */
int dig_writer_open(const char *path, struct dig_writer **ret_writer, struct diag *diag);
/* Legal on NULL. Nobody may use its ground any more. */
void dig_writer_close(struct dig_writer *writer);

/* The ground with all that this writer did, for a reader to share; borrowed. */
struct dig *dig_writer_ground(struct dig_writer *writer);
/* The stamps that count, oldest first; until the next change. */
const struct dig_index *dig_writer_index(const struct dig_writer *writer);

enum dig_result {
    DIG_KNOWN = 1, /* a request that was answered before: nothing was done again */
};

/* Puts a stamp on the ground. `request` tells a request that is sent twice, 0: it cannot be. Gives
 * the stamp's id. 0, DIG_KNOWN, or -ENOSPC, -EIO, -EBUSY, -ESTALE (another file has taken the
 * database's place), -ENOBUFS or -E2BIG as dig_index_reserve: then nothing has changed. */
int dig_writer_add(struct dig_writer *writer, const struct stamp *stamp, int64_t request,
                   int64_t *ret_id, struct diag *diag);

/* Takes the last `count` stamps away, as if they had never been. 0, DIG_KNOWN, -EINVAL where there
 * are not so many, -EBADMSG where a stamp of the journal is damaged, else as above: then nothing
 * has changed. */
int dig_writer_undo(struct dig_writer *writer, uint32_t count, int64_t request, struct diag *diag);

#define DIG_SETTLE_TILES 64 /* in one transaction */

/* Makes and stores some of the tiles that are behind. Returns how many (0: all are settled), or
 * -errno. */
int dig_writer_settle(struct dig_writer *writer, struct diag *diag);
