#include "daemon/replay.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "daemon/stop.h"

#define REPORT_PICTURES 6

nsec_t replay_utc_ns(const struct flight *flight)
{
    nsec_t midnight_ns = 0;
    clock_parse_utc("2026-06-21T00:00:00Z", &midnight_ns);
    double hours = 10.0 - flight->poses[0].position.lon_deg / 15.0;
    return midnight_ns + ns_from_seconds(hours * 3600.0);
}

static uint64_t frame_count(const struct flight *flight, const struct replay_params *params)
{
    double step_s = (params->speed > 0.0 ? params->speed : 1.0) / params->rate_hz;
    return 1 + (uint64_t)(seconds_from_ns(flight_duration_ns(flight)) / step_s + 1e-9);
}

static nsec_t flight_time_ns(const struct replay_params *params, uint64_t frame)
{
    double step_s = (params->speed > 0.0 ? params->speed : 1.0) / params->rate_hz;
    return ns_from_seconds((double)frame * step_s);
}

static void show_progress(const struct replay_params *params, uint64_t frame, uint64_t frames)
{
    if (params->progress && (frame % 16 == 0 || frame + 1 == frames))
        fprintf(stderr, "\rframe %llu of %llu%s", (unsigned long long)(frame + 1),
                (unsigned long long)frames, frame + 1 == frames ? "\n" : "");
}

/* How a recorded pose would have come to this frame, had it been sent at its time. */
struct arrival {
    size_t reached; /* poses that frames have shown or passed */
    float latency_ms, age_ms;
};

/* The newest pose at `time_ns` of the flight; where it is the first frame that reaches it, how long
 * after its arrival that is finished. At full speed nothing arrives at a time: both are NaN. */
static void find_arrival(const struct flight *flight, const struct replay_params *params,
                         nsec_t time_ns, nsec_t start_ns, nsec_t finished_ns,
                         struct arrival *arrival)
{
    size_t reached = arrival->reached;
    arrival->latency_ms = arrival->age_ms = NAN;
    while (reached < flight->count && flight->poses[reached].time_ns <= time_ns)
        reached++;
    if (params->speed <= 0.0 || reached == 0)
        return;
    nsec_t pose_ns = flight->poses[reached - 1].time_ns;
    double came_ns = (double)start_ns + (double)pose_ns / params->speed;
    arrival->age_ms = (float)((double)(time_ns - pose_ns) / params->speed * 1e-6);
    if (reached > arrival->reached)
        arrival->latency_ms = (float)(((double)finished_ns - came_ns) * 1e-6);
    arrival->reached = reached;
}

static void record_frame(struct report *report, const struct replay_params *params, double time_s,
                         struct channel *channel, const struct channel_frame *frame,
                         const struct arrival *arrival)
{
    struct loader_counts counts;
    renderer_loader_counts(channel_renderer(channel), &counts);
    if (counts.tiles_pending > report->pending_max)
        report->pending_max = counts.tiles_pending;
    report_add(report, &(struct report_frame){
                           .time_s = time_s,
                           .frame_ms = (float)frame->frame_ms,
                           .gpu_ms = (float)frame->renderer.gpu_ms,
                           .upload_ms = (float)frame->renderer.upload_ms,
                           .terrain_ms = (float)frame->renderer.terrain_ms,
                           .shade_ms = (float)frame->renderer.shade_ms,
                           .cpu_ms = (float)frame->cpu_ms,
                           .draw_cpu_ms = (float)frame->draw_cpu_ms,
                           .latency_ms = arrival->latency_ms,
                           .pose_age_ms = arrival->age_ms,
                           .triangles = (uint32_t)frame->renderer.triangles,
                           .pixel_error = (float)frame->renderer.pixel_error,
                           .control_points = frame->renderer.control_points,
                           .upload_bytes = (uint32_t)frame->renderer.upload_bytes,
                           .complete = frame->renderer.complete,
                           .missed_deadline = frame->frame_ms > 1000.0 / params->rate_hz,
                       });
}

/* A few frames nobody sees: shaders are compiled and the first terrain is loaded before time is
 * taken. */
static void warm_up(struct channel *channel, const struct flight *flight, nsec_t utc_ns)
{
    struct pose pose;
    struct channel_frame frame;
    flight_sample(flight, 0, &pose);
    for (int i = 0; i < 8; i++)
        channel_draw(channel, &pose, NULL, utc_ns, true, &frame);
}

static int fly_frames(const struct flight *flight, const struct replay_params *params,
                      nsec_t utc_ns, struct channel *channel, struct frame_output *output,
                      struct report *report, struct diag *diag)
{
    uint64_t frames = frame_count(flight, params);
    struct arrival arrival = {0};
    nsec_t start_ns = clock_monotonic_ns();
    warm_up(channel, flight, utc_ns);
    stop_on_signals();
    for (uint64_t i = 0; i < frames && !stop_asked(); i++) {
        struct pose pose, next;
        struct channel_frame frame;
        nsec_t time_ns = flight_time_ns(params, i);
        if (i == 0)
            start_ns = clock_monotonic_ns();
        if (params->speed > 0.0)
            clock_sleep_until(start_ns + ns_from_seconds((double)i / params->rate_hz));
        flight_sample(flight, time_ns, &pose);
        flight_sample(flight, flight_time_ns(params, i + 1), &next);
        channel_draw(channel, &pose, &next, utc_ns + time_ns, params->speed <= 0.0, &frame);
        if (frame.renderer.failed)
            return diag_set(diag, -ENODEV, "%s, at frame %llu", CHANNEL_LOST,
                            (unsigned long long)i);
        find_arrival(flight, params, time_ns, start_ns, frame.finished_ns, &arrival);
        record_frame(report, params, seconds_from_ns(time_ns), channel, &frame, &arrival);
        if (output) {
            frame_output_take(output, channel_renderer(channel), i, &frame.view);
            if (frame_output_error(output) < 0)
                break; /* what was asked for cannot be had */
        }
        show_progress(params, i, frames);
    }
    return 0;
}

