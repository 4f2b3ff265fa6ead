#include "daemon/bench_quality.h"

#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <sysexits.h>

#include "daemon/cli.h"
#include "daemon/geoid_function.h"
#include "daemon/replay.h"
#include "daemon/terrain_setup.h"
#include "render/quality.h"

#define WGS84_A 6378137.0

enum {
    OPT_TERRAIN = 256,
    OPT_GEOID,
    OPT_SIZE,
    OPT_PIXEL_ERROR,
    OPT_RADIUS,
    OPT_FRAMES,
    OPT_PIXELS,
    OPT_REFERENCE_STEP
};

struct quality_options {
    struct channel_params channel;
    const char *flight;
    unsigned frames, pixels;
    double reference_step_m;
    bool json;
};

static const struct argp_option known[] = {
    {"terrain", OPT_TERRAIN, "DB", 0, "a terrain database (default: the embedded planet)", 0},
    {"geoid", OPT_GEOID, "egm96|FILE", 0, "the geoid of heights above mean sea level", 0},
    {"size", OPT_SIZE, "WxH", 0, "pixels (default 1024x576)", 0},
    {"pixel-error", OPT_PIXEL_ERROR, "PX", 0, "error allowed on the screen (default 1)", 0},
    {"radius", OPT_RADIUS, "POSTS", 0,
     "of the clipmap's levels: 32, 64, 128, 256 or 512 (default: by size and pixel error)", 0},
    {"frames", OPT_FRAMES, "N", 0, "evenly over the flight (default 60)", 0},
    {"pixels", OPT_PIXELS, "N", 0, "of a frame that are asked, at random (default 20000)", 0},
    {"reference-step", OPT_REFERENCE_STEP, "M", 0,
     "posts of the reference at most so far apart (default: as the finest level's)", 0},
    {"json", 'j', NULL, 0, "as JSON", 0},
    {0},
};

static error_t parse_option(int key, char *argument, struct argp_state *state)
{
    struct quality_options *options = state->input;
    struct channel_params *channel = &options->channel;
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
    case OPT_RADIUS:
        channel->radius = (int)cli_number(state, "radius", argument, 32.0, 512.0);
        if (channel->radius & (channel->radius - 1))
            argp_error(state, "--radius takes a power of two, not \"%s\"", argument);
        return 0;
    case OPT_FRAMES:
        options->frames = (unsigned)cli_number(state, "frames", argument, 1.0, 1e5);
        return 0;
    case OPT_PIXELS:
        options->pixels = (unsigned)cli_number(state, "pixels", argument, 1.0, 1e6);
        return 0;
    case OPT_REFERENCE_STEP:
        options->reference_step_m = cli_number(state, "reference-step", argument, 0.1, 10000.0);
        return 0;
    case 'j':
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
    .doc = "Measure how true the picture is: how far the ground that pixels show is, on the "
           "screen, from the ground at full detail, which has no levels of detail. Every frame "
           "waits for its terrain."
           "\vExit status: 0 measured, 64 bad usage, 65 not a flight or a bad database, 66 a file "
           "is missing, 69 no OpenGL 4.5.",
};

/* What the picture is measured by: a second look at the same ground. */
struct ground {
    struct terrain_setup terrain;
    struct reference *reference;
    int level;
    double step_m;
};

static int ground_open(const struct quality_options *options, struct ground *ret_ground,
                       struct diag *diag)
{
    const struct channel_params *channel = &options->channel;
    struct ground *ground = ret_ground;
    struct terrain_facts facts;
    int r = terrain_setup_open(channel->terrain_path, channel->geoid, channel->cache_mib,
                               &ground->terrain, diag);
    if (r < 0)
        return r;
    ground->terrain.source->ops->facts(ground->terrain.source, &facts);
    struct reference_params params = {
        .shape =
            clipmap_shape(64, 8, facts.finest_lat_step_deg), /* levels are those of all radii */
        .source = ground->terrain.source,
        .fallback = ground->terrain.fallback,
        .geoid = ground->terrain.geoid,
    };
    params.level = reference_level_for(&params.shape, options->reference_step_m);
    ground->level = params.level;
    ground->step_m = WGS84_A * clipmap_step_rad(&params.shape, params.level);
    r = reference_create(&params, &ground->reference);
    return r == 0 ? 0 : diag_set(diag, r, "no memory for the reference");
}

static void ground_close(struct ground *ground)
{
    reference_destroy(ground->reference);
    terrain_setup_close(&ground->terrain);
}

static int load_flight(const struct quality_options *options, struct geoid *geoid,
                       struct flight **ret_flight, struct diag *diag)
{
    const struct flight_params params = {.geoid = geoid_function_of(geoid)};
    return flight_load(options->flight, &params, ret_flight, diag);
}

/* What a run found. */
struct findings {
    struct quality_tally tally;
    struct samples triangles; /* of the frames */
};

