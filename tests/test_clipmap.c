#include "geo/cube.h"
#include "terrain/window_filler.h"
#include "tests/check.h"

static uint32_t random_state = 1;

static double random_between(double low, double high)
{
    random_state = random_state * 1664525u + 1013904223u;
    return low + (high - low) * (random_state >> 8) / 16777216.0;
}

static void random_normal(double ret[3])
{
    cube_normal_from_geodetic(asin(random_between(-1, 1)) * 180.0 / M_PI, random_between(-180, 180),
                              ret);
}

/* Every so often near a corner, an edge or the middle of a face. */
static void interesting_normal(int i, double ret[3])
{
    static const double angles[] = {-0.25, 0.0, 0.25};
    double xi = angles[i % 3] * M_PI + random_between(-0.02, 0.02) * (i % 2);
    double eta = angles[i / 3 % 3] * M_PI + random_between(-0.02, 0.02) * (i % 2);
    if (i % 5 == 4)
        random_normal(ret);
    else
        cube_normal(i % CUBE_FACES, xi, eta, ret);
}

#define SHAPES 10
static struct clipmap_shape shapes[SHAPES];

static void a_cap_s_posts_fit_into_the_storage(void)
{
    int too_wide = 0, too_large = 0, missing = 0, levels = 0;
    for (size_t s = 0; s < SHAPES; s++)
        for (int i = 0; i < 3000; i++) {
            struct clipmap_cap cap;
            int level = i % shapes[s].levels;
            interesting_normal(i, cap.normal);
            cap.radius = clipmap_reach(&shapes[s], level, cap.normal).cap;
            struct clipmap_pane panes[CLIPMAP_PANES];
            clipmap_panes(&shapes[s], level, &cap, panes);
            int any = 0;
            size_t half_posts = 0;
            for (int p = 0; p < CLIPMAP_PANES; p++) {
                any += panes[p].posts.rows > 0;
                half_posts += (size_t)(2 * panes[p].posts.rows + 1) *
                              (size_t)(2 * panes[p].posts.cols + 1); /* grown by one all around */
                too_wide += panes[p].posts.rows > clipmap_storage(&shapes[s]) ||
                            panes[p].posts.cols > clipmap_storage(&shapes[s]);
                missing += panes[p].face % CLIPMAP_PANES != p;
            }
            missing += any == 0;
            too_large += half_posts > window_filler_half_posts(&shapes[s]);
            levels++;
        }
    CHECK_INT(too_wide, 0);
    CHECK_INT(too_large, 0);
    CHECK_INT(missing, 0);
    CHECK_INT(levels, 30000);
}

/* As one that has dug all of the Earth asks for. */
static void a_cap_wider_than_a_window_has_all_posts(void)
{
    for (double radius = 0.7; radius <= 2.0; radius += 0.65)
        for (int face = 0; face < CUBE_FACES; face++) {
            struct clipmap_cap cap = {.radius = radius};
            random_normal(cap.normal);
            struct clipmap_rect posts = clipmap_cap_posts(&shapes[0], 10, face, &cap);
            CHECK(posts.row0 <= 0 && posts.col0 <= 0);
            CHECK(posts.row0 + posts.rows > clipmap_cells(&shapes[0], 10));
            CHECK(posts.col0 + posts.cols > clipmap_cells(&shapes[0], 10));
        }
}

/* The middle and the corners of a block; col and row count blocks. */
static double block_points(const struct clipmap_shape *shape, int level, int face, int32_t col,
                           int32_t row, double ret_middle[3], double ret_corners[4][3])
{
    double step = clipmap_step_rad(shape, level), farthest = 0.0;
    double first_xi = col * shape->block * step - M_PI / 4.0, side = shape->block * step;
    double first_eta = row * shape->block * step - M_PI / 4.0;
    cube_normal(face, first_xi + 0.5 * side, first_eta + 0.5 * side, ret_middle);
    for (int i = 0; i < 4; i++) {
        cube_normal(face, first_xi + (i & 1) * side, first_eta + (i >> 1) * side, ret_corners[i]);
        farthest = fmax(farthest, cube_chord(ret_middle, ret_corners[i]));
    }
    return farthest;
}

