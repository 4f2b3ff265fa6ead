/* The measure of quality over the Pyrenees, from the folder of real data that OTWD_SHARED names. */
#include "tests/import_fixture.h"
#include "tests/quality_fixture.h"

static const char *raster(void)
{
    static char path[512];
    const char *shared = getenv("OTWD_SHARED");
    snprintf(path, sizeof(path), "%s/data/terrain/N42E001.hgt.zip", shared ? shared : "");
    return path;
}

static struct judgement judge_database(int radius, double truth_step_m, struct view view)
{
    struct look look = {open_source(in("n42.db")), open_source(in("n42.db")), radius, truth_step_m,
                        40.0};
    struct judgement result = judge_view(&look, view);
    terrain_source_destroy(look.truth);
    return result;
}

/* 1500 m above the valleys of Andorra. */
static void mountains_are_nearer_to_the_truth_in_a_finer_mesh(void)
{
    check_run(run("'%s' -o '%s' -q", raster(), in("n42.db")), 0);
    struct view view = view_at(42.6, 1.5, 3500.0, 180.0, -25.0, 0.0);
    struct judgement coarse = judge_database(32, 0.0, view);
    struct judgement fine = judge_database(256, 0.0, view);
    CHECK(coarse.error_px.p999 > 2.0);
    CHECK(fine.error_px.p999 < 0.3 * coarse.error_px.p999);
    CHECK(fine.error_px.p50 < 0.1 * coarse.error_px.p50);
    CHECK(fine.psnr_db > coarse.psnr_db + 3.0);
}

static void the_reference_shows_the_heights_that_it_has(void)
{
    struct view view = view_at(42.6, 1.5, 3500.0, 250.0, -20.0, 15.0);
    struct judgement result = judge_database(32, 40.0, view);
    CHECK(result.reference_px.p999 < 0.01);
    CHECK(result.reference_px.max < 0.05);
    CHECK(result.error_px.p99 > 0.5);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"mountains are nearer to the truth in a finer mesh",
         mountains_are_nearer_to_the_truth_in_a_finer_mesh},
        {"the reference shows the heights that it has",
         the_reference_shows_the_heights_that_it_has},
    };
    if (access(raster(), R_OK) < 0) {
        const char *shared = getenv("OTWD_SHARED");
        printf("skipped: no real data (OTWD_SHARED is %s)\n", shared ? shared : "not set");
        return 77;
    }
    return render_tests_main(tests, sizeof(tests) / sizeof(tests[0]), import_tests_main);
}
