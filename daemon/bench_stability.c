#include "daemon/bench_stability.h"

#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sysexits.h>

#include "daemon/channel_options.h"
#include "daemon/cli.h"
#include "daemon/replay.h"
#include "daemon/terrain_setup.h"
#include "geo/geographic.h"
#include "render/stability.h"
#include "terrain/query.h"

#define RATE_HZ     60.0
#define HEADING_DEG 60.0
#define LEGS        8   /* stretches of a flight that are flown, frame by frame */
#define PATH_PLACES 256 /* at which the highest ground under a flight is looked for */

/* Heights are above the highest ground under the flight, or above the ground right below. */
struct stability_flight {
    const char *name, *what;
    double from_m, to_m;
    double speed_mps, climb_mps; /* over the ground; upwards or downwards, 0: level */
    double pitch_deg, turn_dps;
    bool follow; /* the ground right below */
};

static const struct stability_flight flights[] = {
    {"taxi", "2 m, 15 m/s, on the ground", 2, 2, 15, 0, -3, 0, true},
    {"low", "300 m, 250 m/s", 300, 300, 250, 0, -8, 0, false},
    {"dash", "100 m, 1000 m/s", 100, 100, 1000, 0, -8, 0, false},
    {"fast", "3 km, 1000 m/s", 3000, 3000, 1000, 0, -15, 0, false},
    {"high", "10 km, 1000 m/s", 10000, 10000, 1000, 0, -20, 0, false},
    {"descent", "10 km to 100 m, sinking 50 m/s", 10000, 100, 150, 50, -10, 0, false},
    {"climb", "100 m to 400 km, 1000 m/s upwards", 100, 400000, 0, 1000, -30, 0, false},
    {"creep", "100 m, 1 mm and 1 degree a frame: the noise", 100, 100, 0.06, 0, -10, 60, false},
};
#define FLIGHTS (sizeof(flights) / sizeof(flights[0]))
#define LEVEL_S 40.0 /* of flights that neither climb nor sink */

enum { OPT_AT = 256, OPT_FRAMES, OPT_FLIGHT };

struct stability_options {
    struct channel_params channel;
    unsigned frames; /* pairs of frames a flight */
    const struct stability_flight *only;
    double lat_deg, lon_deg; /* NaN: where the terrain is */
    bool json;
};

static const struct argp_option known[] = {
    {"at", OPT_AT, "LAT,LON", 0,
     "where flights begin (default: in the middle of the database; in the Alps)", 0},
    {"frames", OPT_FRAMES, "N", 0, "of each flight, held against the one before (default 120)", 0},
    {"flight", OPT_FLIGHT, "NAME", 0, "only this one", 0},
    {"json", 'j', NULL, 0, "as JSON", 0},
    {0},
};

static const struct stability_flight *find_flight(struct argp_state *state, const char *name)
{
    for (size_t i = 0; i < FLIGHTS; i++)
        if (strcmp(flights[i].name, name) == 0)
            return &flights[i];
    argp_error(state,
               "there is no flight \"%s\"; they are taxi, low, dash, fast, high, descent, climb "
               "and creep",
               name);
    return NULL;
}

static void parse_place(struct argp_state *state, const char *text, double *ret_lat_deg,
                        double *ret_lon_deg)
{
    char rest;
    if (sscanf(text, "%lf,%lf%c", ret_lat_deg, ret_lon_deg, &rest) != 2 ||
        !(fabs(*ret_lat_deg) <= 90.0 && fabs(*ret_lon_deg) <= 360.0))
        argp_error(state, "--at takes LAT,LON in degrees, not \"%s\"", text);
}

