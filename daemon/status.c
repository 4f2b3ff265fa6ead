#include "daemon/status.h"

#include <argp.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <sysexits.h>

#include "daemon/cli.h"
#include "daemon/faults.h"
#include "io/modbus_client.h"

struct status_options {
    const char *server;
    unsigned unit, timeout_ms;
    bool json;
};

static int parse_number(const char *text, long min, long max, struct argp_state *state,
                        const char *name)
{
    char *end;
    long value = strtol(text, &end, 10);
    if (end == text || *end || value < min || value > max)
        argp_error(state, "--%s takes a whole number between %ld and %ld, not '%s'", name, min, max,
                   text);
    return (int)value;
}

static error_t parse_option(int key, char *argument, struct argp_state *state)
{
    struct status_options *options = state->input;
    switch (key) {
    case 'm':
        options->server = argument;
        return 0;
    case 'u':
        options->unit = (unsigned)parse_number(argument, 0, 255, state, "unit");
        return 0;
    case 't':
        options->timeout_ms = (unsigned)parse_number(argument, 1, 60000, state, "timeout-ms");
        return 0;
    case 'j':
        options->json = true;
        return 0;
    default:
        return cli_argument(key, argument, state, NULL, NULL);
    }
}

static const struct argp_option options_known[] = {
    {"modbus", 'm', "HOST:PORT", 0, "where it listens (default 127.0.0.1:1502)", 0},
    {"unit", 'u', "N", 0, "its Modbus unit (default 1)", 0},
    {"timeout-ms", 't', "MS", 0, "how long to wait for an answer (default 2000)", 0},
    {"json", 'j', NULL, 0, "as JSON", 0},
    {0},
};

static const struct argp parser = {
    .options = options_known,
    .parser = parse_option,
    .doc = "Show the health of a running otwd.\vExit status: 0 read, 64 bad usage, 69 no otwd "
           "answered.",
};

static void print_pose(FILE *out, const struct health *h)
{
    fprintf(out, "%-20s%.7f %.7f\n", "position, deg", h->position.lat_deg, h->position.lon_deg);
    fprintf(out, "%-20s%.2f above ellipsoid\n", "height, m", h->position.height_m);
    if (isnan(h->height_above_terrain_m))
        fprintf(out, "%-20sunknown\n", "above terrain, m");
    else
        fprintf(out, "%-20s%.0f\n", "above terrain, m", h->height_above_terrain_m);
    fprintf(out, "%-20sroll %.2f pitch %.2f heading %.2f\n", "attitude, deg", h->attitude.roll_deg,
            h->attitude.pitch_deg, h->attitude.heading_deg);
}

static void print_input(FILE *out, const struct health *h)
{
    if (h->active_source)
        fprintf(out, "%-20s%u\n", "source", h->active_source);
    else
        fprintf(out, "%-20snone\n", "source");
    if (h->pose_age_ns < 0)
        fprintf(out, "%-20snone yet\n", "pose age, ms");
    else
        fprintf(out, "%-20s%.0f%s\n", "pose age, ms", milliseconds_from_ns(h->pose_age_ns),
                h->pose_valid ? "" : " (stale)");
    fprintf(out, "%-20s%llu accepted, %llu rejected, %llu lost\n", "pose packets",
            (unsigned long long)h->pose_accepted, (unsigned long long)h->pose_rejected,
            (unsigned long long)h->pose_lost);
    fprintf(out, "%-20s%s, %llu frames\n", "CAN", health_can_name(h->can_state),
            (unsigned long long)h->can_frames);
}

static void print_frames(FILE *out, const struct health *h)
{
    fprintf(out, "%-20s%.2f Hz, %llu rendered, %llu deadlines missed\n", "frames", h->frame_rate_hz,
            (unsigned long long)h->frames_rendered, (unsigned long long)h->missed_deadlines);
    fprintf(out, "%-20sp50 %.3f  p99 %.3f  max %.3f\n", "frame time, ms",
            milliseconds_from_ns(h->frame.p50_ns), milliseconds_from_ns(h->frame.p99_ns),
            milliseconds_from_ns(h->frame.max_ns));
    if (h->transport.p99_ns > 0)
        fprintf(out, "%-20sp50 %.3f  p99 %.3f\n", "transport delay, ms",
                milliseconds_from_ns(h->transport.p50_ns),
                milliseconds_from_ns(h->transport.p99_ns));
    else
        fprintf(out, "%-20snone: no pose in the last second\n", "transport delay, ms");
}

void status_print(FILE *out, const struct health *h)
{
    const struct fault_info *fault = fault_find(h->fault_code);
    fprintf(out, "%-20s%s\n", "state", health_state_name(h->state));
    if (fault)
        fprintf(out, "%-20s%u %s: %s\n", "fault", h->fault_code, fault->name, fault->raised);
    else if (h->fault_code)
        fprintf(out, "%-20s%u\n", "fault", h->fault_code);
    else
        fprintf(out, "%-20snone\n", "fault");
    fprintf(out, "%-20s%.0f s\n", "uptime", seconds_from_ns(h->uptime_ns));
    print_frames(out, h);
    if (h->swap.channels > 0) {
        char text[HEALTH_SWAP_TEXT_MAX];
        health_swap_format(&h->swap, text);
        fprintf(out, "%-20s%s\n", "swap lock", text);
    }
    print_input(out, h);
    print_pose(out, h);
    fprintf(out, "%-20s%u resident, %u pending, %llu read errors%s\n", "terrain tiles",
            h->tiles_resident, h->tiles_pending, (unsigned long long)h->terrain_read_errors,
            h->terrain_complete ? "" : " (incomplete)");
    fprintf(out, "%-20s%u resident, %u GPU\n", "memory, MiB", h->resident_mib, h->gpu_mib);
    fprintf(out, "%-20s%llu frames%s\n", "recorded", (unsigned long long)h->frames_recorded,
            h->recorder_good ? "" : " (failed)");
    fprintf(out, "%-20s%u\n", "Modbus clients", h->modbus_clients);
    fprintf(out, "%-20s%u\n", "config generation", h->config_generation);
}

