/* Keeps an image clipmap filled: a thread that samples imagery and hands the renderer strips.
 *
 * As terrain/loader.h does for heights, but level by level: an update moves one window by at most
 * IMAGE_STRIP rows or columns. A level that is filled anew (at the start, after a jump, where its
 * plane changes) is filled in a spare layer of the renderer's storage and takes its
 * place when it is whole; until then the layer that it had stays and moves on. What is not there
 * yet is thus shown by a coarser level, never by a hole. Windows that have to be moved come before
 * those that have to be filled, coarse ones before fine ones.
 *
 * Reading and decoding tiles is this thread's work, too: nothing but the picture's sharpness waits
 * for the disk. */
#pragma once

#include <stddef.h>

#include "base/diag.h"
#include "terrain/image_clipmap.h"

struct imagery;

#define IMAGE_UPDATES 4
#define IMAGE_STRIP   64 /* rows or columns */

/* Both kinds of texels as they are interpolated: alpha and knowledge multiplied in. */
struct image_colour {
    uint8_t red, green, blue, alpha; /* sRGB-coded */
};
struct image_water {
    uint8_t share, known, unused[2];
};

/* Which windows there are, and in which layer of the storage. */
struct image_layout {
    struct image_window windows[IMAGE_CLIPMAP_LEVELS_MAX];
    int layers[IMAGE_CLIPMAP_LEVELS_MAX];
};

struct image_update {
    int slot;     /* which arena */
    int layer;    /* where the texels belong: */
    int row, col; /* their south-west texel's place in the toroidal storage */
    int rows, cols;
    struct image_layout layout;   /* once they are there */
    struct image_colour *colours; /* in the arena, [rows][cols]; NULL: none are wanted */
    struct image_water *waters;   /* the same */
};

struct image_loader_params {
    struct image_shape shape;
    bool colour, water;      /* what is sampled */
    struct imagery *imagery; /* ownership passes */
    /* Memory of the renderer's, one piece an update: colours at 0, waters behind them,
     * image_loader_arena_bytes() in all. It outlives the loader. */
    void *arenas[IMAGE_UPDATES];
};

size_t image_loader_arena_bytes(const struct image_loader_params *params);

/* Where the waters begin in an arena. */
size_t image_loader_water_offset(const struct image_loader_params *params);

struct image_loader;

/* Starts the thread "otwd-imagery". On failure the imagery is closed. */
int image_loader_start(const struct image_loader_params *params, struct image_loader **ret_loader,
                       struct diag *diag);
/* Legal on NULL. */
void image_loader_stop(struct image_loader *loader);

/* Says where the eye is and which level is the finest that is wanted. Render thread; no lock. */
void image_loader_wish(struct image_loader *loader, double lat_deg, double lon_deg, int finest);

/* The next update, or NULL where none is ready. It stays the caller's until given back. */
struct image_update *image_loader_take(struct image_loader *loader);
void image_loader_give_back(struct image_loader *loader, struct image_update *update);

/* Waits until there is an update to take, and returns true; or until the last wish is answered and
 * all its updates have been taken: false. */
bool image_loader_wait(struct image_loader *loader);

struct image_loader_counts {
    uint64_t tiles_loaded, read_errors, texels_sampled;
};
void image_loader_counts(const struct image_loader *loader, struct image_loader_counts *ret_counts);
