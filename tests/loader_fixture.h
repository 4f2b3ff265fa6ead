/* A loader and what a renderer would have made of its updates. */
#pragma once

#include <time.h>

#include "terrain/level_store.h"
#include "terrain/loader.h"
#include "terrain/planet.h"
#include "tests/database_fixture.h"

static inline void nap(void)
{
    nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
}

/* What a renderer would have in its textures. */
struct picture {
    struct loader *loader;
    void *arenas[LOADER_UPDATES];
    struct loader_height *heights; /* [levels][CLIPMAP_PANES][side][side] */
    struct loader_surface *surfaces;
    struct loader_level levels[CLIPMAP_MAX_LEVELS];
    bool late, was_late;
};

static const struct clipmap_shape shape = {.radius = 32, .block = 4, .levels = 11, .depth = 17};

static inline void lay(void *texture, size_t element, int side, int layer, struct clipmap_rect rect,
                       const void *from)
{
    for (int r = 0; r < rect.rows; r++)
        for (int c = 0; c < rect.cols; c++) {
            int y = (rect.row0 + r) & (side - 1), x = (rect.col0 + c) & (side - 1);
            memcpy((char *)texture + element * (size_t)((layer * side + y) * side + x),
                   (const char *)from + element * (size_t)(r * rect.cols + c), element);
        }
}

static inline void take_updates(struct picture *picture)
{
    int side = clipmap_storage(&shape);
    struct loader_update *update;
    while ((update = loader_take(picture->loader))) {
        for (unsigned i = 0; i < update->strip_count; i++) {
            const struct loader_strip *s = &update->strips[i];
            int layer = CLIPMAP_PANES * s->level + s->pane;
            lay(picture->heights, sizeof(struct loader_height), side, layer, s->posts,
                update->heights + s->height_offset);
            lay(picture->surfaces, sizeof(struct loader_surface), 2 * side, layer, s->half_posts,
                update->surfaces + s->surface_offset);
        }
        memcpy(picture->levels, update->levels, sizeof(picture->levels));
        picture->late = update->late;
        picture->was_late |= update->late;
        loader_give_back(picture->loader, update);
    }
}

/* All that a patient wish brings, however many updates that are. */
static inline void take_answer(struct picture *picture)
{
    bool pending;
    do {
        loader_wait(picture->loader);
        pending = loader_pending(picture->loader);
        take_updates(picture);
    } while (pending);
}

/* As a renderer would, until nothing is late any more. */
static inline void draw_until_complete(struct picture *pictures, int count)
{
    bool complete = false;
    for (int i = 0; i < 20000 && !complete; i++, nap()) {
        complete = true;
        for (int p = 0; p < count; p++) {
            bool pending = loader_pending(pictures[p].loader);
            take_updates(&pictures[p]);
            complete &= !pending && pictures[p].levels[0].cap.radius > 0.0 && !pictures[p].late;
        }
    }
    CHECK(complete);
}

/* The planet, of which all pictures share one. The main thread. */
static inline struct terrain_source *planet(void)
{
    static struct terrain_source *first;
    struct terrain_source *source = NULL;
    struct diag diag = {""};
    if (!first && planet_open(&first, &diag) < 0)
        CHECK_FAIL("%s", diag.text);
    CHECK_INT(terrain_source_share(first, &source), 0);
    return source;
}

/* Takes the source, and puts the planet beneath it. */
static inline void open_picture(struct picture *picture, struct terrain_source *source,
                                unsigned samplers)
{
    struct diag diag = {""};
    size_t texels = (size_t)shape.levels * CLIPMAP_PANES * (size_t)clipmap_storage(&shape) *
                    (size_t)clipmap_storage(&shape);
    struct loader_params params = {
        .shape = shape, .source = source, .fallback = planet(), .samplers = samplers};
    for (int i = 0; i < LOADER_UPDATES; i++)
        params.arenas[i] = picture->arenas[i] =
            malloc(loader_arena_bytes(loader_update_bytes(&shape, 0)));
    picture->heights = calloc(texels, sizeof(*picture->heights));
    picture->surfaces = calloc(4 * texels, sizeof(*picture->surfaces));
    if (loader_start(&params, &picture->loader, &diag) < 0)
        CHECK_FAIL("%s", diag.text);
}

