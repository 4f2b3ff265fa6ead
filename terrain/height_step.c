#include "terrain/height_step.h"

#include <math.h>

#include "base/bytes.h"

#define REAL_STEPS_PER_METRE 1024.0

double height_step_for(double max_error_m, double unit_m)
{
    if (unit_m > 0.0)
        return unit_m * (2.0 * floor(max_error_m / unit_m + 1e-9) + 1.0);
    return floor(2.0 * max_error_m * REAL_STEPS_PER_METRE) / REAL_STEPS_PER_METRE;
}

double height_step_error_m(double step_m, double unit_m)
{
    if (step_m == 0.0)
        return 0.0;
    if (unit_m > 0.0) {
        double units = nearbyint(step_m / unit_m), steps = nearbyint(unit_m / step_m);
        if (units >= 1.0 && fabs(units * unit_m - step_m) < 1e-9 * step_m)
            return floor(0.5 * units) * unit_m;
        if (steps >= 1.0 && fabs(steps * step_m - unit_m) < 1e-9 * unit_m)
            return 0.0;
    }
    return 0.5 * step_m;
}

static int32_t symbol_from_bits(float height_m)
{
    uint32_t bits = bits_from_float(height_m);
    return bits & 0x80000000u ? -(int32_t)(bits & 0x7fffffffu) : (int32_t)bits;
}

/* The division's own rounding must not decide between two steps. */
static inline int32_t nearest_step(double height_m, double step_m, double per_step)
{
    double symbol = nearbyint(height_m * per_step), rest = height_m - symbol * step_m;
    symbol += rest > 0.5 * step_m ? 1.0 : 0.0;
    symbol -= rest < -0.5 * step_m ? 1.0 : 0.0;
    return (int32_t)symbol;
}

int32_t symbol_from_height(double height_m, double step_m)
{
    if (isnan(height_m))
        return SYMBOL_NONE;
    if (step_m == 0.0)
        return symbol_from_bits((float)height_m);
    return nearest_step(height_m, step_m, 1.0 / step_m);
}

float height_from_symbol(int32_t symbol, double step_m)
{
    if (symbol == SYMBOL_NONE)
        return NAN;
    if (step_m != 0.0)
        return (float)(symbol * step_m);
    return float_from_bits(symbol < 0 ? (uint32_t)-symbol | 0x80000000u : (uint32_t)symbol);
}

void symbols_from_heights(const float *heights_m, size_t count, double step_m, int32_t *ret_symbols)
{
    double per_step = step_m != 0.0 ? 1.0 / step_m : 0.0;
    for (size_t i = 0; i < count; i++)
        ret_symbols[i] = isnan(heights_m[i]) ? SYMBOL_NONE
                         : step_m != 0.0     ? nearest_step((double)heights_m[i], step_m, per_step)
                                             : symbol_from_bits(heights_m[i]);
}

void heights_from_symbols(const int32_t *symbols, size_t count, double step_m, float *ret_heights_m)
{
    for (size_t i = 0; i < count; i++)
        ret_heights_m[i] = height_from_symbol(symbols[i], step_m);
}
