/* Entities in the drawn frame: where they are, what hides them, which way they point. */
#include "geo/frames.h"
#include "tests/render_fixture.h"

#define LAT_DEG  46.5
#define LON_DEG  8.0
#define EYE_M    400.0
#define GROUND_M 100.0

static uint32_t without[WIDTH * HEIGHT], with[WIDTH * HEIGHT];

/* A wall to the north of the eye, 300 m above the ground, from 450 m on. */
static double walled_ground(double lat_deg, double lon_deg)
{
    (void)lon_deg;
    return lat_deg > LAT_DEG + 0.004 && lat_deg < LAT_DEG + 0.006 ? 700.0 : GROUND_M;
}

static struct view looking_north(void)
{
    return view_at(LAT_DEG, LON_DEG, EYE_M, 0.0, 0.0, 0.0);
}

static struct render_entity entity_at(const struct view *view, double east_m, double north_m,
                                      double up_m, double heading_deg)
{
    const double enu_m[3] = {east_m, north_m, up_m};
    struct geodetic place;
    struct render_entity entity = {.shape = ENTITY_ARROW,
                                   .length_m = 15.0f,
                                   .width_m = 12.0f,
                                   .height_m = 4.0f,
                                   .alpha = 1.0f};
    geodetic_from_enu(&view->eye, enu_m, &place);
    geocentric_from_geodetic(&place, entity.ecef_m);
    entity.ecef_from_body =
        ecef_quaternion_from_attitude(&place, &(struct attitude){.heading_deg = heading_deg});
    return entity;
}

static struct render_entity twice_as_large(struct render_entity entity)
{
    entity.length_m *= 2.0f;
    entity.width_m *= 2.0f;
    entity.height_m *= 2.0f;
    return entity;
}

/* The pixels that entities change. */
struct change {
    int count, left, right, bottom, top; /* inclusive */
    double col, row;                     /* the mean of them */
};

static struct change change_by(struct scene_under_test *scene, const struct view *view,
                               const struct render_entity *entities, size_t count)
{
    struct change change = {.left = WIDTH, .right = -1, .bottom = HEIGHT, .top = -1};
    struct view drawn = *view;
    renderer_set_entities(scene->renderer, NULL, 0);
    draw(scene, &drawn, NULL, without, NULL);
    renderer_set_entities(scene->renderer, entities, count);
    draw(scene, &drawn, NULL, with, NULL);
    for (int row = 0; row < HEIGHT; row++)
        for (int col = 0; col < WIDTH; col++) {
            if (with[row * WIDTH + col] == without[row * WIDTH + col])
                continue;
            change.count++;
            change.col += col;
            change.row += row;
            change.left = col < change.left ? col : change.left;
            change.right = col > change.right ? col : change.right;
            change.bottom = row < change.bottom ? row : change.bottom;
            change.top = row > change.top ? row : change.top;
        }
    change.col /= change.count;
    change.row /= change.count;
    return change;
}

/* Where a place is in the picture; its pixel's middle is half of one. */
static void pixel_of(const struct view *view, double east_m, double north_m, double up_m,
                     double ret_px[2])
{
    const double enu_m[3] = {east_m, north_m, up_m};
    double along_m;
    CHECK(view_project(view, WIDTH, HEIGHT, enu_m, ret_px, &along_m));
}

/* A box 10 m long to the north, 20 wide, 8 high, 100 m ahead, 30 m to the right: all of its nearer
 * side is seen, which fills its projection but for what of the left side is seen as well. */
