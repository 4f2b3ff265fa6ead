/* `otwd send FLIGHT --to URL`: plays a flight as a host would. */
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sysexits.h>

#include "daemon/cli.h"
#include "daemon/commands.h"
#include "daemon/geoid_function.h"
#include "daemon/stop.h"
#include "io/cigi_sender.h"
#include "io/sender.h"

enum {
    OPT_TO = 256,
    OPT_PROTOCOL,
    OPT_RATE,
    OPT_SPEED,
    OPT_JITTER,
    OPT_LOSS,
    OPT_REORDER,
    OPT_SEED,
    OPT_SYNC,
    OPT_LISTEN,
    OPT_DATABASE
};

struct send_options {
    struct send_params params;
    struct cigi_send_params cigi; /* where params.protocol says so */
    const char *flight, *url;
    bool json;
};

static const struct argp_option known[] = {
    {"to", OPT_TO, "URL", 0, "udp://HOST:PORT, can:INTERFACE or sim:PATH", 0},
    {"protocol", OPT_PROTOCOL, "NAME", 0,
     "native, flightgear, xplane, dis, canaerospace, cigi3 or cigi4 (default: native, over CAN "
     "canaerospace)",
     0},
    {"rate", OPT_RATE, "HZ", 0, "poses a second (default 60)", 0},
    {"speed", OPT_SPEED, "X", 0, "flight seconds a second (default 1)", 0},
    {"jitter-ms", OPT_JITTER, "MS", 0, "each packet leaves up to this much late", 0},
    {"loss", OPT_LOSS, "P", 0, "chance of a packet to be left out, 0 to 1", 0},
    {"reorder", OPT_REORDER, "P", 0, "chance of a packet to change places with the next, 0 to 1",
     0},
    {"seed", OPT_SEED, "N", 0, "of jitter, loss and reordering (default 1)", 0},
    {"sync", OPT_SYNC, NULL, 0, "CIGI: answer each Start of Frame, at its rate", 0},
    {"listen", OPT_LISTEN, "ADDRESS:PORT", 0,
     "CIGI: where Start of Frame comes to (default 127.0.0.1:8005)", 0},
    {"database", OPT_DATABASE, "N", 0, "CIGI: the database to ask for first, 1 to 127", 0},
    {"json", 'j', NULL, 0, "print what was sent as JSON", 0},
    {0},
};

/* "cigi3" is 3.3. */
static bool parse_protocol(struct send_options *options, const char *name)
{
    if (strcmp(name, "cigi3") != 0 && strcmp(name, "cigi4") != 0)
        return pose_protocol_from_name(name, &options->params.protocol) == 0 &&
               options->params.protocol != POSE_PROTOCOL_CIGI;
    bool four = name[4] == '4';
    options->params.protocol = POSE_PROTOCOL_CIGI;
    options->cigi.format = (struct cigi_format){.major = four ? 4 : 3, .minor = four ? 0 : 3};
    return true;
}

/* What each protocol has options of its own for. */
static void check_options(const struct send_options *options, struct argp_state *state)
{
    const struct send_params *params = &options->params;
    const struct cigi_send_params *cigi = &options->cigi;
    bool disturbs = params->jitter_ms > 0.0 || params->loss > 0.0 || params->reorder > 0.0;
    if (!options->url)
        argp_error(state, "--to URL is missing");
    if (params->protocol == POSE_PROTOCOL_CIGI && disturbs)
        argp_error(state, "--jitter-ms, --loss and --reorder do not go with CIGI");
    if (params->protocol != POSE_PROTOCOL_CIGI &&
        (cigi->synchronous || cigi->listen || cigi->database))
        argp_error(state, "--sync, --listen and --database go with --protocol cigi3 or cigi4");
}

static error_t parse_option(int key, char *argument, struct argp_state *state)
{
    struct send_options *options = state->input;
    struct send_params *params = &options->params;
    switch (key) {
    case 'j':
        options->json = true;
        return 0;
    case OPT_TO:
        options->url = argument;
        return 0;
    case OPT_PROTOCOL:
        if (!parse_protocol(options, argument))
            argp_error(state,
                       "--protocol takes native, flightgear, xplane, dis, canaerospace, cigi3 or "
                       "cigi4, not "
                       "\"%s\"",
                       argument);
        return 0;
    case OPT_RATE:
        params->rate_hz = cli_number(state, "rate", argument, 0.1, 10000.0);
        return 0;
    case OPT_SPEED:
        params->speed = cli_number(state, "speed", argument, 0.01, 1000.0);
        return 0;
    case OPT_JITTER:
        params->jitter_ms = cli_number(state, "jitter-ms", argument, 0.0, 10000.0);
        return 0;
    case OPT_LOSS:
        params->loss = cli_number(state, "loss", argument, 0.0, 1.0);
        return 0;
    case OPT_REORDER:
        params->reorder = cli_number(state, "reorder", argument, 0.0, 1.0);
        return 0;
    case OPT_SEED:
        params->seed = (uint64_t)cli_number(state, "seed", argument, 0.0, 1e15);
        return 0;
    case OPT_SYNC:
        options->cigi.synchronous = true;
        return 0;
    case OPT_LISTEN:
        options->cigi.listen = argument;
        return 0;
    case OPT_DATABASE:
        options->cigi.database = (uint8_t)cli_number(state, "database", argument, 1.0, 127.0);
        return 0;
    case ARGP_KEY_SUCCESS:
        check_options(options, state);
        return 0;
    default:
        return cli_argument(key, argument, state, "FLIGHT", &options->flight);
    }
}

