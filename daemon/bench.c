/* `otwd bench SUBJECT`: techniques side by side. */
#include <stdio.h>
#include <string.h>
#include <sysexits.h>

#include "daemon/bench_motion.h"
#include "daemon/bench_quality.h"
#include "daemon/bench_stability.h"
#include "daemon/cli.h"
#include "daemon/commands.h"
#include "daemon/import_exec.h"

static void print_subjects(FILE *out)
{
    fputs("Usage: otwd bench SUBJECT [ARGUMENT...]\n\n"
          "Techniques side by side.\n\n"
          "  codec RASTER...  the height codec beside LERC, zstd and PNG\n"
          "  motion           how true and how smooth what is shown of a flight is\n"
          "  quality FLIGHT   how far the picture is from the ground at full detail\n"
          "  stability        what moves on the screen that the camera does not explain\n"
          "\n`otwd bench SUBJECT --help` says more.\n",
          out);
}

int bench_main(int argc, char **argv)
{
    const char *subject = argc > 1 ? argv[1] : "";
    if (strcmp(subject, "--help") == 0 || strcmp(subject, "-h") == 0) {
        print_subjects(stdout);
        return EX_OK;
    }
    if (strcmp(subject, "--version") == 0) {
        puts(argp_program_version);
        return EX_OK;
    }
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
        print_subjects(stderr);
    return EX_USAGE;
}
