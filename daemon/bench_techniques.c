#include "daemon/bench_techniques.h"

#include <assert.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sysexits.h>

#include "daemon/channel_options.h"
#include "daemon/cli.h"
#include "daemon/geoid_function.h"
#include "daemon/replay.h"
#include "daemon/technique_report.h"

#define ENTRIES_MOST  32
#define SURVEY_FRAMES 12 /* on which settings are chosen */
#define SURVEY_POINTS 7  /* settings of each knob */
#define REFINE_STEPS  4
#define JUDGED_FRAMES 40 /* of the flight, about */

enum {
    OPT_FLIGHT = 256,
    OPT_REPORT,
    OPT_TECHNIQUES,
    OPT_RATE,
    OPT_ROUNDS,
    OPT_EVERY,
    OPT_POSTS,
    OPT_SPACING,
    OPT_PIXELS,
    OPT_RADIUS
};

struct asked {
    int index; /* of its name */
    double setting;
};

struct techniques_options {
    struct channel_params channel;
    const char *flight, *report_dir;
    const char *names[ENTRIES_MOST];
    int count;
    struct asked asked[ENTRIES_MOST]; /* in this order, where settings are given */
    int asked_count;
    bool settings_given;
    double rate_hz, spacing_m;
    int rounds, every, posts, radius;
    unsigned pixels;
    bool json;
};

static const struct argp_option known[] = {
    {"flight", OPT_FLIGHT, "FLIGHT", 0, "the flight, of any form that `otwd replay` reads", 0},
    {"techniques", OPT_TECHNIQUES, "all|NAME[@SETTING],...", 0,
     "which are compared (default: all); where a setting is given none is chosen by measuring, and "
     "those without are at their usual one",
     0},
    {"rate", OPT_RATE, "HZ", 0, "frames a second of the flight (default 60)", 0},
    {"rounds", OPT_ROUNDS, "N", 0, "that each is flown, in turn with the others (default 3)", 0},
    {"every", OPT_EVERY, "N", 0, "judge only every Nth picture (default: some 40 of the flight)",
     0},
    {"posts", OPT_POSTS, "N", 0,
     "of the ground a side: 513, 1025, 2049, 4097, 8193 or 16385 (default 4097)", 0},
    {"spacing", OPT_SPACING, "M", 0,
     "of posts at most (default: the least with which the ground reaches 5 km beyond the flight)",
     0},
    {"pixels", OPT_PIXELS, "N", 0, "of a picture whose error is measured (default 4000)", 0},
    {"radius", OPT_RADIUS, "POSTS", 0,
     "that the clipmap's levels reach at most: 32, 64, ... 512 (default: what settings may ask "
     "for)",
     0},
    {"report", OPT_REPORT, "DIR", 0,
     "write report.json, report.html, flown.csv, frames.csv and pictures of each technique's worst "
     "frame",
     0},
    {"json", 'j', NULL, 0, "as JSON", 0},
    {0},
};

static void list_techniques(char *ret, size_t size)
{
    size_t used = (size_t)snprintf(ret, size, "clipmap");
    for (const struct technique_ops *const *ops = techniques; *ops && used < size; ops++)
        used += (size_t)snprintf(ret + used, size - used, ", %s", (*ops)->name);
}

/* Returns the name's index: each is there once. */
static int add_technique(struct argp_state *state, const char *name)
{
    struct techniques_options *options = state->input;
    char list[1024];
    list_techniques(list, sizeof(list));
    if (strcmp(name, "clipmap") != 0 && !technique_find(name))
        argp_error(state, "there is no technique \"%s\"; there are %s", name, list);
    for (int i = 0; i < options->count; i++)
        if (strcmp(options->names[i], name) == 0)
            return i;
    assert(options->count < ENTRIES_MOST); /* there are not so many */
    options->names[options->count] = name;
    return options->count++;
}

static void add_asked(struct argp_state *state, char *name)
{
    struct techniques_options *options = state->input;
    char *setting = strchr(name, '@');
    if (setting)
        *setting++ = '\0';
    if (options->asked_count == ENTRIES_MOST)
        argp_error(state, "--techniques takes at most %d", ENTRIES_MOST);
    int index = add_technique(state, name);
    struct technique_knob knob = entry_knob(name);
    if (setting)
        options->settings_given = true;
    options->asked[options->asked_count++] = (struct asked){
        index, setting ? cli_number(state, name, setting, knob.least, knob.most) : knob.usual};
}

