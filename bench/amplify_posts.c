#include "bench/amplify_posts.h"

#include <errno.h>
#include <stdbool.h>
#include <stdlib.h>

#define AROUND 2 /* posts to each side within which roughness is found */

/* What is as rough as the raster is, in the place of a post. */
struct rough {
    int cols, rows;
    int32_t *missed; /* [rows][cols], 1/AMPLIFY_UNIT */
};

static int32_t *at(const struct amplify_posts *posts, int col, int row)
{
    return &posts->heights[(size_t)row * (size_t)posts->cols + (size_t)col];
}

/* Rounds down, negative numbers too: the same on every machine. */
static int32_t divided(int32_t value, int32_t by)
{
    int32_t quotient = value / by;
    return quotient - (value % by < 0);
}

/* Of the post in the middle of four, which are `step` and 3 `step` from it; at the raster's edges
 * two do. Between two of one height it is flat. */
static int32_t foretell(const struct amplify_posts *posts, int col, int row, int d_col, int d_row,
                        bool *ret_flat)
{
    int32_t b = *at(posts, col - d_col, row - d_row), c = *at(posts, col + d_col, row + d_row);
    int first_col = col - 3 * d_col, first_row = row - 3 * d_row;
    int last_col = col + 3 * d_col, last_row = row + 3 * d_row;
    *ret_flat = b == c;
    if (b == c || first_col < 0 || first_row < 0 || last_col >= posts->cols ||
        last_row >= posts->rows)
        return divided(b + c, 2);
    int32_t a = *at(posts, first_col, first_row), d = *at(posts, last_col, last_row);
    return divided(9 * (b + c) - a - d + 8, 16);
}

static int32_t missed_at(const struct amplify_posts *posts, int col, int row, int d_col, int d_row)
{
    bool flat;
    if (col < d_col || row < d_row || col + d_col >= posts->cols || row + d_row >= posts->rows)
        return 0;
    return abs(*at(posts, col, row) - foretell(posts, col, row, d_col, d_row, &flat));
}

int64_t amplify_posts_missed(const struct amplify_posts *posts, int step)
{
    int64_t sum = 0, count = 0;
    for (int row = step; row < posts->rows - step; row += 2 * step)
        for (int col = step; col < posts->cols - step; col += 2 * step) {
            sum += missed_at(posts, col, row - step, step, 0);
            sum += missed_at(posts, col - step, row, 0, step);
            count += 2;
        }
    return count ? sum / count : 0;
}

/* The mean around each post of the raster. */
static void find_rough(const struct amplify_posts *posts, int step, struct rough *rough)
{
    for (int row = 0; row < rough->rows; row++)
        for (int col = 0; col < rough->cols; col++) {
            int32_t sum = 0, count = 0;
            for (int r = row - AROUND; r <= row + AROUND; r++)
                for (int c = col - AROUND; c <= col + AROUND; c++) {
                    if (r < 0 || c < 0 || r >= rough->rows || c >= rough->cols)
                        continue;
                    sum += missed_at(posts, c * step, r * step, step, 0) / 2;
                    sum += missed_at(posts, c * step, r * step, 0, step) / 2;
                    count++;
                }
            rough->missed[(size_t)row * (size_t)rough->cols + (size_t)col] = sum / count;
        }
}

/* Between the raster's posts, which are `span` apart. */
static int32_t rough_at(const struct rough *rough, int span, int col, int row)
{
    int c = col / span, r = row / span;
    c -= c == rough->cols - 1;
    r -= r == rough->rows - 1;
    int64_t x = col - c * span, y = row - r * span;
    const int32_t *sw = &rough->missed[(size_t)r * (size_t)rough->cols + (size_t)c];
    const int32_t *nw = sw + rough->cols;
    return (int32_t)(((span - y) * ((span - x) * sw[0] + x * sw[1]) +
                      y * ((span - x) * nw[0] + x * nw[1])) /
                     ((int64_t)span * span));
}

/* SplitMix64's finaliser (Steele, Lea, Flood 2014). */
static uint64_t mixed(uint64_t z)
{
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return z ^ z >> 31;
}

