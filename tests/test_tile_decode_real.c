/* Databases of real rasters, from the folder that OTWD_SHARED names, rebuilt by the GPU; and what
 * goes there for it. */
#include "tests/import_fixture.h"
#include "tests/tile_decode_fixture.h"

static const char *raster(const char *name)
{
    static char path[512];
    const char *shared = getenv("OTWD_SHARED");
    snprintf(path, sizeof(path), "%s/data/terrain/%s", shared ? shared : "", name);
    return path;
}

static void real_tiles_are_the_cpus(void)
{
    static const struct {
        const char *name, *max_error;
        double least_times; /* that the residuals are fewer bytes than the tiles */
    } rasters[] = {
        {"N42E001.hgt.zip", "1", 11.0},    {"N41E001.hgt.zip", "2", 16.0},
        {"portland-ned.tif", "0.5", 20.0}, {"iceland-reykjanes-3s.tif", "0.5", 20.0},
        {"etopo5.tif", "10", 11.0},        {"N43E007.hgt.zip", "0", 22.0},
        {"portland-ned.tif", "0", 2.7},
    };
    printf("%-26s %9s %6s %9s %9s %9s %6s\n", "raster", "max error", "tiles", "payload",
           "residuals", "raw", "times");
    for (size_t i = 0; i < sizeof(rasters) / sizeof(rasters[0]); i++) {
        check_run(run("'%s' -o '%s' --max-error %s --fill 0 -q", raster(rasters[i].name),
                      in("real.db"), rasters[i].max_error),
                  0);
        struct walk_bytes bytes = walk_database(in("real.db"), 1 << 20);
        double tiles = bytes.tiles, raw = TILE_POST_COUNT * sizeof(int32_t);
        double times = raw * tiles / (double)bytes.residuals;
        printf("%-26s %9s %6u %9.0f %9.0f %9.0f %6.2f\n", rasters[i].name, rasters[i].max_error,
               bytes.tiles, (double)bytes.payloads / tiles, (double)bytes.residuals / tiles, raw,
               times);
        if (!(times >= rasters[i].least_times))
            CHECK_FAIL("%s: the residuals are %.2f times fewer bytes, not %.2f", rasters[i].name,
                       times, rasters[i].least_times);
        unlink(in("real.db"));
    }
}

int main(void)
{
    static const struct check_test tests[] = {
        {"real tiles are the CPU's, in a fraction of their bytes", real_tiles_are_the_cpus},
    };
    if (access(raster("N42E001.hgt.zip"), R_OK) < 0) {
        const char *shared = getenv("OTWD_SHARED");
        printf("skipped: no real data (OTWD_SHARED is %s)\n", shared ? shared : "not set");
        return 77;
    }
    return render_tests_main(tests, sizeof(tests) / sizeof(tests[0]), import_tests_main);
}
