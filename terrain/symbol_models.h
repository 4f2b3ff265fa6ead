/* How likely each difference is, by what is known of its neighbourhood: the context models. */
#pragma once

#include "terrain/symbol_entropy.h"

/* Activities come in 1/4096 step. Up to MODEL_OCTAVES octaves differences are coded whole; above,
 * all but the low bits are. Two models are asked for each:
 *
 *   slow   by the quarter octave of the activity, and by which fifth of half a step the prediction
 *          lies off a whole symbol (where low bits are left out: by the quarter and how many)
 *   fast   by the octave (where low bits are left out: the quarter), by how much of the activity
 *          comes from the forms, by plane, and by a coarser offset */
#define MODEL_OCTAVES    8
#define MODEL_OFFSETS    5
#define MODEL_SHIFTS     16
#define MODEL_SHARES     8
#define MODEL_PLANES     3
#define MODEL_SLOW_WHOLE (MODEL_OCTAVES * 4 * MODEL_OFFSETS)
#define MODEL_SLOW_COUNT (MODEL_SLOW_WHOLE + 4 * MODEL_SHIFTS)
#define MODEL_FAST_WHOLE (MODEL_OCTAVES * MODEL_SHARES * MODEL_PLANES * 3)
#define MODEL_FAST_COUNT (MODEL_FAST_WHOLE + 4 * MODEL_SHARES * MODEL_PLANES)
#define MODEL_MIDDLE     15 /* the symbol of a difference of zero */
#define MODEL_ESCAPE     31

struct model_choice {
    unsigned slow, fast, low_bits;
};

/* Half octaves of a size of 2 or more. */
static inline unsigned model_half_octaves(unsigned size)
{
    unsigned octave = 31 - (unsigned)__builtin_clz(size);
    return octave * 2 + (size >> (octave - 1) & 1);
}

/* `forms`: the forms' part of the activity. `offset`: 0 .. 511, how far the prediction is off a
 * whole symbol in 1/1024 step. `plane`: 0 centre, 1 row, 2 column. */
static inline struct model_choice model_choose(int32_t activity, int32_t forms, int32_t offset,
                                               unsigned plane)
{
    unsigned size = (unsigned)(activity >> 4) | 4;
    unsigned octave = 31 - (unsigned)__builtin_clz(size);
    unsigned quarter = size >> (octave - 2) & 3;
    int share = (int)model_half_octaves((unsigned)(forms >> 4) | 4) -
                (int)(octave * 2 + quarter / 2) + MODEL_SHARES - 2;
    share = share < 0 ? 0 : share >= MODEL_SHARES ? MODEL_SHARES - 1 : share;
    unsigned place = (unsigned)share * MODEL_PLANES + plane;
    if (octave < MODEL_OCTAVES + 2) {
        unsigned fifth = (unsigned)(offset * MODEL_OFFSETS >> 9);
        return (struct model_choice){
            ((octave - 2) * 4 + quarter) * MODEL_OFFSETS + fifth,
            ((octave - 2) * MODEL_SHARES * MODEL_PLANES + place) * 3 + (fifth + 1) / 2, 0};
    }
    unsigned low_bits = octave - MODEL_OCTAVES - 1;
    unsigned row = low_bits < MODEL_SHIFTS ? low_bits - 1 : MODEL_SHIFTS - 1;
    return (struct model_choice){MODEL_SLOW_WHOLE + row * 4 + quarter,
                                 MODEL_FAST_WHOLE + quarter * MODEL_SHARES * MODEL_PLANES + place,
                                 low_bits};
}

/* What the models begin with, trained by bench/train_symbol_codec: symbol_tables.c. */
extern const int16_t model_slow_first[MODEL_SLOW_COUNT][ENTROPY_SYMBOLS];
extern const int16_t model_fast_first[MODEL_FAST_COUNT][ENTROPY_SYMBOLS];
extern const int16_t model_escape_first[1][ENTROPY_SYMBOLS];
