#include <stdlib.h>
#include <string.h>

#include "terrain/symbol_coder.h"

#define HALF_STEP (1 << (PREDICT_BITS - 1))

/* As many bits as they are, in chunks that the entropy coder takes. */
static inline void put_bits(struct symbol_coder *coder, uint64_t value, unsigned bits)
{
    while (bits > 0) {
        unsigned chunk = bits < ENTROPY_BITS ? bits : ENTROPY_BITS;
        bits -= chunk;
        entropy_put_raw(&coder->encoder, (uint32_t)(value >> bits) & ((1u << chunk) - 1), chunk);
    }
}

static inline uint64_t take_bits(struct entropy_decoder *decoder, unsigned bits)
{
    uint64_t value = 0;
    while (bits > 0) {
        unsigned chunk = bits < ENTROPY_BITS ? bits : ENTROPY_BITS;
        bits -= chunk;
        value = value << chunk | entropy_take_raw(decoder, chunk);
    }
    return value;
}

/* A quotient too large for its model: how many bits it has, its sign, the bits but the first. */
static void put_escape(struct symbol_coder *coder, int64_t quotient)
{
    uint32_t beyond = (uint32_t)(llabs(quotient) - (MODEL_MIDDLE + 1));
    unsigned bits = beyond ? 32 - (unsigned)__builtin_clz(beyond) : 0;
    entropy_put_symbol(&coder->encoder, (struct entropy_pair){&coder->escape[0], &coder->escape[1]},
                       (int)bits);
    put_bits(coder, quotient < 0, 1);
    if (bits > 1)
        put_bits(coder, beyond & ((1u << (bits - 1)) - 1), bits - 1);
}

static int64_t take_escape(struct symbol_coder *coder, struct entropy_decoder *decoder)
{
    unsigned bits = (unsigned)entropy_take_symbol(
        decoder, (struct entropy_pair){&coder->escape[0], &coder->escape[1]});
    bool negative = take_bits(decoder, 1);
    uint64_t beyond = bits > 1 ? 1ull << (bits - 1) | take_bits(decoder, bits - 1) : bits;
    int64_t quotient = (int64_t)beyond + MODEL_MIDDLE + 1;
    return negative ? -quotient : quotient;
}

static inline struct entropy_pair model_pair(struct symbol_coder *coder, struct model_choice choice)
{
    return (struct entropy_pair){&coder->slow[choice.slow], &coder->fast[choice.fast]};
}

static inline void put_difference(struct symbol_coder *coder, struct model_choice choice,
                                  int32_t difference)
{
    unsigned bits = choice.low_bits + coder->grid.shift;
    int64_t raised = (int64_t)difference + (int64_t)((1ull << bits) >> 1);
    int64_t quotient = raised >> bits;
    bool escape = quotient < -MODEL_MIDDLE || quotient > MODEL_MIDDLE;
    entropy_put_symbol(&coder->encoder, model_pair(coder, choice),
                       escape ? MODEL_ESCAPE : (int)quotient + MODEL_MIDDLE);
    if (escape)
        put_escape(coder, quotient);
    put_bits(coder, (uint64_t)raised & ((1ull << bits) - 1), bits);
}

static inline int32_t take_difference(struct symbol_coder *coder, struct entropy_decoder *decoder,
                                      struct model_choice choice)
{
    unsigned bits = choice.low_bits + coder->grid.shift;
    int symbol = entropy_take_symbol(decoder, model_pair(coder, choice));
    int64_t quotient = symbol - MODEL_MIDDLE;
    if (__builtin_expect(symbol == MODEL_ESCAPE, 0)) {
        struct entropy_decoder away = *decoder; /* so that the caller's can stay in registers */
        quotient = take_escape(coder, &away);
        *decoder = away;
    }
    uint64_t raised = (uint64_t)quotient << bits | take_bits(decoder, bits);
    return (int32_t)(uint32_t)(raised - ((1ull << bits) >> 1));
}

/* A row of a phase's plane. */
struct row {
    struct prediction_row predicted;
    int32_t west_weight, west_error_weight;
    int32_t *values, *errors, *symbols;
    int count, symbol_step;
    unsigned plane; /* as the models count */
    bool flat;      /* every post is its rounded prediction: nothing is coded */
};

/* The negative where `flip` is all ones. */
static inline uint32_t mirrored(uint32_t difference, int32_t flip)
{
    return (difference ^ (uint32_t)flip) - (uint32_t)flip;
}

/* Codes the posts one after the other. The booleans are constants where this is expanded. */
static inline __attribute__((always_inline)) void
code_row_as(struct symbol_coder *coder, struct row *row, bool encoding, bool masked)
{
    const struct symbol_grid *grid = &coder->grid;
    struct entropy_decoder decoder = coder->decoder;
    int32_t west = row->values[-1], west_error = row->errors[-1];
    for (int i = 0; i < row->count; i++) {
        int32_t *symbol = row->symbols + i * row->symbol_step;
        int32_t prediction = row->predicted.values[i] + row->west_weight * west;
        int32_t nearest = (prediction + HALF_STEP) >> PREDICT_BITS;
        uint32_t from = (uint32_t)grid->base + ((uint32_t)nearest << grid->shift);
        if (masked && *symbol == SYMBOL_NONE) {
            west = row->values[i] = grid_clamped(nearest);
            west_error = row->errors[i] = 0;
            continue;
        }
        if (!row->flat) {
            /* Mirrored where the prediction was rounded up, so that one model serves both. */
            int32_t offset = prediction - nearest * (1 << PREDICT_BITS), flip = offset >> 31;
            struct model_choice choice =
                model_choose(row->predicted.activities[i] + row->west_error_weight * west_error,
                             row->predicted.forms[i], offset ^ flip, row->plane);
            if (encoding) {
                uint32_t difference = (uint32_t)*symbol - from;
                put_difference(coder, choice, (int32_t)mirrored(difference, flip));
            } else {
                uint32_t difference = (uint32_t)take_difference(coder, &decoder, choice);
                *symbol = (int32_t)(from + mirrored(difference, flip));
            }
        } else if (!encoding)
            *symbol = (int32_t)from;
        west = row->values[i] = grid_value(grid, *symbol);
        int32_t error = abs(west * (1 << PREDICT_BITS) - prediction) >> (PREDICT_BITS - 4);
        west_error = row->errors[i] = error < GRID_ERROR_MAX ? error : GRID_ERROR_MAX;
    }
    coder->decoder = decoder;
}