/* Within what is drawn of a level no block is larger than its bound says. */
static void blocks_are_as_small_as_they_are_said_to_be(void)
{
    int larger = 0, met = 0;
    double closest = 0.0;
    for (size_t s = 0; s < SHAPES; s++)
        for (int i = 0; i < 4000; i++) {
            const struct clipmap_shape *shape = &shapes[s];
            int level = i % (shape->levels - 1);
            double eye[3], middle[3], corners[4][3];
            interesting_normal(i, eye);
            struct clipmap_reach reach = clipmap_reach(shape, level, eye);
            int face = cube_face_of(eye);
            double xi, eta, side = shape->block * clipmap_step_rad(shape, level);
            cube_angles(face, eye, &xi, &eta);
            xi += random_between(-1, 1) * reach.end;
            eta += random_between(-1, 1) * reach.end;
            int32_t last = clipmap_cells(shape, level) / shape->block - 1;
            int32_t col = (int32_t)floor((xi + M_PI / 4.0) / side);
            int32_t row = (int32_t)floor((eta + M_PI / 4.0) / side);
            if (col < 0 || row < 0 || col > last || row > last)
                continue;
            double farthest = block_points(shape, level, face, col, row, middle, corners);
            larger += farthest > reach.block;
            closest = fmax(closest, farthest / reach.block);
            met++;
        }
    CHECK_INT(larger, 0);
    CHECK(met > 8000);
    CHECK(closest > 0.98);
}

/* What select.comp is told of a level, on the face of an eye `up` above it. */
struct selection {
    double block, ends; /* `ends`: of the next finer level */
    struct clipmap_rect near;
};

static void select_levels(const struct clipmap_shape *shape, const double eye[3], double up,
                          const double *ends, int face, struct selection *ret)
{
    struct clipmap_reach reaches[CLIPMAP_MAX_LEVELS];
    clipmap_reaches(shape, eye, reaches);
    for (int level = 1; level < shape->levels; level++) {
        double block = reaches[level].block, end = ends[level - 1];
        double across = sqrt(fmax(end * end - up * up, 0.0)) + block;
        ret[level] =
            (struct selection){block, end, clipmap_near_blocks(shape, level, face, eye, across)};
    }
}

/* The arithmetic that select.comp does, on one face around an eye. */
static bool is_split(const struct clipmap_shape *shape, int level, const double eye[3], double up,
                     const struct selection *selection, int face, int32_t col, int32_t row)
{
    double middle[3], side = shape->block * clipmap_step_rad(shape, level);
    cube_normal(face, (col + 0.5) * side - M_PI / 4.0, (row + 0.5) * side - M_PI / 4.0, middle);
    double across = fmax(cube_chord(middle, eye) - selection->block, 0.0);
    return hypot(across, up) < selection->ends;
}

/* Whether a block that is split is among those that are looked at. */
static bool is_looked_at(struct clipmap_rect near, int32_t col, int32_t row)
{
    return row >= near.row0 && row < near.row0 + near.rows && col >= near.col0 &&
           col < near.col0 + near.cols;
}

static int overlooked;

/* Goes down to the leaf that has a place; returns its level. */
static int leaf_at(const struct clipmap_shape *shape, const double eye[3], double up,
                   const struct selection *selection, int face, double xi, double eta)
{
    int level = shape->levels - 1;
    for (; level > 0; level--) {
        double side = shape->block * clipmap_step_rad(shape, level);
        int32_t col = (int32_t)floor((xi + M_PI / 4.0) / side);
        int32_t row = (int32_t)floor((eta + M_PI / 4.0) / side);
        if (!is_split(shape, level, eye, up, &selection[level], face, col, row))
            return level;
        overlooked += !is_looked_at(selection[level].near, col, row);
    }
    return level;
}

