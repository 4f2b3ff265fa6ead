/* What geomipmap works out beforehand of each patch: of every level but the finest, the post that
 * the level misses by most ("maxerror vertex"). Any thread. */
#pragma once

#include "render/field_box.h"

#define PATCH_CELLS  16
#define PATCH_LEVELS 5 /* level l has every 2^l-th post; level 4 is one square */

struct patch_errors {
    struct {
        float at_m[3]; /* in the field's frame */
        float error_m;
    } levels[PATCH_LEVELS - 1]; /* from level 1 on */
};

/* Of all patches, row by row: [cells / PATCH_CELLS][cells / PATCH_CELLS]; to be freed. On all
 * processors. NULL without memory. */
struct patch_errors *patch_errors_create(const struct field *field,
                                         const struct field_frame *frame);
