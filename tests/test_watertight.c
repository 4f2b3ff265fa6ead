/* The mesh as the GPU makes it, read back by transform feedback: every edge of a triangle has
 * another triangle on its other side, with the same two vertices to the bit. What is left over are
 * rims that nobody sees. A rasteriser leaves no pixel out then, at any resolution and with any
 * number of samples. */
#include <epoxy/gl.h>

#include "geo/cube.h"
#include "render/clipmap_pass.h"
#include "render/program.h"
#include "render/scene.h"
#include "tests/render_fixture.h"

#define TRIANGLES_MAX 900000
#define WGS84_A       6378137.0

/* Much like a sine, which would take most of the test's time. */
static double wave(double angle)
{
    double turns = angle * (0.5 / M_PI) + 1e6;
    turns -= (double)(int64_t)turns;
    return turns < 0.5 ? 16.0 * turns * (0.5 - turns) : -16.0 * (turns - 0.5) * (1.0 - turns);
}

/* From 0, in places, to 1. */
static double patches(const double n[3], double per_radian)
{
    return fmax(wave(per_radian * n[0]) * wave(per_radian * n[1] + 1.0) + wave(per_radian * n[2]),
                0.0);
}

/* A different height at every post, and hills: the worst there can be for shared edges. There are
 * flat parts of all sizes, too. */
static double rough_ground(double lat_deg, double lon_deg)
{
    double n[3];
    cube_normal_from_geodetic(lat_deg, lon_deg, n);
    uint64_t h = (uint64_t)llround(n[0] * 1e8) * 0x9e3779b97f4a7c15u ^
                 (uint64_t)llround(n[1] * 1e8) * 0xc2b2ae3d27d4eb4fu ^
                 (uint64_t)llround(n[2] * 1e8) * 0x165667b19e3779f9u;
    h = (h ^ h >> 29) * 0xbf58476d1ce4e5b9u;
    double rough =
        fmin(1.0, patches(n, 20.0) + patches(n, 500.0)) * fmin(1.0, 2.0 * patches(n, 3e4));
    return 2000.0 + 1500.0 * wave(40.0 * n[0]) * wave(37.0 * n[1] + 50.0 * n[2]) +
           40.0 * rough * ((double)(h >> 11) * 0x1p-53 - 0.5);
}

/* The terrain pass without a renderer around it, with its shaders in a program that captures. */
struct mesh {
    struct clipmap_shape shape;
    struct clipmap_pass *pass;
    struct loader *loader;
    GLuint program, scene, captured, query, framebuffer;
    float (*corners)[4]; /* clip coordinates, three to a triangle */
    int triangles;
};

static const char *text_of(const char *name)
{
    const struct shader_file *file = shader_files;
    while (strcmp(file->name, name) != 0)
        file++;
    return file->text;
}

static GLuint capturing_program(void)
{
    const char *varyings[] = {"gl_Position"};
    const char *sources[] = {"#version 450 core\n", text_of("common.glsl"),
                             text_of("terrain.vert")};
    GLuint program = glCreateProgram(), shader = glCreateShader(GL_VERTEX_SHADER);
    glShaderSource(shader, 3, sources, NULL);
    glCompileShader(shader);
    glAttachShader(program, shader);
    glDeleteShader(shader);
    glTransformFeedbackVaryings(program, 1, varyings, GL_INTERLEAVED_ATTRIBS);
    glLinkProgram(program);
    GLint ok = 0;
    glGetProgramiv(program, GL_LINK_STATUS, &ok);
    CHECK(ok);
    return program;
}

static bool open_mesh(int radius, struct mesh *ret)
{
    struct diag diag = {0};
    struct loader_params params = {.source = formula_create(rough_ground)};
    *ret = (struct mesh){.shape = clipmap_shape(radius, radius / 8, 1.0)};
    params.shape = ret->shape;
    if (clipmap_pass_create(&ret->shape, loader_update_bytes(&ret->shape, SIZE_MAX), &gl,
                            &ret->pass, &diag) < 0) {
        CHECK_FAIL("%s", diag.text);
        return false;
    }
    for (int i = 0; i < LOADER_UPDATES; i++)
        params.arenas[i] = clipmap_pass_arena(ret->pass, i);
    if (loader_start(&params, &ret->loader, &diag) < 0) {
        CHECK_FAIL("%s", diag.text);
        return false;
    }
    ret->program = capturing_program();
    glCreateBuffers(1, &ret->scene);
    glNamedBufferStorage(ret->scene, sizeof(struct scene_block), NULL, GL_DYNAMIC_STORAGE_BIT);
    glCreateBuffers(1, &ret->captured);
    glNamedBufferStorage(ret->captured, TRIANGLES_MAX * 3 * sizeof(*ret->corners), NULL, 0);
    glCreateQueries(GL_TRANSFORM_FEEDBACK_PRIMITIVES_WRITTEN, 1, &ret->query);
    glCreateFramebuffers(1, &ret->framebuffer);
    glNamedFramebufferParameteri(ret->framebuffer, GL_FRAMEBUFFER_DEFAULT_WIDTH, WIDTH);
    glNamedFramebufferParameteri(ret->framebuffer, GL_FRAMEBUFFER_DEFAULT_HEIGHT, HEIGHT);
    ret->corners = malloc(TRIANGLES_MAX * 3 * sizeof(*ret->corners));
    return true;
}

