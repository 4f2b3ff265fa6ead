/* `otwd bench stability`; argv[0] is the subject's name. */
#pragma once

int bench_stability_main(int argc, char **argv);
