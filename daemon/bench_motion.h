/* `otwd bench motion`; argv[0] is the subject's name. */
#pragma once

int bench_motion_main(int argc, char **argv);