static void an_entity_is_where_it_should_be(void)
{
    struct scene_under_test scene = {0};
    if (!open_scene(flat_ground, 32, NULL, &scene))
        return;
    struct view view = looking_north();
    struct render_entity box = entity_at(&view, 30.0, 100.0, 0.0, 0.0);
    box.shape = ENTITY_BOX;
    box.length_m = 10.0f;
    box.width_m = 20.0f;
    box.height_m = 8.0f;
    struct change change = change_by(&scene, &view, &box, 1);
    double near_low[2], near_high[2], far_low[2];
    pixel_of(&view, 40.0, 95.0, 8.0, near_high);
    pixel_of(&view, 20.0, 95.0, 0.0, near_low);
    pixel_of(&view, 20.0, 105.0, 0.0, far_low);
    CHECK_NEAR(change.left, far_low[0], 1.0);
    CHECK_NEAR(change.right, near_high[0] - 1.0, 1.0);
    CHECK_NEAR(change.bottom, near_low[1], 1.0);
    CHECK_NEAR(change.top, near_high[1] - 1.0, 1.0);
    double area = (near_high[0] - near_low[0]) * (near_high[1] - near_low[1]);
    CHECK(change.count > 0.9 * area);
    struct render_entity unseen = box;
    unseen.alpha = 0.0f;
    CHECK_INT(change_by(&scene, &view, &unseen, 1).count, 0);
    close_scene(&scene);
}

static void terrain_hides_what_is_behind_it(void)
{
    struct scene_under_test scene = {0};
    if (!open_scene(walled_ground, 64, NULL, &scene))
        return;
    struct view view = looking_north();
    const struct render_entity before = twice_as_large(entity_at(&view, 0.0, 300.0, 0.0, 90.0));
    const struct render_entity behind = twice_as_large(entity_at(&view, 0.0, 900.0, 0.0, 90.0));
    const struct render_entity above = twice_as_large(entity_at(&view, 0.0, 900.0, 700.0, 90.0));
    CHECK(change_by(&scene, &view, &before, 1).count > 30);
    CHECK_INT(change_by(&scene, &view, &behind, 1).count, 0);
    view = view_at(LAT_DEG, LON_DEG, EYE_M, 0.0, 35.0, 0.0); /* over the wall */
    CHECK(change_by(&scene, &view, &above, 1).count > 3);
    close_scene(&scene);
}

/* Seen from above an arrow-head is widest at its tail: the middle of its pixels lies behind its
 * place. */
static void the_nose_points_where_it_is_headed(void)
{
    struct scene_under_test scene = {0};
    if (!open_scene(flat_ground, 32, NULL, &scene))
        return;
    struct view view = view_at(LAT_DEG, LON_DEG, EYE_M, 0.0, -90.0, 0.0); /* up is north */
    static const double noses[4][2] = {{0, 1}, {1, 0}, {0, -1}, {-1, 0}};
    for (int i = 0; i < 4; i++) {
        struct render_entity arrow = entity_at(&view, 0.0, 0.0, -60.0, 90.0 * i);
        struct change change = change_by(&scene, &view, &arrow, 1);
        double along = (change.col - (WIDTH - 1) / 2.0) * noses[i][0] +
                       (change.row - (HEIGHT - 1) / 2.0) * noses[i][1];
        double aside = (change.col - (WIDTH - 1) / 2.0) * noses[i][1] +
                       (change.row - (HEIGHT - 1) / 2.0) * noses[i][0];
        CHECK(change.count > 200);
        CHECK_NEAR(along, -6.0, 3.0);
        CHECK_NEAR(aside, 0.0, 1.0);
    }
    close_scene(&scene);
}

/* Of two in a line the nearer one is seen, in whatever order they come. */
static void entities_hide_each_other(void)
{
    struct scene_under_test scene = {0};
    if (!open_scene(flat_ground, 32, NULL, &scene))
        return;
    static uint32_t first[WIDTH * HEIGHT];
    struct view view = looking_north();
    struct render_entity two[2] = {entity_at(&view, 0.0, 100.0, 0.0, 90.0),
                                   entity_at(&view, 0.0, 200.0, -3.0, 0.0)};
    two[1].shape = ENTITY_BOX;
    change_by(&scene, &view, two, 2);
    memcpy(first, with, sizeof(first));
    struct render_entity was = two[0];
    two[0] = two[1];
    two[1] = was;
    change_by(&scene, &view, two, 2);
    CHECK(memcmp(first, with, sizeof(first)) == 0);
    int both = change_by(&scene, &view, two, 2).count;
    CHECK(both > change_by(&scene, &view, &two[1], 1).count);
    CHECK(both <
          change_by(&scene, &view, &two[1], 1).count + change_by(&scene, &view, &two[0], 1).count);
    close_scene(&scene);
}

