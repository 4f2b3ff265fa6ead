/* How likely each difference is, by how active the neighbourhood is: the context models. */
#pragma once

#include "terrain/symbol_entropy.h"

/* Activities come in 1/4096 step. Their class is a quarter octave; below MODEL_CLASSES / 4 octaves
 * differences are coded whole, by class and by which fifth of half a step the prediction lies off a
 * whole symbol; above, all but the low bits are. */
#define MODEL_CLASSES 32
#define MODEL_PHASES  5
#define MODEL_SHIFTS  16
#define MODEL_COUNT   (MODEL_CLASSES * MODEL_PHASES + 4 * MODEL_SHIFTS)
#define MODEL_MIDDLE  15 /* the symbol of a difference of zero */
#define MODEL_ESCAPE  31

struct model_choice {
    unsigned model, low_bits;
};

/* `offset`: 0 .. 511, how far the prediction is off a whole symbol in 1/1024 step. */
static inline struct model_choice model_choose(int32_t activity, int32_t offset)
{
    unsigned size = (unsigned)(activity >> 4) | 4;
    unsigned octave = 31 - (unsigned)__builtin_clz(size);
    unsigned quarter = size >> (octave - 2) & 3;
    if (octave < 10)
        return (struct model_choice){((octave - 2) * 4 + quarter) * MODEL_PHASES +
                                         (unsigned)(offset * MODEL_PHASES >> 9),
                                     0};
    unsigned low_bits = octave - 9;
    unsigned row = low_bits < MODEL_SHIFTS ? low_bits - 1 : MODEL_SHIFTS - 1;
    return (struct model_choice){MODEL_CLASSES * MODEL_PHASES + row * 4 + quarter, low_bits};
}

/* symbol_tables.c */
extern const union entropy_model model_first[MODEL_COUNT];
extern const union entropy_model model_escape_first;
