#include "render/technique_quadtree_patches.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

/* How far the middles of two cells' squares are from what is drawn without them: of an edge, its
 * line; of four cells, either of the two lines, for which of them is drawn the GPU decides. */
static float left_out_m(const struct field *field, int col, int row, int half)
{
    float sw = field_height_m(field, col, row);
    float se = field_height_m(field, col + 2 * half, row);
    float nw = field_height_m(field, col, row + 2 * half);
    float ne = field_height_m(field, col + 2 * half, row + 2 * half);
    float s = field_height_m(field, col + half, row), w = field_height_m(field, col, row + half);
    float n = field_height_m(field, col + half, row + 2 * half);
    float e = field_height_m(field, col + 2 * half, row + half);
    float middle = field_height_m(field, col + half, row + half);
    float edges = fmaxf(fmaxf(fabsf(s - 0.5f * (sw + se)), fabsf(w - 0.5f * (sw + nw))),
                        fmaxf(fabsf(n - 0.5f * (nw + ne)), fabsf(e - 0.5f * (se + ne))));
    float cuts = fmaxf(fabsf(middle - 0.5f * (sw + ne)), fabsf(middle - 0.5f * (se + nw)));
    return fmaxf(edges, cuts);
}

static float cut_error_m(const struct field *field, int col, int row)
{
    float rising = field_height_m(field, col, row) + field_height_m(field, col + 1, row + 1);
    float falling = field_height_m(field, col + 1, row) + field_height_m(field, col, row + 1);
    return 0.5f * fabsf(rising - falling);
}

/* Err_Int: how far what the patch leaves out of its offspring is from it. What half-posts have
 * beyond posts is which way each cell is cut. */
static float interpolation_error_m(const struct field *field, int col, int row, int step)
{
    float most = 0.0f;
    for (int r = 0; r < PATCH_CELLS; r++)
        for (int c = 0; c < PATCH_CELLS; c++) {
            int at_col = col + c * step / 2, at_row = row + r * step / 2;
            most = fmaxf(most, step == 2 ? cut_error_m(field, at_col, at_row)
                                         : left_out_m(field, at_col, at_row, step / 4));
        }
    return most;
}

static struct patch finest_patch(const struct field *field, int col, int row)
{
    struct patch patch = {.least_m = INFINITY, .most_m = -INFINITY};
    for (int r = row; r <= row + PATCH_CELLS / 2; r++)
        for (int c = col; c <= col + PATCH_CELLS / 2; c++) {
            float height_m = field_height_m(field, c, r);
            patch.least_m = fminf(patch.least_m, height_m);
            patch.most_m = fmaxf(patch.most_m, height_m);
        }
    return patch;
}