static void add_all(struct argp_state *state)
{
    add_technique(state, "clipmap");
    for (const struct technique_ops *const *ops = techniques; *ops; ops++)
        add_technique(state, (*ops)->name);
}

/* Cuts the list up where it is: argv is the program's own. */
static void parse_techniques(struct argp_state *state, char *list)
{
    struct techniques_options *options = state->input;
    char *rest = list;
    options->count = options->asked_count = 0;
    options->settings_given = false;
    if (strcmp(list, "all") == 0)
        return;
    for (char *name; (name = strsep(&rest, ","));)
        add_asked(state, name);
}

static int parse_radius(struct argp_state *state, const char *text)
{
    int radius = (int)cli_number(state, "radius", text, 32.0, 512.0);
    if (radius & (radius - 1))
        argp_error(state, "--radius takes a power of two, not \"%s\"", text);
    return radius;
}

static int parse_posts(struct argp_state *state, const char *text)
{
    int posts = (int)cli_number(state, "posts", text, 513.0, 16385.0);
    if ((posts - 1) & (posts - 2))
        argp_error(state, "--posts takes a power of two and one more, not \"%s\"", text);
    return posts;
}

static error_t parse_option(int key, char *argument, struct argp_state *state)
{
    struct techniques_options *options = state->input;
    switch (key) {
    case ARGP_KEY_INIT:
        state->child_inputs[0] = &options->channel;
        return 0;
    case OPT_FLIGHT:
        options->flight = argument;
        return 0;
    case OPT_REPORT:
        options->report_dir = argument;
        return 0;
    case OPT_TECHNIQUES:
        parse_techniques(state, argument);
        return 0;
    case OPT_RATE:
        options->rate_hz = cli_number(state, "rate", argument, 0.1, 1000.0);
        return 0;
    case OPT_ROUNDS:
        options->rounds = (int)cli_number(state, "rounds", argument, 1.0, 100.0);
        return 0;
    case OPT_EVERY:
        options->every = (int)cli_number(state, "every", argument, 1.0, 1e6);
        return 0;
    case OPT_POSTS:
        options->posts = parse_posts(state, argument);
        return 0;
    case OPT_SPACING:
        options->spacing_m = cli_number(state, "spacing", argument, 0.1, 1000.0);
        return 0;
    case OPT_PIXELS:
        options->pixels = (unsigned)cli_number(state, "pixels", argument, 100.0, 1e6);
        return 0;
    case OPT_RADIUS:
        options->radius = parse_radius(state, argument);
        return 0;
    case 'j':
        options->json = true;
        return 0;
    case ARGP_KEY_END:
        if (!options->flight)
            argp_error(state, "--flight FLIGHT is missing");
        if (options->count == 0)
            add_all(state);
        return 0;
    default:
        return cli_argument(key, argument, state, NULL, NULL);
    }
}

static const struct argp parser = {
    .options = known,
    .parser = parse_option,
    .children = channel_compared_children,
    .doc =
        "Hold techniques for terrain against each other: the same ground, flight, shading and "
        "camera. The setting of each is chosen by measuring, so that all have the same error, "
        "--pixel-error at the 99th percentile; then so that all take the same time as the "
        "clipmap did. Or each is flown at the settings that are given, as in "
        "--techniques quadtree@1,quadtree@2,clipmap@1. Each is flown in turn with the others."
        "\n\nOr one of these, of which `otwd bench SUBJECT --help` says more:\n"
        "  codec RASTER...  the height codec beside LERC, zstd and PNG\n"
        "  motion           how true and how smooth what is shown of a flight is\n"
        "  quality FLIGHT   how far the picture is from the ground at full detail\n"
        "  stability        what moves on the screen that the camera does not explain"
        "\vExit status: 0 measured, 64 bad usage (the techniques are listed), 65 not a flight or "
        "a bad database, 66 a file is missing, 69 no OpenGL 4.5, 74 a file cannot be written. "
        "A technique that is not available here does not end the comparison.",
};