static void count_poses(const struct flight *flight, struct report *report)
{
    const struct intake_counters *counters = &flight->counters;
    report->poses = (struct report_poses){.received = counters->received,
                                          .rejected = intake_rejected_total(counters),
                                          .others = counters->others,
                                          .lost = counters->lost,
                                          .reordered = counters->reordered};
}

/* What cannot be written is an error of output, whatever the file system calls it. */
static int output_error(int r)
{
    return r == -ENOMEM || r == -EINVAL || r == -ENODEV || r >= 0 ? r : -EIO;
}

int replay_fly(const struct flight *flight, const struct replay_params *params,
               struct report *ret_report, struct report_facts *ret_facts, struct diag *diag)
{
    uint64_t frames = frame_count(flight, params);
    if (report_init(ret_report, frames) < 0)
        return diag_set(diag, -ENOMEM, "no memory for the report of %llu frames",
                        (unsigned long long)frames);
    count_poses(flight, ret_report);
    struct channel *channel = NULL;
    struct frame_output *output = NULL;
    struct channel_params eye = params->channel;
    if (params->output.geo_dir)
        eye.samples = 1; /* a pixel has one place */
    int r = channel_create(&eye, &channel, diag);
    struct frame_output_params files = params->output;
    files.width = params->channel.width;
    files.height = params->channel.height;
    files.video_rate_hz = params->rate_hz;
    files.report_dir = params->report_dir;
    files.report_every = (unsigned)((frames + REPORT_PICTURES - 1) / REPORT_PICTURES);
    if (r == 0 && (files.frames_dir || files.geo_dir || files.video_path || files.report_dir))
        r = output_error(frame_output_open(&files, &output, diag));
    if (r < 0) {
        channel_destroy(channel);
        return r;
    }
    static struct gl_facts gl; /* outlives the channel, for the report */
    gl = *channel_gl(channel);
    if (channel_note(channel)[0])
        fprintf(stderr, "otwd: %s\n", channel_note(channel));
    int flown = fly_frames(flight, params, params->utc_ns ? params->utc_ns : replay_utc_ns(flight),
                           channel, output, ret_report, diag);
    *ret_facts = (struct report_facts){.width = files.width,
                                       .height = files.height,
                                       .rate_hz = params->rate_hz,
                                       .technique = params->channel.technique,
                                       .flight = params->flight_name,
                                       .gl = &gl,
                                       .gpu_memory_mib = gl_memory_used_mib(&gl),
                                       .report_every = files.report_every};
    renderer_loader_counts(channel_renderer(channel), &ret_facts->loader);
    renderer_image_counts(channel_renderer(channel), &ret_facts->images);
    r = output_error(frame_output_close(output, flown < 0 ? NULL : diag));
    channel_destroy(channel);
    r = flown < 0 ? flown : r;
    if (r == 0 && params->report_dir)
        r = output_error(report_write(ret_report, ret_facts, params->report_dir, diag));
    if (r == 0 && stop_asked())
        r = diag_set(diag, -ECANCELED, "interrupted after %zu of %llu frames", ret_report->count,
                     (unsigned long long)frames);
    return r;
}

static void print_row(const char *name, const struct report *report, enum report_metric metric)
{
    struct distribution d = {0};
    report_distribution(report, metric, &d);
    printf("  %-10s %9.2f %9.2f %9.2f %9.2f %9.2f\n", name, d.p50, d.p95, d.p99, d.p999, d.max);
}

void replay_print_summary(const struct report *report, const struct report_facts *facts)
{
    printf("%zu frames of %d x %d on %s\n", report->count, facts->width, facts->height,
           facts->gl->renderer);
    printf("  %-10s %9s %9s %9s %9s %9s\n", "ms", "p50", "p95", "p99", "p99.9", "max");
    print_row("frame", report, REPORT_FRAME_MS);
    print_row("gpu", report, REPORT_GPU_MS);
    print_row("cpu", report, REPORT_CPU_MS);
}

struct replay_params replay_defaults(void)
{
    return (struct replay_params){
        .channel = {.width = 1024,
                    .height = 576,
                    .geometry = {.left_deg = -30.0,
                                 .right_deg = 30.0,
                                 .bottom_deg = -17.5,
                                 .top_deg = 17.5},
                    .terrain_path = "",
                    .geoid = "egm96",
                    .technique = "clipmap",
                    .pixel_error = 1.0,
                    .cache_mib = 256,
                    .visibility_m = 40000.0,
                    .cache_programs = true},
        .output = {.every = 1},
        .rate_hz = 60.0,
        .speed = 1.0,
        .progress = isatty(STDERR_FILENO),
    };
}
