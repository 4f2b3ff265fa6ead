#include "io/flight.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "geo/frames.h"
#include "geo/geographic.h"
#include "io/flight_formats.h"

#define FILE_MAX_BYTES (INT64_C(8) << 30)

static const struct flight_format *const formats[] = {
    &flight_format_otwlog, &flight_format_pcap, &flight_format_candump,
    &flight_format_igc,    &flight_format_csv,
};

static int grow(struct flight *flight)
{
    if (flight->count >= FLIGHT_POSES_MAX)
        return -E2BIG;
    size_t capacity = flight->capacity ? flight->capacity * 2 : 1024;
    struct pose *poses = realloc(flight->poses, capacity * sizeof(*poses));
    if (poses)
        flight->poses = poses;
    float *agl_m = realloc(flight->agl_m, capacity * sizeof(*agl_m));
    if (agl_m)
        flight->agl_m = agl_m;
    if (!poses || !agl_m)
        return -ENOMEM;
    flight->capacity = capacity;
    return 0;
}

int flight_append(struct flight *flight, const struct pose *pose, double agl_m)
{
    if (flight->count == 0)
        flight->start_ns = pose->time_ns;
    nsec_t time_ns = pose->time_ns - flight->start_ns;
    size_t at = flight->count;
    if (at > 0 && time_ns <= flight->poses[at - 1].time_ns) {
        if (time_ns < flight->poses[at - 1].time_ns) {
            flight->counters.reordered++;
            return 0;
        }
        at--;
    } else if (at == flight->capacity) {
        int r = grow(flight);
        if (r < 0)
            return r;
    }
    flight->poses[at] = *pose;
    flight->poses[at].time_ns = flight->poses[at].receive_ns = time_ns;
    flight->agl_m[at] = (float)agl_m;
    flight->count = at + 1;
    return 0;
}

static void velocity_between(const struct pose *a, const struct pose *b, struct pose *pose)
{
    double a_m[3], b_m[3], axes[3][3], v_ecef_mps[3];
    double dt_s = seconds_from_ns(b->time_ns - a->time_ns);
    geocentric_from_geodetic(&a->position, a_m);
    geocentric_from_geodetic(&b->position, b_m);
    for (int i = 0; i < 3; i++)
        v_ecef_mps[i] = (b_m[i] - a_m[i]) / dt_s;
    frames_ned_axes_ecef(pose->position.lat_deg, pose->position.lon_deg, axes);
    frames_rotate(axes, v_ecef_mps, pose->velocity_ned_mps);
    pose->valid |= POSE_VELOCITY;
}

/* The turn from a to b in body axes, per second. */
static void rates_between(const struct pose *a, const struct pose *b, struct pose *pose)
{
    struct quaternion turn = quaternion_product(
        quaternion_conjugate(ecef_quaternion_from_attitude(&a->position, &a->attitude)),
        ecef_quaternion_from_attitude(&b->position, &b->attitude));
    double sign = turn.w < 0.0 ? -1.0 : 1.0;
    double v[3] = {sign * turn.x, sign * turn.y, sign * turn.z};
    double sine = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    double angle_rad = 2.0 * atan2(sine, sign * turn.w);
    double scale = sine > 1e-12 ? angle_rad / sine : 2.0;
    double dt_s = seconds_from_ns(b->time_ns - a->time_ns);
    for (int i = 0; i < 3; i++)
        pose->rates_body_dps[i] = v[i] * scale / dt_s * 180.0 / M_PI;
    pose->valid |= POSE_RATES;
}

void flight_add_motion(struct flight *flight)
{
    for (size_t i = 0; flight->count > 1 && i < flight->count; i++) {
        const struct pose *a = &flight->poses[i > 0 ? i - 1 : 0];
        const struct pose *b = &flight->poses[i + 1 < flight->count ? i + 1 : i];
        struct pose *pose = &flight->poses[i];
        velocity_between(a, b, pose);
        if (a->valid & b->valid & POSE_ATTITUDE)
            rates_between(a, b, pose);
    }
}

int line_reader_next(struct line_reader *reader, char ret_text[LINE_MAX_BYTES])
{
    if (reader->offset >= reader->size)
        return 0;
    reader->line++;
    const uint8_t *start = reader->data + reader->offset;
    size_t rest = reader->size - reader->offset;
    const uint8_t *end = memchr(start, '\n', rest);
    size_t length = end ? (size_t)(end - start) : rest;
    reader->offset += length + (end ? 1 : 0);
    reader->torn = !end;
    if (length > 0 && start[length - 1] == '\r')
        length--;
    if (length >= LINE_MAX_BYTES || memchr(start, '\0', length))
        return -EBADMSG;
    memcpy(ret_text, start, length);
    ret_text[length] = '\0';
    return 1;
}

