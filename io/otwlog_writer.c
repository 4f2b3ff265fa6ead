/* A byte ring between the thread that receives and the one that writes, and a chain of files. All
 * recordings in the directory together stay within max_mib: each may take an eighth, and before one
 * is begun the oldest give way to it. A new file begins with the sources again, so that each can be
 * read alone. */
#include <assert.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "base/bytes.h"
#include "io/arbiter.h"
#include "io/crc32.h"
#include "io/otwlog.h"
#include "io/otwlog_format.h"
#include "io/otwlog_room.h"

#define FILE_SHARE         8
#define NUMBER_MAX         999999
#define FLAGS              (O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_APPEND)
#define MAX_MIB_DEFAULT    1024
#define RING_BYTES_DEFAULT (4u << 20)
#define PATH_BYTES         4096
#define SOURCE_NAME_MAX    64
#define RECORD_BYTES_MAX   (OTWLOG_RECORD_HEAD + OTWLOG_PAYLOAD_MAX)

struct source_record {
    size_t size;
    uint8_t bytes[OTWLOG_RECORD_HEAD + SOURCE_NAME_MAX];
};

struct otwlog_writer {
    /* the ring: head is moved by the flushing thread, tail by the adding one */
    uint8_t *ring;
    size_t ring_size; /* a power of two */
    _Atomic size_t head, tail;
    _Atomic uint64_t written, dropped, removed;
    /* the rest belongs to the flushing thread */
    char directory[PATH_BYTES - 64], stem[32], path[PATH_BYTES];
    int fd;
    unsigned number; /* of the file now written */
    size_t file_bytes, file_limit;
    struct source_record sources[ARBITER_SOURCES_MAX];
};

static void path_of(const struct otwlog_writer *writer, unsigned number, char ret[PATH_BYTES])
{
    snprintf(ret, PATH_BYTES, "%s/%s-%03u.otwlog", writer->directory, writer->stem, number);
}

static int write_all(int fd, const uint8_t *data, size_t size)
{
    while (size > 0) {
        ssize_t n = write(fd, data, size);
        if (n < 0 && errno == EINTR)
            continue;
        if (n < 0)
            return -errno;
        data += n;
        size -= (size_t)n;
    }
    return 0;
}

static int append(struct otwlog_writer *writer, const uint8_t *data, size_t size)
{
    int r = write_all(writer->fd, data, size);
    if (r == 0)
        writer->file_bytes += size;
    return r;
}

/* Opens the next file whose name is free, and holds it. */
static int open_next(struct otwlog_writer *writer)
{
    while (writer->number < NUMBER_MAX) { /* others may have begun in the same second */
        path_of(writer, ++writer->number, writer->path);
        int fd = open(writer->path, FLAGS, 0644);
        if (fd < 0 && errno != EEXIST)
            return -errno;
        if (fd >= 0 && otwlog_hold(fd) == 0)
            return fd;
        if (fd >= 0)
            close(fd);
    }
    return -EEXIST;
}

static int begin_file(struct otwlog_writer *writer, struct diag *diag)
{
    if (writer->fd >= 0)
        close(writer->fd);
    /* Where the directory cannot be listed now, it is when the next file begins. */
    int removed =
        otwlog_make_room(writer->directory, writer->file_limit * (uint64_t)(FILE_SHARE - 1));
    if (removed > 0)
        atomic_fetch_add_explicit(&writer->removed, (uint64_t)removed, memory_order_relaxed);
    writer->file_bytes = 0;
    writer->fd = open_next(writer);
    if (writer->fd < 0)
        return diag_set(diag, writer->fd, "%s: cannot record: %s", writer->path,
                        strerror(-writer->fd));
    uint8_t head[OTWLOG_HEADER_SIZE] = OTWLOG_MAGIC;
    struct byte_writer out = {.data = head, .size = sizeof(head), .offset = 8};
    byte_writer_put(&out, OTWLOG_VERSION, 4, false);
    int r = append(writer, head, sizeof(head));
    for (int i = 0; r == 0 && i < ARBITER_SOURCES_MAX; i++)
        r = append(writer, writer->sources[i].bytes, writer->sources[i].size);
    if (r < 0) { /* nothing that was recorded is in it */
        unlink(writer->path);
        return diag_set(diag, r, "%s: cannot record: %s", writer->path, strerror(-r));
    }
    return 0;
}

