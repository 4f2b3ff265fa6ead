#include "daemon/channel_options.h"

#include "daemon/channel.h"
#include "daemon/cli.h"

enum { OPT_TERRAIN = 256, OPT_GEOID, OPT_SIZE, OPT_PIXEL_ERROR, OPT_TECHNIQUE };

static const struct argp_option known[] = {
    {"terrain", OPT_TERRAIN, "DB", 0, "a terrain database (default: the embedded planet)", 0},
    {"geoid", OPT_GEOID, "egm96|FILE", 0, "the geoid of heights above mean sea level", 0},
    {"size", OPT_SIZE, "WxH", 0, "pixels (default 1024x576)", 0},
    {"pixel-error", OPT_PIXEL_ERROR, "PX", 0, "error allowed on the screen (default 1)", 0},
    {0},
};

static error_t parse_option(int key, char *argument, struct argp_state *state)
{
    struct channel_params *channel = state->input;
    switch (key) {
    case OPT_TERRAIN:
        channel->terrain_path = argument;
        return 0;
    case OPT_GEOID:
        channel->geoid = argument;
        return 0;
    case OPT_SIZE:
        cli_size(state, argument, &channel->width, &channel->height);
        return 0;
    case OPT_PIXEL_ERROR:
        channel->pixel_error = cli_number(state, "pixel-error", argument, 0.1, 100.0);
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp parser = {.options = known, .parser = parse_option};

const struct argp_child channel_compared_children[] = {{&parser, 0, NULL, 0}, {0}};

static const struct argp_option technique[] = {
    {"technique", OPT_TECHNIQUE, "NAME", 0, "how the terrain is drawn (clipmap)", 0},
    {0},
};

static error_t parse_technique(int key, char *argument, struct argp_state *state)
{
    struct channel_params *channel = state->input;
    switch (key) {
    case ARGP_KEY_INIT:
        state->child_inputs[0] = channel;
        return 0;
    case OPT_TECHNIQUE:
        channel->technique = argument;
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp technique_parser = {
    .options = technique, .parser = parse_technique, .children = channel_compared_children};

const struct argp_child channel_children[] = {{&technique_parser, 0, NULL, 0}, {0}};