/* On the line between two leaves the finer one shows the coarser one's heights, and that one its
 * own: for any eye, and for caps that trail behind it in any way. */
static void neighbours_differ_by_one_level_and_agree(void)
{
    int steps = 0, disagree = 0, borders = 0;
    for (int i = 0; i < 1200; i++) {
        const struct clipmap_shape *shape = &shapes[i % SHAPES];
        struct clipmap_cap caps[CLIPMAP_MAX_LEVELS];
        double eye[3], ends[CLIPMAP_MAX_LEVELS], xi, eta;
        interesting_normal(i, eye);
        int face = cube_face_of(eye);
        cube_angles(face, eye, &xi, &eta);
        for (int level = 0; level < shape->levels; level++) {
            double step = clipmap_step_rad(shape, level);
            double lag = i % 3 ? 0.0 : random_between(0, 60) * step;
            cube_normal(face, xi + lag, eta, caps[level].normal);
            caps[level].radius = clipmap_reach(shape, level, eye).cap;
            if (i % 7 == 0 && random_between(0, 1) < 0.1)
                caps[level].radius *= random_between(0, 1);
        }
        clipmap_ends(shape, caps, eye, 1.0, ends);
        /* A walk outwards, over all levels. */
        double way = random_between(-M_PI, M_PI), up = i % 2 ? 0.0 : random_between(0, 1) * ends[3];
        double turn_xi = cos(way), turn_eta = sin(way);
        struct selection selection[CLIPMAP_MAX_LEVELS];
        select_levels(shape, eye, up, ends, face, selection);
        double at = 0.5 * clipmap_step_rad(shape, 0), before = 0.0;
        int last = -1;
        while (at < 0.35) {
            double a = xi + at * turn_xi, b = eta + at * turn_eta, place[3];
            if (fabs(a) >= M_PI / 4.0 || fabs(b) >= M_PI / 4.0)
                break;
            int level = leaf_at(shape, eye, up, selection, face, a, b);
            if (last >= 0 && level != last) {
                /* Somewhere between the two samples is the border. */
                int coarse = level > last ? level : last, fine = level > last ? last : level;
                double least, most;
                cube_normal(face, xi + before * turn_xi, eta + before * turn_eta, place);
                least = hypot(cube_chord(place, eye), up);
                cube_normal(face, a, b, place);
                most = hypot(cube_chord(place, eye), up);
                borders++;
                steps += coarse - fine > 1;
                disagree += most < ends[fine];
                if (coarse < shape->levels - 1)
                    disagree += least > (1.0 - CLIPMAP_BLEND) * ends[coarse];
            }
            last = level;
            before = at;
            at += 0.5 * clipmap_step_rad(shape, level);
        }
    }
    CHECK_INT(steps, 0);
    CHECK_INT(disagree, 0);
    CHECK_INT(overlooked, 0);
    CHECK(borders > 8000);
}

/* With everything held, levels end where they are meant to. */
static void what_is_held_does_not_shorten_a_level(void)
{
    int shortened = 0;
    for (int i = 0; i < 2000; i++) {
        const struct clipmap_shape *shape = &shapes[i % SHAPES];
        struct clipmap_cap caps[CLIPMAP_MAX_LEVELS];
        double eye[3], ends[CLIPMAP_MAX_LEVELS];
        interesting_normal(i, eye);
        for (int level = 0; level < shape->levels; level++) {
            struct clipmap_reach reach = clipmap_reach(shape, level, eye);
            memcpy(caps[level].normal, eye, sizeof(eye));
            caps[level].normal[i % 3] += 0.9 * reach.lag;
            caps[level].radius = reach.cap;
        }
        clipmap_ends(shape, caps, eye, 1.0, ends);
        for (int level = 0; level < shape->levels - 1; level++)
            shortened += ends[level] < 0.9999 * clipmap_reach(shape, level, eye).end;
    }
    CHECK_INT(shortened, 0);
}

