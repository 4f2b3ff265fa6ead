#include "terrain/clipmap.h"
#include "tests/check.h"

static uint32_t random_state = 1;

static double random_between(double low, double high)
{
    random_state = random_state * 1664525u + 1013904223u;
    return low + (high - low) * (random_state >> 8) / 16777216.0;
}

static const struct clipmap_shape shapes[] = {
    {.n = 15, .levels = 6, .step_deg = 1e-3},   {.n = 63, .levels = 9, .step_deg = 1e-5},
    {.n = 127, .levels = 15, .step_deg = 1e-5}, {.n = 255, .levels = 9, .step_deg = 1e-5},
    {.n = 511, .levels = 7, .step_deg = 1e-5},
};
#define SHAPES (sizeof(shapes) / sizeof(shapes[0]))

static void windows_nest_and_stay_about_the_eye(void)
{
    int wrong_nesting = 0, odd = 0, far = 0;
    for (size_t s = 0; s < SHAPES; s++) {
        const struct clipmap_shape *shape = &shapes[s];
        int m = clipmap_m(shape), n = shape->n;
        for (int i = 0; i < 2000; i++) {
            double lat = random_between(-80, 80), lon = random_between(-540, 540);
            double factor = clipmap_lon_factor(lat, 0);
            struct clipmap_layout layout;
            clipmap_place(shape, lat, lon, factor, &layout);
            for (int k = 0; k < shape->levels; k++) {
                struct clipmap_window w = layout.windows[k];
                double step = ldexp(shape->step_deg, k);
                odd += (w.row0 & 1) || (w.col0 & 1);
                far += fabs(lat / step - w.row0 - (n - 1) / 2.0) > 2.0;
                far += fabs(lon / (step * factor) - w.col0 - (n - 1) / 2.0) > 2.0;
                if (k == 0)
                    continue;
                int dr = layout.windows[k - 1].row0 / 2 - w.row0 - m;
                int dc = layout.windows[k - 1].col0 / 2 - w.col0 - m;
                wrong_nesting += dr < 0 || dr > 1 || dc < 0 || dc > 1;
            }
        }
    }
    CHECK_INT(odd, 0);
    CHECK_INT(far, 0);
    CHECK_INT(wrong_nesting, 0);
}

static void coverage(const struct clipmap_shape *shape, const struct clipmap_layout *layout,
                     int level, bool hole, int *ret_wrong)
{
    int cells = shape->n - 1;
    unsigned char *covered = calloc((size_t)cells * (size_t)cells, 1);
    struct clipmap_block blocks[CLIPMAP_MAX_BLOCKS];
    int count = clipmap_blocks(shape, layout, level, hole, blocks);
    for (int b = 0; b < count; b++)
        for (int r = 0; r < blocks[b].rows; r++)
            for (int c = 0; c < blocks[b].cols; c++)
                covered[(blocks[b].row + r) * cells + blocks[b].col + c]++;
    int from_row = 0, from_col = 0, side = 0;
    if (hole) {
        from_row = layout->windows[level - 1].row0 / 2 - layout->windows[level].row0;
        from_col = layout->windows[level - 1].col0 / 2 - layout->windows[level].col0;
        side = cells / 2;
    }
    for (int r = 0; r < cells; r++) {
        for (int c = 0; c < cells; c++) {
            bool inside =
                r >= from_row && r < from_row + side && c >= from_col && c < from_col + side;
            *ret_wrong += covered[r * cells + c] != !inside;
        }
    }
    free(covered);
}

static void blocks_cover_every_cell_outside_the_hole_once(void)
{
    int wrong = 0;
    for (size_t s = 0; s < SHAPES; s++) {
        for (int i = 0; i < 40; i++) {
            struct clipmap_layout layout;
            clipmap_place(&shapes[s], random_between(-80, 80), random_between(-180, 180), 1,
                          &layout);
            coverage(&shapes[s], &layout, 0, false, &wrong);
            coverage(&shapes[s], &layout, 1 + i % (shapes[s].levels - 1), true, &wrong);
        }
    }
    CHECK_INT(wrong, 0);
}

/* Marks where an edge of a block has vertices, on a lattice of half cells; a doubled edge has them
 * at every half cell. */
static void mark_edge(signed char *marks, int side, int x, int y, int dx, int dy, int cells,
                      bool doubled, int *ret_wrong)
{
    for (int i = 0; i <= 2 * cells; i++) {
        signed char *mark = &marks[(y + i * dy) * side + x + i * dx];
        signed char has = doubled || i % 2 == 0 ? 1 : -1;
        if (*mark && *mark != has)
            ++*ret_wrong; /* the neighbour disagrees: a T-vertex */
        *mark = has;
    }
}

