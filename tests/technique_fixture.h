/* A field and the clipmap over the same ground, and techniques that draw it from the same places
 * and are judged by what they show. */
#pragma once
#include "geo/geographic.h"
#include "render/technique.h"
#include "terrain/field.h"
#include "tests/quality_fixture.h"

#define DEPTH 20  /* of the shape: posts are 6.8 to 9.6 m apart */
#define CELLS 512 /* of the field: 4 km */
#define AT    46.5, 8.0

/* A field, and the clipmap over the same ground at the same spacing. */
struct stage {
    struct scene_under_test scene;
    struct terrain_source *source;
    struct reference *reference;
    struct field *field;
    struct field_texture heights;
};

static inline void close_stage(struct stage *stage)
{
    field_texture_destroy(&stage->heights);
    field_destroy(stage->field);
    reference_destroy(stage->reference);
    terrain_source_destroy(stage->source);
    close_scene(&stage->scene);
}

static inline bool open_stage(struct stage *ret)
{
    const struct geodetic middle = {AT, 0.0};
    const struct clipmap_shape shape = clipmap_shape_of_depth(64, 8, DEPTH);
    struct diag diag = {""};
    struct terrain_source *drawn = formula_create(rugged_ground);
    struct stage stage = {.source = formula_create(rugged_ground)};
    const struct renderer_params renderer = {
        .width = WIDTH, .height = HEIGHT, .shape = shape, .source = drawn};
    const struct reference_params reference = {.shape = shape, .source = stage.source, .jobs = 2};
    int r = renderer_create(&renderer, &gl, &stage.scene.renderer, &diag);
    if (r == 0)
        r = readback_create(WIDTH, HEIGHT, READBACK_DEPTH, &stage.scene.depth, &diag);
    if (r == 0)
        r = readback_create(WIDTH, HEIGHT, READBACK_COLOUR, &stage.scene.colour, &diag);
    if (r == 0)
        r = reference_create(&reference, &stage.reference);
    if (r == 0)
        r = field_create(stage.reference, &middle, CELLS, &stage.field, &diag);
    if (r == 0)
        r = field_texture_create(stage.field, &gl, &stage.heights, &diag);
    if (r < 0)
        CHECK_FAIL("%s", diag.text);
    *ret = stage;
    return r == 0;
}

/* The parameters point into the stage. */
static inline struct technique_params params_of(const struct stage *stage)
{
    return (struct technique_params){.field = stage->field,
                                     .heights = &stage->heights,
                                     .facts = &gl,
                                     .width = WIDTH,
                                     .height = HEIGHT};
}

/* Over the field, which reaches 2 km to each side of the place: steps of a flight, and other
 * places. */
#define POSES 8
static inline struct view pose_view(int pose)
{
    double lat_deg = 46.5, lon_deg = 8.0;
    switch (pose) {
    case 0: /* a step after another */
    case 1:
    case 2:
        return view_at(lat_deg - 0.002 + 1e-5 * pose, lon_deg,
                       rugged_ground(lat_deg, lon_deg) + 400.0, 30.0, -30.0, 5.0);
    case 3: /* straight down */
        return view_at(lat_deg, lon_deg, rugged_ground(lat_deg, lon_deg) + 900.0, 200.0, -90.0,
                       0.0);
    case 4: /* low, along the ground */
        return view_at(lat_deg, lon_deg, rugged_ground(lat_deg, lon_deg) + 30.0, 120.0, -5.0,
                       -20.0);
    case 5: /* all of it, from beside it */
        return view_at(lat_deg - 0.05, lon_deg, 3000.0, 0.0, -20.0, 0.0);
    case 6:
        return view_at(lat_deg + 0.01, lon_deg + 0.01,
                       rugged_ground(lat_deg + 0.01, lon_deg + 0.01) + 150.0, 225.0, -15.0, 0.0);
    default: /* upside down */
        return view_at(lat_deg, lon_deg, rugged_ground(lat_deg, lon_deg) + 300.0, 300.0, -25.0,
                       180.0);
    }
}

/* The same so many frames later, or before: at 140 m/s, turning by 6 degrees a second. */
static inline struct view flown_view(int pose, int frames)
{
    const double turn[2] = {cos(0.0017 * frames), sin(0.0017 * frames)};
    struct view view = pose_view(pose);
    view.eye.lat_deg += 2e-5 * frames;
    view.eye.lon_deg += 1e-5 * frames;
    view.eye.height_m += 0.2 * frames;
    for (int i = 0; i < 3; i++) {
        double east = view.enu_from_eye[0][i], north = view.enu_from_eye[1][i];
        view.enu_from_eye[0][i] = turn[0] * east - turn[1] * north;
        view.enu_from_eye[1][i] = turn[1] * east + turn[0] * north;
    }
    return view;
}

struct verdict {
    struct distribution error_px;
    size_t judged;
    uint64_t holes, walls, pixels;
    double worst_db;
};

