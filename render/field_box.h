/* Boxes around parts of a field, all in one frame at its middle (x along its rows of posts, z up),
 * and what an eye sees of them: the bounding boxes of the papers, on a curved Earth. Boxes hold
 * floats; what these round is within FIELD_BOX_SLACK_M, by which every box is larger than what is
 * in it. Any thread. */
#pragma once

#include "render/sight.h"
#include "terrain/field.h"

#define FIELD_BOX_SLACK_M 0.5

struct field_frame {
    double middle_ecef_m[3];
    double axes[3][3]; /* rows: unit vectors in ECEF */
};

struct field_box {
    float least_m[3], most_m[3];
};

/* In the frame of a field: where the eye is, and the inward unit normals of its frustum's sides. */
struct field_eye {
    float at_m[3];
    float sides[4][3];
};

struct field_frame field_frame_of(const struct field *field);

/* As field_place(), in the frame. */
void field_frame_place(const struct field_frame *frame, const struct field *field, double col,
                       double row, double height_m, double ret_m[3]);

/* Around the ground of span x span cells from a post on. */
struct field_box field_box_of(const struct field *field, const struct field_frame *frame, int col,
                              int row, int span);
/* Around both. */
struct field_box field_box_join(struct field_box a, struct field_box b);
float field_box_diagonal_m(const struct field_box *box);

struct field_eye field_eye_of(const struct field_frame *frame, const struct view *view);

enum field_seen {
    FIELD_UNSEEN, /* no point of the box can be in the picture */
    FIELD_CUT,
    FIELD_SEEN, /* nothing of it is beside the picture */
};
enum field_seen field_eye_sees(const struct field_eye *eye, const struct field_box *box);

/* From the eye to the nearest point of the box, squared; 0 within it. m^2. */
float field_eye_distance2(const struct field_eye *eye, const struct field_box *box);

/* All of a field in boxes: of squares of so many cells, and of 2 x 2 boxes of the level before, as
 * long as these come out even. */
#define FIELD_BOXES_LEVELS 12
struct field_boxes {
    struct field_frame frame;
    int count; /* of levels */
    struct {
        struct field_box *boxes; /* [along][along] */
        int along;
    } levels[FIELD_BOXES_LEVELS];
};

/* `cells` divides FIELD_ALIGNED. On all processors. -ENOMEM. */
int field_boxes_create(const struct field *field, int cells, struct field_boxes *ret_boxes);
/* Legal on zeros. */
void field_boxes_destroy(struct field_boxes *boxes);
size_t field_boxes_bytes(const struct field_boxes *boxes);
