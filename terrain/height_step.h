/* Heights as whole numbers ("symbols"): how a database quantises.
 *
 * height = symbol * step. For whole multiples of a unit u and a bound D the step is
 * u * (2 * floor(D / u) + 1), the uniform quantiser with a dead zone of Yusov 2012, section 2.3.2;
 * for other heights it is 2 D, rounded down to a multiple of 2^-10 m so that every height within
 * the Earth's is exact in a float. A step of 0 is lossless: the symbol is then the float's bits,
 * negative ones mirrored, so that symbols have the order of the heights. */
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "terrain/symbol_codec.h" /* SYMBOL_NONE */

/* No place on Earth has heights beyond this: in a source they are voids. */
#define HEIGHT_MIN_M (-12000.0)
#define HEIGHT_MAX_M 9500.0

/* The largest step that keeps the bound for multiples of `unit_m` (0: for any height). */
double height_step_for(double max_error_m, double unit_m);

/* How far a multiple of `unit_m` (0: any height) can be from what is stored of it. */
double height_step_error_m(double step_m, double unit_m);

/* The nearest symbol, |symbol * step - height| <= step / 2 exactly; SYMBOL_NONE for NaN. */
int32_t symbol_from_height(double height_m, double step_m);
/* Quantised heights come back as the symbols that they were. */
float height_from_symbol(int32_t symbol, double step_m);

void symbols_from_heights(const float *heights_m, size_t count, double step_m,
                          int32_t *ret_symbols);
void heights_from_symbols(const int32_t *symbols, size_t count, double step_m,
                          float *ret_heights_m);
