#include <dirent.h>
#include <errno.h>
#include <unistd.h>

#include "daemon/health_collect.h"
#include "daemon/recorder.h"
#include "daemon/terrain_setup.h"
#include "tests/check.h"

static struct health_collect collect;

/* Frame `number` of a run at 50 Hz: finished 20 ms after the one before. */
static struct frame_sample sample_at(unsigned number)
{
    return (struct frame_sample){.frame = number,
                                 .finished_ns = number * 20 * NSEC_PER_MSEC,
                                 .frame_ms = number,
                                 .transport_ns = -1,
                                 .complete = true};
}

static void add_frames(unsigned first, unsigned last)
{
    for (unsigned i = first; i <= last; i++) {
        struct frame_sample sample = sample_at(i);
        health_collect_add(&collect, &sample);
    }
}

static void nothing_is_claimed_before_the_first_frame(void)
{
    struct health health = {0};
    health_collect_init(&collect);
    health_collect_expire(&collect, NSEC_PER_SEC);
    health_collect_fill(&collect, &health);
    CHECK_INT(health.frames_rendered, 0);
    CHECK_NEAR(health.frame_rate_hz, 0.0, 0.0);
    CHECK(isnan(health.height_above_terrain_m));
    CHECK(!health.terrain_complete);
    CHECK_INT(health_collect_behind_ns(&collect, 100 * NSEC_PER_SEC), 0);
}

static void times_are_of_the_last_second_alone(void)
{
    struct health health = {0};
    health_collect_init(&collect);
    add_frames(1, 200); /* four seconds; the last fifty and one lie within a second of the end */
    health_collect_expire(&collect, 200 * 20 * NSEC_PER_MSEC);
    health_collect_fill(&collect, &health);
    CHECK_INT(collect.count, 51);
    CHECK_INT(health.frames_rendered, 200);
    CHECK_NEAR(health.frame_rate_hz, 50.0, 1e-9);
    CHECK_INT(health.frame.p50_ns, 175 * NSEC_PER_MSEC); /* 150 .. 200 */
    CHECK_INT(health.frame.max_ns, 200 * NSEC_PER_MSEC);
    health_collect_expire(&collect, 10 * NSEC_PER_SEC);
    health_collect_fill(&collect, &health);
    CHECK_INT(health.frame.max_ns, 0);
    CHECK_INT(health.frames_rendered, 200);
}

static void more_samples_than_the_window_holds_lose_the_oldest(void)
{
    health_collect_init(&collect);
    add_frames(1, RENDER_SAMPLES + 10);
    CHECK_INT(collect.count, RENDER_SAMPLES);
    CHECK_INT(collect.window[collect.first].frame, 11);
    CHECK_INT(collect.newest.frame, RENDER_SAMPLES + 10);
}

static void transport_delay_counts_only_poses_drawn_for_the_first_time(void)
{
    struct health health = {0};
    health_collect_init(&collect);
    add_frames(1, 3);
    struct frame_sample sample = sample_at(4);
    sample.transport_ns = 7 * NSEC_PER_MSEC;
    health_collect_add(&collect, &sample);
    health_collect_fill(&collect, &health);
    CHECK_INT(health.transport.p50_ns, 7 * NSEC_PER_MSEC);
    CHECK_INT(health.transport.p99_ns, 7 * NSEC_PER_MSEC);
}

static void a_late_frame_is_remembered_for_a_second(void)
{
    health_collect_init(&collect);
    struct frame_sample sample = sample_at(1);
    sample.late = true;
    health_collect_add(&collect, &sample);
    CHECK(health_collect_any_late(&collect));
    add_frames(2, 100);
    CHECK(health_collect_any_late(&collect));
    health_collect_expire(&collect, sample.finished_ns + NSEC_PER_SEC + 1);
    CHECK(!health_collect_any_late(&collect));
}

static void missing_terrain_is_timed_from_when_it_was_complete(void)
{
    struct health health = {0};
    health_collect_init(&collect);
    add_frames(1, 10);
    for (unsigned i = 11; i <= 20; i++) {
        struct frame_sample sample = sample_at(i);
        sample.complete = false;
        sample.tiles_pending = 7;
        sample.tiles_resident = 300;
        sample.terrain_errors = i > 15 ? 2 : 0;
        health_collect_add(&collect, &sample);
    }
    CHECK_INT(health_collect_behind_ns(&collect, NSEC_PER_SEC), 800 * NSEC_PER_MSEC);
    CHECK_INT(collect.error_ns, 320 * NSEC_PER_MSEC);
    health_collect_fill(&collect, &health);
    CHECK_INT(health.tiles_pending, 7);
    CHECK_INT(health.tiles_resident, 300);
    CHECK_INT(health.terrain_read_errors, 2);
}

static void a_recording_that_cannot_be_made_names_its_place(void)
{
    struct recorder *recorder = NULL;
    struct diag diag = {""};
    const struct recorder_params params = {.directory = "/dev/null/record", .max_mib = 1};
    CHECK_INT(recorder_open(&params, &recorder, &diag), -ENOTDIR);
    CHECK_CONTAINS(diag.text, "/dev/null/record");
    CHECK(!recorder);
    recorder_close(NULL);
}

static void a_recording_keeps_within_its_limit_and_says_so(void)
{
    char directory[] = "/tmp/otwd-record-XXXXXX", path[512];
    struct recorder *recorder = NULL;
    struct recorder_status status = {0};
    struct diag diag = {""};
    static uint8_t packet[OTWLOG_PAYLOAD_MAX];
    CHECK(mkdtemp(directory));
    const struct recorder_params params = {.directory = directory, .max_mib = 1};
    CHECK_INT(recorder_open(&params, &recorder, &diag), 0);
    if (!recorder)
        return;
    /* Twice the limit, slowly enough for the writer's ring. */
    for (int i = 0; i < 512; i++) {
        CHECK(otwlog_add_packet(recorder_writer(recorder), 0, packet, sizeof(packet), i));
        if (i % 128 == 127)
            clock_sleep_until(clock_monotonic_ns() + 100 * NSEC_PER_MSEC);
    }
    for (int i = 0; i < 50 && status.recorded < 512; i++) {
        clock_sleep_until(clock_monotonic_ns() + 20 * NSEC_PER_MSEC);
        recorder_status(recorder, &status, &diag);
    }
    CHECK(!status.failed);
    CHECK(status.removed > 0);
    CHECK_INT(status.recorded, 512);
    CHECK_INT(status.dropped, 0);
    recorder_close(recorder);
    DIR *list = opendir(directory);
    for (struct dirent *entry; list && (entry = readdir(list));) {
        snprintf(path, sizeof(path), "%s/%s", directory, entry->d_name);
        unlink(path);
    }
    closedir(list);
    CHECK_INT(rmdir(directory), 0);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"nothing is claimed before the first frame", nothing_is_claimed_before_the_first_frame},
        {"times are of the last second alone", times_are_of_the_last_second_alone},
        {"more samples than the window holds lose the oldest",
         more_samples_than_the_window_holds_lose_the_oldest},
        {"transport delay counts only poses drawn for the first time",
         transport_delay_counts_only_poses_drawn_for_the_first_time},
        {"a late frame is remembered for a second", a_late_frame_is_remembered_for_a_second},
        {"missing terrain is timed from when it was complete",
         missing_terrain_is_timed_from_when_it_was_complete},
        {"a recording that cannot be made names its place",
         a_recording_that_cannot_be_made_names_its_place},
        {"a recording keeps within its limit and says so",
         a_recording_keeps_within_its_limit_and_says_so},
    };
    return CHECK_MAIN(tests);
}
