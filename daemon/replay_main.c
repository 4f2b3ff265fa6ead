/* `otwd replay`: the command line. */
#include <errno.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "config/config.h"
#include "daemon/channel_options.h"
#include "daemon/check_config.h"
#include "daemon/cli.h"
#include "daemon/config_channel.h"
#include "daemon/geoid_function.h"
#include "daemon/replay.h"

enum {
    OPT_RATE = 512, /* beyond those of daemon/channel_options */
    OPT_SPEED,
    OPT_SAMPLES,
    OPT_FRAMES,
    OPT_EVERY,
    OPT_VIDEO,
    OPT_GEO,
    OPT_REPORT,
    OPT_PROTOCOL,
    OPT_JSON,
    OPT_UTC
};

struct replay_options {
    struct replay_params params;
    const char *flight, *config_path;
    struct config config;
    bool have_config, force_protocol, json;
    enum pose_protocol protocol;
};

static const struct argp_option known[] = {
    {"config", 'c', "FILE", 0,
     "channel, display, terrain, environment, DIS entity and CAN table from a configuration", 0},
    {"rate", OPT_RATE, "HZ", 0, "frames a second (default 60)", 0},
    {"speed", OPT_SPEED, "X|max", 0,
     "flight seconds a second (default 1); max: as fast as it can, every frame complete", 0},
    {"time-utc", OPT_UTC, "TIME", 0,
     "when the flight starts, for the sun: 2026-06-21T09:30:00Z (default: ten in the morning)", 0},
    {"samples", OPT_SAMPLES, "1|4", 0,
     "of a pixel, 4 for smooth edges (default 1, which geodetic images always have)", 0},
    {"frames", OPT_FRAMES, "DIR", 0, "write frames as DIR/frame-%06d.png", 0},
    {"every", OPT_EVERY, "N", 0, "only every Nth frame to --frames and --geo", 0},
    {"video", OPT_VIDEO, "FILE.mp4", 0, "write a video (needs ffmpeg)", 0},
    {"geo", OPT_GEO, "DIR", 0,
     "write latitude, longitude and height of every pixel as DIR/frame-%06d.tif", 0},
    {"report", OPT_REPORT, "DIR", 0, "write report.json, frames.csv and report.html", 0},
    {"protocol", OPT_PROTOCOL, "NAME", 0,
     "of a pcap: native, flightgear, xplane or dis (default: found out packet by packet)", 0},
    {"json", OPT_JSON, NULL, 0, "print the report as JSON", 0},
    {0},
};

/* The configuration comes first, wherever -c stands, so that other options override it. */
static void load_config(struct replay_options *options, const char *path)
{
    struct config_errors errors = {0};
    int r = config_load(path, &options->config, &errors);
    if (r < 0) {
        check_config_print(stderr, &errors);
        exit(check_config_exit_status(r));
    }
    config_errors_finish(&errors);
    options->have_config = true;
    config_to_channel(&options->config, &options->params.channel);
    options->params.rate_hz = options->config.display.rate_hz;
    options->params.utc_ns = options->config.environment.time_utc_ns;
}

static void parse_speed(struct argp_state *state, struct replay_params *params, const char *text)
{
    params->speed = strcmp(text, "max") == 0 ? 0.0 : cli_number(state, "speed", text, 0.01, 1000.0);
}

static error_t parse_option(int key, char *argument, struct argp_state *state)
{
    struct replay_options *options = state->input;
    struct replay_params *params = &options->params;
    switch (key) {
    case ARGP_KEY_INIT:
        state->child_inputs[0] = &params->channel;
        return 0;
    case 'c':
        return 0; /* taken before */
    case OPT_RATE:
        params->rate_hz = cli_number(state, "rate", argument, 0.1, 1000.0);
        return 0;
    case OPT_SPEED:
        parse_speed(state, params, argument);
        return 0;
    case OPT_SAMPLES:
        if (strcmp(argument, "1") != 0 && strcmp(argument, "4") != 0)
            argp_error(state, "--samples takes 1 or 4, not \"%s\"", argument);
        params->channel.samples = atoi(argument);
        return 0;
    case OPT_UTC:
        if (clock_parse_utc(argument, &params->utc_ns) < 0)
            argp_error(state, "--time-utc takes YYYY-MM-DDThh:mm:ssZ, not \"%s\"", argument);
        return 0;
    case OPT_FRAMES:
        params->output.frames_dir = argument;
        return 0;
    case OPT_EVERY:
        params->output.every = (unsigned)cli_number(state, "every", argument, 1.0, 1e9);
        return 0;
    case OPT_VIDEO:
        params->output.video_path = argument;
        return 0;
    case OPT_GEO:
        params->output.geo_dir = argument;
        return 0;
    case OPT_REPORT:
        params->report_dir = argument;
        return 0;
    case OPT_PROTOCOL:
        options->force_protocol = true;
        if (pose_protocol_from_name(argument, &options->protocol) < 0)
            argp_error(state, "--protocol takes native, flightgear, xplane or dis, not \"%s\"",
                       argument);
        return 0;
    case OPT_JSON:
        options->json = true;
        return 0;
    default:
        return cli_argument(key, argument, state, "FLIGHT", &options->flight);
    }
}

