/* Positions relative to the eye in 32-bit floats, as the GPU computes them, against GeographicLib
 * in doubles; and the way back that the shading pass goes. */
#include <epoxy/gl.h>

#include "geo/cube.h"
#include "geo/frames.h"
#include "geo/geographic.h"
#include "render/program.h"
#include "render/scene.h"
#include "tests/render_fixture.h"

#define VERTICES 10000 /* of each level */
#define WORST    1e-6  /* of the distance, or of FLOOR_M where the distance is less */
#define FLOOR_M  1.0
#define HALVES   0.1  /* the way back: half-posts of the level that is drawn there */
#define RISE     1e-5 /* the same: of the distance; haze and tree lines go by it */

struct vertex {
    int32_t post[4]; /* half-post (column, row), level, pane */
    float height_m, enu[3];
};

struct captured {
    float enu[3], dn[3], rise_m;
};

static const char vertex_shader[] = "layout(location = 0) in ivec4 post;\n"
                                    "layout(location = 1) in vec4 place;\n"
                                    "out vec3 enu, dn;\n"
                                    "out float rise;\n"
                                    "void main()\n"
                                    "{\n"
                                    "    vec3 there = normal_difference(post.w, post.xy, post.z);\n"
                                    "    enu = enu_from_difference(there, place.x,\n"
                                    "                              rise_of(place.x));\n"
                                    "    vec4 back = difference_from_enu(place.yzw);\n"
                                    "    dn = back.xyz;\n"
                                    "    rise = back.w;\n"
                                    "}\n";

static const char *common_text(void)
{
    const struct shader_file *file = shader_files;
    while (strcmp(file->name, "common.glsl") != 0)
        file++;
    return file->text;
}

static GLuint create_program(void)
{
    const char *sources[] = {"#version 450 core\n", common_text(), vertex_shader};
    const char *varyings[] = {"enu", "dn", "rise"};
    GLuint program = glCreateProgram(), shader = glCreateShader(GL_VERTEX_SHADER);
    GLint ok = 0;
    glShaderSource(shader, 3, sources, NULL);
    glCompileShader(shader);
    glAttachShader(program, shader);
    glDeleteShader(shader);
    glTransformFeedbackVaryings(program, 3, varyings, GL_INTERLEAVED_ATTRIBS);
    glLinkProgram(program);
    glGetProgramiv(program, GL_LINK_STATUS, &ok);
    CHECK(ok);
    return program;
}

/* The buffers of one run of the shader. */
struct capture {
    GLuint program, array, scene, vertices, captured;
    GLuint framebuffer; /* empty: a context without a window has none */
};

static void open_capture(struct capture *capture)
{
    capture->program = create_program();
    glCreateBuffers(1, &capture->scene);
    glCreateBuffers(1, &capture->vertices);
    glCreateBuffers(1, &capture->captured);
    glNamedBufferStorage(capture->scene, sizeof(struct scene_block), NULL, GL_DYNAMIC_STORAGE_BIT);
    glNamedBufferStorage(capture->vertices, VERTICES * sizeof(struct vertex), NULL,
                         GL_DYNAMIC_STORAGE_BIT);
    glNamedBufferStorage(capture->captured, VERTICES * sizeof(struct captured), NULL, 0);
    glCreateFramebuffers(1, &capture->framebuffer);
    glNamedFramebufferParameteri(capture->framebuffer, GL_FRAMEBUFFER_DEFAULT_WIDTH, 1);
    glNamedFramebufferParameteri(capture->framebuffer, GL_FRAMEBUFFER_DEFAULT_HEIGHT, 1);
    glCreateVertexArrays(1, &capture->array);
    glVertexArrayVertexBuffer(capture->array, 0, capture->vertices, 0, sizeof(struct vertex));
    glVertexArrayAttribIFormat(capture->array, 0, 4, GL_INT, offsetof(struct vertex, post));
    glVertexArrayAttribFormat(capture->array, 1, 4, GL_FLOAT, GL_FALSE,
                              offsetof(struct vertex, height_m));
    for (GLuint i = 0; i < 2; i++) {
        glEnableVertexArrayAttrib(capture->array, i);
        glVertexArrayAttribBinding(capture->array, i, 0);
    }
}