static void uncovered_rectangles_complete_the_new_window(void)
{
    enum { SIDE = 40 };
    int wrong = 0;
    for (int i = 0; i < 3000; i++) {
        struct clipmap_rect rects[4], both[2];
        for (int k = 0; k < 2; k++)
            both[k] = (struct clipmap_rect){(int32_t)random_between(0, 20),
                                            (int32_t)random_between(0, 20),
                                            (int)random_between(0, 20), (int)random_between(0, 20)};
        int count = clipmap_uncovered(both[0], both[1], rects);
        for (int row = 0; row < SIDE; row++)
            for (int col = 0; col < SIDE; col++) {
                const struct clipmap_rect place = {row, col, 1, 1};
                int held = clipmap_common(both[0], place).rows, covered = 0;
                int wanted = clipmap_common(both[1], place).rows;
                for (int k = 0; k < count; k++)
                    covered += clipmap_common(rects[k], place).rows;
                wrong += covered != (wanted && !held);
            }
    }
    CHECK_INT(wrong, 0);
}

static void the_finest_level_follows_the_height(void)
{
    double normal[3];
    interesting_normal(4, normal);
    for (size_t s = 0; s < SHAPES; s++) {
        int last = 0;
        for (double height_m = -50.0; height_m < 4e7; height_m = fmax(1.0, height_m * 1.3)) {
            int level = clipmap_finest_level(&shapes[s], normal, height_m);
            CHECK(level >= last && level < shapes[s].levels);
            if (level > 0)
                CHECK(height_m >=
                      clipmap_reach(&shapes[s], level - 1, normal).end * 6378137.0 * 0.999999);
            last = level;
        }
        CHECK_INT(last, shapes[s].levels - 1);
    }
}

static void the_coarsest_level_reaches_the_horizon_from_400_km(void)
{
    for (size_t s = 0; s < SHAPES; s++) {
        int top = shapes[s].levels - 1;
        double normal[3];
        for (int i = 0; i < 200; i++) {
            interesting_normal(i, normal);
            struct clipmap_reach reach = clipmap_reach(&shapes[s], top, normal);
            double horizon = acos(6356.0 / (6356.0 + 400.0)) + acos(6356.0 / (6356.0 + 9.0));
            CHECK(reach.cap - 2.0 * reach.block > 2.0 * sin(0.5 * horizon));
        }
    }
}

int main(void)
{
    shapes[0] = clipmap_shape(64, 8, 90.0 / (1 << 23));
    shapes[1] = clipmap_shape(128, 16, 90.0 / (1 << 23));
    shapes[2] = clipmap_shape(32, 4, 90.0 / (1 << 20));
    shapes[3] = clipmap_shape(128, 8, 90.0 / (1 << 25));
    shapes[4] = clipmap_shape(256, 8, 90.0 / (1 << 23));
    shapes[5] = clipmap_shape(512, 16, 90.0 / (1 << 23));
    shapes[6] = clipmap_shape(512, 8, 90.0 / (1 << 23));
    shapes[7] = clipmap_shape(256, 16, 90.0 / (1 << 23));
    shapes[8] = clipmap_shape(64, 4, 90.0 / (1 << 23));
    shapes[9] = clipmap_shape(1024, 16, 90.0 / (1 << 23));
    static const struct check_test tests[] = {
        {"a cap's posts fit into the storage", a_cap_s_posts_fit_into_the_storage},
        {"a cap wider than a window has all posts", a_cap_wider_than_a_window_has_all_posts},
        {"blocks are as small as they are said to be", blocks_are_as_small_as_they_are_said_to_be},
        {"neighbours differ by one level and agree", neighbours_differ_by_one_level_and_agree},
        {"what is held does not shorten a level", what_is_held_does_not_shorten_a_level},
        {"uncovered rectangles complete the new window",
         uncovered_rectangles_complete_the_new_window},
        {"the finest level follows the height", the_finest_level_follows_the_height},
        {"the coarsest level reaches the horizon from 400 km",
         the_coarsest_level_reaches_the_horizon_from_400_km},
    };
    return CHECK_MAIN(tests);
}
