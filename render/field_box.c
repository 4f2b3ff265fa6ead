#include "render/field_box.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "geo/frames.h"
#include "terrain/parallel.h"

#define EARTH_RADIUS_M 6.4e6 /* at least; of the sagitta */

static void scale_to_unit(double v[3])
{
    double length = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    for (int i = 0; i < 3; i++)
        v[i] /= length;
}

struct field_frame field_frame_of(const struct field *field)
{
    struct field_frame frame;
    double above[3], beside[3], along_up = 0.0, middle = 0.5 * field->cells;
    double *x = frame.axes[0], *y = frame.axes[1], *z = frame.axes[2];
    field_place(field, middle, middle, 0.0, frame.middle_ecef_m);
    field_place(field, middle, middle, 1e5, above);
    field_place(field, middle + 1.0, middle, 0.0, beside);
    for (int i = 0; i < 3; i++) {
        z[i] = above[i] - frame.middle_ecef_m[i];
        x[i] = beside[i] - frame.middle_ecef_m[i];
    }
    scale_to_unit(z);
    for (int i = 0; i < 3; i++)
        along_up += x[i] * z[i];
    for (int i = 0; i < 3; i++)
        x[i] -= along_up * z[i];
    scale_to_unit(x);
    for (int i = 0; i < 3; i++)
        y[i] = z[(i + 1) % 3] * x[(i + 2) % 3] - z[(i + 2) % 3] * x[(i + 1) % 3];
    return frame;
}

static void into_frame(const struct field_frame *frame, const double ecef_m[3], double ret_m[3])
{
    double from_middle[3];
    for (int i = 0; i < 3; i++)
        from_middle[i] = ecef_m[i] - frame->middle_ecef_m[i];
    frames_rotate(frame->axes, from_middle, ret_m);
}

void field_frame_place(const struct field_frame *frame, const struct field *field, double col,
                       double row, double height_m, double ret_m[3])
{
    double ecef_m[3];
    field_place(field, col, row, height_m, ecef_m);
    into_frame(frame, ecef_m, ret_m);
}

/* Around the corners of the block of air between the least and the greatest height, out of which
 * the ground bulges by no more than the sagitta of the diagonal. */
struct field_box field_box_of(const struct field *field, const struct field_frame *frame, int col,
                              int row, int span)
{
    struct field_box box = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    float lowest_m = INFINITY, highest_m = -INFINITY;
    for (int r = row; r <= row + span; r++)
        for (int c = col; c <= col + span; c++) {
            float height_m = field_height_m(field, c, r);
            lowest_m = height_m < lowest_m ? height_m : lowest_m;
            highest_m = height_m > highest_m ? height_m : highest_m;
        }
    double angle = span * clipmap_step_rad(&field->shape, 0);
    float slack_m = (float)(EARTH_RADIUS_M * angle * angle / 4.0 + FIELD_BOX_SLACK_M);
    for (int i = 0; i < 8; i++) {
        double at_m[3];
        field_frame_place(frame, field, col + (i & 1) * span, row + (i >> 1 & 1) * span,
                          (double)(i & 4 ? highest_m : lowest_m), at_m);
        for (int k = 0; k < 3; k++) {
            box.least_m[k] = fminf(box.least_m[k], (float)at_m[k] - slack_m);
            box.most_m[k] = fmaxf(box.most_m[k], (float)at_m[k] + slack_m);
        }
    }
    return box;
}

struct field_box field_box_join(struct field_box a, struct field_box b)
{
    for (int k = 0; k < 3; k++) {
        a.least_m[k] = fminf(a.least_m[k], b.least_m[k]);
        a.most_m[k] = fmaxf(a.most_m[k], b.most_m[k]);
    }
    return a;
}

float field_box_diagonal_m(const struct field_box *box)
{
    return hypotf(hypotf(box->most_m[0] - box->least_m[0], box->most_m[1] - box->least_m[1]),
                  box->most_m[2] - box->least_m[2]);
}