/* A grid of them, 3 m boxes 300 m ahead. */
static void so_many_are_drawn_and_none_beyond(void)
{
    struct scene_under_test scene = {0};
    if (!open_scene(flat_ground, 32, NULL, &scene))
        return;
    static struct render_entity many[ENTITIES_MAX + 1];
    struct view view = looking_north();
    for (int i = 0; i <= ENTITIES_MAX; i++) {
        many[i] = entity_at(&view, 10.0 * (i % 16 - 8), 300.0, 10.0 * (double)(i / 16 - 8), 0.0);
        many[i].shape = ENTITY_BOX;
        many[i].length_m = many[i].width_m = many[i].height_m = 5.0f;
    }
    change_by(&scene, &view, many, ENTITIES_MAX + 1);
    int missing = 0;
    for (int i = 0; i <= ENTITIES_MAX; i++) {
        double px[2];
        pixel_of(&view, 10.0 * (i % 16 - 8), 300.0, 10.0 * (double)(i / 16 - 8) + 2.5, px);
        int at = (int)px[1] * WIDTH + (int)px[0];
        missing += with[at] == without[at];
    }
    CHECK_INT(missing, 1);
    CHECK_INT(change_by(&scene, &view, &many[ENTITIES_MAX], 1).count > 0, 1);
    close_scene(&scene);
}

/* The first frame, for which the pass is made ready, and those after some were seen. */
static void without_entities_the_picture_is_the_same(void)
{
    struct scene_under_test fresh = {0}, used = {0};
    if (!open_scene(flat_ground, 32, NULL, &fresh) || !open_scene(flat_ground, 32, NULL, &used))
        return;
    struct view view = looking_north(), again = view;
    static uint32_t never[WIDTH * HEIGHT];
    draw(&fresh, &view, NULL, never, NULL);
    const struct render_entity arrow = entity_at(&again, 0.0, 100.0, 0.0, 0.0);
    CHECK(change_by(&used, &again, &arrow, 1).count > 0);
    CHECK(memcmp(never, without, sizeof(never)) == 0);
    renderer_set_entities(used.renderer, NULL, 0);
    draw(&used, &again, NULL, with, NULL);
    CHECK(memcmp(never, with, sizeof(never)) == 0);
    close_scene(&fresh);
    close_scene(&used);
}

/* Pixels that are shaded sample by sample hide as much of an entity as of their samples lies before
 * it. */
static void several_samples_hide_as_one_does(void)
{
    struct scene_under_test scene = {0};
    if (!open_scene_over(formula_create(walled_ground), 64, 4, NULL, &scene))
        return;
    struct view view = looking_north();
    const struct render_entity before = twice_as_large(entity_at(&view, 0.0, 300.0, 0.0, 90.0));
    const struct render_entity behind = twice_as_large(entity_at(&view, 0.0, 900.0, 0.0, 90.0));
    CHECK(change_by(&scene, &view, &before, 1).count > 30);
    CHECK_INT(change_by(&scene, &view, &behind, 1).count, 0);
    close_scene(&scene);
}

/* As on a GPU: depth is another texture there. */
static void where_compute_shaders_draw_it_is_the_same(void)
{
    in_compute = true;
    an_entity_is_where_it_should_be();
    terrain_hides_what_is_behind_it();
    the_nose_points_where_it_is_headed();
    so_many_are_drawn_and_none_beyond();
    without_entities_the_picture_is_the_same();
    in_compute = false;
}

int main(void)
{
    static const struct check_test tests[] = {
        {"an entity is where it should be", an_entity_is_where_it_should_be},
        {"terrain hides what is behind it", terrain_hides_what_is_behind_it},
        {"the nose points where it is headed", the_nose_points_where_it_is_headed},
        {"entities hide each other", entities_hide_each_other},
        {"so many are drawn, and none beyond", so_many_are_drawn_and_none_beyond},
        {"without entities the picture is the same", without_entities_the_picture_is_the_same},
        {"several samples hide as one does", several_samples_hide_as_one_does},
        {"where compute shaders draw it is the same", where_compute_shaders_draw_it_is_the_same},
    };
    return render_tests_main(tests, sizeof(tests) / sizeof(tests[0]), check_main);
}
