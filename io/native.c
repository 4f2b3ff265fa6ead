#include "io/native.h"

#include "base/bytes.h"

/* The twelve numbers, in the order of the wire. */
static const struct decode_field fields[] = {
    DECODE_FIELD(POSE_POSITION, position.lat_deg, 32, "latitude", "deg"),
    DECODE_FIELD(POSE_POSITION, position.lon_deg, 40, "longitude", "deg"),
    DECODE_FIELD(POSE_POSITION, position.height_m, 48, "altitude", "m"),
    DECODE_FIELD(POSE_ATTITUDE, attitude.roll_deg, 56, "roll", "deg"),
    DECODE_FIELD(POSE_ATTITUDE, attitude.pitch_deg, 64, "pitch", "deg"),
    DECODE_FIELD(POSE_ATTITUDE, attitude.heading_deg, 72, "heading", "deg"),
    DECODE_FIELD(POSE_VELOCITY, velocity_ned_mps[0], 80, "velocity north", "m/s"),
    DECODE_FIELD(POSE_VELOCITY, velocity_ned_mps[1], 88, "velocity east", "m/s"),
    DECODE_FIELD(POSE_VELOCITY, velocity_ned_mps[2], 96, "velocity down", "m/s"),
    DECODE_FIELD(POSE_RATES, rates_body_dps[0], 104, "roll rate", "deg/s"),
    DECODE_FIELD(POSE_RATES, rates_body_dps[1], 112, "pitch rate", "deg/s"),
    DECODE_FIELD(POSE_RATES, rates_body_dps[2], 120, "yaw rate", "deg/s"),
};
#define FIELDS (sizeof(fields) / sizeof(fields[0]))

static const struct {
    uint32_t flag, valid;
} flag_map[] = {
    {NATIVE_POSITION, POSE_POSITION},
    {NATIVE_ATTITUDE, POSE_ATTITUDE},
    {NATIVE_VELOCITY, POSE_VELOCITY},
    {NATIVE_RATES, POSE_RATES},
};
#define FLAGS (sizeof(flag_map) / sizeof(flag_map[0]))

bool native_recognises(const void *data, size_t size)
{
    struct byte_reader in = byte_reader_over(data, size);
    return read_u32be(&in) == NATIVE_MAGIC && !in.overrun;
}

/* Magic, version and size; leaves `in` behind them. */
static int decode_header(struct byte_reader *in, struct rejection *ret_rejection)
{
    if (in->size < 8)
        return reject(ret_rejection, REJECT_SHORT, in->size,
                      "it ends at byte %zu, within the header", in->size);
    uint32_t magic = read_u32be(in);
    if (magic != NATIVE_MAGIC)
        return reject(ret_rejection, REJECT_MAGIC, 0,
                      "it begins with %08x, not with %08x: it is not a native pose", magic,
                      NATIVE_MAGIC);
    unsigned major = read_u8(in), minor = read_u8(in), size = read_u16be(in);
    if (major != NATIVE_VERSION_MAJOR)
        return reject(ret_rejection, REJECT_VERSION, 4, "version %u.%u seen, version %d expected",
                      major, minor, NATIVE_VERSION_MAJOR);
    if (in->size < NATIVE_SIZE)
        return reject(ret_rejection, REJECT_SHORT, in->size,
                      "it ends at byte %zu, version %u.%u needs %d", in->size, major, minor,
                      NATIVE_SIZE);
    if (size != in->size)
        return reject(ret_rejection, REJECT_LENGTH, 6, "it says %u bytes and has %zu", size,
                      in->size);
    if (minor == NATIVE_VERSION_MINOR && size != NATIVE_SIZE)
        return reject(ret_rejection, REJECT_LENGTH, 6, "version %u.%u is %d bytes, this has %u",
                      major, minor, NATIVE_SIZE, size);
    return 0;
}

int native_decode(const void *data, size_t size, struct pose_sample *ret_sample,
                  struct rejection *ret_rejection)
{
    struct byte_reader in = byte_reader_over(data, size);
    int r = decode_header(&in, ret_rejection);
    if (r < 0)
        return r;
    struct pose_sample sample = {.has_sequence = true};
    sample.sequence = read_u32be(&in);
    uint32_t flags = read_u32be(&in);
    sample.sender_ns = (int64_t)read_u64be(&in);
    sample.session = read_u32be(&in);
    for (size_t i = 0; i < FLAGS; i++)
        if (flags & flag_map[i].flag)
            sample.pose.valid |= flag_map[i].valid;
    sample.datum = flags & NATIVE_ALTITUDE_EGM96 ? ALTITUDE_EGM96 : ALTITUDE_ELLIPSOID;
    if (!(sample.pose.valid & POSE_POSITION))
        return reject(ret_rejection, REJECT_FIELD, 12, "its flags %08x claim no position", flags);
    for (size_t i = 0; i < FIELDS; i++) {
        byte_reader_seek(&in, fields[i].offset);
        double value = read_f64be(&in);
        if (sample.pose.valid & fields[i].valid)
            memcpy((char *)&sample.pose + fields[i].member, &value, sizeof(value));
    }
    r = decode_check_fields(&sample.pose, fields, FIELDS, ret_rejection);
    if (r < 0)
        return r;
    decode_normalise(&sample.pose);
    *ret_sample = sample;
    return 0;
}

void native_encode(const struct pose_sample *sample, uint8_t ret_data[NATIVE_SIZE])
{
    uint32_t flags = sample->datum == ALTITUDE_EGM96 ? NATIVE_ALTITUDE_EGM96 : 0;
    for (size_t i = 0; i < FLAGS; i++)
        if (sample->pose.valid & flag_map[i].valid)
            flags |= flag_map[i].flag;
    struct byte_writer out = {.data = ret_data, .size = NATIVE_SIZE};
    byte_writer_put(&out, NATIVE_MAGIC, 4, true);
    byte_writer_put(&out, NATIVE_VERSION_MAJOR, 1, true);
    byte_writer_put(&out, NATIVE_VERSION_MINOR, 1, true);
    byte_writer_put(&out, NATIVE_SIZE, 2, true);
    byte_writer_put(&out, sample->sequence, 4, true);
    byte_writer_put(&out, flags, 4, true);
    byte_writer_put(&out, (uint64_t)sample->sender_ns, 8, true);
    byte_writer_put(&out, sample->session, 4, true);
    byte_writer_put(&out, 0, 4, true);
    for (size_t i = 0; i < FIELDS; i++) {
        double value = 0.0;
        if (sample->pose.valid & fields[i].valid)
            memcpy(&value, (const char *)&sample->pose + fields[i].member, sizeof(value));
        byte_writer_put(&out, bits_from_double(value), 8, true);
    }
}