static const struct argp parser = {
    .options = known,
    .parser = parse_option,
    .args_doc = "FLIGHT",
    .children = channel_children,
    .doc =
        "Replay a recorded flight headless: a recording (.otwlog), CSV, pcap, candump log or IGC."
        "\vExit status: 0 flown, 64 bad usage, 65 not a flight or a bad database, 66 a file is "
        "missing, 69 no OpenGL 4.5, 74 a file cannot be written, 75 interrupted, 78 a bad "
        "configuration.",
};

/* Finds -c before argp runs, because options override the configuration. */
static error_t parse_config_only(int key, char *argument, struct argp_state *state)
{
    struct replay_options *options = state->input;
    if (key == ARGP_KEY_INIT)
        state->child_inputs[0] = &options->params.channel;
    else if (key == 'c')
        load_config(options, argument);
    return 0;
}

static const struct argp config_parser = {
    .options = known, .parser = parse_config_only, .children = channel_children};

/* The first source of that type in the configuration, or NULL. */
static const struct config_source *find_source(const struct config *config,
                                               enum config_source_type type)
{
    for (unsigned i = 0; i < config->sources_count; i++)
        if (config->sources[i].type == type)
            return &config->sources[i];
    return NULL;
}

static int load_flight(const struct replay_options *options, struct flight **ret_flight,
                       struct diag *diag)
{
    struct geoid *geoid;
    int r = geoid_setup_open(options->params.channel.geoid, &geoid, diag);
    if (r < 0)
        return r;
    struct flight_params params = {.geoid = geoid_function_of(geoid),
                                   .force_protocol = options->force_protocol,
                                   .protocol = options->protocol};
    const struct config_source *dis = find_source(&options->config, CONFIG_SOURCE_DIS);
    const struct config_source *bus = find_source(&options->config, CONFIG_SOURCE_CAN_TABLE);
    struct can_table table;
    if (dis)
        params.dis = (struct dis_filter){.exercise = dis->exercise, .id = dis->entity_id};
    if (bus) {
        table = config_can_table(bus);
        params.table = &table;
    }
    r = flight_load(options->flight, &params, ret_flight, diag);
    if (r == 0 && (*ret_flight)->note.text[0] && !cli_quiet())
        fprintf(stderr, "otwd: %s\n", (*ret_flight)->note.text);
    geoid_close(geoid);
    return r;
}

int replay_main(int argc, char **argv)
{
    struct replay_options options = {.params = replay_defaults()};
    cli_parse_before(&config_parser, argc, argv, &options);
    cli_parse(&parser, "replay", argc, argv, &options);
    options.params.flight_name = options.flight;
    options.params.progress = options.params.progress && !cli_quiet();
    struct diag diag = {0};
    struct flight *flight = NULL;
    struct report report = {0};
    struct report_facts facts;
    int r = load_flight(&options, &flight, &diag);
    if (r == 0)
        r = replay_fly(flight, &options.params, &report, &facts, &diag);
    bool flown = r == 0 || r == -ECANCELED;
    if (flown && options.json)
        cli_print_json(report_json(&report, &facts));
    else if (flown && !cli_quiet())
        replay_print_summary(&report, &facts);
    report_finish(&report);
    flight_destroy(flight);
    if (options.have_config)
        config_finish(&options.config);
    return r < 0 ? cli_fail(r, &diag) : EX_OK;
}
