/* What our pages have in common: one file each, no script, plots as SVG. */
#pragma once

#include <stdio.h>

/* Up to where the page's own begins. */
void html_begin(FILE *file, const char *title);

/* Closes the page and the file. 0 or -errno where anything of it could not be written. */
int html_end(FILE *file);

/* Opens the SVG of a plot of that size, with its upper left corner at 0 0, and room for the labels:
 * of the top line above it, of the other axis below. */
void html_plot_begin(FILE *file, int width, int height);

/* Text of the world, escaped. */
void html_text(FILE *file, const char *text);

/* The least of 1, 2, 2.5, 5, 10 times a power of ten that is not less: the top of an axis. */
double html_nice_above(double value);
