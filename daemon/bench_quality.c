#include "daemon/bench_quality.h"

#include <errno.h>
#include <inttypes.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <sys/stat.h>
#include <sysexits.h>
#include <unistd.h>

#include "daemon/channel_options.h"
#include "daemon/cli.h"
#include "daemon/geoid_function.h"
#include "daemon/image_file.h"
#include "daemon/replay.h"
#include "daemon/terrain_setup.h"
#include "render/quality.h"

#define WGS84_A         6378137.0
#define STEPS_A_POST    8.0  /* of the drawn reference between two posts of the database, */
#define STEP_LEAST_M    10.0 /* but no finer than that */
#define TILES_MIB       1024 /* of the GPU's memory, for the drawn reference */
#define DIFFERENCE_GAIN 8.0  /* of the picture of differences */

enum { OPT_RADIUS = 256, OPT_FRAMES, OPT_PIXELS, OPT_REFERENCE_STEP, OPT_IMAGES, OPT_NO_PICTURE };

struct quality_options {
    struct channel_params channel;
    const char *flight, *images_dir;
    unsigned frames, pixels;
    double reference_step_m; /* 0: as the database asks for */
    bool picture, json;
};

static const struct argp_option known[] = {
    {"radius", OPT_RADIUS, "POSTS", 0,
     "of the clipmap's levels: 32, 64, 128 or 256 (default: by size and pixel error)", 0},
    {"frames", OPT_FRAMES, "N", 0, "evenly over the flight (default 60)", 0},
    {"pixels", OPT_PIXELS, "N", 0, "of a frame that are asked, at random (default 20000)", 0},
    {"reference-step", OPT_REFERENCE_STEP, "M", 0,
     "posts of the drawn reference at most so far apart (default: an eighth of the database's, at "
     "least 10)",
     0},
    {"no-picture", OPT_NO_PICTURE, NULL, 0, "measure depth alone; draw no reference", 0},
    {"images", OPT_IMAGES, "DIR", 0,
     "write the frame with the worst PSNR: ours.png, reference.png, difference.png", 0},
    {"json", 'j', NULL, 0, "as JSON", 0},
    {0},
};

