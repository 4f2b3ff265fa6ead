/* `otwd bench SUBJECT`: techniques side by side. */
#include <stdio.h>
#include <string.h>
#include <sysexits.h>

#include "daemon/bench_motion.h"
#include "daemon/bench_quality.h"
#include "daemon/bench_stability.h"
#include "daemon/bench_techniques.h"
#include "daemon/cli.h"
#include "daemon/commands.h"
#include "daemon/import_exec.h"

int bench_main(int argc, char **argv)
{
    const char *subject = argc > 1 ? argv[1] : "";
    if (subject[0] == '-')
        return bench_techniques_main(argc, argv);
    if (strcmp(subject, "codec") == 0) { /* rasters are GDAL's to read */
        argv[1] = (char *)"--bench-codec";
        return import_exec(argv);
    }
    if (strcmp(subject, "motion") == 0)
        return bench_motion_main(argc - 1, argv + 1);
    if (strcmp(subject, "quality") == 0)
        return bench_quality_main(argc - 1, argv + 1);
    if (strcmp(subject, "stability") == 0)
        return bench_stability_main(argc - 1, argv + 1);
    if (*subject)
        fprintf(stderr, "otwd: there is no subject \"%s\"; `otwd bench --help` lists them\n",
                subject);
    else
        fputs("otwd: bench what? --flight FLIGHT, or codec RASTER..., motion, quality FLIGHT or "
              "stability; `otwd bench --help` tells\n",
              stderr);
    return EX_USAGE;
}
