/* The field size that an error asks for. */
#include "render/detail.h"
#include "tests/check.h"

static void posts_and_error_are_inverse(void)
{
    for (double error = 0.1; error < 20.0; error *= 1.7) {
        double posts = detail_posts(6.0e-4, error);
        CHECK_NEAR(detail_pixel_error(6.0e-4, posts), error, 1e-12 * error);
        CHECK_NEAR(detail_posts(3.0e-4, error), 2.0 * posts, 1e-9 * posts);
    }
}

int main(void)
{
    static const struct check_test tests[] = {
        {"posts and error are inverse", posts_and_error_are_inverse},
    };
    return check_main(tests, sizeof(tests) / sizeof(tests[0]));
}
