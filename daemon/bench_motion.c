#include "daemon/bench_motion.h"

#include <jansson.h>
#include <stdio.h>
#include <string.h>
#include <sysexits.h>

#include "daemon/cli.h"
#include "daemon/motion_trial.h"

#define EXTRAPOLATE_MS   1000 /* so that the figures show the prediction, not its end */
#define DELAY_DEFAULT_MS 40.0
#define ATTITUDE_EVERY   8 /* of a bus: attitudes for each position */

static const double rates_hz[] = {10.0, 20.0, 50.0, 60.0};
#define RATES (sizeof(rates_hz) / sizeof(rates_hz[0]))

/* Those that `otwd send` speaks. */
static const enum pose_protocol protocols[] = {POSE_PROTOCOL_NATIVE, POSE_PROTOCOL_FLIGHTGEAR,
                                               POSE_PROTOCOL_XPLANE, POSE_PROTOCOL_DIS,
                                               POSE_PROTOCOL_CANAEROSPACE};
#define PROTOCOLS (sizeof(protocols) / sizeof(protocols[0]))

enum { OPT_PROTOCOL = 256, OPT_JITTER, OPT_LOSS, OPT_REORDER, OPT_SEED, OPT_DURATION };

struct motion_options {
    struct motion_trial_params trial;
    bool only, json;
    json_t *results; /* an array */
};

static const struct argp_option known[] = {
    {"protocol", OPT_PROTOCOL, "NAME", 0, "only this one", 0},
    {"jitter-ms", OPT_JITTER, "MS", 0, "each pose leaves up to this much late (10)", 0},
    {"loss", OPT_LOSS, "P", 0, "chance of a packet to be left out, 0 to 1 (0.1)", 0},
    {"reorder", OPT_REORDER, "P", 0,
     "chance of a packet to change places with the next, 0 to 1 (0.1)", 0},
    {"seed", OPT_SEED, "N", 0, "of jitter, loss and reordering (1)", 0},
    {"duration", OPT_DURATION, "S", 0, "of a flight (120)", 0},
    {"json", 'j', NULL, 0, "as JSON", 0},
    {0},
};

static enum pose_protocol find_protocol(struct argp_state *state, const char *name)
{
    for (size_t i = 0; i < PROTOCOLS; i++)
        if (strcmp(name, pose_protocol_name(protocols[i])) == 0)
            return protocols[i];
    argp_error(state, "there is no protocol \"%s\" to measure", name);
    return protocols[0];
}

static error_t parse_option(int key, char *argument, struct argp_state *state)
{
    struct motion_options *options = state->input;
    struct motion_trial_params *trial = &options->trial;
    switch (key) {
    case OPT_PROTOCOL:
        options->only = true;
        trial->protocol = find_protocol(state, argument);
        return 0;
    case OPT_JITTER:
        trial->jitter_ms = cli_number(state, "jitter-ms", argument, 0.0, 1000.0);
        return 0;
    case OPT_LOSS:
        trial->loss = cli_number(state, "loss", argument, 0.0, 0.9);
        return 0;
    case OPT_REORDER:
        trial->reorder = cli_number(state, "reorder", argument, 0.0, 1.0);
        return 0;
    case OPT_SEED:
        trial->seed = (uint64_t)cli_number(state, "seed", argument, 0.0, 1e15);
        return 0;
    case OPT_DURATION:
        trial->duration_s = cli_number(state, "duration", argument, 10.0, 3600.0);
        return 0;
    case 'j':
        options->json = true;
        return 0;
    default:
        return cli_argument(key, argument, state, NULL, NULL);
    }
}

static const struct argp parser = {
    .options = known,
    .parser = parse_option,
    .doc = "Measure how true and how smooth motion is: a figure of eight, 80 to 130 m/s, climbing "
           "and sinking, sent with jitter, loss and reordering, decoded, and shown in frames of 60 "
           "Hz. Position and attitude against where the aircraft was at the time that the frame "
           "shows (its own less the delay); and how sharply the shown path bends from frame to "
           "frame (its second difference), as a multiple of the true one's."
           "\vThe longest delay is two periods of the position and 30 ms (four periods on a bus, "
           "whose position comes in five frames), so that it is between two poses even where one "
           "is lost; 40 ms is the default; without delay all is predicted. The first 5 s of a "
           "flight do not count. No clock is read: the same seed gives the same figures.",
};

static bool is_bus(const struct motion_trial_params *trial)
{
    return trial->position_every > 1;
}

static double position_hz(const struct motion_trial_params *trial)
{
    return is_bus(trial) ? trial->rate_hz / trial->position_every : trial->rate_hz;
}

