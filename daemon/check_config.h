/* `otwd check-config FILE`: what is wrong with a configuration. */
#pragma once

#include <stdio.h>

#include "config/config.h"

/* argv[0] is the name that usage messages show. Exits by argp on bad usage (64). Returns 0; 78
 * where the file is wrong, after printing every error; 66 where it cannot be read. */
int check_config_main(int argc, char **argv);

/* Prints the errors a line each and how many were held back. For `otwd run` too. */
void check_config_print(FILE *out, const struct config_errors *errors);

/* The exit status for what config_load() returned. */
int check_config_exit_status(int r);