bool flight_breaks_off(struct flight *flight, const char *name, const struct line_reader *lines)
{
    if (lines->torn)
        diag_set(&flight->note, 0, "%s:%u: it ends within this line; what comes before is read",
                 name, lines->line);
    return lines->torn;
}

int flight_load_memory(const char *name, const void *data, size_t size,
                       const struct flight_params *params, struct flight **ret_flight,
                       struct diag *diag)
{
    struct flight_input input = {.name = name, .data = data, .size = size};
    const struct flight_format *format = NULL;
    for (size_t i = 0; !format && i < sizeof(formats) / sizeof(formats[0]); i++)
        if (formats[i]->recognises(&input))
            format = formats[i];
    if (!format)
        return diag_set(diag, -EBADMSG,
                        "%s: byte 0: not a flight; CSV, pcap, candump, otwlog or IGC expected",
                        name);
    struct flight *flight = calloc(1, sizeof(*flight));
    if (!flight)
        return diag_set(diag, -ENOMEM, "%s: no memory", name);
    flight->format = format->name;
    int r = format->read(&input, params, flight, diag);
    if (r == -ENOMEM)
        diag_set(diag, r, "%s: no memory for %zu poses", name, flight->count);
    else if (r == -E2BIG)
        diag_set(diag, r, "%s: more than the %d poses that a flight may have", name,
                 FLIGHT_POSES_MAX);
    else if (r == 0 && flight->count == 0)
        r = diag_set(diag, -EBADMSG, "%s: it is %s, but holds no pose", name, format->name);
    if (r < 0) {
        flight_destroy(flight);
        return r;
    }
    *ret_flight = flight;
    return 0;
}

/* Into memory, not mapped: a file that shrinks while it is read would end the program by SIGBUS. So
 * many bytes as it had to begin with, or fewer where it has shrunk. */
static int read_whole(int fd, size_t size, uint8_t **ret_data, size_t *ret_size)
{
    uint8_t *data = malloc(size ? size : 1);
    size_t have = 0;
    if (!data)
        return -ENOMEM;
    while (have < size) {
        ssize_t n = read(fd, data + have, size - have);
        if (n < 0 && errno == EINTR)
            continue;
        if (n < 0) {
            int r = -errno;
            free(data);
            return r;
        }
        if (n == 0)
            break;
        have += (size_t)n;
    }
    *ret_data = data;
    *ret_size = have;
    return 0;
}

int flight_load(const char *path, const struct flight_params *params, struct flight **ret_flight,
                struct diag *diag)
{
    int fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0)
        return diag_set(diag, -errno, "%s: %s", path, strerror(errno));
    struct stat st;
    int r = fstat(fd, &st) < 0 ? -errno : 0;
    if (r == 0 && !S_ISREG(st.st_mode)) {
        close(fd);
        return diag_set(diag, S_ISDIR(st.st_mode) ? -EISDIR : -EBADMSG, "%s: not a file", path);
    }
    if (r == 0 && st.st_size > FILE_MAX_BYTES)
        r = -EFBIG;
    uint8_t *data = NULL;
    size_t size = 0;
    if (r == 0)
        r = read_whole(fd, (size_t)st.st_size, &data, &size);
    close(fd);
    if (r < 0)
        return diag_set(diag, r, "%s: %s", path, strerror(-r));
    r = flight_load_memory(path, data, size, params, ret_flight, diag);
    free(data);
    return r;
}

void flight_destroy(struct flight *flight)
{
    if (!flight)
        return;
    free(flight->poses);
    free(flight->agl_m);
    free(flight);
}

nsec_t flight_duration_ns(const struct flight *flight)
{
    return flight->poses[flight->count - 1].time_ns;
}

void flight_sample(const struct flight *flight, nsec_t time_ns, struct pose *ret_pose)
{
    const struct pose *poses = flight->poses;
    if (time_ns <= 0 || flight->count == 1) {
        *ret_pose = poses[0];
        return;
    }
    if (time_ns >= flight_duration_ns(flight)) {
        *ret_pose = poses[flight->count - 1];
        return;
    }
    size_t low = 0, high = flight->count - 1; /* poses[low] <= time < poses[high] */
    while (high - low > 1) {
        size_t middle = low + (high - low) / 2;
        *(poses[middle].time_ns <= time_ns ? &low : &high) = middle;
    }
    double fraction =
        (double)(time_ns - poses[low].time_ns) / (double)(poses[high].time_ns - poses[low].time_ns);
    pose_interpolate(&poses[low], &poses[high], fraction, ret_pose);
    ret_pose->time_ns = ret_pose->receive_ns = time_ns;
}