/* All that a comparison works with. */
struct comparing {
    struct techniques_options options;
    struct flight *flight;
    struct stage stage;
    struct entry entries[ENTRIES_MOST];
    struct curve curves[ENTRIES_MOST];
    struct flown flown[COMPARISONS][ENTRIES_MOST];
    struct technique_report report;
    struct progress progress;
};

/* Heights of the flight and of the ground are by the same geoid. */
static int load_flight(struct comparing *comparing, struct diag *diag)
{
    struct geoid *geoid;
    int r = geoid_setup_open(comparing->options.channel.geoid, &geoid, diag);
    if (r < 0)
        return r;
    const struct flight_params params = {.geoid = geoid_function_of(geoid)};
    r = flight_load(comparing->options.flight, &params, &comparing->flight, diag);
    geoid_close(geoid);
    return r;
}

static int open_entries(struct comparing *comparing, struct diag *diag)
{
    for (int i = 0; i < comparing->options.count; i++) {
        struct entry *entry = &comparing->entries[i];
        comparing->report.count = i + 1;
        comparing->curves[i].entry = entry;
        if (entry_open(&comparing->stage, comparing->options.names[i], entry) < 0)
            return diag_set(diag, -EIO, "%s: the GPU was lost", entry->name);
    }
    return 0;
}

static int open_all(struct comparing *comparing, struct diag *diag)
{
    const struct techniques_options *options = &comparing->options;
    int r = load_flight(comparing, diag);
    if (r < 0)
        return r;
    const struct stage_params stage = {
        .channel = &options->channel,
        .flight = comparing->flight,
        .cells = options->posts - 1,
        .spacing_m = options->spacing_m,
        .pixels = options->pixels,
        .finest_error = 0.25 * options->channel.pixel_error,
        .radius = options->radius,
    };
    r = stage_open(&stage, &comparing->stage, diag);
    if (r < 0)
        return r;
    progress_tell(&comparing->progress, "ground", 1, 1);
    double frames =
        floor(seconds_from_ns(flight_duration_ns(comparing->flight)) * options->rate_hz + 1e-9);
    struct flights_params params = {
        .frames = 1 + (int)fmin(frames, 1e6),
        .step_ns = ns_from_seconds(1.0 / options->rate_hz),
        .rounds = options->rounds,
        .every = options->every,
        .pixels = options->pixels,
        .watched = stability_pixels(options->channel.width, options->channel.height),
        .progress = &comparing->progress};
    if (params.every == 0)
        params.every = 1 + params.frames / JUDGED_FRAMES;
    comparing->report = (struct technique_report){.flight = options->flight,
                                                  .terrain = options->channel.terrain_path,
                                                  .channel = &options->channel,
                                                  .stage = &comparing->stage,
                                                  .params = params,
                                                  .error_px = options->channel.pixel_error,
                                                  .entries = comparing->entries,
                                                  .curves = comparing->curves};
    for (int which = 0; which < COMPARISONS; which++)
        comparing->report.flown[which] = comparing->flown[which];
    return open_entries(comparing, diag);
}

static void close_all(struct comparing *comparing)
{
    for (int which = 0; which < COMPARISONS; which++)
        for (int i = 0; i < ENTRIES_MOST; i++)
            flown_finish(&comparing->flown[which][i]);
    for (int i = 0; i < comparing->report.count; i++)
        entry_close(&comparing->entries[i]);
    stage_close(&comparing->stage);
    flight_destroy(comparing->flight);
}

/* The clipmap, whose time is the goal, keeps the setting that gave it. */
static const struct point *meeting(const struct comparing *comparing, int index,
                                   enum point_goal goal, double value)
{
    const struct curve *curve = &comparing->curves[index];
    bool same = goal == POINT_TIME && !comparing->entries[index].ops;
    return same ? points_meeting(curve, POINT_ERROR, comparing->report.error_px)
                : points_meeting(curve, goal, value);
}

