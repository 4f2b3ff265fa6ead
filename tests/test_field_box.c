/* Boxes around parts of a field hold what is in them, and an eye is told of no less than it sees.
 */
#include "geo/geographic.h"
#include "render/field_box.h"
#include "tests/render_fixture.h"

#define CELLS 256
#define SPAN  32

static struct field *open_field(void)
{
    const struct reference_params params = {.shape = clipmap_shape_of_depth(64, 8, 18),
                                            .source = formula_create(rugged_ground),
                                            .jobs = 1};
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

/* A place on the ground, in ECEF and in the frame. */
static void ground_at(const struct field *field, const struct field_frame *frame, int col, int row,
                      double ret_ecef_m[3], double ret_m[3])
{
    field_place(field, col, row, (double)field_height_m(field, col, row), ret_ecef_m);
    for (int i = 0; i < 3; i++) {
        ret_m[i] = 0.0;
        for (int k = 0; k < 3; k++)
            ret_m[i] += frame->axes[i][k] * (ret_ecef_m[k] - frame->middle_ecef_m[k]);
    }
}

static void a_box_holds_the_ground_it_is_around(void)
{
    struct field *field = open_field();
    if (!field)
        return;
    struct field_frame frame = field_frame_of(field);
    double deepest_m = 0.0, ecef_m[3], at_m[3];
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            double dot = 0.0;
            for (int j = 0; j < 3; j++)
                dot += frame.axes[i][j] * frame.axes[k][j];
            CHECK_NEAR(dot, i == k, 1e-9);
        }
    for (int first = 0; first < CELLS; first += SPAN) {
        struct field_box box = field_box_of(field, &frame, first, CELLS - SPAN - first, SPAN);
        struct field_box twice =
            field_box_join(box, field_box_of(field, &frame, CELLS - SPAN - first, first, SPAN));
        for (int i = 0; i < (SPAN + 1) * (SPAN + 1); i++) {
            ground_at(field, &frame, first + i % (SPAN + 1), CELLS - SPAN - first + i / (SPAN + 1),
                      ecef_m, at_m);
            for (int k = 0; k < 3; k++) {
                CHECK(at_m[k] >= (double)box.least_m[k] && at_m[k] <= (double)box.most_m[k]);
                CHECK(box.least_m[k] >= twice.least_m[k] && box.most_m[k] <= twice.most_m[k]);
                deepest_m = fmax(deepest_m, (double)(box.most_m[k] - box.least_m[k]));
            }
        }
        double wide_m = SPAN * 38.0; /* posts are 27 to 38 m apart */
        CHECK((double)field_box_diagonal_m(&box) < 2.0 * wide_m);
    }
    CHECK(deepest_m > 0.0);
    field_destroy(field);
}

static void an_eye_is_told_of_no_less_than_it_sees(void)
{
    struct field *field = open_field();
    if (!field)
        return;
    struct field_frame frame = field_frame_of(field);
    int count[3] = {0};
    for (int pose = 0; pose < 12; pose++) {
        struct view view =
            view_at(46.5, 8.0, 1500.0 + 300.0 * pose, 30.0 * pose, -8.0 * pose, 15.0 * pose);
        struct field_eye eye = field_eye_of(&frame, &view);
        double eye_m[3];
        geocentric_from_geodetic(&view.eye, eye_m);
        for (int node = 0; node < CELLS / SPAN * (CELLS / SPAN); node++) {
            int col = node % (CELLS / SPAN) * SPAN, row = node / (CELLS / SPAN) * SPAN, inside = 0;
            struct field_box box = field_box_of(field, &frame, col, row, SPAN);
            enum field_seen seen = field_eye_sees(&eye, &box);
            double nearest2 = (double)field_eye_distance2(&eye, &box), least2 = INFINITY;
            for (int i = 0; i < (SPAN + 1) * (SPAN + 1); i++) {
                double ecef_m[3], at_m[3], enu_m[3], px[2], along_m;
                struct geodetic place;
                ground_at(field, &frame, col + i % (SPAN + 1), row + i / (SPAN + 1), ecef_m, at_m);
                geodetic_from_geocentric(ecef_m, &place);
                enu_from_geodetic(&view.eye, &place, enu_m);
                inside += view_project(&view, WIDTH, HEIGHT, enu_m, px, &along_m) && px[0] >= 0.0 &&
                          px[0] < WIDTH && px[1] >= 0.0 && px[1] < HEIGHT;
                double d2 = 0.0;
                for (int k = 0; k < 3; k++)
                    d2 += (ecef_m[k] - eye_m[k]) * (ecef_m[k] - eye_m[k]);
                least2 = fmin(least2, d2);
            }
            count[seen]++;
            CHECK(nearest2 <= least2);
            CHECK(sqrt(nearest2) > sqrt(least2) - 40.0 * SPAN);
            CHECK(seen != FIELD_UNSEEN || inside == 0);
            CHECK(seen != FIELD_SEEN || inside == (SPAN + 1) * (SPAN + 1));
        }
    }
    CHECK(count[FIELD_UNSEEN] > 100 && count[FIELD_CUT] > 20 && count[FIELD_SEEN] > 20);
    field_destroy(field);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"a box holds the ground it is around", a_box_holds_the_ground_it_is_around},
        {"an eye is told of no less than it sees", an_eye_is_told_of_no_less_than_it_sees},
    };
    return CHECK_MAIN(tests);
}
