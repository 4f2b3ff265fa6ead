/* The patch quadtree of Yusov's technique: its bounds hold, and what it chooses is the field. */
#include <errno.h>
#include <stdint.h>

#include "geo/geographic.h"
#include "render/technique_quadtree_patches.h"
#include "tests/check.h"

#define CELLS 512
#define FACE  1

static uint32_t seed = 1;

static int below(int count)
{
    seed = seed * 1664525u + 1013904223u;
    return (int)((seed >> 8) % (uint32_t)count);
}

/* Hills, and a post here and there that sticks out. */
static struct field *open_field(int cells)
{
    struct field *field = malloc(sizeof(*field));
    *field =
        (struct field){.shape = clipmap_shape_of_depth(64, 8, 20), .face = FACE, .cells = cells};
    field->col0 = 3 * FIELD_ALIGNED, field->row0 = 70 * FIELD_ALIGNED;
    field->height_m = malloc((size_t)(cells + 1) * (size_t)(cells + 1) * sizeof(float));
    for (int i = 0; i < (cells + 1) * (cells + 1); i++)
        field->height_m[i] =
            (float)(300.0 * sin(i % (cells + 1) * 0.02) * cos(i / (cells + 1) * 0.03)) +
            (below(500) == 0 ? 40.0f : 0.0f);
    return field;
}

static struct patches *open_patches(const struct field *field)
{
    struct patches *patches = NULL;
    struct diag diag = {""};
    CHECK_INT(patches_create(field, &patches, &diag), 0);
    return patches;
}

static struct sight sight_from(const struct field *field, double col, double row, double height_m)
{
    struct sight sight = {.eye_ecef_m = {0.0}};
    field_place(field, col, row, height_m, sight.eye_ecef_m);
    return sight;
}

/* From a post to the triangles over every `step`th post that cover it, cut the one way or the
 * other; the greater. */
static float off_by_m(const struct field *field, int col, int row, int step)
{
    int c = col / step * step, r = row / step * step;
    c = c < CELLS ? c : CELLS - step;
    r = r < CELLS ? r : CELLS - step;
    float x = (float)(col - c) / (float)step, y = (float)(row - r) / (float)step;
    float sw = field_height_m(field, c, r), se = field_height_m(field, c + step, r);
    float nw = field_height_m(field, c, r + step), ne = field_height_m(field, c + step, r + step);
    float rising = sw + (y < x ? x * (se - sw) + y * (ne - se) : y * (nw - sw) + x * (ne - nw));
    float falling = x + y < 1.0f ? sw + x * (se - sw) + y * (nw - sw)
                                 : ne + (1.0f - x) * (nw - ne) + (1.0f - y) * (se - ne);
    float height_m = field_height_m(field, col, row);
    return fmaxf(fabsf(height_m - rising), fabsf(height_m - falling));
}

static void no_post_is_farther_from_a_patch_than_its_bound(void)
{
    struct field *field = open_field(CELLS);
    struct patches *patches = open_patches(field);
    for (int level = 0; patches && level < patches->levels - 1; level++) {
        int step = patch_step(patches, level) / 2, span = PATCH_CELLS * step;
        float nearest = INFINITY;
        for (int row = 0; row <= CELLS; row++)
            for (int col = 0; col <= CELLS; col++) {
                struct patch_id id = {level, col / span, row / span};
                id.col -= col == CELLS;
                id.row -= row == CELLS;
                float slack =
                    patches->all[patch_index(id)].error_m - off_by_m(field, col, row, step);
                nearest = fminf(nearest, slack);
            }
        CHECK(nearest >= -1e-3f);
    }
    patches_destroy(patches);
    field_destroy(field);
}

static void boxes_hold_their_ground(void)
{
    struct field *field = open_field(CELLS);
    struct patches *patches = open_patches(field);
    for (int level = 0; patches && level < patches->levels; level++)
        for (int i = 0; i < 3000; i++) {
            struct patch_id id = {level, below(1 << level), below(1 << level)};
            int span = PATCH_CELLS * patch_step(patches, level) / 2;
            int col = id.col * span + below(span + 1), row = id.row * span + below(span + 1);
            const struct patch_box *box = &patches->all[patch_index(id)].box;
            double height_m = (double)field_height_m(field, col, row), high_m = 10.0 + below(5000);
            struct sight on = sight_from(field, col, row, height_m);
            struct sight above = sight_from(field, col, row, height_m + high_m);
            CHECK(patch_box_distance_m(box, &on) == 0.0);
            CHECK(patch_box_distance_m(box, &above) <= high_m + 1e-6);
        }
    patches_destroy(patches);
    field_destroy(field);
}

/* Every place is in one patch, which is fine enough and could be no coarser. */
static void what_is_chosen_covers_the_field_once(void)
{
    struct field *field = open_field(CELLS);
    struct patches *patches = open_patches(field);
    struct patch_id chosen[1024];
    int most = 0, least = INT32_MAX;
    for (int i = 0; patches && i < 40; i++) {
        struct sight sight = sight_from(field, below(2 * CELLS), below(2 * CELLS), below(4000));
        double error_per_m = 1e-4 * (1 << i % 8), cells = 0.0;
        int count = patches_choose(patches, &sight, error_per_m, 1024, chosen);
        for (int k = 0; k < count; k++) {
            const struct patch_id id = chosen[k];
            const struct patch_id parent_id = {id.level - 1, id.col / 2, id.row / 2};
            const struct patch *patch = &patches->all[patch_index(id)];
            CHECK(id.level == patches->levels - 1 ||
                  (double)patch->error_m <=
                      error_per_m * patch_box_distance_m(&patch->box, &sight));
            const struct patch *parent = &patches->all[id.level > 0 ? patch_index(parent_id) : 0];
            CHECK(id.level == 0 || (double)parent->error_m >
                                       error_per_m * patch_box_distance_m(&parent->box, &sight));
            cells += pow(4.0, -id.level);
        }
        CHECK(cells == 1.0);
        CHECK_INT(patches_choose(patches, &sight, error_per_m, count - 1, chosen), -1);
        most = count > most ? count : most;
        least = count < least ? count : least;
    }
    CHECK(most > 4 * least); /* there was something to choose */
    patches_destroy(patches);
    field_destroy(field);
}

static void a_field_that_cannot_be_halved_is_told(void)
{
    struct field *field = open_field(3 * FIELD_ALIGNED);
    struct patches *patches = NULL;
    struct diag diag = {""};
    CHECK_INT(patches_create(field, &patches, &diag), -EINVAL);
    CHECK_CONTAINS(diag.text, "384 cells");
    patches_destroy(patches);
    field_destroy(field);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"no post is farther from a patch than its bound",
         no_post_is_farther_from_a_patch_than_its_bound},
        {"boxes hold their ground", boxes_hold_their_ground},
        {"what is chosen covers the field once", what_is_chosen_covers_the_field_once},
        {"a field that cannot be halved is told", a_field_that_cannot_be_halved_is_told},
    };
    return CHECK_MAIN(tests);
}