struct field_eye field_eye_of(const struct field_frame *frame, const struct view *view)
{
    const struct sight sight = sight_from_view(view);
    struct field_eye eye;
    double at_m[3];
    into_frame(frame, sight.eye_ecef_m, at_m);
    for (int k = 0; k < 3; k++)
        eye.at_m[k] = (float)at_m[k];
    for (int s = 0; s < 4; s++) {
        double side[3];
        frames_rotate(frame->axes, sight.sides[s], side);
        for (int k = 0; k < 3; k++)
            eye.sides[s][k] = (float)side[k];
    }
    return eye;
}

/* By the corners that are farthest out and farthest in. */
enum field_seen field_eye_sees(const struct field_eye *eye, const struct field_box *box)
{
    enum field_seen seen = FIELD_SEEN;
    for (int s = 0; s < 4; s++) {
        const float *side = eye->sides[s];
        float inmost_m = 0.0f, outmost_m = 0.0f;
        for (int k = 0; k < 3; k++) {
            float a = side[k] * (box->least_m[k] - eye->at_m[k]);
            float b = side[k] * (box->most_m[k] - eye->at_m[k]);
            inmost_m += a > b ? a : b;
            outmost_m += a > b ? b : a;
        }
        if (inmost_m < 0.0f)
            return FIELD_UNSEEN;
        if (outmost_m < 0.0f)
            seen = FIELD_CUT;
    }
    return seen;
}

float field_eye_distance2(const struct field_eye *eye, const struct field_box *box)
{
    float d2 = 0.0f;
    for (int k = 0; k < 3; k++) {
        float below = box->least_m[k] - eye->at_m[k], above = eye->at_m[k] - box->most_m[k];
        float d = below > above ? below : above;
        d2 += d > 0.0f ? d * d : 0.0f;
    }
    return d2;
}

struct leaves {
    const struct field *field;
    struct field_boxes *boxes;
    int cells;
};

static int create_row(void *user, unsigned worker, unsigned row)
{
    const struct leaves *leaves = user;
    int along = leaves->boxes->levels[0].along;
    (void)worker;
    for (int i = 0; i < along; i++)
        leaves->boxes->levels[0].boxes[(int)row * along + i] =
            field_box_of(leaves->field, &leaves->boxes->frame, i * leaves->cells,
                         (int)row * leaves->cells, leaves->cells);
    return 0;
}

static void join_level(struct field_boxes *boxes, int l)
{
    int along = boxes->levels[l].along, finer = boxes->levels[l - 1].along;
    for (int i = 0; i < along * along; i++) {
        const struct field_box *of =
            &boxes->levels[l - 1].boxes[2 * (i / along) * finer + 2 * (i % along)];
        boxes->levels[l].boxes[i] =
            field_box_join(field_box_join(of[0], of[1]), field_box_join(of[finer], of[finer + 1]));
    }
}

int field_boxes_create(const struct field *field, int cells, struct field_boxes *ret_boxes)
{
    struct field_boxes boxes = {.frame = field_frame_of(field)};
    int along = field->cells / cells, r = 0;
    do {
        boxes.levels[boxes.count].along = along;
        boxes.levels[boxes.count].boxes =
            malloc((size_t)along * (size_t)along * sizeof(struct field_box));
        if (!boxes.levels[boxes.count++].boxes)
            r = -ENOMEM;
        along /= 2;
    } while (r == 0 && boxes.levels[boxes.count - 1].along % 2 == 0);
    if (r == 0)
        r = parallel_run(parallel_processors(), (unsigned)boxes.levels[0].along, create_row,
                         &(struct leaves){field, &boxes, cells});
    if (r < 0) {
        field_boxes_destroy(&boxes);
        return r;
    }
    for (int l = 1; l < boxes.count; l++)
        join_level(&boxes, l);
    *ret_boxes = boxes;
    return 0;
}

void field_boxes_destroy(struct field_boxes *boxes)
{
    for (int l = 0; l < boxes->count; l++)
        free(boxes->levels[l].boxes);
    *boxes = (struct field_boxes){0};
}

size_t field_boxes_bytes(const struct field_boxes *boxes)
{
    size_t count = 0;
    for (int l = 0; l < boxes->count; l++)
        count += (size_t)boxes->levels[l].along * (size_t)boxes->levels[l].along;
    return count * sizeof(struct field_box);
}
