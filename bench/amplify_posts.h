/* Finer posts made up between those of a raster, so that techniques can be shown more ground than
 * was measured: "amplified" terrain. Only whole numbers are computed with, so that every machine
 * makes the same bytes.
 *
 * Each doubling puts a post between every two, where four posts in a row foretell it (weights -1,
 * 9, 9, -1), off by chance. How far off continues what the raster has: by how much its own posts
 * miss what is foretold of them by every second one, near the place (5 x 5 posts), times how much
 * less that is from one doubling to the next over all of the raster. The raster's posts stay as
 * they are, and between posts of one height it stays flat, so that water remains water. What is
 * made of more doublings has, at every second post, what is made of fewer. */
#pragma once

#include <stdint.h>

struct amplify_posts {
    int cols, rows;
    int32_t *heights; /* [rows][cols], in 1/AMPLIFY_UNIT of the raster's units */
};

#define AMPLIFY_UNIT          256
#define AMPLIFY_DOUBLINGS_MAX 6
#define AMPLIFY_LEAST         16 /* posts a side, of the raster */

/* Doubles the raster's heights ([rows][cols], units of the raster) so many times. Returns 0,
 * -EINVAL where it has too few posts or there are too many doublings, -ENOMEM. */
int amplify_posts_create(const uint16_t *raster, int cols, int rows, int doublings,
                         struct amplify_posts *ret_posts);
/* Legal on zeros. */
void amplify_posts_destroy(struct amplify_posts *posts);

/* A row in the raster's units again. */
void amplify_posts_row(const struct amplify_posts *posts, int row, uint16_t *ret_heights);

/* By how much posts `step` apart miss what is foretold by every second of them: mean, in
 * 1/AMPLIFY_UNIT. Terrain has about half as much at half the step; so should what is made of it. */
int64_t amplify_posts_missed(const struct amplify_posts *posts, int step);
