#include <errno.h>
#include <math.h>
#include <string.h>

#include "base/bytes.h"
#include "io/crc32.h"
#include "io/flight_formats.h"
#include "io/otwlog.h"
#include "io/otwlog_format.h"

bool otwlog_recognises(const void *data, size_t size)
{
    return size >= strlen(OTWLOG_MAGIC) && memcmp(data, OTWLOG_MAGIC, strlen(OTWLOG_MAGIC)) == 0;
}

int otwlog_reader_init(struct otwlog_reader *reader, const void *data, size_t size,
                       const char *name, struct diag *diag)
{
    struct byte_reader in = byte_reader_over(data, size);
    byte_reader_seek(&in, 8);
    uint32_t version = read_u32le(&in);
    read_u32le(&in);
    if (in.overrun)
        return diag_set(diag, -EBADMSG, "%s: byte %zu: it ends within the head", name, size);
    if (version != OTWLOG_VERSION)
        return diag_set(diag, -EBADMSG, "%s: byte 8: recording version %u, %d expected", name,
                        version, OTWLOG_VERSION);
    *reader = (struct otwlog_reader){.data = data, .size = size, .offset = OTWLOG_HEADER_SIZE};
    return 0;
}

int otwlog_reader_next(struct otwlog_reader *reader, struct otwlog_record *ret_record)
{
    if (reader->torn || reader->offset == reader->size)
        return 0;
    reader->torn = true; /* until the record proves sound */
    struct byte_reader in = byte_reader_over(reader->data, reader->size);
    byte_reader_seek(&in, reader->offset);
    uint32_t size = read_u32le(&in);
    unsigned type = read_u16le(&in), source = read_u16le(&in);
    nsec_t time_ns = (nsec_t)read_u64le(&in);
    uint32_t sum = read_u32le(&in);
    read_u32le(&in);
    if (in.overrun || size > OTWLOG_PAYLOAD_MAX || otwlog_padded(size) > in.size - in.offset)
        return 0;
    uint32_t crc = crc32_of_bytes(0, reader->data + reader->offset, 16);
    if (crc32_of_bytes(crc, in.data + in.offset, size) != sum)
        return 0;
    reader->torn = false;
    reader->offset = in.offset + otwlog_padded(size);
    *ret_record = (struct otwlog_record){.type = (enum otwlog_type)type,
                                         .source = source,
                                         .time_ns = time_ns,
                                         .payload = in.data + in.offset,
                                         .size = size};
    return 1;
}

int otwlog_pose_decode(const struct otwlog_record *record, struct pose *ret_pose)
{
    struct byte_reader in = byte_reader_over(record->payload, record->size);
    struct pose pose = {.time_ns = record->time_ns, .receive_ns = (nsec_t)read_u64le(&in)};
    pose.valid = read_u32le(&in);
    read_u32le(&in);
    pose.position.lat_deg = read_f64le(&in);
    pose.position.lon_deg = read_f64le(&in);
    pose.position.height_m = read_f64le(&in);
    pose.attitude.roll_deg = read_f64le(&in);
    pose.attitude.pitch_deg = read_f64le(&in);
    pose.attitude.heading_deg = read_f64le(&in);
    for (int i = 0; i < 3; i++)
        pose.velocity_ned_mps[i] = read_f64le(&in);
    for (int i = 0; i < 3; i++)
        pose.rates_body_dps[i] = read_f64le(&in);
    bool time_ok = pose.time_ns >= 0 && pose.time_ns < INT64_MAX / 2;
    if (in.overrun || !time_ok || !(pose.valid & POSE_POSITION) || !pose_is_sane(&pose))
        return -EBADMSG;
    *ret_pose = pose;
    return 0;
}

static bool format_recognises(const struct flight_input *input)
{
    return otwlog_recognises(input->data, input->size);
}

static int format_read(const struct flight_input *input, const struct flight_params *params,
                       struct flight *flight, struct diag *diag)
{
    struct otwlog_reader reader;
    struct otwlog_record record;
    size_t records = 0;
    int r = otwlog_reader_init(&reader, input->data, input->size, input->name, diag);
    if (r < 0)
        return r;
    for (; otwlog_reader_next(&reader, &record); records++) {
        struct pose pose;
        if (record.type != OTWLOG_POSE)
            continue;
        flight->counters.received++;
        if (otwlog_pose_decode(&record, &pose) < 0) {
            flight->counters.rejected[REJECT_FIELD]++;
            continue;
        }
        flight->counters.accepted++;
        r = flight_append(flight, &pose, NAN);
        if (r < 0)
            return r;
    }
    if (reader.torn)
        diag_set(&flight->note, 0,
                 "%s: byte %zu: a record that is cut off or damaged; the flight ends there, after "
                 "%zu records, and leaves out %zu bytes",
                 input->name, reader.offset, records, reader.size - reader.offset);
    return 0;
}

const struct flight_format flight_format_otwlog = {"otwlog", format_recognises, format_read};
