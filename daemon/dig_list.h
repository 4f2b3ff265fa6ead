/* `otwd dig DB --list`: what was dug, oldest first. */
#pragma once

#include <stdbool.h>

#include "base/diag.h"

/* Prints the stamps that count, as a table or as a JSON array. Needs no right to write. -EBADMSG
 * where some are damaged, after the others; else as dig_open. */
int dig_list(const char *path, bool json, struct diag *diag);