static error_t parse_option(int key, char *argument, struct argp_state *state)
{
    struct stability_options *options = state->input;
    switch (key) {
    case ARGP_KEY_INIT:
        state->child_inputs[0] = &options->channel;
        return 0;
    case OPT_AT:
        parse_place(state, argument, &options->lat_deg, &options->lon_deg);
        return 0;
    case OPT_FRAMES:
        options->frames = (unsigned)cli_number(state, "frames", argument, LEGS, 10000);
        return 0;
    case OPT_FLIGHT:
        options->only = find_flight(state, argument);
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
    .children = channel_children,
    .doc = "Measure how still the ground stands: what moves on the screen from frame to frame that "
           "the camera's motion does not explain, in pixels, of all pixels that show ground that "
           "the frame before showed, too. Flights of 60 frames a second, in eight stretches; "
           "every frame waits for its terrain."
           "\vExit status: 0 measured, 64 bad usage, 65 a bad database, 66 a file is missing, 69 "
           "no OpenGL 4.5.",
};

/* The ground that flights are planned by. */
struct plan {
    struct terrain_setup terrain;
    struct query *query;
    struct geodetic start; /* height: of the highest ground under the flight at hand */
};

static double ground_m(struct plan *plan, double lat_deg, double lon_deg)
{
    struct query_answer answer = {.height_m = 0.0};
    query_height(plan->query, lat_deg, lon_deg, 0, &answer);
    double geoid_m =
        plan->terrain.geoid ? geoid_undulation_m(plan->terrain.geoid, lat_deg, lon_deg) : 0.0;
    return (isnan(answer.height_m) ? 0.0 : answer.height_m) + geoid_m;
}

static int plan_open(const struct stability_options *options, struct plan *ret_plan,
                     struct diag *diag)
{
    const struct channel_params *channel = &options->channel;
    struct plan plan = {.start = {46.5, 8.0, 0.0}};
    int r = terrain_setup_open(channel->terrain_path, channel->geoid, channel->cache_mib,
                               &plan.terrain, diag);
    if (r < 0)
        return r;
    bool database = channel->terrain_path[0] != '\0';
    if (database) {
        struct terrain_facts facts;
        plan.terrain.source->ops->facts(plan.terrain.source, &facts);
        plan.start.lat_deg = 0.5 * (facts.south_deg + facts.north_deg);
        plan.start.lon_deg = 0.5 * (facts.west_deg + facts.east_deg);
    }
    if (!isnan(options->lat_deg))
        plan.start = (struct geodetic){options->lat_deg, options->lon_deg, 0.0};
    plan.start.lon_deg = longitude_normalised_deg(plan.start.lon_deg);
    const struct query_params query = {
        .database = database ? plan.terrain.source : NULL,
        .fallback = database ? plan.terrain.fallback : plan.terrain.source,
    };
    *ret_plan = plan;
    r = query_create(&query, &ret_plan->query);
    return r < 0 ? diag_set(diag, r, "no memory for questions about the ground") : 0;
}

static void plan_close(struct plan *plan)
{
    query_destroy(plan->query);
    terrain_setup_close(&plan->terrain);
}

static double duration_s(const struct stability_flight *flight)
{
    return flight->climb_mps > 0.0 ? fabs(flight->to_m - flight->from_m) / flight->climb_mps
                                   : LEVEL_S;
}

/* When a stretch begins: evenly in time, or, of a climb, by equal factors of height. */
static double leg_s(const struct stability_flight *flight, unsigned leg, double length_s)
{
    double fraction = (double)leg / (LEGS - 1), last_s = duration_s(flight) - length_s;
    if (flight->climb_mps <= 0.0)
        return fraction * last_s;
    double height_m = flight->from_m * pow(flight->to_m / flight->from_m, fraction);
    return fmin(fabs(height_m - flight->from_m) / flight->climb_mps, last_s);
}

static void place_at(const struct plan *plan, const struct stability_flight *flight, double time_s,
                     struct geodetic *ret_place)
{
    double way_m = flight->speed_mps * time_s, heading_rad = HEADING_DEG * M_PI / 180.0;
    const double enu_m[3] = {way_m * sin(heading_rad), way_m * cos(heading_rad), 0.0};
    geodetic_from_enu(&plan->start, enu_m, ret_place);
}

static struct pose pose_at(struct plan *plan, const struct stability_flight *flight, double time_s)
{
    struct pose pose = {.attitude = {.pitch_deg = flight->pitch_deg,
                                     .heading_deg = HEADING_DEG + flight->turn_dps * time_s}};
    struct geodetic *place = &pose.position;
    place_at(plan, flight, time_s, place);
    double climb_mps = flight->to_m < flight->from_m ? -flight->climb_mps : flight->climb_mps;
    place->height_m =
        flight->from_m + climb_mps * time_s +
        (flight->follow ? ground_m(plan, place->lat_deg, place->lon_deg) : plan->start.height_m);
    return pose;
}

static void find_highest(struct plan *plan, const struct stability_flight *flight)
{
    double highest_m = -1e9;
    plan->start.height_m = 0.0;
    for (int i = 0; i <= PATH_PLACES; i++) {
        struct geodetic place;
        place_at(plan, flight, duration_s(flight) * i / PATH_PLACES, &place);
        highest_m = fmax(highest_m, ground_m(plan, place.lat_deg, place.lon_deg));
    }
    plan->start.height_m = highest_m;
}

static int fly(struct plan *plan, const struct stability_flight *flight, unsigned frames,
               struct channel *channel, struct stability *stability, struct stability_tally *tally)
{
    unsigned pairs = frames / LEGS;
    find_highest(plan, flight);
    for (unsigned leg = 0; leg < LEGS; leg++) {
        double start_s = leg_s(flight, leg, pairs / RATE_HZ);
        for (unsigned i = 0; i <= pairs; i++) {
            struct pose pose = pose_at(plan, flight, start_s + i / RATE_HZ);
            struct channel_frame frame;
            if (i == 0) /* the first tells how high the ground is, by which levels are chosen */
                channel_draw(channel, &pose, NULL, 0, true, &frame);
            channel_draw(channel, &pose, NULL, 0, true, &frame);
            int r = stability_look(stability, channel_renderer(channel), &frame.view,
                                   frame.renderer.height_above_terrain_m, i > 0 ? tally : NULL);
            if (r < 0)
                return r;
        }
    }
    return 0;
}

static void print_heading(const struct stability_options *options, const struct gl_facts *gl)
{
    printf("%s, %d x %d on %s: motion that the camera does not explain, px a frame (at %g Hz, px a "
           "second)\n",
           options->channel.technique, options->channel.width, options->channel.height,
           gl->renderer, RATE_HZ);
    printf("  %-8s %-44s %8s %9s %9s %9s %9s %9s\n", "flight", "", "judged", "p50", "p99", "p99.9",
           "max", "p99.9/s");
}

static void print_row(const struct stability_flight *flight, double judged,
                      const struct distribution *px)
{
    printf("  %-8s %-44s %6.1f %% %9.4f %9.4f %9.4f %9.4f %9.3f\n", flight->name, flight->what,
           100.0 * judged, px->p50, px->p99, px->p999, px->max, RATE_HZ * px->p999);
    fflush(stdout);
}

static json_t *json_motion(const struct distribution *px, double factor)
{
    return json_pack("{s:f,s:f,s:f,s:f}", "p50", factor * px->p50, "p99", factor * px->p99, "p999",
                     factor * px->p999, "max", factor * px->max);
}

/* Flies one flight and tells of it: on the terminal, or into `results`. */
static int measure(const struct stability_options *options, const struct stability_flight *flight,
                   struct plan *plan, struct channel *channel, struct stability *stability,
                   json_t *results, struct diag *diag)
{
    const struct channel_params *size = &options->channel;
    struct stability_tally tally = {0};
    struct distribution px;
    size_t room = stability_pixels(size->width, size->height) * options->frames;
    int r = samples_init(&tally.motion_px, room);
    if (r == 0)
        r = fly(plan, flight, options->frames, channel, stability, &tally);
    if (r < 0) {
        samples_finish(&tally.motion_px);
        return diag_set(diag, r, "%s: %s", flight->name,
                        r == -ENOMEM ? "no memory for its pixels" : "the GPU was lost");
    }
    double judged = (double)tally.motion_px.count / fmax((double)tally.pixels, 1.0);
    distribution_of_values(tally.motion_px.values, tally.motion_px.count, &px);
    if (options->json)
        json_array_append_new(
            results, json_pack("{s:s,s:s,s:I,s:I,s:o,s:o}", "flight", flight->name, "what",
                               flight->what, "pixels", (json_int_t)tally.pixels, "pixels_judged",
                               (json_int_t)tally.motion_px.count, "px_per_frame",
                               json_motion(&px, 1.0), "px_per_second", json_motion(&px, RATE_HZ)));
    else if (!cli_quiet())
        print_row(flight, judged, &px);
    samples_finish(&tally.motion_px);
    return 0;
}

static void print_json(const struct stability_options *options, const struct gl_facts *gl,
                       json_t *results)
{
    json_t *root = json_pack("{s:s,s:{s:s,s:s,s:s},s:[i,i],s:f,s:f,s:i,s:O}", "technique",
                             options->channel.technique, "gl", "vendor", gl->vendor, "renderer",
                             gl->renderer, "version", gl->version, "size_px",
                             options->channel.width, options->channel.height, "rate_hz", RATE_HZ,
                             "pixel_error", options->channel.pixel_error, "frames",
                             (int)(options->frames / LEGS * LEGS), "flights", results);
    json_dumpf(root, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(7));
    putchar('\n');
    json_decref(root);
}

int bench_stability_main(int argc, char **argv)
{
    struct stability_options options = {
        .channel = replay_defaults().channel, .frames = 120, .lat_deg = NAN};
    struct diag diag = {.text = ""};
    struct plan plan = {0};
    struct channel *channel = NULL;
    struct stability *stability = NULL;
    json_t *results = json_array();
    cli_parse(&parser, "bench stability", argc, argv, &options);
    int r = plan_open(&options, &plan, &diag);
    if (r == 0)
        r = channel_create(&options.channel, &channel, &diag);
    if (r == 0)
        r = stability_create(options.channel.width, options.channel.height, &stability, &diag);
    if (r == 0 && !options.json && !cli_quiet())
        print_heading(&options, channel_gl(channel));
    for (size_t i = 0; r == 0 && i < FLIGHTS; i++)
        if (!options.only || options.only == &flights[i])
            r = measure(&options, &flights[i], &plan, channel, stability, results, &diag);
    if (r == 0 && options.json)
        print_json(&options, channel_gl(channel), results);
    json_decref(results);
    stability_destroy(stability);
    channel_destroy(channel);
    plan_close(&plan);
    return r < 0 ? cli_fail(r, &diag) : EX_OK;
}