static void close_capture(struct capture *capture)
{
    const GLuint buffers[] = {capture->scene, capture->vertices, capture->captured};
    glDeleteProgram(capture->program);
    glDeleteFramebuffers(1, &capture->framebuffer);
    glDeleteVertexArrays(1, &capture->array);
    glDeleteBuffers(3, buffers);
}

static void run_capture(const struct capture *capture, const struct scene_block *scene,
                        const struct vertex *vertices, struct captured *ret)
{
    glNamedBufferSubData(capture->scene, 0, sizeof(*scene), scene);
    glNamedBufferSubData(capture->vertices, 0, VERTICES * sizeof(*vertices), vertices);
    glBindBufferBase(GL_UNIFORM_BUFFER, 0, capture->scene);
    glBindBufferBase(GL_TRANSFORM_FEEDBACK_BUFFER, 0, capture->captured);
    glBindFramebuffer(GL_FRAMEBUFFER, capture->framebuffer);
    glBindVertexArray(capture->array);
    glUseProgram(capture->program);
    glEnable(GL_RASTERIZER_DISCARD);
    glBeginTransformFeedback(GL_POINTS);
    glDrawArrays(GL_POINTS, 0, VERTICES);
    glEndTransformFeedback();
    glDisable(GL_RASTERIZER_DISCARD);
    glGetNamedBufferSubData(capture->captured, 0, VERTICES * sizeof(*ret), ret);
    CHECK_INT(glGetError(), GL_NO_ERROR);
}

static double uniform(double from, double to)
{
    static uint64_t state = 1;
    state = state * 6364136223846793005u + 1442695040888963407u;
    return from + (to - from) * ((double)(state >> 11) * 0x1p-53);
}