/* Flies all that are available, each at the setting that meets a goal. */
static int fly_all(struct comparing *comparing, enum comparison which, enum point_goal goal,
                   double value, struct diag *diag)
{
    struct technique_report *report = &comparing->report;
    struct flown *flown = comparing->flown[which];
    struct flights_params params = report->params;
    int count = 0;
    if (which != EQUAL_ERROR)
        params.watched = 0; /* motion is measured once */
    for (int i = 0; i < report->count; i++) {
        const struct point *point = meeting(comparing, i, goal, value);
        if (!entry_is_available(&comparing->entries[i]) || !point)
            continue;
        if (flown_init(&flown[count], &comparing->entries[i], &params) < 0)
            return diag_set(diag, -ENOMEM, "no memory for %d frames", report->params.frames);
        flown[count].setting = point->setting;
        flown[count++].met = point_value(point, goal) <= value * (1.0 + POINTS_WITHIN);
    }
    report->flown_count[which] = count;
    return count == 0 ? 0 : flights_fly(&comparing->stage, &params, flown, count, diag);
}

/* What the clipmap's terrain takes where its error is as asked; 0 where it is not compared. */
static double clipmap_ms(const struct technique_report *report)
{
    for (int i = 0; i < report->count; i++) {
        const struct point *point =
            points_meeting(&report->curves[i], POINT_ERROR, report->error_px);
        if (!report->entries[i].ops && point)
            return point->terrain_ms;
    }
    return 0.0;
}

/* Flies all that are available, as often as settings were given. */
static int fly_asked(struct comparing *comparing, struct diag *diag)
{
    const struct techniques_options *options = &comparing->options;
    struct technique_report *report = &comparing->report;
    struct flown *flown = comparing->flown[AS_ASKED];
    int *count = &report->flown_count[AS_ASKED];
    report->params.watched = 0;
    for (int i = 0; i < options->asked_count; i++) {
        struct entry *entry = &comparing->entries[options->asked[i].index];
        if (!entry_is_available(entry))
            continue;
        if (flown_init(&flown[*count], entry, &report->params) < 0)
            return diag_set(diag, -ENOMEM, "no memory for %d frames", report->params.frames);
        flown[*count].setting = options->asked[i].setting;
        flown[(*count)++].met = true;
    }
    return *count == 0 ? 0 : flights_fly(&comparing->stage, &report->params, flown, *count, diag);
}

static int compare(struct comparing *comparing, struct diag *diag)
{
    struct technique_report *report = &comparing->report;
    if (comparing->options.settings_given)
        return fly_asked(comparing, diag);
    const struct points_params params = {.frames = SURVEY_FRAMES,
                                         .step_ns = report->params.step_ns,
                                         .pixels = report->params.pixels,
                                         .progress = &comparing->progress};
    struct stage *stage = &comparing->stage;
    int r = points_survey(stage, &params, comparing->curves, report->count, SURVEY_POINTS, diag);
    if (r == 0)
        r = points_refine(stage, &params, comparing->curves, report->count, POINT_ERROR,
                          report->error_px, REFINE_STEPS, diag);
    if (r == 0)
        r = fly_all(comparing, EQUAL_ERROR, POINT_ERROR, report->error_px, diag);
    report->time_ms = clipmap_ms(report);
    if (r < 0 || report->time_ms == 0.0 || report->flown_count[EQUAL_ERROR] < 2)
        return r;
    r = points_refine(stage, &params, comparing->curves, report->count, POINT_TIME, report->time_ms,
                      REFINE_STEPS, diag);
    return r < 0 ? r : fly_all(comparing, EQUAL_TIME, POINT_TIME, report->time_ms, diag);
}

int bench_techniques_main(int argc, char **argv)
{
    static struct comparing comparing; /* some 100 KB */
    struct diag diag = {.text = ""};
    comparing.options = (struct techniques_options){.channel = replay_defaults().channel,
                                                    .rate_hz = 60.0,
                                                    .rounds = 3,
                                                    .posts = 4097,
                                                    .pixels = 4000};
    cli_parse(&parser, "bench", argc, argv, &comparing.options);
    progress_init(&comparing.progress);
    int r = open_all(&comparing, &diag);
    if (r == 0)
        r = compare(&comparing, &diag);
    const char *directory = comparing.options.report_dir;
    if (r == 0 && directory) {
        mkdir(directory, 0777); /* what is wrong with it the files will tell */
        r = technique_report_write(&comparing.report, &comparing.stage, directory, &diag);
    }
    if (r == 0 && comparing.options.json)
        technique_report_print_json(&comparing.report, stdout);
    else if (r == 0 && !cli_quiet())
        technique_report_print(&comparing.report);
    close_all(&comparing);
    return r < 0 ? cli_fail(r, &diag) : EX_OK;
}
