/* Terrain that is made finer for comparisons: bench/amplify_posts. */
#include "bench/amplify_posts.h"

#include <errno.h>
#include <string.h>

#include "tests/check.h"

#define SIDE 65

/* Hills in the west, a lake in the east, by whole numbers alone. */
static void make_raster(uint16_t *raster)
{
    static const int hills[6][4] = {{10, 12, 14, 900}, {25, 40, 20, 1400}, {5, 55, 9, 700},
                                    {20, 25, 5, 300},  {15, 48, 3, 250},   {30, 8, 7, 500}};
    for (int row = 0; row < SIDE; row++)
        for (int col = 0; col < SIDE; col++) {
            int height = 1000 + (col < 40 ? 8 * (40 - col) : 0);
            for (int i = 0; col < 40 && i < 6; i++) {
                int x = col - hills[i][0], y = row - hills[i][1], r = hills[i][2];
                int within = r * r - x * x - y * y;
                height += within > 0 ? hills[i][3] * within / (r * r) : 0;
            }
            raster[row * SIDE + col] = (uint16_t)height;
        }
}

static struct amplify_posts amplified(int doublings)
{
    uint16_t raster[SIDE * SIDE];
    struct amplify_posts posts = {0};
    make_raster(raster);
    CHECK_INT(amplify_posts_create(raster, SIDE, SIDE, doublings, &posts), 0);
    return posts;
}

static void the_posts_that_were_there_stay(void)
{
    uint16_t raster[SIDE * SIDE], row_of[(SIDE - 1) * 16 + 1];
    struct amplify_posts posts = amplified(4);
    make_raster(raster);
    CHECK_INT(posts.cols, (SIDE - 1) * 16 + 1);
    for (int row = 0; row < SIDE; row++) {
        amplify_posts_row(&posts, 16 * row, row_of);
        for (int col = 0; col < SIDE; col++)
            CHECK_INT(row_of[16 * col], raster[row * SIDE + col]);
    }
    amplify_posts_destroy(&posts);
}

static void more_doublings_keep_what_fewer_made(void)
{
    struct amplify_posts few = amplified(2), many = amplified(4);
    int changed = 0;
    for (int row = 0; row < few.rows; row++)
        for (int col = 0; col < few.cols; col++)
            changed +=
                many.heights[4 * row * many.cols + 4 * col] != few.heights[row * few.cols + col];
    CHECK_INT(changed, 0);
    amplify_posts_destroy(&few);
    amplify_posts_destroy(&many);
}

static void roughness_goes_on_as_it_did(void)
{
    struct amplify_posts posts = amplified(3);
    double measured =
        (double)amplify_posts_missed(&posts, 8) / (double)amplify_posts_missed(&posts, 16);
    for (int step = 4; step > 0; step /= 2) {
        double made = (double)amplify_posts_missed(&posts, step) /
                      (double)amplify_posts_missed(&posts, 2 * step);
        CHECK(made > 0.6 * measured && made < 1.4 * measured);
    }
    amplify_posts_destroy(&posts);
}

static void a_lake_stays_flat(void)
{
    struct amplify_posts posts = amplified(3);
    int bumps = 0;
    for (int row = 0; row < posts.rows; row++)
        for (int col = 8 * 40; col < posts.cols; col++)
            bumps += posts.heights[row * posts.cols + col] != 1000 * AMPLIFY_UNIT;
    CHECK_INT(bumps, 0);
    amplify_posts_destroy(&posts);
}

/* FNV-1a. Written down on one machine: another that makes other bytes compares other ground. */
static void every_machine_makes_the_same_bytes(void)
{
    struct amplify_posts posts = amplified(4);
    uint64_t sum = 0xcbf29ce484222325u;
    for (int i = 0; i < posts.cols * posts.rows; i++)
        for (int byte = 0; byte < 4; byte++)
            sum = (sum ^ ((uint32_t)posts.heights[i] >> 8 * byte & 0xff)) * 0x100000001b3u;
    CHECK_INT((int64_t)sum, INT64_C(8332388627331346661));
    amplify_posts_destroy(&posts);
}

static void what_cannot_be_amplified_is_refused(void)
{
    static const uint16_t raster[SIDE * SIDE];
    struct amplify_posts posts = {0};
    CHECK_INT(amplify_posts_create(raster, AMPLIFY_LEAST - 1, SIDE, 1, &posts), -EINVAL);
    CHECK_INT(amplify_posts_create(raster, SIDE, SIDE, AMPLIFY_DOUBLINGS_MAX + 1, &posts), -EINVAL);
    CHECK_INT(amplify_posts_create(raster, SIDE, SIDE, 1, &posts), 0); /* flat: no roughness */
    CHECK_INT(posts.heights[SIDE], 0);
    amplify_posts_destroy(&posts);
    amplify_posts_destroy(&posts);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"the posts that were there stay", the_posts_that_were_there_stay},
        {"more doublings keep what fewer made", more_doublings_keep_what_fewer_made},
        {"roughness goes on as it did", roughness_goes_on_as_it_did},
        {"a lake stays flat", a_lake_stays_flat},
        {"every machine makes the same bytes", every_machine_makes_the_same_bytes},
        {"what cannot be amplified is refused", what_cannot_be_amplified_is_refused},
    };
    return CHECK_MAIN(tests);
}