/* Err_Appr, as a sum over the levels below. */
static struct patch parent_patch(const struct patches *patches, const struct field *field,
                                 struct patch_id id, int col, int row)
{
    struct patch patch = {.least_m = INFINITY, .most_m = -INFINITY};
    for (int i = 0; i < 4; i++) {
        struct patch_id child_id = {id.level + 1, 2 * id.col + (i & 1), 2 * id.row + (i >> 1)};
        const struct patch *child = &patches->all[patch_index(child_id)];
        patch.error_m = fmaxf(patch.error_m, child->error_m);
        patch.least_m = fminf(patch.least_m, child->least_m);
        patch.most_m = fmaxf(patch.most_m, child->most_m);
    }
    patch.error_m += interpolation_error_m(field, col, row, patch_step(patches, id.level));
    return patch;
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void subtract(const double a[3], const double b[3], double ret[3])
{
    for (int k = 0; k < 3; k++)
        ret[k] = a[k] - b[k];
}

static void normalize(double a[3])
{
    double length = sqrt(dot(a, a));
    for (int k = 0; k < 3; k++)
        a[k] /= length;
}

/* Up in the middle, and along the rows; what is left is across both. */
static void set_axes(const struct field *field, double col, double row, double half, double mean_m,
                     struct patch_box *box)
{
    double(*axes)[3] = box->axes, from[3], to[3];
    field_place(field, col, row, mean_m + 1e3, to);
    subtract(to, box->centre_ecef_m, axes[2]);
    normalize(axes[2]);
    field_place(field, col - half, row, mean_m, from);
    field_place(field, col + half, row, mean_m, to);
    subtract(to, from, axes[0]);
    double up = dot(axes[0], axes[2]);
    for (int k = 0; k < 3; k++)
        axes[0][k] -= up * axes[2][k];
    normalize(axes[0]);
    for (int k = 0; k < 3; k++)
        axes[1][k] = axes[2][(k + 1) % 3] * axes[0][(k + 2) % 3] -
                     axes[2][(k + 2) % 3] * axes[0][(k + 1) % 3];
}

/* Around the eight corners of the block of air that the ground is in. Between them it bulges by
 * less than the sagitta of its diagonal, upwards and to the sides. */
static void set_box(const struct field *field, int col, int row, int span, struct patch *patch)
{
    struct patch_box *box = &patch->box;
    double mean_m = 0.5 * ((double)patch->least_m + (double)patch->most_m);
    double angle = span * clipmap_step_rad(&field->shape, 0);
    field_place(field, col + 0.5 * span, row + 0.5 * span, mean_m, box->centre_ecef_m);
    set_axes(field, col + 0.5 * span, row + 0.5 * span, 0.5 * span, mean_m, box);
    for (int i = 0; i < 8; i++) {
        double corner[3];
        field_place(field, col + (i & 1) * span, row + (i >> 1 & 1) * span,
                    (double)(i & 4 ? patch->most_m : patch->least_m), corner);
        subtract(corner, box->centre_ecef_m, corner);
        for (int k = 0; k < 3; k++)
            box->half_m[k] = fmax(box->half_m[k], fabs(dot(corner, box->axes[k])));
    }
    for (int k = 0; k < 3; k++)
        box->half_m[k] += 6.4e6 * angle * angle / 4.0;
}

static void set_level(const struct field *field, struct patches *patches, int level)
{
    int span = PATCH_CELLS * patch_step(patches, level) / 2; /* posts */
    for (int i = 0; i < 1 << 2 * level; i++) {
        struct patch_id id = {level, i & ((1 << level) - 1), i >> level};
        struct patch *patch = &patches->all[patch_index(id)];
        int col = id.col * span, row = id.row * span;
        *patch = level == patches->levels - 1 ? finest_patch(field, col, row)
                                              : parent_patch(patches, field, id, col, row);
        set_box(field, col, row, span, patch);
    }
}

int patches_create(const struct field *field, struct patches **ret_patches, struct diag *diag)
{
    int levels = 1;
    while (PATCH_CELLS << (levels - 1) < 2 * field->cells)
        levels++;
    if (PATCH_CELLS << (levels - 1) != 2 * field->cells)
        return diag_set(diag, -EINVAL,
                        "a field of %d cells a side: a quadtree of patches has %d, %d, %d, ...",
                        field->cells, PATCH_CELLS, 2 * PATCH_CELLS, 4 * PATCH_CELLS);
    struct patches *patches = calloc(1, sizeof(*patches));
    int count = patch_index((struct patch_id){levels, 0, 0});
    struct patch *all = calloc((size_t)count, sizeof(*all));
    if (!patches || !all) {
        free(patches);
        free(all);
        return diag_set(diag, -ENOMEM, "no memory for %d patches", count);
    }
    *patches = (struct patches){.levels = levels, .count = count, .all = all};
    for (int level = levels - 1; level >= 0; level--)
        set_level(field, patches, level);
    *ret_patches = patches;
    return 0;
}

void patches_destroy(struct patches *patches)
{
    if (!patches)
        return;
    free(patches->all);
    free(patches);
}

double patch_box_distance_m(const struct patch_box *box, const struct sight *sight)
{
    double d[3], sum = 0.0;
    subtract(sight->eye_ecef_m, box->centre_ecef_m, d);
    for (int k = 0; k < 3; k++) {
        double beyond = fmax(fabs(dot(d, box->axes[k])) - box->half_m[k], 0.0);
        sum += beyond * beyond;
    }
    return sqrt(sum);
}

bool patch_box_in_sight(const struct patch_box *box, const struct sight *sight)
{
    double d[3];
    subtract(box->centre_ecef_m, sight->eye_ecef_m, d);
    for (int s = 0; s < 4; s++) {
        double reach = 0.0;
        for (int k = 0; k < 3; k++)
            reach += box->half_m[k] * fabs(dot(sight->sides[s], box->axes[k]));
        if (dot(sight->sides[s], d) < -reach)
            return false;
    }
    return true;
}

struct choice {
    const struct patches *patches;
    const struct sight *sight;
    double error_per_m;
    int most, count;
    struct patch_id *chosen; /* [most] */
};

static bool choose(struct choice *choice, struct patch_id id)
{
    const struct patch *patch = &choice->patches->all[patch_index(id)];
    if (id.level == choice->patches->levels - 1 ||
        (double)patch->error_m <=
            choice->error_per_m * patch_box_distance_m(&patch->box, choice->sight)) {
        if (choice->count == choice->most)
            return false;
        choice->chosen[choice->count++] = id;
        return true;
    }
    for (int i = 0; i < 4; i++)
        if (!choose(choice,
                    (struct patch_id){id.level + 1, 2 * id.col + (i & 1), 2 * id.row + (i >> 1)}))
            return false;
    return true;
}

int patches_choose(const struct patches *patches, const struct sight *sight, double error_per_m,
                   int most, struct patch_id ret_chosen[])
{
    struct choice choice = {patches, sight, error_per_m, most, 0, ret_chosen};
    return choose(&choice, (struct patch_id){0, 0, 0}) ? choice.count : -1;
}
