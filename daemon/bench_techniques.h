/* `otwd bench --flight FLIGHT`. */
#pragma once

int bench_techniques_main(int argc, char **argv);