static void print_heading(const struct motion_trial_params *trial)
{
    printf("%s, jitter %g ms, loss %g %%, reordering %g %%\n\n",
           pose_protocol_name(trial->protocol), trial->jitter_ms, 100.0 * trial->loss,
           100.0 * trial->reorder);
    puts("| poses, Hz | delay, ms | position, m: p50 | p99 | attitude, deg: p50 | p99 | "
         "bend: p50 | p99 | max |\n|---|---|---|---|---|---|---|---|---|");
}

static void print_row(const struct motion_trial_params *trial,
                      const struct motion_trial_result *result)
{
    char rate[32];
    snprintf(rate, sizeof(rate), is_bus(trial) ? "%g, %g" : "%g", position_hz(trial),
             trial->rate_hz);
    printf("| %s | %.0f | %.3f | %.3f | %.3f | %.3f | %.2f | %.2f | %.2f |\n", rate,
           milliseconds_from_ns(trial->delay_ns), result->position_m.p50, result->position_m.p99,
           result->attitude_deg.p50, result->attitude_deg.p99,
           result->bend_m.p50 / result->true_bend_m.p50,
           result->bend_m.p99 / result->true_bend_m.p99,
           result->bend_m.max / result->true_bend_m.max);
    fflush(stdout);
}

static json_t *json_figures(const struct distribution *d)
{
    return json_pack("{s:f,s:f,s:f}", "p50", d->p50, "p99", d->p99, "max", d->max);
}

static json_t *json_row(const struct motion_trial_params *trial,
                        const struct motion_trial_result *result)
{
    return json_pack(
        "{s:s,s:f,s:f,s:f,s:I,s:I,s:I,s:I,s:o,s:o,s:o,s:o}", "protocol",
        pose_protocol_name(trial->protocol), "position_hz", position_hz(trial), "attitude_hz",
        trial->rate_hz, "delay_ms", milliseconds_from_ns(trial->delay_ns), "frames",
        (json_int_t)result->frames, "packets", (json_int_t)result->packets, "left_out",
        (json_int_t)result->left_out, "refused", (json_int_t)result->refused, "position_m",
        json_figures(&result->position_m), "attitude_deg", json_figures(&result->attitude_deg),
        "second_difference_m", json_figures(&result->bend_m), "true_second_difference_m",
        json_figures(&result->true_bend_m));
}

static int measure_rate(struct motion_options *options, struct motion_trial_params *trial,
                        struct diag *diag)
{
    double long_ms = (is_bus(trial) ? 4.0 : 2.0) * 1000.0 / position_hz(trial) + 30.0;
    const double delays_ms[] = {long_ms, DELAY_DEFAULT_MS, 0.0};
    for (int i = 0; i < 3; i++) {
        struct motion_trial_result result;
        trial->delay_ns = ns_from_seconds(delays_ms[i] * 1e-3);
        int r = motion_trial_run(trial, &result, diag);
        if (r < 0)
            return r;
        if (options->json)
            json_array_append_new(options->results, json_row(trial, &result));
        else if (!cli_quiet())
            print_row(trial, &result);
    }
    return 0;
}

static int measure_protocol(struct motion_options *options, enum pose_protocol protocol,
                            struct diag *diag)
{
    struct motion_trial_params trial = options->trial;
    trial.protocol = protocol;
    bool bus = protocol == POSE_PROTOCOL_CANAEROSPACE;
    int r = 0;
    if (!options->json && !cli_quiet())
        print_heading(&trial);
    for (size_t i = 0; i < (bus ? 1 : RATES) && r == 0; i++) {
        trial.position_every = bus ? ATTITUDE_EVERY : 1;
        trial.rate_hz = trial.position_every * rates_hz[i];
        r = measure_rate(options, &trial, diag);
    }
    if (!options->json && !cli_quiet())
        putchar('\n');
    return r;
}

int bench_motion_main(int argc, char **argv)
{
    struct motion_options options = {
        .trial = {.jitter_ms = 10.0,
                  .loss = 0.1,
                  .reorder = 0.1,
                  .seed = 1,
                  .extrapolate_ns = EXTRAPOLATE_MS * NSEC_PER_MSEC,
                  .duration_s = 120.0},
    };
    struct diag diag = {.text = ""};
    cli_parse(&parser, "bench motion", argc, argv, &options);
    options.results = json_array();
    int r = 0;
    for (size_t i = 0; i < PROTOCOLS && r == 0; i++)
        if (!options.only || options.trial.protocol == protocols[i])
            r = measure_protocol(&options, protocols[i], &diag);
    if (r == 0 && options.json) {
        json_dumpf(options.results, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(7));
        putchar('\n');
    }
    json_decref(options.results);
    return r < 0 ? cli_fail(r, &diag) : EX_OK;
}