static int fly(const struct quality_options *options, const struct flight *flight,
               struct channel *channel, struct quality *quality, struct findings *findings)
{
    nsec_t duration_ns = flight_duration_ns(flight);
    for (unsigned i = 0; i < options->frames; i++) {
        double share = options->frames > 1 ? (double)i / (options->frames - 1) : 0.0;
        struct pose pose;
        struct channel_frame frame;
        flight_sample(flight, (nsec_t)(share * (double)duration_ns), &pose);
        for (int again = 0; again < 2; again++) /* the first tells how near the ground is */
            channel_draw(channel, &pose, NULL, 0, true, &frame);
        int r = quality_look(quality, channel_renderer(channel), &frame.view, &findings->tally);
        if (r < 0)
            return r;
        samples_add(&findings->triangles, (double)frame.renderer.triangles);
    }
    return 0;
}

static int measure(const struct quality_options *options, const struct flight *flight,
                   struct channel *channel, struct quality *quality, struct findings *findings,
                   struct diag *diag)
{
    size_t room = (size_t)options->frames * options->pixels;
    int r = samples_init(&findings->tally.error_px, room);
    if (r == 0)
        r = samples_init(&findings->tally.depth_px, room);
    if (r == 0)
        r = samples_init(&findings->triangles, options->frames);
    if (r == 0)
        r = fly(options, flight, channel, quality, findings);
    if (r < 0)
        return diag_set(diag, r, r == -ENOMEM ? "no memory for the pixels" : "the GPU was lost");
    return 0;
}

static json_t *json_distribution(const struct distribution *d)
{
    return json_pack("{s:f,s:f,s:f,s:f}", "p50", d->p50, "p99", d->p99, "p999", d->p999, "max",
                     d->max);
}

static void print_findings(const struct quality_options *options, const struct ground *ground,
                           const struct gl_facts *gl, struct findings *findings)
{
    struct distribution error_px, depth_px, triangles;
    struct quality_tally *tally = &findings->tally;
    size_t judged = tally->error_px.count;
    distribution_of_values(tally->error_px.values, judged, &error_px);
    distribution_of_values(tally->depth_px.values, judged, &depth_px);
    distribution_of_values(findings->triangles.values, findings->triangles.count, &triangles);
    const struct channel_params *channel = &options->channel;
    if (!options->json) {
        printf("%s, %u frames of %d x %d on %s\n", channel->technique, options->frames,
               channel->width, channel->height, gl->renderer);
        printf("  reference: level %d, posts %.2f m apart; %zu pixels judged, %.1f %% of those "
               "asked\n",
               ground->level, ground->step_m, judged,
               100.0 * (double)judged / fmax((double)tally->pixels, 1.0));
        printf("  triangles %.0f at the median, at most %.0f\n", triangles.p50, triangles.max);
        printf("  %-16s %9s %9s %9s %9s\n", "px", "p50", "p99", "p99.9", "max");
        printf("  %-16s %9.4f %9.4f %9.4f %9.4f\n", "error", error_px.p50, error_px.p99,
               error_px.p999, error_px.max);
        printf("  %-16s %9.4f %9.4f %9.4f %9.4f\n", "depth resolution", depth_px.p50, depth_px.p99,
               depth_px.p999, depth_px.max);
        return;
    }
    json_t *root = json_pack(
        "{s:s,s:o,s:{s:s,s:s,s:s},s:[i,i],s:f,s:i,s:{s:i,s:f},s:I,s:I,s:o,s:o,s:{s:f,s:f}}",
        "technique", channel->technique, "flight", cli_json_text(options->flight), "gl", "vendor",
        gl->vendor, "renderer", gl->renderer, "version", gl->version, "size_px", channel->width,
        channel->height, "pixel_error", channel->pixel_error, "frames", (int)options->frames,
        "reference", "level", ground->level, "step_m", ground->step_m, "pixels",
        (json_int_t)tally->pixels, "pixels_judged", (json_int_t)judged, "error_px",
        json_distribution(&error_px), "depth_resolution_px", json_distribution(&depth_px),
        "triangles", "p50", triangles.p50, "max", triangles.max);
    json_dumpf(root, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(7));
    putchar('\n');
    json_decref(root);
}

int bench_quality_main(int argc, char **argv)
{
    struct quality_options options = {
        .channel = replay_defaults().channel, .frames = 60, .pixels = 20000};
    struct diag diag = {.text = ""};
    struct ground ground = {0};
    struct flight *flight = NULL;
    struct channel *channel = NULL;
    struct quality *quality = NULL;
    struct findings findings = {0};
    cli_parse(&parser, "bench quality", argc, argv, &options);
    int r = ground_open(&options, &ground, &diag);
    if (r == 0)
        r = load_flight(&options, ground.terrain.geoid, &flight, &diag);
    if (r == 0)
        r = channel_create(&options.channel, &channel, &diag);
    const struct quality_params params = {options.channel.width, options.channel.height,
                                          options.pixels, ground.reference};
    if (r == 0)
        r = quality_create(&params, &quality, &diag);
    if (r == 0)
        r = measure(&options, flight, channel, quality, &findings, &diag);
    if (r == 0)
        print_findings(&options, &ground, channel_gl(channel), &findings);
    samples_finish(&findings.tally.error_px);
    samples_finish(&findings.tally.depth_px);
    samples_finish(&findings.triangles);
    quality_destroy(quality);
    channel_destroy(channel);
    flight_destroy(flight);
    ground_close(&ground);
    return r < 0 ? cli_fail(r, &diag) : EX_OK;
}
