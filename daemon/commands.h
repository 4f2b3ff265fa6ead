/* The subcommands' entry points. argv[0] is the subcommand's name; the value is main's. */
#pragma once

#include "daemon/check_config.h"
#include "daemon/replay.h"
#include "daemon/status.h"

int bench_main(int argc, char **argv);
int dig_main(int argc, char **argv);
int import_main(int argc, char **argv);
int merge_main(int argc, char **argv);
int info_main(int argc, char **argv);
int verify_main(int argc, char **argv);
int height_main(int argc, char **argv);
int run_main(int argc, char **argv);
int send_main(int argc, char **argv);
