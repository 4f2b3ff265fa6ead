/* `otwd bench quality`; argv[0] is the subject's name. */
#pragma once

int bench_quality_main(int argc, char **argv);
