#include "terrain/symbol_models.h"
#include "terrain/symbol_predict.h"

/* The tables are text, a line a model or a phase, so that a reader written from
 * docs/height-codec.md can use them too. */

const int16_t predictor_weights[PREDICTOR_SETS][PHASE_COUNT][TAPS_MAX] = {
#include "terrain/data/symbol_predictors.txt"
};

const int16_t form_weights[PHASE_COUNT][FORMS_MAX] = {
#include "terrain/data/symbol_forms.txt"
};

const int16_t error_weights[PHASE_COUNT][ERROR_TAPS_MAX] = {
#include "terrain/data/symbol_errors.txt"
};

const int16_t model_slow_first[MODEL_SLOW_COUNT][ENTROPY_SYMBOLS] = {
#include "terrain/data/symbol_slow.txt"
};

const int16_t model_fast_first[MODEL_FAST_COUNT][ENTROPY_SYMBOLS] = {
#include "terrain/data/symbol_fast.txt"
};

const int16_t model_escape_first[1][ENTROPY_SYMBOLS] = {
#include "terrain/data/symbol_escapes.txt"
};
