/* `otwd status`: a running daemon's health, over Modbus. */
#pragma once

#include <jansson.h>
#include <stdio.h>

#include "io/health.h"

/* argv[0] is the name that usage messages show. Exits by argp on bad usage (64). Returns 0, 69
 * where no otwd answers at the address, 64 for an address that is none. */
int status_main(int argc, char **argv);

/* One value a line, aligned, for people. */
void status_print(FILE *out, const struct health *health);

/* A new object, or NULL where memory is out; the names are those of docs/modbus.md with units. */
json_t *status_json(const struct health *health);