static const struct argp parser = {
    .options = known,
    .parser = parse_option,
    .args_doc = "FLIGHT --to URL",
    .doc = "Play a flight as a host would: a recording, CSV, pcap, candump log or IGC."
           "\vExit status: 0 sent, 64 bad usage, 65 not a flight, 66 no such file, 69 the target "
           "cannot be reached.",
};

static bool is_can(const char *url)
{
    return strncmp(url, "can:", 4) == 0 || strncmp(url, "sim:", 4) == 0;
}

static int send_poses(const struct flight *flight, const struct send_options *options,
                      struct diag *diag)
{
    struct send_schedule *schedule = NULL;
    struct send_result result = {0};
    int r = send_schedule_create(flight, &options->params, &schedule, diag);
    if (r < 0)
        return r;
    r = send_run(schedule, options->url, options->params.protocol, stop_on_signals(), &result,
                 diag);
    if (r == 0 && options->json)
        cli_print_json(json_pack("{s:I, s:I, s:I}", "sent", (json_int_t)result.sent, "left_out",
                                 (json_int_t)schedule->left_out, "refused",
                                 (json_int_t)result.failed));
    else if (r == 0 && !cli_quiet())
        printf("%llu packets sent, %llu left out, %llu refused\n", (unsigned long long)result.sent,
               (unsigned long long)schedule->left_out, (unsigned long long)result.failed);
    /* A refusal is heard of at the next packet, so of those to a closed port about half are. */
    if (r == 0 && result.failed > 0 && result.failed + 1 >= result.sent)
        r = diag_set(diag, -ECONNREFUSED, "%s: nobody takes the packets there", options->url);
    send_schedule_destroy(schedule);
    return r;
}

static int send_cigi(const struct flight *flight, struct send_options *options, struct diag *diag)
{
    struct cigi_send_result result;
    options->cigi.rate_hz = options->params.rate_hz;
    options->cigi.speed = options->params.speed;
    int r = cigi_send_run(flight, options->url, &options->cigi, stop_on_signals(), &result, diag);
    if (r == 0 && options->json)
        cli_print_json(json_pack("{s:I, s:I, s:I, s:I, s:I, s:I}", "sent", (json_int_t)result.sent,
                                 "refused", (json_int_t)result.failed, "starts_of_frame",
                                 (json_int_t)result.starts, "gaps", (json_int_t)result.gaps,
                                 "starts_refused", (json_int_t)result.refused, "not_in_step",
                                 (json_int_t)result.unheld));
    else if (r == 0 && !cli_quiet())
        printf("%llu messages sent, %llu refused; %llu Starts of Frame, %llu gaps in their "
               "numbers, %llu refused, %llu not in step\n",
               (unsigned long long)result.sent, (unsigned long long)result.failed,
               (unsigned long long)result.starts, (unsigned long long)result.gaps,
               (unsigned long long)result.refused, (unsigned long long)result.unheld);
    return r;
}

int send_main(int argc, char **argv)
{
    struct send_options options = {.params = {.protocol = POSE_PROTOCOLS, .seed = 1}};
    cli_parse(&parser, "send", argc, argv, &options);
    options.params.session = (uint32_t)(clock_realtime_ns() / NSEC_PER_MSEC);
    if (options.params.protocol == POSE_PROTOCOLS)
        options.params.protocol =
            is_can(options.url) ? POSE_PROTOCOL_CANAEROSPACE : POSE_PROTOCOL_NATIVE;
    struct diag diag = {0};
    struct geoid *geoid = NULL;
    struct flight *flight = NULL;
    int r = geoid_setup_open("egm96", &geoid, &diag);
    options.params.geoid = geoid_function_of(geoid);
    struct flight_params flight_params = {.geoid = options.params.geoid};
    if (r == 0)
        r = flight_load(options.flight, &flight_params, &flight, &diag);
    if (flight && flight->note.text[0] && !cli_quiet())
        fprintf(stderr, "otwd: %s\n", flight->note.text);
    if (r == 0) {
        r = options.params.protocol == POSE_PROTOCOL_CIGI ? send_cigi(flight, &options, &diag)
                                                          : send_poses(flight, &options, &diag);
        if (r < 0 && r != -EINVAL && r != -ENOMEM)
            r = -ENODEV; /* not a file: the target cannot be reached */
    }
    flight_destroy(flight);
    geoid_close(geoid);
    return r < 0 ? cli_fail(r, &diag) : EX_OK;
}