/* Whether every post of the row is its rounded prediction. */
static bool is_flat(const struct symbol_grid *grid, const struct row *row)
{
    int32_t west = row->values[-1];
    for (int i = 0; i < row->count; i++) {
        int32_t symbol = row->symbols[i * row->symbol_step];
        int32_t nearest =
            (row->predicted.values[i] + row->west_weight * west + HALF_STEP) >> PREDICT_BITS;
        if (symbol == SYMBOL_NONE)
            west = grid_clamped(nearest);
        else if ((uint32_t)symbol != (uint32_t)grid->base + ((uint32_t)nearest << grid->shift))
            return false;
        else
            west = grid_value(grid, symbol);
    }
    return true;
}

static void row_init(struct row *row, struct symbol_coder *coder, enum phase phase, int index)
{
    struct symbol_grid *grid = &coder->grid;
    enum plane plane = phase_shapes[phase].plane;
    int step = PLANE_CELLS / grid->cells;
    int odd_row = plane == PLANE_CENTRE || plane == PLANE_ROW;
    int odd_col = plane == PLANE_CENTRE || plane == PLANE_COLUMN;
    row->plane = (unsigned)plane - PLANE_CENTRE;
    row->count = plane_cols(grid, plane);
    row->symbol_step = 2 * step;
    row->symbols = coder->symbols + ((2 * index + odd_row) * TILE_POSTS + odd_col) * step;
    row->values = grid->value[plane] + plane_index(index, 0);
    row->errors = grid->error[plane] + plane_index(index, 0);
    row->west_weight = predictor_weights[coder->set][phase][0];
    row->west_error_weight = error_weights[phase][0];
    symbol_predict_row(grid, phase, coder->set, index, &row->predicted);
    symbol_activity_row(grid, phase, index, &row->predicted);
    int32_t active = 0;
    for (int i = 0; i < row->count; i++)
        active |= row->predicted.activities[i];
    row->flat = false;
    if (active != 0)
        return;
    if (coder->encoding) {
        row->flat = is_flat(grid, row);
        entropy_put_bit(&coder->encoder, &coder->flat_rows[phase], row->flat);
    } else
        row->flat = entropy_take_bit(&coder->decoder, &coder->flat_rows[phase]);
}

CLONES static void code_row(struct symbol_coder *coder, enum phase phase, int index)
{
    struct row row;
    row_init(&row, coder, phase, index);
    if (coder->encoding && coder->masked)
        code_row_as(coder, &row, true, true);
    else if (coder->encoding)
        code_row_as(coder, &row, true, false);
    else if (coder->masked)
        code_row_as(coder, &row, false, true);
    else
        code_row_as(coder, &row, false, false);
}

static bool code_phase(struct symbol_coder *coder, enum phase phase)
{
    grid_fill_margin(&coder->grid, phase);
    int rows = plane_rows(&coder->grid, phase_shapes[phase].plane);
    for (int row = 0; row < rows && symbol_coder_going(coder); row++)
        code_row(coder, phase, row);
    return symbol_coder_going(coder);
}

static bool code_grid(struct symbol_coder *coder)
{
    return code_phase(coder, PHASE_CENTRE) && code_phase(coder, PHASE_ROW) &&
           code_phase(coder, PHASE_COLUMN);
}

/* The corners as they are; then grids of two, four, eight ... cells, each from the one before. */
static bool code_root(struct symbol_coder *coder)
{
    for (int corner = 0; corner < 4; corner++) {
        int row = corner / 2 * TILE_CELLS, col = corner % 2 * TILE_CELLS;
        int32_t *symbol = coder->symbols + row * TILE_POSTS + col;
        if (*symbol == SYMBOL_NONE)
            continue;
        if (coder->encoding)
            put_bits(coder, (uint32_t)*symbol, 32);
        else
            *symbol = (int32_t)(uint32_t)take_bits(&coder->decoder, 32);
    }
    bool going = true;
    for (int cells = 1; cells <= PLANE_CELLS && going; cells *= 2) {
        coder->grid.cells = cells;
        memset(coder->grid.error, 0, sizeof(coder->grid.error));
        grid_load(&coder->grid, PLANE_KNOWN, window_of_tile(coder->symbols, cells));
        going = code_grid(coder);
    }
    return going;
}

bool symbol_code_posts(struct symbol_coder *coder, const struct tile_parent *parent)
{
    if (!parent)
        return code_root(coder);
    coder->grid.cells = PLANE_CELLS;
    memset(coder->grid.error, 0, sizeof(coder->grid.error));
    grid_load(&coder->grid, PLANE_KNOWN, window_of_parent(parent, PLANE_KNOWN));
    if (!parent->same_columns)
        return code_grid(coder);
    grid_load(&coder->grid, PLANE_COLUMN, window_of_parent(parent, PLANE_COLUMN));
    return code_phase(coder, PHASE_ROW_ONLY) && code_phase(coder, PHASE_CENTRE_LAST);
}
