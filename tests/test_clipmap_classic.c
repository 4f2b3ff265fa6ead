/* The rings of clipmap-classic fit into each other, and its heights are the field's. */
#include "render/technique_clipmap_classic_heights.h"
#include "render/technique_clipmap_classic_rings.h"
#include "tests/render_fixture.h"

static void levels_lie_on_the_posts_of_the_next(void)
{
    for (int m = 8; m <= 64; m += 7)
        for (int level = 0; level < 6; level++)
            for (double eye = 0.0; eye <= 4096.0; eye += 0.37) {
                int finer = ring_origin(eye, level, m), coarser = ring_origin(eye, level + 1, m);
                double middle = ldexp(eye, -level) - finer;
                CHECK_INT(finer & 1, 0);
                CHECK(finer / 2 - coarser == m - 1 || finer / 2 - coarser == m);
                CHECK(middle >= 2 * m - 2 && middle < 2 * m); /* of 0 .. 4 m - 2 */
            }
}

/* Counts how often each cell of a level is covered. */
static void check_ring(int m, const int finer[2])
{
    struct ring_piece pieces[RING_PIECES_MAX];
    int count = ring_pieces(m, finer, pieces), along = 4 * m - 2, wrong = 0, outlines = 0;
    char *covered = calloc((size_t)(along * along), 1);
    CHECK(count <= RING_PIECES_MAX);
    for (int i = 0; i < count; i++) {
        outlines += pieces[i].footprint == FOOTPRINT_OUTLINE;
        if (pieces[i].footprint == FOOTPRINT_OUTLINE)
            continue;
        for (int y = pieces[i].y; y < pieces[i].y + pieces[i].height; y++)
            for (int x = pieces[i].x; x < pieces[i].x + pieces[i].width; x++)
                covered[y * along + x]++;
    }
    for (int i = 0; i < along * along; i++) {
        int x = i % along, y = i / along;
        bool in_finer = finer && x >= finer[0] && x < finer[0] + 2 * m - 1 && y >= finer[1] &&
                        y < finer[1] + 2 * m - 1;
        wrong += covered[i] != !in_finer;
    }
    CHECK_INT(wrong, 0);
    CHECK_INT(outlines, 1);
    free(covered);
}

static void a_ring_covers_its_level_once(void)
{
    for (int m = 8; m <= 64; m += 7) {
        check_ring(m, NULL);
        for (int i = 0; i < 4; i++)
            check_ring(m, (const int[2]){m - 1 + i % 2, m - 1 + i / 2});
    }
}

static void heights_are_the_fields_and_the_next_levels(void)
{
    static float posts[129 * 129];
    for (int i = 0; i < 129 * 129; i++)
        posts[i] = (float)((unsigned)i * 2654435761u >> 20);
    const struct field field = {.cells = 128, .height_m = posts};
    struct classic_heights heights;
    CHECK_INT(classic_heights_create(&field, &heights), 0);
    CHECK_INT(heights.count, 8);
    for (int level = 0; level < 7; level++) {
        int last = 128 >> level, step = 1 << level;
        CHECK_INT(heights.last[level], last);
        for (int y = 0; y <= last; y++) {
            float pairs[131 * 3];
            classic_heights_row(&heights, level, -1, y, last + 3, 3, pairs);
            for (int i = 0; i < last + 3; i++) {
                int x = i == 0 ? 0 : i > last + 1 ? last : i - 1;
                /* the two posts of the next level that this one is between */
                int dx = x & 1, dy = y & 1, falls = dx & dy & ((x >> 1) ^ (y >> 1));
                const float *a = &posts[((y - dy) * 129 + x - dx + 2 * dx * falls) * step];
                const float *b = &posts[((y + dy) * 129 + x + dx - 2 * dx * falls) * step];
                CHECK_NEAR((double)pairs[3 * i], (double)posts[(y * 129 + x) * step], 0.0);
                CHECK_NEAR((double)pairs[3 * i + 1], 0.5 * ((double)*a + (double)*b), 0.0);
            }
        }
    }
    classic_heights_destroy(&heights);
    classic_heights_destroy(&heights);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"levels lie on the posts of the next", levels_lie_on_the_posts_of_the_next},
        {"a ring covers its level once", a_ring_covers_its_level_once},
        {"heights are the field's and the next level's",
         heights_are_the_fields_and_the_next_levels},
    };
    return CHECK_MAIN(tests);
}