/* Every edge that two blocks share, or a block and the finer window, has its vertices in the same
 * places on both sides. */
static void edges_agree(const struct clipmap_shape *shape, const struct clipmap_layout *layout,
                        int level, int *ret_wrong)
{
    int side = 2 * (shape->n - 1) + 1;
    signed char *across = calloc((size_t)side * (size_t)side, 1);
    signed char *up = calloc((size_t)side * (size_t)side, 1);
    struct clipmap_block blocks[CLIPMAP_MAX_BLOCKS];
    int count = clipmap_blocks(shape, layout, level, true, blocks);
    int row = 2 * (layout->windows[level - 1].row0 / 2 - layout->windows[level].row0);
    int col = 2 * (layout->windows[level - 1].col0 / 2 - layout->windows[level].col0);
    int fine = (shape->n - 1) / 2;
    mark_edge(across, side, col, row, 1, 0, fine, true, ret_wrong);
    mark_edge(across, side, col, row + 2 * fine, 1, 0, fine, true, ret_wrong);
    mark_edge(up, side, col, row, 0, 1, fine, true, ret_wrong);
    mark_edge(up, side, col + 2 * fine, row, 0, 1, fine, true, ret_wrong);
    for (int b = 0; b < count; b++) {
        struct clipmap_block k = blocks[b];
        int x = 2 * k.col, y = 2 * k.row;
        mark_edge(across, side, x, y, 1, 0, k.cols, k.doubled & CLIPMAP_SOUTH, ret_wrong);
        mark_edge(across, side, x, y + 2 * k.rows, 1, 0, k.cols, k.doubled & CLIPMAP_NORTH,
                  ret_wrong);
        mark_edge(up, side, x, y, 0, 1, k.rows, k.doubled & CLIPMAP_WEST, ret_wrong);
        mark_edge(up, side, x + 2 * k.cols, y, 0, 1, k.rows, k.doubled & CLIPMAP_EAST, ret_wrong);
    }
    free(across);
    free(up);
}

static void shared_edges_have_the_same_vertices_on_both_sides(void)
{
    int wrong = 0;
    for (size_t s = 0; s < SHAPES; s++) {
        for (int i = 0; i < 40; i++) {
            struct clipmap_layout layout;
            clipmap_place(&shapes[s], random_between(-80, 80), random_between(-180, 180), 1,
                          &layout);
            edges_agree(&shapes[s], &layout, 1 + i % (shapes[s].levels - 1), &wrong);
        }
    }
    CHECK_INT(wrong, 0);
}

static void no_edge_needs_more_than_64_segments(void)
{
    for (size_t s = 0; s < SHAPES; s++) {
        int instances = clipmap_instances(&shapes[s]), longest = 0, most = 0;
        for (int i = 0; i < 50; i++) {
            struct clipmap_layout layout;
            struct clipmap_block blocks[CLIPMAP_MAX_BLOCKS];
            clipmap_place(&shapes[s], random_between(-80, 80), random_between(-180, 180), 1,
                          &layout);
            int count = clipmap_blocks(&shapes[s], &layout, 1, i % 2, blocks);
            most = count > most ? count : most;
            for (int b = 0; b < count; b++) {
                int across = blocks[b].doubled & (CLIPMAP_SOUTH | CLIPMAP_NORTH) ? 2 : 1;
                int up = blocks[b].doubled & (CLIPMAP_WEST | CLIPMAP_EAST) ? 2 : 1;
                longest = blocks[b].cols * across > longest ? blocks[b].cols * across : longest;
                longest = blocks[b].rows * up > longest ? blocks[b].rows * up : longest;
            }
        }
        CHECK(longest <= 64 * instances);
        CHECK(most <= CLIPMAP_MAX_BLOCKS);
    }
}

