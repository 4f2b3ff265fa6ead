/* Measures what digging does to the frame time: frames of a low flight, headless, in blocks with
 * ten stamps a second in front of the eye and blocks without, in turn.
 *
 * Usage: bench_dig DB [WIDTHxHEIGHT [BLOCKS]]
 *
 * DB is dug in: give it a copy. 200 frames a block, 50 of them to settle down in; 100 m/s, 300 m
 * above the ground, 30 frames a second of flight, drawn at that rate where the machine can. Stamps
 * go the daemon's way: the thread that digs, the journal, the disk, the loader. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "daemon/channel.h"
#include "daemon/dig_thread.h"
#include "daemon/terrain_setup.h"
#include "terrain/dig.h"

#define FRAMES_BLOCK  200
#define FRAMES_PASSED 50
#define RATE_HZ       30.0
#define STAMP_EVERY   3 /* frames: ten a second */
#define SPEED_MPS     100.0
#define DEGREE_M      111195.0

struct samples {
    double *frame_ms;
    size_t count;
};

static int by_value(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double percentile(const struct samples *samples, double share)
{
    return samples->frame_ms[(size_t)(share * (double)(samples->count - 1))];
}

/* To and fro over the middle of the database, so that every block sees the same ground. */
static struct pose pose_at(const struct terrain_facts *facts, double ground_m, long frame)
{
    double way_m = SPEED_MPS * (double)(frame % FRAMES_BLOCK) / RATE_HZ;
    struct pose pose = {.valid = POSE_POSITION | POSE_ATTITUDE};
    pose.position.lat_deg = 0.5 * (facts->south_deg + facts->north_deg) + way_m / DEGREE_M;
    pose.position.lon_deg = 0.5 * (facts->west_deg + facts->east_deg);
    pose.position.height_m = ground_m + 300.0;
    pose.attitude.pitch_deg = -10.0;
    return pose;
}

static void dig_ahead(struct dig_thread *thread, const struct pose *pose, uint32_t number)
{
    static uint8_t body[STAMP_BYTES_MAX];
    const struct dig_asker asker = {.slot = 0};
    struct stamp stamp = {
        .kind = STAMP_CRATER,
        .lat_deg = pose->position.lat_deg + (300.0 + 40.0 * (double)(number % 10)) / DEGREE_M,
        .lon_deg = pose->position.lon_deg + 20.0 * ((double)(number % 7) - 3.0) / DEGREE_M,
        .crater = {20.0, 4.0, 0.8, 10.0}};
    struct dig_message message = {.kind = DIG_ADD, .session = 1, .request = number, .body = body};
    struct dig_reply reply;
    if (stamp_prepare(&stamp, NULL) < 0)
        exit(70);
    message.size = stamp_encode(&stamp, body);
    if (!dig_thread_ask(thread, &message, &asker))
        fprintf(stderr, "bench_dig: a stamp is not taken\n");
    while (dig_thread_take(thread, &reply))
        if (reply.message.status != DIG_STATUS_DONE)
            fprintf(stderr, "bench_dig: %s\n", reply.message.text);
}

static void wait_until(nsec_t time_ns)
{
    nsec_t left_ns = time_ns - clock_monotonic_ns();
    struct timespec pause = {.tv_sec = left_ns / NSEC_PER_SEC, .tv_nsec = left_ns % NSEC_PER_SEC};
    if (left_ns > 0)
        nanosleep(&pause, NULL);
}

static void run(struct channel *channel, struct dig_thread *thread,
                const struct terrain_facts *facts, double ground_m, int blocks,
                struct samples samples[2])
{
    uint32_t stamps = 0;
    nsec_t tick_ns = clock_monotonic_ns();
    for (long frame = 0; frame < (long)blocks * FRAMES_BLOCK; frame++) {
        struct pose pose = pose_at(facts, ground_m, frame),
                    next = pose_at(facts, ground_m, frame + 1);
        struct channel_frame result;
        bool digs = frame / FRAMES_BLOCK % 2;
        if (digs && frame % STAMP_EVERY == 0)
            dig_ahead(thread, &pose, stamps++);
        channel_draw(channel, &pose, &next, 0, false, &result);
        struct samples *mine = &samples[digs];
        if (frame % FRAMES_BLOCK >= FRAMES_PASSED)
            mine->frame_ms[mine->count++] = result.frame_ms;
        tick_ns += (nsec_t)((double)NSEC_PER_SEC / RATE_HZ);
        wait_until(tick_ns);
    }
    printf("%u stamps\n", stamps);
}

int main(int argc, char **argv)
{
    struct diag diag = {""};
    struct dig_thread *thread = NULL;
    struct channel *channel = NULL;
    struct terrain_setup terrain;
    struct terrain_facts facts;
    double ground_m = 0.0;
    int blocks = argc > 3 ? atoi(argv[3]) : 20, width = 640, height = 360;
    if (argc < 2 || (argc > 2 && sscanf(argv[2], "%dx%d", &width, &height) != 2) || blocks < 2) {
        fprintf(stderr, "usage: bench_dig DB [WIDTHxHEIGHT [BLOCKS]]\n");
        return 64;
    }
    int r = terrain_setup_open(argv[1], "none", 64, &terrain, &diag);
    if (r == 0) {
        terrain.source->ops->facts(terrain.source, &facts);
        terrain.source->ops->sample_point(terrain.source, 0.5 * (facts.south_deg + facts.north_deg),
                                          0.5 * (facts.west_deg + facts.east_deg), &ground_m);
        terrain_setup_close(&terrain);
        r = dig_thread_start(argv[1], &thread, &diag);
    }
    if (r == 0) {
        const struct channel_params params = {
            .width = width,
            .height = height,
            .geometry = {.left_deg = -30, .right_deg = 30, .bottom_deg = -18, .top_deg = 18},
            .terrain_path = argv[1],
            .dig = dig_thread_ground(thread),
            .geoid = "egm96",
            .technique = "clipmap",
            .pixel_error = 1.0,
            .cache_mib = 256,
            .visibility_m = 40000.0};
        r = channel_create(&params, &channel, &diag);
    }
    if (r != 0) {
        fprintf(stderr, "bench_dig: %s\n", diag.text);
        return 1;
    }
    struct samples samples[2];
    for (int i = 0; i < 2; i++)
        samples[i] = (struct samples){malloc((size_t)blocks * FRAMES_BLOCK * sizeof(double)), 0};
    run(channel, thread, &facts, isnan(ground_m) ? 0.0 : ground_m, blocks, samples);
    for (int i = 0; i < 2; i++) {
        qsort(samples[i].frame_ms, samples[i].count, sizeof(double), by_value);
        printf("%-20s p50 %.2f ms, p99 %.2f ms, longest %.2f ms, %zu frames\n",
               i ? "10 stamps a second" : "none", percentile(&samples[i], 0.5),
               percentile(&samples[i], 0.99), percentile(&samples[i], 1.0), samples[i].count);
    }
    printf("p99 with stamps: %+.1f %%\n",
           100.0 * (percentile(&samples[1], 0.99) / percentile(&samples[0], 0.99) - 1.0));
    channel_destroy(channel);
    dig_thread_stop(thread);
    free(samples[0].frame_ms);
    free(samples[1].frame_ms);
    return 0;
}