static inline void close_picture(struct picture *picture)
{
    loader_stop(picture->loader);
    for (int i = 0; i < LOADER_UPDATES; i++)
        free(picture->arenas[i]);
    free(picture->heights);
    free(picture->surfaces);
}

/* How far apart heights and codes may lie to count as equal. */
struct tolerance {
    float height_m;
    int code;
};

static inline bool same_height(const void *a, const void *b, const struct tolerance *tolerance)
{
    const struct loader_height *own = a, *other = b;
    return fabsf(own->own_m - other->own_m) <= tolerance->height_m &&
           fabsf(own->coarser_m - other->coarser_m) <= tolerance->height_m;
}

static inline bool same_surface(const void *a, const void *b, const struct tolerance *tolerance)
{
    const struct loader_surface *own = a, *other = b;
    return abs(own->slope_along - other->slope_along) <= tolerance->code &&
           abs(own->slope_across - other->slope_across) <= tolerance->code &&
           abs(own->bend - other->bend) <= tolerance->code && own->water == other->water;
}

typedef bool (*same_function)(const void *a, const void *b, const struct tolerance *tolerance);

/* Counts the elements of a rectangle that differ in two toroidal textures. */
static inline int differences_of(const void *a, const void *b, size_t element, same_function same,
                                 const struct tolerance *tolerance, int side, int layer,
                                 struct clipmap_rect rect)
{
    int different = 0;
    for (int r = 0; r < rect.rows; r++)
        for (int c = 0; c < rect.cols; c++) {
            int y = (rect.row0 + r) & (side - 1), x = (rect.col0 + c) & (side - 1);
            size_t at = element * (size_t)((layer * side + y) * side + x);
            different += !same((const char *)a + at, (const char *)b + at, tolerance);
        }
    return different;
}

/* In what both pictures have. */
static inline int differences_beyond(const struct tolerance *tolerance, const struct picture *a,
                                     const struct picture *b)
{
    int side = clipmap_storage(&shape), different = 0;
    for (int layer = 0; layer < shape.levels * CLIPMAP_PANES; layer++) {
        const struct clipmap_pane *of_a =
            &a->levels[layer / CLIPMAP_PANES].panes[layer % CLIPMAP_PANES];
        const struct clipmap_pane *of_b =
            &b->levels[layer / CLIPMAP_PANES].panes[layer % CLIPMAP_PANES];
        struct clipmap_rect posts = clipmap_common(of_a->posts, of_b->posts);
        if (of_a->face != of_b->face || posts.rows < 4 || posts.cols < 4)
            continue;
        /* Slopes and bends on the rim are one-sided or not, by when neighbours left the window. */
        const int rim = LEVEL_STORE_GROWTH;
        struct clipmap_rect inside = {2 * posts.row0 + rim, 2 * posts.col0 + rim,
                                      2 * (posts.rows - rim) - 1, 2 * (posts.cols - rim) - 1};
        different += differences_of(a->heights, b->heights, sizeof(*a->heights), same_height,
                                    tolerance, side, layer, posts);
        different += differences_of(a->surfaces, b->surfaces, sizeof(*a->surfaces), same_surface,
                                    tolerance, 2 * side, layer, inside);
    }
    return different;
}

static inline int differences(const struct picture *a, const struct picture *b)
{
    return differences_beyond(&(struct tolerance){0.0f, 0}, a, b);
}

/* Where ground was dug its tiles may have finer posts than the ground around a stamp: what lies
 * between those is rounded otherwise. */
static inline int differences_of_dug(const struct picture *a, const struct picture *b)
{
    return differences_beyond(&(struct tolerance){1e-3f, 2}, a, b);
}