static json_t *times_json(const struct health_times *times, bool with_max)
{
    json_t *object = json_pack("{s:f,s:f}", "p50", milliseconds_from_ns(times->p50_ns), "p99",
                               milliseconds_from_ns(times->p99_ns));
    if (with_max)
        json_object_set_new(object, "max", json_real(milliseconds_from_ns(times->max_ns)));
    return object;
}

static json_t *pose_json(const struct health *h)
{
    json_t *age =
        h->pose_age_ns < 0 ? json_null() : json_real(milliseconds_from_ns(h->pose_age_ns));
    json_t *above =
        isnan(h->height_above_terrain_m) ? json_null() : json_real(h->height_above_terrain_m);
    return json_pack("{s:b,s:i,s:o,s:I,s:I,s:I,s:f,s:f,s:f,s:o,s:f,s:f,s:f}", "valid",
                     h->pose_valid, "source", (int)h->active_source, "age_ms", age, "accepted",
                     (json_int_t)h->pose_accepted, "rejected", (json_int_t)h->pose_rejected, "lost",
                     (json_int_t)h->pose_lost, "lat_deg", h->position.lat_deg, "lon_deg",
                     h->position.lon_deg, "height_m", h->position.height_m,
                     "height_above_terrain_m", above, "roll_deg", h->attitude.roll_deg, "pitch_deg",
                     h->attitude.pitch_deg, "heading_deg", h->attitude.heading_deg);
}

static json_t *can_json(const struct health *h)
{
    return json_pack("{s:s,s:I,s:b}", "state", health_can_name(h->can_state), "frames",
                     (json_int_t)h->can_frames, "good", h->can_good);
}

static json_t *terrain_json(const struct health *h)
{
    return json_pack("{s:i,s:i,s:I,s:b}", "tiles_resident", (int)h->tiles_resident, "tiles_pending",
                     (int)h->tiles_pending, "read_errors", (json_int_t)h->terrain_read_errors,
                     "complete", h->terrain_complete);
}

static json_t *swap_json(const struct health_swap *swap)
{
    if (swap->channels == 0)
        return json_null();
    return json_pack("{s:i,s:i,s:I,s:I,s:I,s:f}", "channels", (int)swap->channels, "present",
                     (int)swap->present, "shown", (json_int_t)swap->frames, "timeouts",
                     (json_int_t)swap->timeouts, "out_of_step", (json_int_t)swap->out_of_step,
                     "skew_worst_ms", milliseconds_from_ns(swap->skew_worst_ns));
}

json_t *status_json(const struct health *h)
{
    const struct fault_info *fault = fault_find(h->fault_code);
    return json_pack("{s:s,s:s,s:{s:i,s:s?},s:I,s:f,s:I,s:I,s:b,s:o,s:o,s:o,s:o,s:o,s:{s:i,s:i},"
                     "s:{s:I,s:b},s:i,s:I,s:o}",
                     "schema", "otwd-status-1", "state", health_state_name(h->state), "fault",
                     "code", (int)h->fault_code, "name", fault ? fault->name : NULL, "uptime_s",
                     (json_int_t)(h->uptime_ns / NSEC_PER_SEC), "frame_rate_hz", h->frame_rate_hz,
                     "frames_rendered", (json_int_t)h->frames_rendered, "missed_deadlines",
                     (json_int_t)h->missed_deadlines, "running", h->running, "frame_ms",
                     times_json(&h->frame, true), "latency_ms", times_json(&h->transport, false),
                     "pose", pose_json(h), "can", can_json(h), "terrain", terrain_json(h),
                     "memory_mib", "resident", (int)h->resident_mib, "gpu", (int)h->gpu_mib,
                     "record", "frames", (json_int_t)h->frames_recorded, "good", h->recorder_good,
                     "modbus_clients", (int)h->modbus_clients, "config_generation",
                     (json_int_t)h->config_generation, "swap_lock", swap_json(&h->swap));
}

static int print_json(const struct health *health)
{
    json_t *object = status_json(health);
    int r = object ? json_dumpf(object, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(10)) : -1;
    json_decref(object);
    putchar('\n');
    return r < 0 ? EX_SOFTWARE : 0;
}

int status_main(int argc, char **argv)
{
    struct status_options options = {.server = "127.0.0.1:1502", .unit = 1, .timeout_ms = 2000};
    struct health health;
    struct diag diag;
    cli_parse(&parser, "status", argc, argv, &options);
    int r = modbus_client_read(options.server, options.unit, options.timeout_ms, &health, &diag);
    if (r < 0) {
        fprintf(stderr, "%s: %s\n", argv[0], diag.text);
        return r == -EINVAL ? EX_USAGE : EX_UNAVAILABLE;
    }
    if (options.json)
        r = print_json(&health);
    else if (!cli_quiet())
        status_print(stdout, &health);
    return r;
}
