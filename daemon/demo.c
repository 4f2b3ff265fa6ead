/* `otwd demo`: the embedded flight over the embedded terrain, with everything that a first look
 * should show. */
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <sysexits.h>

#include "daemon/cli.h"
#include "daemon/commands.h"
#include "daemon/demo_flight.h"
#include "daemon/geoid_function.h"
#include "daemon/video_pipe.h"

#define PICTURE_SECONDS 5

enum { OPT_OUT = 256, OPT_SIZE, OPT_RATE, OPT_NO_VIDEO };

struct demo_options {
    struct replay_params params;
    const char *out;
    bool video, json;
};

static const struct argp_option known[] = {
    {"out", OPT_OUT, "DIR", 0, "where pictures, video and report go (default demo)", 0},
    {"size", OPT_SIZE, "WxH", 0, "pixels (default 1024x576)", 0},
    {"rate", OPT_RATE, "HZ", 0, "frames a second of flight (default 30)", 0},
    {"no-video", OPT_NO_VIDEO, NULL, 0, "leave the video out", 0},
    {"json", 'j', NULL, 0, "print the report as JSON", 0},
    {0},
};

static error_t parse_option(int key, char *argument, struct argp_state *state)
{
    struct demo_options *options = state->input;
    switch (key) {
    case 'j':
        options->json = true;
        return 0;
    case OPT_OUT:
        options->out = argument;
        return 0;
    case OPT_SIZE:
        cli_size(state, argument, &options->params.channel.width, &options->params.channel.height);
        return 0;
    case OPT_RATE:
        options->params.rate_hz = cli_number(state, "rate", argument, 1.0, 1000.0);
        return 0;
    case OPT_NO_VIDEO:
        options->video = false;
        return 0;
    default:
        return cli_argument(key, argument, state, NULL, NULL);
    }
}

static const struct argp parser = {
    .options = known,
    .parser = parse_option,
    .doc =
        "Fly the embedded flight headless over the embedded planet: pictures, a video, a report."
        "\vExit status: 0 flown, 64 bad usage, 66 no geoid, 69 no OpenGL 4.5, 74 a file cannot be "
        "written, 75 interrupted.",
};

static int fly(struct demo_options *options, struct diag *diag)
{
    char frames[4096], video[4096], report_dir[4096];
    snprintf(frames, sizeof(frames), "%s/frames", options->out);
    snprintf(video, sizeof(video), "%s/demo.mp4", options->out);
    snprintf(report_dir, sizeof(report_dir), "%s/report", options->out);
    if (mkdir(options->out, 0777) < 0 && errno != EEXIST)
        return diag_set(diag, -EIO, "%s: cannot make the directory: %s", options->out,
                        strerror(errno));
    struct replay_params params = options->params;
    params.output.frames_dir = frames;
    params.output.every = (unsigned)(params.rate_hz * PICTURE_SECONDS);
    params.output.video_path = options->video ? video : NULL;
    params.report_dir = report_dir;
    params.flight_name = "the embedded flight";
    struct geoid *geoid = NULL;
    struct flight *flight = NULL;
    struct report report = {0};
    struct report_facts facts;
    int r = geoid_setup_open("egm96", &geoid, diag);
    struct flight_params flight_params = {.geoid = geoid_function_of(geoid)};
    if (r == 0)
        r = flight_load_memory("demo flight", demo_flight_csv,
                               (size_t)(demo_flight_csv_end - demo_flight_csv), &flight_params,
                               &flight, diag);
    if (r == 0)
        r = replay_fly(flight, &params, &report, &facts, diag);
    bool flown = r == 0 || r == -ECANCELED;
    if (flown && options->json) {
        cli_print_json(report_json(&report, &facts));
    } else if (flown && !cli_quiet()) {
        replay_print_summary(&report, &facts);
        printf("pictures  %s\n", frames);
        if (options->video)
            printf("video     %s\n", video);
        printf("report    %s/report.html\n", report_dir);
    }
    report_finish(&report);
    flight_destroy(flight);
    geoid_close(geoid);
    return r;
}

int demo_main(int argc, char **argv)
{
    struct demo_options options = {
        .params = replay_defaults(), .out = "demo", .video = video_pipe_available()};
    options.params.rate_hz = 30.0;
    options.params.speed = 0.0;
    cli_parse(&parser, "demo", argc, argv, &options);
    options.params.progress = options.params.progress && !cli_quiet();
    struct diag diag = {0};
    int r = fly(&options, &diag);
    return r < 0 ? cli_fail(r, &diag) : EX_OK;
}