static void close_mesh(struct mesh *mesh)
{
    loader_stop(mesh->loader);
    clipmap_pass_destroy(mesh->pass);
    glDeleteProgram(mesh->program);
    glDeleteBuffers(1, &mesh->scene);
    glDeleteBuffers(1, &mesh->captured);
    glDeleteQueries(1, &mesh->query);
    glDeleteFramebuffers(1, &mesh->framebuffer);
    free(mesh->corners);
}

static void load(struct mesh *mesh, const struct geodetic *eye, int finest)
{
    bool pending = true;
    loader_wish(mesh->loader, eye, finest, true);
    while (pending) {
        struct loader_update *update;
        loader_wait(mesh->loader);
        pending = loader_pending(mesh->loader);
        while ((update = loader_take(mesh->loader))) {
            clipmap_pass_apply(mesh->pass, update);
            clipmap_pass_upload(mesh->pass);
            glFinish();
            loader_give_back(mesh->loader, update);
        }
    }
}

/* Draws as the pass does, then once more from what it has left bound: the list of blocks, the
 * heights, the draws' commands (16 bytes, then 16 a draw). */
static void capture(struct mesh *mesh, const struct view *view, double above_m,
                    double tolerance_rad, double share)
{
    struct scene_block scene = {0};
    GLint bytes = 0;
    GLuint written = 0;
    scene_set_view(view, &scene);
    int groups = scene_set_levels(view, &mesh->shape, clipmap_pass_levels(mesh->pass), above_m,
                                  &(struct scene_detail){1e-3, tolerance_rad, share}, &scene);
    glNamedBufferSubData(mesh->scene, 0, sizeof(scene), &scene);
    glBindBufferBase(GL_UNIFORM_BUFFER, 0, mesh->scene);
    glBindFramebuffer(GL_FRAMEBUFFER, mesh->framebuffer);
    glEnable(GL_RASTERIZER_DISCARD);
    clipmap_pass_make(mesh->pass, groups, &(struct sample_lattice){0}, NULL);
    clipmap_pass_draw(mesh->pass);
    glGetBufferParameteriv(GL_DRAW_INDIRECT_BUFFER, GL_BUFFER_SIZE, &bytes);
    glUseProgram(mesh->program);
    glBindBufferBase(GL_TRANSFORM_FEEDBACK_BUFFER, 0, mesh->captured);
    glBeginQuery(GL_TRANSFORM_FEEDBACK_PRIMITIVES_WRITTEN, mesh->query);
    glBeginTransformFeedback(GL_TRIANGLES);
    for (GLint at = 16; at < bytes; at += 20)
        glDrawElementsIndirect(GL_TRIANGLES, GL_UNSIGNED_INT, (const char *)NULL + at);
    glEndTransformFeedback();
    glEndQuery(GL_TRANSFORM_FEEDBACK_PRIMITIVES_WRITTEN);
    glDisable(GL_RASTERIZER_DISCARD);
    glGetQueryObjectuiv(mesh->query, GL_QUERY_RESULT, &written);
    mesh->triangles = (int)written;
    glGetNamedBufferSubData(mesh->captured, 0, written * 3 * sizeof(*mesh->corners), mesh->corners);
    CHECK_INT(glGetError(), GL_NO_ERROR);
    CHECK(written < TRIANGLES_MAX);
}

struct edge {
    float ends[2][4]; /* the lesser first, as bits go */
    int way;          /* 1: it was so; -1: it ran from the other */
};

static int compare_edges(const void *a, const void *b)
{
    return memcmp(a, b, sizeof(((struct edge *)NULL)->ends));
}

static struct edge edge_of(const float from[4], const float to[4])
{
    bool swap = memcmp(from, to, 16) > 0;
    struct edge edge = {.way = swap ? -1 : 1};
    memcpy(edge.ends[0], swap ? to : from, 16);
    memcpy(edge.ends[1], swap ? from : to, 16);
    return edge;
}

static double horizon_m(double height_m)
{
    double above_m = height_m + 500.0;
    return sqrt(above_m * (2.0 * WGS84_A + above_m));
}

/* Beyond one side of the frustum, or the horizon. */
static bool is_unseen(const struct view *view, const struct edge *edge)
{
    bool beyond[5] = {true, true, true, true, true};
    for (int i = 0; i < 2; i++) {
        const float *v = edge->ends[i];
        double x = (double)v[0] * view->tan_right, y = (double)v[1] * view->tan_top;
        double distance_m = sqrt(x * x + y * y + (double)v[3] * (double)v[3]);
        beyond[0] &= v[0] < -v[3];
        beyond[1] &= v[0] > v[3];
        beyond[2] &= v[1] < -v[3];
        beyond[3] &= v[1] > v[3];
        beyond[4] &= distance_m > horizon_m(view->eye.height_m);
    }
    return beyond[0] || beyond[1] || beyond[2] || beyond[3] || beyond[4];
}