static error_t parse_option(int key, char *argument, struct argp_state *state)
{
    struct quality_options *options = state->input;
    struct channel_params *channel = &options->channel;
    switch (key) {
    case ARGP_KEY_INIT:
        state->child_inputs[0] = &options->channel;
        return 0;
    case OPT_RADIUS:
        channel->radius = (int)cli_number(state, "radius", argument, 32.0, 256.0);
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
    case OPT_NO_PICTURE:
        options->picture = false;
        return 0;
    case OPT_IMAGES:
        options->images_dir = argument;
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
    .children = channel_children,
    .args_doc = "FLIGHT",
    .doc = "Measure how true the picture is, over a flight: how far the ground that pixels show "
           "is, on the screen, from the ground at full detail, which has no levels of detail; and "
           "the peak signal-to-noise ratio beside a picture of that ground. Every frame waits for "
           "its terrain."
           "\vExit status: 0 measured, 64 bad usage, 65 not a flight or a bad database, 66 a file "
           "is missing, 69 no OpenGL 4.5, 74 a file cannot be written.",
};

/* The ground at full detail, by a look of its own at the database. */
struct detail {
    struct terrain_setup terrain;
    struct clipmap_shape shape;
    struct reference *truth, *drawn; /* the finest level; what a picture can be drawn of */
    struct reference_pass *pass;     /* NULL: no picture */
};

static int add_reference(struct detail *detail, double step_m, struct reference **ret_reference,
                         struct diag *diag)
{
    const struct reference_params params = {
        .shape = detail->shape,
        .level = reference_level_for(&detail->shape, step_m),
        .source = detail->terrain.source,
        .fallback = detail->terrain.fallback,
        .geoid = detail->terrain.geoid,
    };
    int r = reference_create(&params, ret_reference);
    return r == 0 ? 0 : diag_set(diag, r, "no memory for the reference");
}

static double step_m(const struct reference *reference)
{
    return WGS84_A * clipmap_step_rad(reference_shape(reference), reference_level(reference));
}

/* A GL context is current. */
static int detail_open(const struct quality_options *options, struct detail *ret_detail,
                       struct diag *diag)
{
    const struct channel_params *channel = &options->channel;
    struct terrain_facts facts;
    int r = terrain_setup_open(channel->terrain_path, channel->geoid, channel->cache_mib,
                               &ret_detail->terrain, diag);
    if (r < 0)
        return r;
    ret_detail->terrain.source->ops->facts(ret_detail->terrain.source, &facts);
    /* What its levels are does not depend on the radius. */
    ret_detail->shape = clipmap_shape(64, 8, facts.finest_lat_step_deg);
    double asked_m = options->reference_step_m;
    if (asked_m == 0.0)
        asked_m =
            fmax(facts.finest_lat_step_deg * M_PI / 180.0 * WGS84_A / STEPS_A_POST, STEP_LEAST_M);
    r = add_reference(ret_detail, 0.0, &ret_detail->truth, diag);
    if (r == 0)
        r = add_reference(ret_detail, asked_m, &ret_detail->drawn, diag);
    if (r == 0 && options->picture)
        r = reference_pass_create(ret_detail->drawn, TILES_MIB, &ret_detail->pass, diag);
    return r;
}

static void detail_close(struct detail *detail)
{
    reference_pass_destroy(detail->pass);
    reference_destroy(detail->truth);
    reference_destroy(detail->drawn);
    terrain_setup_close(&detail->terrain);
}

/* Heights of the flight and of the ground are by the same geoid. */
static int load_flight(const struct quality_options *options, struct flight **ret_flight,
                       struct diag *diag)
{
    struct geoid *geoid;
    int r = geoid_setup_open(options->channel.geoid, &geoid, diag);
    if (r < 0)
        return r;
    const struct flight_params params = {.geoid = geoid_function_of(geoid)};
    r = flight_load(options->flight, &params, ret_flight, diag);
    geoid_close(geoid);
    return r;
}

/* What a run found. */
struct findings {
    struct quality_tally tally;
    struct samples triangles, reference_triangles; /* of frames */
    double worst_db, worst_s; /* the frame with the worst ratio, and when it is */
};

static void findings_finish(struct findings *findings)
{
    samples_finish(&findings->tally.error_px);
    samples_finish(&findings->tally.depth_px);
    samples_finish(&findings->tally.reference_px);
    samples_finish(&findings->tally.psnr_db);
    samples_finish(&findings->triangles);
    samples_finish(&findings->reference_triangles);
}

static int findings_init(struct findings *findings, const struct quality_options *options)
{
    size_t frames = options->frames, pixels = frames * options->pixels;
    *findings = (struct findings){.worst_db = INFINITY};
    const struct {
        struct samples *samples;
        size_t room;
    } all[] = {
        {&findings->tally.error_px, pixels},
        {&findings->tally.depth_px, pixels},
        {&findings->tally.reference_px, options->picture ? pixels : 1},
        {&findings->tally.psnr_db, frames},
        {&findings->triangles, frames},
        {&findings->reference_triangles, frames},
    };
    for (size_t i = 0; i < sizeof(all) / sizeof(all[0]); i++)
        if (samples_init(all[i].samples, all[i].room) < 0)
            return -ENOMEM;
    return 0;
}

/* All that a run works with. */
struct run {
    struct quality_options options;
    struct flight *flight;
    struct channel *channel;
    struct detail detail;
    struct quality *quality;
    struct findings findings;
};

static int write_images(struct run *run, struct diag *diag)
{
    const struct quality_options *options = &run->options;
    struct quality_pictures pictures = quality_pictures(run->quality, DIFFERENCE_GAIN);
    const struct {
        const char *name;
        const uint8_t *rgba;
    } all[] = {{"ours", pictures.ours},
               {"reference", pictures.reference},
               {"difference", pictures.difference}};
    char path[4096];
    mkdir(options->images_dir, 0777); /* what is wrong with it the file will tell */
    for (size_t i = 0; i < sizeof(all) / sizeof(all[0]); i++) {
        snprintf(path, sizeof(path), "%s/%s.png", options->images_dir, all[i].name);
        if (image_write_png(path, options->channel.width, options->channel.height, all[i].rgba,
                            diag) < 0)
            return -EIO;
    }
    return 0;
}

/* Keeps the frame in mind if it is the worst so far. */
static int note_worst(struct run *run, double time_s, struct diag *diag)
{
    struct findings *findings = &run->findings;
    const struct samples *psnr_db = &findings->tally.psnr_db;
    double db = psnr_db->values[psnr_db->count - 1];
    if (db >= findings->worst_db)
        return 0;
    findings->worst_db = db;
    findings->worst_s = time_s;
    return run->options.images_dir ? write_images(run, diag) : 0;
}

static int judge_frame(struct run *run, nsec_t time_ns, struct diag *diag)
{
    struct findings *findings = &run->findings;
    struct pose pose;
    struct channel_frame frame;
    flight_sample(run->flight, time_ns, &pose);
    for (int again = 0; again < 2; again++) /* the first tells how near the ground is */
        channel_draw(run->channel, &pose, NULL, replay_utc_ns(run->flight) + time_ns, true, &frame);
    samples_add(&findings->triangles, (double)frame.renderer.triangles);
    if (quality_look(run->quality, channel_renderer(run->channel), &frame.view, &findings->tally) <
        0)
        return diag_set(diag, -EIO, "the GPU was lost");
    if (!run->detail.pass)
        return 0;
    samples_add(&findings->reference_triangles,
                (double)reference_pass_counts(run->detail.pass).triangles);
    return note_worst(run, seconds_from_ns(time_ns), diag);
}

static int fly(struct run *run, struct diag *diag)
{
    unsigned frames = run->options.frames;
    double duration_ns = (double)flight_duration_ns(run->flight);
    for (unsigned i = 0; i < frames; i++) {
        double share = frames > 1 ? (double)i / (frames - 1) : 0.0;
        if (isatty(STDERR_FILENO) && !cli_quiet())
            fprintf(stderr, "\rframe %u of %u%s", i + 1, frames, i + 1 == frames ? "\n" : "");
        int r = judge_frame(run, (nsec_t)(share * duration_ns), diag);
        if (r < 0)
            return r;
    }
    return 0;
}

static double mean_of(const struct samples *samples)
{
    double sum = 0.0;
    for (size_t i = 0; i < samples->count; i++)
        sum += samples->values[i];
    return sum / fmax((double)samples->count, 1.0);
}

/* The share of pixels that are off by more than was promised. */
static double share_over(const struct samples *error_px, double most_px)
{
    size_t over = 0;
    for (size_t i = 0; i < error_px->count; i++)
        over += error_px->values[i] > most_px;
    return (double)over / fmax((double)error_px->count, 1.0);
}

static struct distribution distribution_of(struct samples *samples)
{
    struct distribution distribution;
    distribution_of_values(samples->values, samples->count, &distribution);
    return distribution;
}

static void print_row(const char *name, struct samples *px)
{
    struct distribution d = distribution_of(px);
    printf("  %-24s %9.4f %9.4f %9.4f %9.4f\n", name, d.p50, d.p99, d.p999, d.max);
}

static void print_table(struct run *run)
{
    const struct channel_params *channel = &run->options.channel;
    const struct gl_facts *gl = channel_gl(run->channel);
    const struct detail *detail = &run->detail;
    struct findings *findings = &run->findings;
    struct quality_tally *tally = &findings->tally;
    struct distribution triangles = distribution_of(&findings->triangles);
    printf("%s, %u frames of %d x %d on %s\n", channel->technique, run->options.frames,
           channel->width, channel->height, gl->renderer);
    printf("  %.0f triangles at the median, at most %.0f\n", triangles.p50, triangles.max);
    printf("  %zu pixels with ground of %" PRIu64 " asked; %.3f %% are off by more than %g px\n",
           tally->error_px.count, tally->pixels,
           100.0 * share_over(&tally->error_px, channel->pixel_error), channel->pixel_error);
    printf("  %-24s %9s %9s %9s %9s\n", "px", "p50", "p99", "p99.9", "max");
    print_row("error", &tally->error_px);
    print_row("depth's resolution", &tally->depth_px);
    printf("  ground: posts %.2f m apart (level %d)\n", step_m(detail->truth),
           reference_level(detail->truth));
    if (!detail->pass)
        return;
    triangles = distribution_of(&findings->reference_triangles);
    print_row("the reference's error", &tally->reference_px);
    printf("  reference: posts %.2f m apart (level %d), at most %.0f triangles\n",
           step_m(detail->drawn), reference_level(detail->drawn), triangles.max);
    printf("  PSNR %.2f dB on average, at worst %.2f (at %.2f s)\n", mean_of(&tally->psnr_db),
           findings->worst_db, findings->worst_s);
}

static json_t *json_distribution(struct samples *samples)
{
    struct distribution d = distribution_of(samples);
    return json_pack("{s:f,s:f,s:f,s:f}", "p50", d.p50, "p99", d.p99, "p999", d.p999, "max", d.max);
}

static json_t *json_level(const struct reference *reference)
{
    return json_pack("{s:i,s:f}", "level", reference_level(reference), "step_m", step_m(reference));
}

static void print_json(struct run *run)
{
    const struct channel_params *channel = &run->options.channel;
    const struct gl_facts *gl = channel_gl(run->channel);
    const struct detail *detail = &run->detail;
    struct findings *findings = &run->findings;
    struct quality_tally *tally = &findings->tally;
    json_t *root = json_pack(
        "{s:s,s:o,s:{s:s,s:s,s:s},s:[i,i],s:f,s:i,s:I,s:I}", "technique", channel->technique,
        "flight", cli_json_text(run->options.flight), "gl", "vendor", gl->vendor, "renderer",
        gl->renderer, "version", gl->version, "size_px", channel->width, channel->height,
        "pixel_error", channel->pixel_error, "frames", (int)run->options.frames, "pixels",
        (json_int_t)tally->pixels, "pixels_judged", (json_int_t)tally->error_px.count);
    json_object_set_new(root, "share_over_pixel_error",
                        json_real(share_over(&tally->error_px, channel->pixel_error)));
    json_object_set_new(root, "triangles", json_distribution(&findings->triangles));
    json_object_set_new(root, "ground", json_level(detail->truth));
    json_object_set_new(root, "error_px", json_distribution(&tally->error_px));
    json_object_set_new(root, "depth_resolution_px", json_distribution(&tally->depth_px));
    if (detail->pass) {
        json_object_set_new(root, "reference", json_level(detail->drawn));
        json_object_set_new(root, "reference_error_px", json_distribution(&tally->reference_px));
        json_object_set_new(root, "reference_triangles",
                            json_distribution(&findings->reference_triangles));
        json_object_set_new(root, "psnr_db",
                            json_pack("{s:f,s:f,s:f}", "mean", mean_of(&tally->psnr_db), "worst",
                                      findings->worst_db, "worst_at_s", findings->worst_s));
    }
    json_dumpf(root, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(7));
    putchar('\n');
    json_decref(root);
}

static int run_open(struct run *run, struct diag *diag)
{
    const struct quality_options *options = &run->options;
    int r = load_flight(options, &run->flight, diag);
    if (r == 0)
        r = channel_create(&options->channel, &run->channel, diag);
    if (r == 0)
        r = detail_open(options, &run->detail, diag);
    const struct quality_params params = {options->channel.width, options->channel.height,
                                          options->pixels, run->detail.truth, run->detail.pass};
    if (r == 0)
        r = quality_create(&params, &run->quality, diag);
    if (r == 0 && findings_init(&run->findings, options) < 0)
        r = diag_set(diag, -ENOMEM, "no memory for the pixels");
    return r;
}

static void run_close(struct run *run)
{
    findings_finish(&run->findings);
    quality_destroy(run->quality);
    detail_close(&run->detail);
    channel_destroy(run->channel);
    flight_destroy(run->flight);
}

int bench_quality_main(int argc, char **argv)
{
    struct diag diag = {.text = ""};
    struct run run = {
        .options = {
            .channel = replay_defaults().channel, .frames = 60, .pixels = 20000, .picture = true}};
    cli_parse(&parser, "bench quality", argc, argv, &run.options);
    int r = run_open(&run, &diag);
    if (r == 0)
        r = fly(&run, &diag);
    if (r == 0 && run.options.json)
        print_json(&run);
    else if (r == 0 && !cli_quiet())
        print_table(&run);
    run_close(&run);
    return r < 0 ? cli_fail(r, &diag) : EX_OK;
}
