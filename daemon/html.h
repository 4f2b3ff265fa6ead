/* What our pages have in common: one file each, no script, plots as SVG. */
#pragma once

#include <stdio.h>

/* Up to where the page's own begins. */
void html_begin(FILE *file, const char *title);

/* Closes the page and the file. 0 or -errno where anything of it could not be written. */
int html_end(FILE *file);

/* Text of the world, escaped. */
void html_text(FILE *file, const char *text);

/* The least of 1, 2, 2.5, 5, 10 times a power of ten that is not less: the top of an axis. */
double html_nice_above(double value);
