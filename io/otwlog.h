/* Our own recording (.otwlog): what was received and what drove the picture. docs/wire.md specifies
 * the file. Append-only: a file that was cut off is good up to the cut.
 *
 * The writer never waits for a disk where poses come in: otwlog_add_*() copy into a ring (thread
 * A), otwlog_flush() takes it from there to the file (thread B, or A when it has time). What does
 * not fit the ring is dropped and counted. */
#pragma once

#include <stdatomic.h>

#include "base/diag.h"
#include "geo/pose.h"
#include "io/intake.h"

#define OTWLOG_VERSION     1
#define OTWLOG_HEADER_SIZE 16
#define OTWLOG_RECORD_HEAD 24
#define OTWLOG_PAYLOAD_MAX 4096

enum otwlog_type {
    OTWLOG_SOURCE = 1, /* u8 protocol, then the name: what a source number means */
    OTWLOG_POSE = 2,   /* the pose that drives the picture, ellipsoidal */
    OTWLOG_PACKET = 3, /* a datagram or a struct can_frame as received */
};

/* ---- reading: pure */

struct otwlog_record {
    enum otwlog_type type; /* or one that a later program wrote: pass it over */
    unsigned source;
    nsec_t time_ns; /* monotonic, of the recording machine */
    const uint8_t *payload;
    size_t size;
};

struct otwlog_reader {
    const uint8_t *data;
    size_t size, offset;
    bool torn; /* the file ends within a record, or in one whose checksum is wrong */
};

bool otwlog_recognises(const void *data, size_t size);

/* Returns 0, or -EBADMSG with a sentence that names the version. */
int otwlog_reader_init(struct otwlog_reader *reader, const void *data, size_t size,
                       const char *name, struct diag *diag);

/* Returns 1 with a record that points into the data, or 0 at the end or where the tail is torn. */
int otwlog_reader_next(struct otwlog_reader *reader, struct otwlog_record *ret_record);

/* Reads the payload of an OTWLOG_POSE. Returns 0 or -EBADMSG. */
int otwlog_pose_decode(const struct otwlog_record *record, struct pose *ret_pose);

/* ---- writing */

struct otwlog_params {
    const char *directory; /* must exist; files are otwd-YYYYMMDDThhmmssZ-NNN.otwlog */
    unsigned max_mib;      /* of all recordings there; the oldest are removed; 0 = 1024 */
    size_t ring_bytes;     /* 0 = 4 MiB */
};

struct otwlog_writer;

/* Returns 0 or -errno with a sentence that names the file. */
int otwlog_create(const struct otwlog_params *params, struct otwlog_writer **ret_writer,
                  struct diag *diag);

/* Flushes and closes. Legal on NULL. */
void otwlog_destroy(struct otwlog_writer *writer);

/* Thread A. Each returns false where the ring is full: the record is dropped and counted. */
bool otwlog_add_source(struct otwlog_writer *writer, unsigned source, enum pose_protocol protocol,
                       const char *name, nsec_t time_ns);
bool otwlog_add_pose(struct otwlog_writer *writer, unsigned source, const struct pose *pose);
bool otwlog_add_packet(struct otwlog_writer *writer, unsigned source, const void *data, size_t size,
                       nsec_t receive_ns);

/* Thread B. Writes what the ring holds; begins a new file where this one is full. Returns 0 or
 * -errno with a sentence (disk full); what was in the ring is then lost and the writer goes on. */
int otwlog_flush(struct otwlog_writer *writer, struct diag *diag);

/* Records in the files, which outlive a killed program, and those dropped for want of room or by a
 * fault of the disk. Any thread. */
uint64_t otwlog_written(const struct otwlog_writer *writer);
uint64_t otwlog_dropped(const struct otwlog_writer *writer);
/* Files removed to stay within max_mib. Any thread. */
uint64_t otwlog_removed(const struct otwlog_writer *writer);
/* The file being written. Thread B. */
const char *otwlog_path(const struct otwlog_writer *writer);