static inline int asked_a_pose(void)
{
    return check_rounds(8000, 1000);
}

/* A technique at a setting of its knob, and what is found of it. */
struct run {
    struct technique *technique;
    int pose_step; /* every so many poses it is judged */
    struct samples error_px;
    struct verdict verdict;
};

static inline void open_run(struct technique *technique, double knob, struct run *ret)
{
    *ret = (struct run){.technique = technique, .verdict = {.worst_db = QUALITY_PSNR_MOST}};
    ret->pose_step = technique->ops->history > 1 ? 6 : 1; /* there are many frames to each */
    CHECK_INT(technique->ops->tune(technique, knob), 0);
}

/* A pose's frame, after those before it that the technique's history asks for. */
static inline void show_run(struct stage *stage, const struct run *run, int pose)
{
    const struct technique_params params = params_of(stage);
    int history = (int)run->technique->ops->history, lead = (int)run->technique->ops->ahead;
    for (int frame = -history; frame <= 0; frame++) {
        struct view view = flown_view(pose, frame), ahead = flown_view(pose, frame + lead);
        if (history > 0)
            draw(&stage->scene, &view, NULL, NULL, NULL);
        technique_show(run->technique, &params, stage->scene.renderer, &view, &ahead, NULL);
    }
}

static inline void tell(struct run *run)
{
    struct verdict *verdict = &run->verdict;
    verdict->judged = run->error_px.count;
    verdict->error_px = take(&run->error_px);
    printf("     %-20s p50 %.4f, p99 %.4f, p99.9 %.4f, max %.4f px; %.1f dB at worst; of %llu "
           "pixels %llu holes, %llu walls\n",
           run->technique->ops->name, verdict->error_px.p50, verdict->error_px.p99,
           verdict->error_px.p999, verdict->error_px.max, verdict->worst_db,
           (unsigned long long)verdict->pixels, (unsigned long long)verdict->holes,
           (unsigned long long)verdict->walls);
}

/* Draws all poses by all runs, after what a technique's history asks for, and holds them against
 * the reference. Loading the terrain of a pose takes longer than all techniques together. */
static inline void judge_runs(struct stage *stage, struct technique *reference, struct run *runs,
                              size_t count)
{
    const struct technique_params params = params_of(stage);
    struct quality *quality = NULL;
    struct diag diag = {""};
    struct quality_params quality_params = {WIDTH, HEIGHT,      asked_a_pose(), stage->reference,
                                            NULL,  stage->field};
    CHECK_INT(quality_create(&quality_params, &quality, &diag), 0);
    for (size_t i = 0; i < count; i++)
        CHECK_INT(samples_init(&runs[i].error_px, POSES * asked_a_pose()), 0);
    for (int pose = 0; pose < POSES; pose += check_rounds(1, 3)) {
        struct view view = pose_view(pose);
        draw(&stage->scene, &view, NULL, NULL, NULL);
        technique_show(reference, &params, stage->scene.renderer, &view, NULL, NULL);
        CHECK_INT(quality_keep(quality, stage->scene.renderer), 0);
        quality_ask(quality);
        for (size_t i = 0; i < count; i++) {
            struct quality_difference difference;
            struct verdict *verdict = &runs[i].verdict;
            if (pose % runs[i].pose_step != 0)
                continue;
            show_run(stage, &runs[i], pose);
            CHECK_INT(quality_judge(quality, stage->scene.renderer, &view, &runs[i].error_px, NULL),
                      0);
            CHECK_INT(quality_against_kept(quality, stage->scene.renderer, &difference), 0);
            verdict->holes += difference.holes;
            verdict->walls += difference.walls;
            verdict->pixels += difference.pixels;
            verdict->worst_db = fmin(verdict->worst_db, difference.psnr_db);
        }
    }
    for (size_t i = 0; i < count; i++)
        tell(&runs[i]);
    quality_destroy(quality);
}

static inline struct technique *open_technique(const struct stage *stage,
                                               const struct technique_ops *ops)
{
    const struct technique_params params = params_of(stage);
    struct technique *technique = NULL;
    struct diag diag = {""};
    int r = technique_create(ops, &params, &technique, &diag);
    if (r == -ENOTSUP)
        printf("     %s is not available: %s\n", ops->name, diag.text);
    else if (r < 0)
        CHECK_FAIL("%s: %s", ops->name, diag.text);
    return technique;
}

static inline void close_runs(struct run *runs, size_t count)
{
    for (size_t i = 0; i < count; i++)
        technique_destroy(runs[i].technique);
}

static inline int count_sky(struct stage *stage)
{
    int sky = 0;
    uint64_t number;
    readback_start(stage->scene.depth, renderer_depth_framebuffer(stage->scene.renderer), 0);
    const float *depth = readback_take(stage->scene.depth, true, &number);
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        sky += depth[i] <= 0.0f;
    readback_release(stage->scene.depth);
    return sky;
}