/* Edges that are not between two triangles, and seen. */
static int count_open(const struct mesh *mesh, const struct view *view)
{
    size_t count = 3 * (size_t)mesh->triangles, end;
    struct edge *edges = malloc(count * sizeof(*edges));
    int open = 0;
    for (size_t i = 0; i < count; i++)
        edges[i] = edge_of(mesh->corners[i], mesh->corners[i / 3 * 3 + (i + 1) % 3]);
    qsort(edges, count, sizeof(*edges), compare_edges);
    for (size_t i = 0; i < count; i = end) {
        int ways = 0;
        for (end = i; end < count && compare_edges(&edges[i], &edges[end]) == 0; end++)
            ways += edges[end].way;
        if ((end - i != 2 || ways != 0) && !is_unseen(view, &edges[i]))
            open++;
    }
    free(edges);
    return open;
}

#define CORNER_LAT_DEG 35.264389682754654
#define EDGE_LON_DEG   (45.0 - CUBE_TURN_DEG)

static const double places[][2] = {
    {90.0, 0.0},
    {-89.9999, 40.0},
    {12.0, 180.0},
    {46.5, 8.0},
    {10.0, EDGE_LON_DEG},
    {-20.0, EDGE_LON_DEG + 90.0003},
    {44.9, -CUBE_TURN_DEG},
    {-45.0, 90.0 - CUBE_TURN_DEG},
    {CORNER_LAT_DEG, EDGE_LON_DEG},
    {CORNER_LAT_DEG + 0.01, EDGE_LON_DEG + 90.02},
    {-CORNER_LAT_DEG, EDGE_LON_DEG + 180.0},
    {-CORNER_LAT_DEG - 1e-4, EDGE_LON_DEG - 90.0},
};

static const double tolerances_rad[] = {1e-9, 1e-9, 1e-3, 0.01, 0.1};

#define TOLERANCES (int)(sizeof(tolerances_rad) / sizeof(tolerances_rad[0]))

/* What is open at one place with any tolerance, and how many triangles there are. */
static int check_view(struct mesh *mesh, const struct view *view, double above_m,
                      int triangles[TOLERANCES])
{
    int open = 0;
    for (int i = 0; i < TOLERANCES; i++) {
        capture(mesh, view, above_m, tolerances_rad[i], i > 0 ? 0.9 : 1.0);
        int found = count_open(mesh, view);
        if (found)
            fprintf(stderr, "%d at %g %g, %g m, tolerance %g\n", found, view->eye.lat_deg,
                    view->eye.lon_deg, above_m, tolerances_rad[i]);
        open += found;
        triangles[i] += mesh->triangles;
    }
    return open;
}

static void check_places(int radius, size_t stride, int stride_above)
{
    static const double above_m[] = {10.0, 300.0, 8000.0, 150e3};
    struct mesh mesh;
    if (!open_mesh(radius, &mesh))
        return;
    int triangles[TOLERANCES] = {0}, open = 0, frames = 0;
    stride *= (size_t)check_rounds(1, 4);
    for (size_t p = 0; p < sizeof(places) / sizeof(places[0]); p += stride) {
        for (int h = 0; h < 4; h += stride_above) {
            double turn = 77.0 * (double)p + 50.0 * h;
            struct view view = view_at(places[p][0], places[p][1], 3540.0 + above_m[h], turn,
                                       -15.0 - 12.0 * h, 10.0 * h);
            double normal[3];
            cube_normal_from_geodetic(places[p][0], places[p][1], normal);
            load(&mesh, &view.eye, clipmap_finest_level(&mesh.shape, normal, above_m[h]));
            open += check_view(&mesh, &view, above_m[h], triangles);
            frames++;
        }
    }
    printf("     radius %d:", radius);
    for (int i = 0; i < TOLERANCES; i++)
        printf(" %d triangles (tolerance %g)%s", triangles[i], tolerances_rad[i],
               i < TOLERANCES - 1 ? "," : "\n");
    CHECK_INT(open, 0);
    CHECK(triangles[0] > frames * radius * radius);
    for (int i = 1; i < TOLERANCES; i++)
        CHECK(triangles[i] < triangles[i - 1]);
    CHECK(4 * triangles[TOLERANCES - 1] < 3 * triangles[0]);
    close_mesh(&mesh);
}

static void no_edge_is_open(void)
{
    check_places(32, 1, 1);
}

static void no_edge_is_open_where_they_have_64_segments(void)
{
    check_places(256, 8, 2);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"no edge is open", no_edge_is_open},
        {"no edge is open where they have 64 segments",
         no_edge_is_open_where_they_have_64_segments},
    };
    return render_tests_main(tests, sizeof(tests) / sizeof(tests[0]), check_main);
}