static size_t power_of_two(size_t at_least)
{
    size_t size = 4 * RECORD_BYTES_MAX; /* room for a few records, whatever was asked */
    size_t power = 1;
    while (power < (at_least > size ? at_least : size))
        power *= 2;
    return power;
}

int otwlog_create(const struct otwlog_params *params, struct otwlog_writer **ret_writer,
                  struct diag *diag)
{
    struct otwlog_writer *writer = calloc(1, sizeof(*writer));
    if (!writer)
        return diag_set(diag, -ENOMEM, "%s: no memory to record", params->directory);
    writer->fd = -1;
    writer->ring_size = power_of_two(params->ring_bytes ? params->ring_bytes : RING_BYTES_DEFAULT);
    writer->ring = malloc(writer->ring_size);
    if (writer->ring) /* from now on, not little by little: memory that grows looks like a leak */
        memset(writer->ring, 0xff, writer->ring_size);
    size_t max_mib = params->max_mib ? params->max_mib : MAX_MIB_DEFAULT;
    writer->file_limit = (max_mib << 20) / FILE_SHARE;
    snprintf(writer->directory, sizeof(writer->directory), "%s", params->directory);
    time_t now = (time_t)(clock_realtime_ns() / NSEC_PER_SEC);
    struct tm utc;
    strftime(writer->stem, sizeof(writer->stem), "otwd-%Y%m%dT%H%M%SZ", gmtime_r(&now, &utc));
    int r = writer->ring ? begin_file(writer, diag)
                         : diag_set(diag, -ENOMEM, "%s: no memory to record", params->directory);
    if (r < 0) {
        otwlog_destroy(writer);
        return r;
    }
    *ret_writer = writer;
    return 0;
}

void otwlog_destroy(struct otwlog_writer *writer)
{
    if (!writer)
        return;
    if (writer->fd >= 0) {
        otwlog_flush(writer, NULL);
        close(writer->fd);
    }
    free(writer->ring);
    free(writer);
}

static void ring_write(struct otwlog_writer *writer, size_t at, const uint8_t *data, size_t size)
{
    size_t start = at & (writer->ring_size - 1), first = writer->ring_size - start;
    if (first > size)
        first = size;
    memcpy(writer->ring + start, data, first);
    memcpy(writer->ring, data + first, size - first);
}

static void ring_read(const struct otwlog_writer *writer, size_t at, uint8_t *ret_data, size_t size)
{
    size_t start = at & (writer->ring_size - 1), first = writer->ring_size - start;
    if (first > size)
        first = size;
    memcpy(ret_data, writer->ring + start, first);
    memcpy(ret_data + first, writer->ring, size - first);
}

static bool add(struct otwlog_writer *writer, enum otwlog_type type, unsigned source,
                nsec_t time_ns, const void *payload, size_t size)
{
    uint8_t record[RECORD_BYTES_MAX] = {0};
    size_t total = OTWLOG_RECORD_HEAD + otwlog_padded(size);
    size_t tail = atomic_load_explicit(&writer->tail, memory_order_relaxed);
    size_t head = atomic_load_explicit(&writer->head, memory_order_acquire);
    if (size > OTWLOG_PAYLOAD_MAX || writer->ring_size - (tail - head) < total) {
        atomic_fetch_add_explicit(&writer->dropped, 1, memory_order_relaxed);
        return false;
    }
    struct byte_writer out = {.data = record, .size = OTWLOG_RECORD_HEAD};
    byte_writer_put(&out, size, 4, false);
    byte_writer_put(&out, type, 2, false);
    byte_writer_put(&out, source, 2, false);
    byte_writer_put(&out, (uint64_t)time_ns, 8, false);
    byte_writer_put(&out, crc32_of_bytes(crc32_of_bytes(0, record, 16), payload, size), 4, false);
    memcpy(record + OTWLOG_RECORD_HEAD, payload, size);
    ring_write(writer, tail, record, total);
    atomic_store_explicit(&writer->tail, tail + total, memory_order_release);
    return true;
}

bool otwlog_add_source(struct otwlog_writer *writer, unsigned source, enum pose_protocol protocol,
                       const char *name, nsec_t time_ns)
{
    assert(source < ARBITER_SOURCES_MAX);
    uint8_t payload[SOURCE_NAME_MAX] = {(uint8_t)protocol};
    size_t length = strnlen(name, sizeof(payload) - 1);
    memcpy(payload + 1, name, length);
    return add(writer, OTWLOG_SOURCE, source, time_ns, payload, length + 1);
}