static double length_of(const double v[3])
{
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

static double distance_between(const double a[3], const double b[3])
{
    const double d[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
    return length_of(d);
}

struct eye {
    const char *name;
    double lat_deg, lon_deg, height_m, above_m;
};

/* Everything that is known of one eye. */
struct stand {
    struct clipmap_shape shape;
    struct view view;
    struct scene_block scene;
    double normal[3], above_m, ends[CLIPMAP_MAX_LEVELS];
    struct loader_level levels[CLIPMAP_MAX_LEVELS];
    int finest;
};

static void take_stand(const struct eye *eye, int radius, struct stand *ret)
{
    struct clipmap_cap caps[CLIPMAP_MAX_LEVELS];
    *ret = (struct stand){.shape = clipmap_shape(radius, radius / 8, 1.0), .above_m = eye->above_m};
    ret->view = view_at(eye->lat_deg, eye->lon_deg, eye->height_m, 0.0, 0.0, 0.0);
    cube_normal_from_geodetic(eye->lat_deg, eye->lon_deg, ret->normal);
    for (int k = 0; k < ret->shape.levels; k++) {
        memcpy(caps[k].normal, ret->normal, sizeof(ret->normal));
        caps[k].radius = clipmap_reach(&ret->shape, k, ret->normal).cap;
        ret->levels[k].cap = caps[k];
        clipmap_panes(&ret->shape, k, &caps[k], ret->levels[k].panes);
    }
    clipmap_ends(&ret->shape, caps, ret->normal, 1.0, ret->ends);
    scene_set_view(&ret->view, &ret->scene);
    scene_set_levels(&ret->view, &ret->shape, ret->levels, eye->above_m,
                     &(struct scene_detail){1e-3, 1e-3, 1.0}, &ret->scene);
    ret->finest = clipmap_finest_level(&ret->shape, ret->normal, eye->above_m);
}

/* A post of a level on any of the faces it is drawn on, and the truth about it. */
struct truth {
    double enu[3], dn[3]; /* east, north, up at the eye */
};

static bool is_drawn(const struct stand *stand, int level, const double normal[3])
{
    double chord = distance_between(normal, stand->normal), up = stand->above_m / 6378137.0;
    bool beyond_finer =
        level == 0 || level == stand->finest ||
        chord * chord + up * up > 0.5 * stand->ends[level - 1] * stand->ends[level - 1];
    return beyond_finer && chord < stand->ends[level];
}

static void random_vertex(const struct stand *stand, int level, struct vertex *ret_vertex,
                          struct truth *ret_truth)
{
    double normal[3], step = 0.5 * clipmap_step_rad(&stand->shape, level);
    int32_t end = 2 * clipmap_cells(&stand->shape, level);
    for (;;) {
        int p = (int)uniform(0, CLIPMAP_PANES);
        const struct clipmap_pane *pane = &stand->levels[level].panes[p];
        int32_t col = 2 * pane->posts.col0 + (int32_t)uniform(0, 2 * pane->posts.cols - 1);
        int32_t row = 2 * pane->posts.row0 + (int32_t)uniform(0, 2 * pane->posts.rows - 1);
        if (pane->posts.cols == 0 || col < 0 || row < 0 || col > end || row > end)
            continue;
        cube_normal(pane->face, col * step - M_PI / 4.0, row * step - M_PI / 4.0, normal);
        *ret_vertex = (struct vertex){.post = {col, row, level, p}};
        if (is_drawn(stand, level, normal))
            break;
    }
    struct geodetic place;
    const struct geodetic *eye = &stand->view.eye;
    double axes[3][3], dn[3], away_m = 6.4e6 * distance_between(normal, stand->normal);
    double height_m = eye->height_m - stand->above_m + 0.1 * away_m * uniform(-1.0, 1.0);
    ret_vertex->height_m = (float)fmin(fmax(height_m, -430.0), 8900.0);
    cube_geodetic_from_normal(normal, &place.lat_deg, &place.lon_deg);
    place.height_m = (double)ret_vertex->height_m;
    enu_from_geodetic(eye, &place, ret_truth->enu);
    frames_enu_axes_ecef(eye->lat_deg, eye->lon_deg, axes);
    for (int i = 0; i < 3; i++) {
        dn[i] = normal[i] - stand->normal[i];
        ret_vertex->enu[i] = (float)ret_truth->enu[i];
    }
    frames_rotate(axes, dn, ret_truth->dn);
}

struct worst {
    double position, rise, halves;
};

static void compare(const struct stand *stand, const struct vertex *vertex,
                    const struct truth *truth, const struct captured *captured,
                    struct worst *ret_worst)
{
    double enu[3], dn[3], distance_m = fmax(length_of(truth->enu), FLOOR_M);
    double half_rad = 0.5 * clipmap_step_rad(&stand->shape, vertex->post[2]);
    double rise_m = (double)vertex->height_m - stand->view.eye.height_m;
    for (int i = 0; i < 3; i++) {
        enu[i] = (double)captured->enu[i];
        dn[i] = (double)captured->dn[i];
    }
    double position = distance_between(enu, truth->enu) / distance_m;
    double rise = fabs((double)captured->rise_m - rise_m) / distance_m;
    double halves = distance_between(dn, truth->dn) / half_rad;
    CHECK(!isnan(position) && !isnan(rise) && !isnan(halves));
    ret_worst->position = fmax(ret_worst->position, position);
    ret_worst->rise = fmax(ret_worst->rise, rise);
    ret_worst->halves = fmax(ret_worst->halves, halves);
}

static void check_eye(const struct capture *capture, const struct eye *eye, int radius)
{
    static struct vertex vertices[VERTICES];
    static struct truth truths[VERTICES];
    static struct captured captured[VERTICES];
    static struct stand stand;
    struct worst most = {0};
    int position_level = 0;
    take_stand(eye, radius, &stand);
    for (int level = stand.finest; level < stand.shape.levels; level++) {
        struct worst worst = {0};
        for (int i = 0; i < VERTICES; i++)
            random_vertex(&stand, level, &vertices[i], &truths[i]);
        run_capture(capture, &stand.scene, vertices, captured);
        for (int i = 0; i < VERTICES; i++)
            compare(&stand, &vertices[i], &truths[i], &captured[i], &worst);
        if (worst.position > most.position)
            position_level = level;
        most.position = fmax(most.position, worst.position);
        most.rise = fmax(most.rise, worst.rise);
        most.halves = fmax(most.halves, worst.halves);
    }
    printf("     %-36s levels %2d..%d: position %.1e (level %d), and back %.1e, %.2g half-posts\n",
           eye->name, stand.finest, stand.shape.levels - 1, most.position, position_level,
           most.rise, most.halves);
    CHECK(most.position < WORST);
    CHECK(most.rise < RISE);
    CHECK(most.halves < HALVES);
}

#define CORNER_LAT_DEG 35.264389682754654 /* atan(1 / sqrt(2)) */
#define EDGE_LON_DEG   (45.0 - CUBE_TURN_DEG)

static void positions_are_good_to_a_millionth_of_the_distance(void)
{
    static const struct eye eyes[] = {
        {"middle of a face", 0.0, -CUBE_TURN_DEG, 300.0, 250.0},
        {"on a post, 2 m above the ground", 0.0, -CUBE_TURN_DEG, 102.0, 2.0},
        {"mountains", 46.5, 8.0, 4123.4567, 500.0},
        {"mountains, 10 km", 46.5, 8.0, 10000.0, 9000.0},
        {"on an edge of the cube", 10.0, EDGE_LON_DEG, 600.0, 300.0},
        {"a metre from an edge", 10.0, EDGE_LON_DEG + 1e-5, 402.0, 2.0},
        {"near an edge, 10 km", 10.0, EDGE_LON_DEG - 0.7, 10000.0, 9500.0},
        {"on a corner of the cube", CORNER_LAT_DEG, EDGE_LON_DEG, 400.0, 30.0},
        {"near a corner, 2 m above the ground", CORNER_LAT_DEG + 2e-5, EDGE_LON_DEG, 902.0, 2.0},
        {"near a southern corner, 10 km", -CORNER_LAT_DEG + 0.3, EDGE_LON_DEG + 90.0, 10000.0, 1e4},
        {"north pole", 90.0, 0.0, 502.0, 2.0},
        {"a metre from the north pole", 89.99999, 123.0, 502.0, 2.0},
        {"south pole", -90.0, 77.0, 3300.0, 500.0},
        {"south pole, 10 km", -90.0, -30.0, 10000.0, 7200.0},
        {"antimeridian", 12.0, 180.0, 150.0, 140.0},
        {"antimeridian, from the west", -17.0, -179.9999999, 1000.0, 200.0},
        {"Dead Sea", 31.5, 35.5, -400.0, 30.0},
        {"orbit", 51.6, -120.0, 400e3, 400e3},
        {"orbit over a corner", CORNER_LAT_DEG, EDGE_LON_DEG - 90.0, 400e3, 400e3},
        {"orbit over the pole", 90.0, 0.0, 400e3, 397e3},
    };
    struct capture capture;
    open_capture(&capture);
    for (size_t i = 0; i < sizeof(eyes) / sizeof(eyes[0]); i++)
        check_eye(&capture, &eyes[i], gl.software ? 64 : 256);
    close_capture(&capture);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"positions are good to a millionth of the distance",
         positions_are_good_to_a_millionth_of_the_distance},
    };
    return render_tests_main(tests, sizeof(tests) / sizeof(tests[0]), check_main);
}