static void uncovered_rectangles_complete_the_new_window(void)
{
    enum { SIDE = 31, SPAN = 200 };
    int wrong = 0;
    for (int i = 0; i < 3000; i++) {
        struct clipmap_window from = {60, 60};
        struct clipmap_window to = {60 + (int)random_between(-40, 40),
                                    60 + (int)random_between(-40, 40)};
        static unsigned char held[SPAN][SPAN];
        memset(held, 0, sizeof(held));
        for (int r = 0; r < SIDE; r++)
            for (int c = 0; c < SIDE; c++)
                held[from.row0 + r][from.col0 + c] = 1;
        struct clipmap_rect rects[2];
        int count = clipmap_uncovered(SIDE, from, to, rects);
        for (int k = 0; k < count; k++)
            for (int r = 0; r < rects[k].rows; r++)
                for (int c = 0; c < rects[k].cols; c++)
                    held[rects[k].row0 + r][rects[k].col0 + c]++;
        for (int r = 0; r < SIDE; r++)
            for (int c = 0; c < SIDE; c++)
                wrong += held[to.row0 + r][to.col0 + c] == 0;
        /* Nothing is fetched twice; what is kept is not fetched again unless all is. */
        if (abs(to.row0 - from.row0) < SIDE && abs(to.col0 - from.col0) < SIDE)
            for (int r = 0; r < SIDE; r++)
                for (int c = 0; c < SIDE; c++)
                    wrong += held[to.row0 + r][to.col0 + c] != 1;
    }
    CHECK_INT(wrong, 0);
}

static void cells_stay_near_square_as_the_meridians_close_in(void)
{
    double worst = 1.0;
    for (double lat = -82.0; lat <= 82.0; lat += 0.01) {
        double aspect = clipmap_lon_factor(lat, 0) * cos(lat * M_PI / 180.0);
        worst = fmax(worst, fmax(aspect, 1.0 / aspect));
    }
    CHECK(worst < 1.0906); /* the eighth root of 2 */
    /* Within half a degree of a band's edge it stays what it was; a first choice does not. */
    double edge_deg = acos(exp2(-0.125)) * 180.0 / M_PI;
    double low = clipmap_lon_factor(edge_deg - 0.1, 0),
           high = clipmap_lon_factor(edge_deg + 0.1, 0);
    CHECK_NEAR(low, 1.0, 0);
    CHECK_NEAR(high, exp2(0.25), 0);
    CHECK_NEAR(clipmap_lon_factor(edge_deg + 0.3, low), low, 0);
    CHECK_NEAR(clipmap_lon_factor(edge_deg - 0.3, high), high, 0);
    CHECK_NEAR(clipmap_lon_factor(edge_deg + 1.0, low), high, 0);
    CHECK_NEAR(clipmap_lon_factor(edge_deg - 1.0, high), low, 0);
}

static void longitudes_unwrap_to_the_nearest_turn(void)
{
    CHECK_NEAR(longitude_unwrapped_deg(-179.9, 179.9), 180.1, 1e-12);
    CHECK_NEAR(longitude_unwrapped_deg(179.9, -179.9), -180.1, 1e-12);
    CHECK_NEAR(longitude_unwrapped_deg(10, 725), 730, 1e-12);
    CHECK_NEAR(longitude_unwrapped_deg(-170, 0), -170, 0);
}

static void fine_levels_fade_before_they_go(void)
{
    const struct clipmap_shape *shape = &shapes[2];
    float fade, before = 0.0f;
    int level_before = clipmap_finest_level(shape, 0.5, &fade);
    CHECK_INT(level_before, 0);
    CHECK_NEAR(fade, 0, 0);
    for (double height_m = 1.0; height_m < 500e3; height_m *= 1.001) {
        int level = clipmap_finest_level(shape, height_m, &fade);
        if (level != level_before) {
            CHECK_INT(level, level_before + 1);
            CHECK(before > 0.99f && fade < 0.01f);
        } else {
            CHECK(fade >= before && fade - before < 0.01f);
        }
        before = fade;
        level_before = level;
    }
    CHECK(level_before > 8);
    CHECK_INT(clipmap_finest_level(shape, NAN, &fade), 0);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"windows nest and stay about the eye", windows_nest_and_stay_about_the_eye},
        {"blocks cover every cell outside the hole once",
         blocks_cover_every_cell_outside_the_hole_once},
        {"shared edges have the same vertices on both sides",
         shared_edges_have_the_same_vertices_on_both_sides},
        {"no edge needs more than 64 segments", no_edge_needs_more_than_64_segments},
        {"uncovered rectangles complete the new window",
         uncovered_rectangles_complete_the_new_window},
        {"cells stay near square as the meridians close in",
         cells_stay_near_square_as_the_meridians_close_in},
        {"longitudes unwrap to the nearest turn", longitudes_unwrap_to_the_nearest_turn},
        {"fine levels fade before they go", fine_levels_fade_before_they_go},
    };
    return CHECK_MAIN(tests);
}
