#include "terrain/field.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "geo/cube.h"
#include "geo/geographic.h"

/* The first post along one axis of the face. */
static int32_t first_post(double angle_rad, double step_rad, int cells, int32_t face_cells)
{
    double first = (angle_rad + M_PI / 4.0) / step_rad - 0.5 * cells;
    int32_t aligned = (int32_t)nearbyint(first / FIELD_ALIGNED) * FIELD_ALIGNED;
    return aligned < 0 ? 0 : aligned > face_cells - cells ? face_cells - cells : aligned;
}

int field_create(struct reference *reference, const struct geodetic *middle, int cells,
                 struct field **ret_field, struct diag *diag)
{
    const struct clipmap_shape *shape = reference_shape(reference);
    int32_t face_cells = clipmap_cells(shape, 0);
    if (cells < FIELD_ALIGNED || cells % FIELD_ALIGNED || cells > FIELD_CELLS_MAX ||
        cells > face_cells)
        return diag_set(
            diag, -EINVAL, "a field of %d posts a side: its cells are a multiple of %d, at most %d",
            cells + 1, FIELD_ALIGNED, face_cells < FIELD_CELLS_MAX ? face_cells : FIELD_CELLS_MAX);
    struct field *field = calloc(1, sizeof(*field));
    size_t side = (size_t)cells + 1;
    double normal[3], angle[2], step_rad = clipmap_step_rad(shape, 0);
    if (!field)
        return diag_set(diag, -ENOMEM, "no memory for a field");
    cube_normal_from_geodetic(middle->lat_deg, middle->lon_deg, normal);
    *field = (struct field){.shape = *shape, .face = cube_face_of(normal), .cells = cells};
    cube_angles(field->face, normal, &angle[0], &angle[1]);
    field->col0 = first_post(angle[0], step_rad, cells, face_cells);
    field->row0 = first_post(angle[1], step_rad, cells, face_cells);
    field->height_m = malloc(side * side * sizeof(*field->height_m));
    if (!field->height_m) {
        field_destroy(field);
        return diag_set(diag, -ENOMEM, "no memory for a field of %zu x %zu posts", side, side);
    }
    const struct clipmap_rect posts = {field->row0, field->col0, (int32_t)side, (int32_t)side};
    reference_posts(reference, field->face, posts, field->height_m);
    *ret_field = field;
    return 0;
}

void field_destroy(struct field *field)
{
    if (!field)
        return;
    free(field->height_m);
    free(field);
}

bool field_find(const struct field *field, const struct geodetic *place, double ret_at[2])
{
    double normal[3], angle[2], step_rad = clipmap_step_rad(&field->shape, 0);
    cube_normal_from_geodetic(place->lat_deg, place->lon_deg, normal);
    if (cube_face_of(normal) != field->face)
        return false;
    cube_angles(field->face, normal, &angle[0], &angle[1]);
    ret_at[0] = (angle[0] + M_PI / 4.0) / step_rad - field->col0;
    ret_at[1] = (angle[1] + M_PI / 4.0) / step_rad - field->row0;
    return fmin(ret_at[0], ret_at[1]) >= 0.0 && fmax(ret_at[0], ret_at[1]) <= field->cells;
}

void field_place(const struct field *field, double col, double row, double height_m,
                 double ret_ecef_m[3])
{
    double normal[3], step_rad = clipmap_step_rad(&field->shape, 0);
    struct geodetic place = {.height_m = height_m};
    cube_normal(field->face, (field->col0 + col) * step_rad - M_PI / 4.0,
                (field->row0 + row) * step_rad - M_PI / 4.0, normal);
    cube_geodetic_from_normal(normal, &place.lat_deg, &place.lon_deg);
    geocentric_from_geodetic(&place, ret_ecef_m);
}

/* The ground bulges out of the chord between its corners by less than the sagitta, which the eight
 * corners of the block of air between its least and its greatest height leave out. */
struct field_ball field_ball(const struct field *field, int col, int row, int span)
{
    struct field_ball ball = {.least_m = INFINITY, .most_m = -INFINITY};
    for (int r = row; r <= row + span; r++)
        for (int c = col; c <= col + span; c++) {
            float height_m = field_height_m(field, c, r);
            ball.least_m = fminf(ball.least_m, height_m);
            ball.most_m = fmaxf(ball.most_m, height_m);
        }
    double mean_m = 0.5 * ((double)ball.least_m + (double)ball.most_m);
    field_place(field, col + 0.5 * span, row + 0.5 * span, mean_m, ball.centre_ecef_m);
    for (int i = 0; i < 8; i++) {
        double corner[3], d2 = 0.0;
        field_place(field, col + (i & 1) * span, row + (i >> 1 & 1) * span,
                    (double)(i & 4 ? ball.most_m : ball.least_m), corner);
        for (int k = 0; k < 3; k++)
            d2 += (corner[k] - ball.centre_ecef_m[k]) * (corner[k] - ball.centre_ecef_m[k]);
        ball.radius_m = fmax(ball.radius_m, sqrt(d2));
    }
    double angle = span * clipmap_step_rad(&field->shape, 0);
    ball.radius_m += 6.4e6 * angle * angle / 4.0; /* the sagitta of its diagonal */
    return ball;
}