/* The sum of two even chances, -65536 to 65536: 21845 off on average. */
static int32_t chance(int doubling, int col, int row)
{
    uint64_t hash = mixed((uint64_t)doubling << 58 ^ (uint64_t)(unsigned)row << 29 ^ (unsigned)col);
    return (int32_t)(hash & 0xffff) - (int32_t)(hash >> 16 & 0xffff);
}

struct doubling {
    struct amplify_posts *posts;
    const struct rough *rough;
    int number, step, span; /* from 1 on; between a new post and the next old one; the raster's */
    int64_t share;          /* of the raster's roughness, 1/65536 */
};

static void set_post(const struct doubling *d, int col, int row, int32_t foretold, bool flat)
{
    int64_t off = 0;
    if (!flat)
        off = (int64_t)rough_at(d->rough, d->span, col, row) * d->share / 65536 *
              chance(d->number, col / d->step, row / d->step) / 21845;
    *at(d->posts, col, row) = foretold + (int32_t)off;
}

/* First those on the lines between old posts, then those in the middle of four. */
static void double_posts(const struct doubling *d)
{
    int step = d->step, cols = d->posts->cols, rows = d->posts->rows;
    bool flat[2];
    for (int row = 0; row < rows; row += step) {
        bool old_row = row / step % 2 == 0;
        for (int col = old_row ? step : 0; col < cols; col += 2 * step) {
            int32_t foretold =
                foretell(d->posts, col, row, old_row ? step : 0, old_row ? 0 : step, flat);
            set_post(d, col, row, foretold, flat[0]);
        }
    }
    for (int row = step; row < rows; row += 2 * step)
        for (int col = step; col < cols; col += 2 * step) {
            int32_t along = foretell(d->posts, col, row, step, 0, &flat[0]);
            int32_t across = foretell(d->posts, col, row, 0, step, &flat[1]);
            set_post(d, col, row, divided(along + across, 2), flat[0] && flat[1]);
        }
}

static void double_all(struct amplify_posts *posts, const struct rough *rough, int doublings)
{
    int span = 1 << doublings;
    int64_t fine = amplify_posts_missed(posts, span),
            coarse = amplify_posts_missed(posts, 2 * span);
    int64_t less = coarse > 0 ? 65536 * fine / coarse : 0;
    struct doubling d = {.posts = posts, .rough = rough, .span = span, .share = 65536};
    for (d.number = 1; d.number <= doublings; d.number++) {
        d.step = span >> d.number;
        d.share = d.share * less / 65536;
        double_posts(&d);
    }
}

int amplify_posts_create(const uint16_t *raster, int cols, int rows, int doublings,
                         struct amplify_posts *ret_posts)
{
    if (cols < AMPLIFY_LEAST || rows < AMPLIFY_LEAST || doublings < 0 ||
        doublings > AMPLIFY_DOUBLINGS_MAX || cols > 65536 || rows > 65536)
        return -EINVAL;
    int span = 1 << doublings;
    struct amplify_posts posts = {.cols = (cols - 1) * span + 1, .rows = (rows - 1) * span + 1};
    struct rough rough = {.cols = cols, .rows = rows};
    posts.heights = malloc((size_t)posts.cols * (size_t)posts.rows * sizeof(*posts.heights));
    rough.missed = malloc((size_t)cols * (size_t)rows * sizeof(*rough.missed));
    if (!posts.heights || !rough.missed) {
        free(rough.missed);
        amplify_posts_destroy(&posts);
        return -ENOMEM;
    }
    for (int row = 0; row < rows; row++)
        for (int col = 0; col < cols; col++)
            *at(&posts, col * span, row * span) =
                AMPLIFY_UNIT * raster[(size_t)row * (size_t)cols + (size_t)col];
    find_rough(&posts, span, &rough);
    double_all(&posts, &rough, doublings);
    free(rough.missed);
    *ret_posts = posts;
    return 0;
}

void amplify_posts_destroy(struct amplify_posts *posts)
{
    free(posts->heights);
    *posts = (struct amplify_posts){0};
}

void amplify_posts_row(const struct amplify_posts *posts, int row, uint16_t *ret_heights)
{
    for (int col = 0; col < posts->cols; col++) {
        int32_t height = divided(*at(posts, col, row) + AMPLIFY_UNIT / 2, AMPLIFY_UNIT);
        ret_heights[col] = (uint16_t)(height < 0 ? 0 : height > 65535 ? 65535 : height);
    }
}
