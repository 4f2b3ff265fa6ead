/* What geomipmap works out beforehand: errors of levels, and what can be seen from where. */
#include "render/technique_geomipmap_errors.h"
#include "render/technique_geomipmap_pvs.h"
#include "tests/render_fixture.h"

#define CELLS 512

/* Long ridges with valleys between them: much is hidden. */
static double ridges(double lat_deg, double lon_deg)
{
    return rugged_ground(lat_deg, lon_deg) * 0.05 + 400.0 * sin(400.0 * lat_deg);
}

static struct field *open_field(double (*height_m)(double, double))
{
    const struct reference_params params = {
        .shape = clipmap_shape_of_depth(64, 8, 19), .source = formula_create(height_m), .jobs = 2};
    const struct geodetic middle = {46.5, 8.0, 0.0};
    struct reference *reference = NULL;
    struct field *field = NULL;
    struct diag diag = {""};
    CHECK_INT(reference_create(&params, &reference), 0);
    if (field_create(reference, &middle, CELLS, &field, &diag) < 0)
        CHECK_FAIL("%s", diag.text);
    reference_destroy(reference);
    terrain_source_destroy(params.source);
    return field;
}

/* A level's triangles at a post, worked out from the corners of the square around it. */
static double level_height(const struct field *field, int col, int row, int level)
{
    int step = 1 << level, c0 = col - col % step, r0 = row - row % step;
    double x = (double)(col - c0) / step, y = (double)(row - r0) / step;
    int east = c0 + step > CELLS ? c0 : c0 + step, north = r0 + step > CELLS ? r0 : r0 + step;
    double sw = (double)field_height_m(field, c0, r0), se = (double)field_height_m(field, east, r0);
    double nw = (double)field_height_m(field, c0, north);
    double ne = (double)field_height_m(field, east, north);
    if (((c0 / step ^ r0 / step) & 1) != 0)
        return x + y < 1.0 ? sw + x * (se - sw) + y * (nw - sw)
                           : ne + (1.0 - x) * (nw - ne) + (1.0 - y) * (se - ne);
    return y < x ? sw + x * (se - sw) + y * (ne - se) : sw + y * (nw - sw) + x * (ne - nw);
}

static void a_levels_worst_post_is_its_worst(void)
{
    struct field *field = open_field(rugged_ground);
    if (!field)
        return;
    struct field_frame frame = field_frame_of(field);
    struct patch_errors *errors = patch_errors_create(field, &frame);
    CHECK(errors != NULL);
    for (int patch = 0; errors && patch < CELLS / PATCH_CELLS * (CELLS / PATCH_CELLS); patch += 37)
        for (int level = 1; level < PATCH_LEVELS; level++) {
            int col = patch % (CELLS / PATCH_CELLS) * PATCH_CELLS, worst_col = 0;
            int row = patch / (CELLS / PATCH_CELLS) * PATCH_CELLS, worst_row = 0;
            double worst_m = -1.0, at_m[3];
            for (int i = 0; i < (PATCH_CELLS + 1) * (PATCH_CELLS + 1); i++) {
                int c = col + i % (PATCH_CELLS + 1), r = row + i / (PATCH_CELLS + 1);
                double error_m =
                    fabs(level_height(field, c, r, level) - (double)field_height_m(field, c, r));
                if (error_m > worst_m) {
                    worst_m = error_m;
                    worst_col = c;
                    worst_row = r;
                }
            }
            field_frame_place(&frame, field, worst_col, worst_row,
                              (double)field_height_m(field, worst_col, worst_row), at_m);
            CHECK_NEAR((double)errors[patch].levels[level - 1].error_m, worst_m, 1e-3);
            for (int k = 0; k < 3; k++)
                CHECK_NEAR((double)errors[patch].levels[level - 1].at_m[k], at_m[k], 0.01);
        }
    free(errors);
    field_destroy(field);
}

/* Whether a straight line in the frame is above the ground all along, by its triangles at places a
 * third of a post apart. */
static bool is_seen(const struct field *field, const double from[3], const double to[3])
{
    int steps = 1 + (int)(3.0 * fmax(fabs(to[0] - from[0]), fabs(to[1] - from[1])));
    for (int i = 1; i < steps; i++) {
        double t = (double)i / steps, col = from[0] + t * (to[0] - from[0]);
        double row = from[1] + t * (to[1] - from[1]), height_m = from[2] + t * (to[2] - from[2]);
        int c = (int)col, r = (int)row;
        double x = col - c, y = row - r;
        double south = (double)field_height_m(field, c, r) * (1.0 - x) +
                       (double)field_height_m(field, c + 1, r) * x;
        double north = (double)field_height_m(field, c, r + 1) * (1.0 - x) +
                       (double)field_height_m(field, c + 1, r + 1) * x;
        if (height_m < south * (1.0 - y) + north * y - 1.0)
            return false;
    }
    return true;
}

/* The field is 17 km wide, so that the Earth curves away by less than 6 m from its middle: heights
 * above the ellipsoid and in the frame are taken for the same, and 1 m of doubt stays on the line.
 */
static void what_can_be_seen_is_in_the_set(void)
{
    struct field *field = open_field(ridges);
    struct field_boxes boxes = {0};
    struct pvs pvs = {0};
    if (!field)
        return;
    CHECK_INT(field_boxes_create(field, PATCH_CELLS, &boxes), 0);
    CHECK_INT(pvs_create(field, &boxes, &pvs), 0);
    CHECK_INT(pvs.along, 32);
    int seen = 0, hidden = 0, unseen = 0;
    for (int i = 0; i < 20000 && pvs.first_layer; i++) {
        unsigned a = (unsigned)i * 2654435761u, b = ((unsigned)i + 7919u) * 2246822519u;
        double from[3] = {(a >> 8) % (CELLS - 1) + 0.5, (a >> 20) % (CELLS - 1) + 0.5, 0.0};
        double to[3] = {(b >> 8) % (CELLS - 1), (b >> 20) % (CELLS - 1), 0.0}, eye_m[3];
        from[2] = (double)field_height_m(field, (int)from[0], (int)from[1]) + 60.0 + i % 7 * 40.0;
        to[2] = (double)field_height_m(field, (int)to[0], (int)to[1]) + 0.1;
        field_frame_place(&boxes.frame, field, from[0], from[1], from[2], eye_m);
        const uint8_t *first = pvs_from(&pvs, field, from);
        int square = (int)to[1] / PATCH_CELLS * pvs.along + (int)to[0] / PATCH_CELLS;
        bool in = first[square] <= pvs_layer(&pvs, (float)eye_m[2]);
        bool is = is_seen(field, from, to);
        CHECK(in || !is);
        seen += is;
        hidden += !in;
        unseen += !is;
    }
    CHECK(seen > 1000);
    CHECK(hidden > unseen / 4);
    const double beside[2] = {-1.0, 5.0};
    CHECK(pvs_from(&pvs, field, beside) == NULL);
    pvs_destroy(&pvs);
    CHECK(pvs_from(&pvs, field, (const double[2]){5.0, 5.0}) == NULL);
    field_boxes_destroy(&boxes);
    field_destroy(field);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"a level's worst post is its worst", a_levels_worst_post_is_its_worst},
        {"what can be seen is in the set", what_can_be_seen_is_in_the_set},
    };
    return CHECK_MAIN(tests);
}
