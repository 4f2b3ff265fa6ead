/* Handing over to otwd-import, the only program that links GDAL. */
#pragma once

/* Becomes otwd-import with these arguments (argv[0] is set here). Returns only where it cannot be
 * run: the exit status, after saying so. */
int import_exec(char **argv);