void otwlog_pose_encode(const struct pose *pose, uint8_t ret_payload[OTWLOG_POSE_SIZE])
{
    struct byte_writer out = {.data = ret_payload, .size = OTWLOG_POSE_SIZE};
    const double numbers[12] = {
        pose->position.lat_deg,    pose->position.lon_deg,    pose->position.height_m,
        pose->attitude.roll_deg,   pose->attitude.pitch_deg,  pose->attitude.heading_deg,
        pose->velocity_ned_mps[0], pose->velocity_ned_mps[1], pose->velocity_ned_mps[2],
        pose->rates_body_dps[0],   pose->rates_body_dps[1],   pose->rates_body_dps[2]};
    byte_writer_put(&out, (uint64_t)pose->receive_ns, 8, false);
    byte_writer_put(&out, pose->valid, 4, false);
    byte_writer_put(&out, 0, 4, false);
    for (int i = 0; i < 12; i++)
        byte_writer_put(&out, bits_from_double(numbers[i]), 8, false);
}

bool otwlog_add_pose(struct otwlog_writer *writer, unsigned source, const struct pose *pose)
{
    uint8_t payload[OTWLOG_POSE_SIZE];
    otwlog_pose_encode(pose, payload);
    return add(writer, OTWLOG_POSE, source, pose->time_ns, payload, sizeof(payload));
}

bool otwlog_add_packet(struct otwlog_writer *writer, unsigned source, const void *data, size_t size,
                       nsec_t receive_ns)
{
    return add(writer, OTWLOG_PACKET, source, receive_ns, data, size);
}

/* Keeps a source record for the files to come. */
static void remember_source(struct otwlog_writer *writer, const uint8_t *record, size_t size)
{
    struct byte_reader in = byte_reader_over(record, size);
    byte_reader_seek(&in, 4);
    unsigned type = read_u16le(&in), source = read_u16le(&in);
    if (type != OTWLOG_SOURCE || source >= ARBITER_SOURCES_MAX ||
        size > sizeof(writer->sources[source].bytes))
        return;
    memcpy(writer->sources[source].bytes, record, size);
    writer->sources[source].size = size;
}

static int flush_record(struct otwlog_writer *writer, const uint8_t *record, size_t size,
                        struct diag *diag)
{
    int r = writer->file_bytes + size > writer->file_limit || writer->fd < 0
                ? begin_file(writer, diag)
                : 0;
    remember_source(writer, record, size);
    if (r == 0 && (r = append(writer, record, size)) < 0)
        diag_set(diag, r, "%s: cannot record: %s", writer->path, strerror(-r));
    return r;
}

int otwlog_flush(struct otwlog_writer *writer, struct diag *diag)
{
    size_t head = atomic_load_explicit(&writer->head, memory_order_relaxed);
    size_t tail = atomic_load_explicit(&writer->tail, memory_order_acquire);
    int result = 0;
    while (head != tail) {
        uint8_t record[RECORD_BYTES_MAX];
        ring_read(writer, head, record, 4);
        struct byte_reader in = byte_reader_over(record, 4);
        size_t size = OTWLOG_RECORD_HEAD + otwlog_padded(read_u32le(&in));
        ring_read(writer, head, record, size);
        if (result == 0)
            result = flush_record(writer, record, size, diag);
        atomic_fetch_add_explicit(result < 0 ? &writer->dropped : &writer->written, 1,
                                  memory_order_relaxed);
        head += size;
        atomic_store_explicit(&writer->head, head, memory_order_release);
    }
    if (result < 0 && writer->fd >= 0) { /* a torn record ends this file; go on in another */
        close(writer->fd);
        writer->fd = -1;
    }
    return result;
}

uint64_t otwlog_written(const struct otwlog_writer *writer)
{
    return atomic_load_explicit(&writer->written, memory_order_relaxed);
}

uint64_t otwlog_dropped(const struct otwlog_writer *writer)
{
    return atomic_load_explicit(&writer->dropped, memory_order_relaxed);
}

uint64_t otwlog_removed(const struct otwlog_writer *writer)
{
    return atomic_load_explicit(&writer->removed, memory_order_relaxed);
}

const char *otwlog_path(const struct otwlog_writer *writer)
{
    return writer->path;
}
