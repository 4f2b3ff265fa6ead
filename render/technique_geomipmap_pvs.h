/* Potentially visible sets over a field: which of its squares may be seen from which, and from how
 * high (Wagner 2004, "Optimizations"). What is hidden is so from every point of a square and of a
 * layer of height, so nothing that can be seen is left out. Any thread. */
#pragma once

#include <stdint.h>

#include "render/field_box.h"

#define PVS_ALONG  64 /* squares along a side, at most */
#define PVS_LAYERS 32 /* in three times the ground's range of heights */

/* Zeros: everything may be seen. */
struct pvs {
    int along, level; /* a square is a box of that level of the field's */
    float lowest_m, layer_m;
    uint8_t *first_layer; /* [along^2 from][along^2 of], from which it may be seen */
};

/* Zeros where the squares would be too many, or the field is so wide that its rows of posts are not
 * straight enough. On all processors. -ENOMEM. */
int pvs_create(const struct field *field, const struct field_boxes *boxes, struct pvs *ret_pvs);
/* Legal on zeros. */
void pvs_destroy(struct pvs *pvs);

/* What may be seen by an eye at a place of the field (posts from its first) and a height in its
 * frame: by square, compare with pvs_layer(). NULL: everything, for the eye is beside the field. */
const uint8_t *pvs_from(const struct pvs *pvs, const struct field *field, const double at[2]);
int pvs_layer(const struct pvs *pvs, float height_m);
