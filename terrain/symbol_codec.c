#include "terrain/symbol_codec.h"

#include <assert.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/symbol_models.h"
#include "terrain/symbol_predict.h"

enum payload_mode { MODE_EMPTY, MODE_CODED, MODE_RAW };
#define HEADER_SIZE   2
#define BASE_SIZE     4
#define SHIFT_MAX     14
#define ITEMS_MAX     (4 * TILE_POST_COUNT)
#define ROW_ITEMS     (TILE_POSTS * 10) /* at most in one row */
#define MASK_CONTEXTS 20

/* One tile on its way in or out. */
struct coder {
    struct symbol_grid grid;
    union entropy_model models[MODEL_COUNT], escape;
    entropy_bit_model flat_rows[PHASE_COUNT], mask[MASK_CONTEXTS];
    struct entropy_encoder encoder;
    struct entropy_decoder decoder;
    int32_t *symbols; /* of the tile; read or written */
    int32_t base;
    unsigned shift, set;
    bool encoding, masked;
};

/* Where the posts of a plane that are known beforehand lie in an array of symbols. */
struct window {
    const int32_t *symbols; /* that of row 0, column 0 of the plane */
    int row_step, col_step;
    int first_row, last_row, first_col, last_col; /* what there is, in rows of the plane */
};

static int clamped(int value, int low, int high)
{
    return value < low ? low : value > high ? high : value;
}

static struct window window_cut(struct window window, int rows, int cols)
{
    window.first_row = clamped(window.first_row, -PLANE_MARGIN, 0);
    window.first_col = clamped(window.first_col, -PLANE_MARGIN, 0);
    window.last_row = clamped(window.last_row, 0, rows - 1 + PLANE_MARGIN);
    window.last_col = clamped(window.last_col, 0, cols - 1 + PLANE_MARGIN);
    return window;
}

static const int32_t *window_at(const struct window *window, int row, int col)
{
    return window->symbols + row * window->row_step + col * window->col_step;
}

/* The plane's window into the parent. */
static struct window parent_window(const struct tile_parent *parent, enum plane plane)
{
    int row = parent->row_half * PLANE_CELLS;
    int col = parent->same_columns ? plane == PLANE_COLUMN : parent->col_half * PLANE_CELLS;
    int col_step = parent->same_columns ? 2 : 1;
    struct window window = {
        .symbols = parent->symbols + row * TILE_POSTS + col,
        .row_step = TILE_POSTS,
        .col_step = col_step,
        .first_row = -row,
        .last_row = TILE_CELLS - row,
        .first_col = -col / col_step,
        .last_col = (TILE_CELLS - col) / col_step,
    };
    return window_cut(window, PLANE_CELLS + 1, PLANE_CELLS + (plane == PLANE_KNOWN));
}

/* A tile without a parent is its own, ever finer. */
static struct window own_window(const int32_t *symbols, int cells)
{
    int step = TILE_CELLS / cells;
    return (struct window){symbols, step * TILE_POSTS, step, 0, cells, 0, cells};
}

static int32_t value_from_symbol(const struct coder *coder, int32_t symbol)
{
    int64_t value = ((int64_t)symbol - coder->base) >> coder->shift;
    return value < -GRID_VALUE_MAX  ? -GRID_VALUE_MAX
           : value > GRID_VALUE_MAX ? GRID_VALUE_MAX
                                    : (int32_t)value;
}

/* Posts without data take the value west of them, or where the row begins without, its first. False
 * where the row has none. */
static bool fill_row(int32_t *row, int first, int last, const int32_t *symbols, int step,
                     const struct coder *coder)
{
    int begin = first;
    while (begin <= last && symbols[begin * step] == SYMBOL_NONE)
        begin++;
    if (begin > last)
        return false;
    for (int col = begin; col <= last; col++)
        row[col] = symbols[col * step] == SYMBOL_NONE
                       ? row[col - 1]
                       : value_from_symbol(coder, symbols[col * step]);
    for (int col = first; col < begin; col++)
        row[col] = row[begin];
    return true;
}

/* Continues a line of `count` values from `at` by `step` beyond its first one, straight on. */
static void continue_line(int32_t *at, int step, int count)
{
    for (int i = 1; i <= count; i++)
        at[-i * step] = at[0];
}

/* Fills a plane of the grid, margins included, from what is known; zeros where nothing is. */
static void load_plane(struct coder *coder, enum plane plane, struct window window)
{
    int32_t *values = coder->grid.value[plane];
    int last_row = plane_rows(&coder->grid, plane) - 1 + PLANE_MARGIN;
    int last_col = plane_cols(&coder->grid, plane) - 1 + PLANE_MARGIN;
    int filled = window.last_row + 1; /* the first row that has data */
    for (int row = window.first_row; row <= window.last_row; row++) {
        int32_t *to = values + plane_index(row, 0);
        if (fill_row(to, window.first_col, window.last_col, window_at(&window, row, 0),
                     window.col_step, coder)) {
            if (filled > row)
                filled = row;
        } else if (filled < row) {
            for (int col = window.first_col; col <= window.last_col; col++)
                to[col] = to[col - PLANE_STRIDE];
        }
    }
    for (int row = (filled <= window.last_row ? filled : window.last_row + 1) - 1;
         row >= window.first_row; row--)
        for (int col = window.first_col; col <= window.last_col; col++) {
            int32_t *to = values + plane_index(row, col);
            *to = filled <= window.last_row ? to[PLANE_STRIDE] : 0;
        }
    for (int row = window.first_row; row <= window.last_row; row++) {
        continue_line(values + plane_index(row, window.first_col), 1,
                      window.first_col + PLANE_MARGIN);
        continue_line(values + plane_index(row, window.last_col), -1, last_col - window.last_col);
    }
    for (int col = -PLANE_MARGIN; col <= last_col; col++) {
        continue_line(values + plane_index(window.first_row, col), PLANE_STRIDE,
                      window.first_row + PLANE_MARGIN);
        continue_line(values + plane_index(window.last_row, col), -PLANE_STRIDE,
                      last_row - window.last_row);
    }
}

/* A difference too large for its model: the number of its bits, its sign, the bits. */
static void put_escape(struct coder *coder, int64_t quotient)
{
    bool negative = quotient < 0;
    uint32_t beyond = (uint32_t)((negative ? -quotient : quotient) - (MODEL_MIDDLE + 1));
    unsigned bits = beyond ? 32 - (unsigned)__builtin_clz(beyond) : 0;
    entropy_put_symbol(&coder->encoder, &coder->escape, (int)bits);
    entropy_put_raw(&coder->encoder, negative, 1);
    for (unsigned left = bits > 0 ? bits - 1 : 0; left > 0;) {
        unsigned chunk = left < ENTROPY_BITS ? left : ENTROPY_BITS;
        left -= chunk;
        entropy_put_raw(&coder->encoder, beyond >> left & ((1u << chunk) - 1), chunk);
    }
}

static int64_t take_escape(struct coder *coder)
{
    unsigned bits = (unsigned)entropy_take_symbol(&coder->decoder, &coder->escape);
    bool negative = entropy_take_raw(&coder->decoder, 1);
    uint32_t beyond = bits > 0;
    for (unsigned left = bits > 0 ? bits - 1 : 0; left > 0;) {
        unsigned chunk = left < ENTROPY_BITS ? left : ENTROPY_BITS;
        left -= chunk;
        beyond = beyond << chunk | entropy_take_raw(&coder->decoder, chunk);
    }
    int64_t quotient = (int64_t)beyond + MODEL_MIDDLE + 1;
    return negative ? -quotient : quotient;
}

static void put_low_bits(struct coder *coder, uint64_t low, unsigned bits)
{
    while (bits > 0) {
        unsigned chunk = bits < ENTROPY_BITS ? bits : ENTROPY_BITS;
        bits -= chunk;
        entropy_put_raw(&coder->encoder, (uint32_t)(low >> bits) & ((1u << chunk) - 1), chunk);
    }
}

static uint64_t take_low_bits(struct coder *coder, unsigned bits)
{
    uint64_t low = 0;
    while (bits > 0) {
        unsigned chunk = bits < ENTROPY_BITS ? bits : ENTROPY_BITS;
        bits -= chunk;
        low = low << chunk | entropy_take_raw(&coder->decoder, chunk);
    }
    return low;
}

static inline void put_difference(struct coder *coder, struct model_choice choice,
                                  int32_t difference)
{
    unsigned bits = choice.low_bits + coder->shift;
    int64_t raised = (int64_t)difference + (int64_t)((1ull << bits) >> 1);
    int64_t quotient = raised >> bits;
    bool escape = quotient < -MODEL_MIDDLE || quotient > MODEL_MIDDLE;
    entropy_put_symbol(&coder->encoder, &coder->models[choice.model],
                       escape ? MODEL_ESCAPE : (int)quotient + MODEL_MIDDLE);
    if (escape)
        put_escape(coder, quotient);
    put_low_bits(coder, (uint64_t)raised & ((1ull << bits) - 1), bits);
}

static inline int32_t take_difference(struct coder *coder, struct model_choice choice)
{
    unsigned bits = choice.low_bits + coder->shift;
    int symbol = entropy_take_symbol(&coder->decoder, &coder->models[choice.model]);
    int64_t quotient = symbol - MODEL_MIDDLE;
    if (__builtin_expect(symbol == MODEL_ESCAPE, 0))
        quotient = take_escape(coder);
    uint64_t raised = ((uint64_t)quotient << bits) | take_low_bits(coder, bits);
    return (int32_t)(uint32_t)(raised - ((1ull << bits) >> 1));
}

/* Codes a row of a plane. `encoding` and `masked` are constants where this is expanded. */
static inline __attribute__((always_inline)) void
code_row_as(struct coder *coder, enum phase phase, int row, int step, bool encoding, bool masked)
{
    const struct phase_shape *shape = &phase_shapes[phase];
    enum plane plane = shape->plane;
    int count = plane_cols(&coder->grid, plane);
    int32_t predictions[PLANE_STRIDE], activities[PLANE_STRIDE];
    symbol_predict_row(&coder->grid, phase, coder->set, row, count, predictions, activities);
    int32_t active = 0;
    for (int i = 0; i < count; i++)
        active |= activities[i];
    bool odd_row = plane == PLANE_CENTRE || plane == PLANE_ROW;
    bool odd_col = plane == PLANE_CENTRE || plane == PLANE_COLUMN;
    int32_t *symbols = coder->symbols + (2 * row + odd_row) * step * TILE_POSTS + odd_col * step;
    int32_t *values = coder->grid.value[plane] + plane_index(row, 0);
    int32_t *errors = coder->grid.error[plane] + plane_index(row, 0);
    int32_t west_weight = predictor_weights[coder->set][phase][0];
    int32_t west_error_weight = error_weights[phase][0];
    bool flat = false;
    if (active == 0) {
        if (encoding) {
            flat = true; /* found out below */
            int32_t west = values[-1];
            for (int i = 0; i < count && flat; i++) {
                int32_t nearest =
                    (predictions[i] + west_weight * west + (1 << (PREDICT_BITS - 1))) >>
                    PREDICT_BITS;
                int32_t symbol = symbols[2 * step * i];
                if (symbol == SYMBOL_NONE)
                    west = nearest;
                else {
                    flat = (uint32_t)symbol - (uint32_t)coder->base == (uint32_t)nearest
                                                                           << coder->shift;
                    west = value_from_symbol(coder, symbol);
                }
            }
            entropy_put_bit(&coder->encoder, &coder->flat_rows[phase], flat);
        } else
            flat = entropy_take_bit(&coder->decoder, &coder->flat_rows[phase]);
    }
    int32_t west = values[-1], west_error = errors[-1];
    for (int i = 0; i < count; i++) {
        int32_t *symbol = symbols + 2 * step * i;
        int32_t prediction = predictions[i] + west_weight * west;
        int32_t nearest = (prediction + (1 << (PREDICT_BITS - 1))) >> PREDICT_BITS;
        int32_t offset = prediction - (nearest << PREDICT_BITS);
        int32_t flip = offset >> 31;
        if (masked && *symbol == SYMBOL_NONE) {
            west = values[i] = clamped(nearest, -GRID_VALUE_MAX, GRID_VALUE_MAX);
            west_error = errors[i] = 0;
            continue;
        }
        uint32_t from = (uint32_t)coder->base + ((uint32_t)nearest << coder->shift);
        if (!flat) {
            struct model_choice choice =
                model_choose(activities[i] + west_error_weight * west_error, offset ^ flip);
            if (encoding) {
                int32_t difference = (int32_t)((uint32_t)*symbol - from);
                put_difference(coder, choice, (difference ^ flip) - flip);
            } else {
                int32_t difference = take_difference(coder, choice);
                *symbol = (int32_t)(from + (uint32_t)((difference ^ flip) - flip));
            }
        } else if (!encoding)
            *symbol = (int32_t)from;
        west = values[i] = value_from_symbol(coder, *symbol);
        int32_t error = abs((west << PREDICT_BITS) - prediction) >> 6;
        west_error = errors[i] = error < GRID_ERROR_MAX ? error : GRID_ERROR_MAX;
    }
}

static void code_row(struct coder *coder, enum phase phase, int row, int step)
{
    if (coder->encoding && coder->masked)
        code_row_as(coder, phase, row, step, true, true);
    else if (coder->encoding)
        code_row_as(coder, phase, row, step, true, false);
    else if (coder->masked)
        code_row_as(coder, phase, row, step, false, true);
    else
        code_row_as(coder, phase, row, step, false, false);
}

/* False where there is no room left, or nothing left to read. */
static bool room_left(const struct coder *coder)
{
    return coder->encoding ? coder->encoder.count + ROW_ITEMS <= coder->encoder.limit
                           : !entropy_decoder_overrun(&coder->decoder);
}

static bool code_phase(struct coder *coder, enum phase phase, int step)
{
    symbol_fill_margin(&coder->grid, phase);
    int rows = plane_rows(&coder->grid, phase_shapes[phase].plane);
    for (int row = 0; row < rows && room_left(coder); row++)
        code_row(coder, phase, row, step);
    return room_left(coder);
}

/* Posts of a grid in the tile, every `step`-th: those that no window knows. */
static bool code_grid(struct coder *coder, int step, bool same_columns)
{
    if (same_columns)
        return code_phase(coder, PHASE_ROW_ONLY, step) &&
               code_phase(coder, PHASE_CENTRE_LAST, step);
    return code_phase(coder, PHASE_CENTRE, step) && code_phase(coder, PHASE_ROW, step) &&
           code_phase(coder, PHASE_COLUMN, step);
}

static bool code_root(struct coder *coder)
{
    for (int corner = 0; corner < 4; corner++) {
        int32_t *symbol =
            coder->symbols + (corner / 2) * TILE_CELLS * TILE_POSTS + (corner % 2) * TILE_CELLS;
        if (*symbol == SYMBOL_NONE)
            continue;
        if (coder->encoding)
            put_low_bits(coder, (uint32_t)*symbol, 32);
        else
            *symbol = (int32_t)(uint32_t)take_low_bits(coder, 32);
    }
    bool going = true;
    for (int cells = 1; cells <= PLANE_CELLS && going; cells *= 2) {
        coder->grid.cells = cells;
        memset(coder->grid.error, 0, sizeof(coder->grid.error));
        load_plane(coder, PLANE_KNOWN, own_window(coder->symbols, cells));
        going = code_grid(coder, PLANE_CELLS / cells, false);
    }
    return going;
}

/* Codes which posts have data: marks the others in the decoder's symbols. */
static bool code_mask_post(struct coder *coder, int row, int col, int step, bool odd_row,
                           bool odd_col)
{
    int32_t *at = coder->symbols + row * TILE_POSTS + col;
    int south = row >= step ? -step * TILE_POSTS : step * TILE_POSTS;
    int north = row + step < TILE_POSTS ? step * TILE_POSTS : -step * TILE_POSTS;
    int west = col >= step ? -step : step, east = col + step < TILE_POSTS ? step : -step;
    int known;
    if (odd_row && odd_col)
        known = (at[south + west] != SYMBOL_NONE) + (at[south + east] != SYMBOL_NONE) +
                (at[north + west] != SYMBOL_NONE) + (at[north + east] != SYMBOL_NONE);
    else
        known = (at[south] != SYMBOL_NONE) + (at[north] != SYMBOL_NONE) +
                (at[west] != SYMBOL_NONE) + (at[east] != SYMBOL_NONE);
    bool before = col < 2 * step || at[-2 * step] != SYMBOL_NONE;
    bool below = row < 2 * step || at[-2 * step * TILE_POSTS] != SYMBOL_NONE;
    entropy_bit_model *model = &coder->mask[known * 4 + before * 2 + below];
    if (coder->encoding)
        entropy_put_bit(&coder->encoder, model, *at != SYMBOL_NONE);
    else
        *at = entropy_take_bit(&coder->decoder, model) ? 0 : SYMBOL_NONE;
    return room_left(coder);
}

static bool code_mask_grid(struct coder *coder, int step, bool same_columns)
{
    static const bool odd_rows[] = {true, true, false}, odd_cols[] = {true, false, true};
    bool going = true;
    for (int phase = 0; phase < 3; phase++) {
        bool odd_row = odd_rows[phase], odd_col = odd_cols[phase];
        if (same_columns && !odd_row)
            continue;
        for (int row = odd_row * step; row < TILE_POSTS; row += 2 * step)
            for (int col = odd_col * step; going && col < TILE_POSTS; col += 2 * step)
                going = code_mask_post(coder, row, col, step, odd_row, odd_col && !same_columns);
    }
    return going;
}

static bool code_mask(struct coder *coder, const struct tile_parent *parent)
{
    if (parent)
        return code_mask_grid(coder, 1, parent->same_columns);
    for (int corner = 0; corner < 4; corner++) {
        int32_t *at =
            coder->symbols + (corner / 2) * TILE_CELLS * TILE_POSTS + (corner % 2) * TILE_CELLS;
        if (coder->encoding)
            entropy_put_raw(&coder->encoder, *at != SYMBOL_NONE, 1);
        else
            *at = entropy_take_raw(&coder->decoder, 1) ? 0 : SYMBOL_NONE;
    }
    bool going = true;
    for (int step = TILE_CELLS / 2; going && step >= 1; step /= 2)
        going = code_mask_grid(coder, step, false);
    return going;
}

static bool code_tile(struct coder *coder, const struct tile_parent *parent)
{
    if (coder->masked && !code_mask(coder, parent))
        return false;
    if (!parent)
        return code_root(coder);
    return code_grid(coder, 1, parent->same_columns);
}

static void coder_init(struct coder *coder, int32_t *symbols)
{
    memset(coder->grid.error, 0, sizeof(coder->grid.error));
    memcpy(coder->models, model_first, sizeof(coder->models));
    coder->escape = model_escape_first;
    for (int i = 0; i < PHASE_COUNT; i++)
        coder->flat_rows[i] = ENTROPY_TOTAL / 2;
    for (int i = 0; i < MASK_CONTEXTS; i++)
        coder->mask[i] = ENTROPY_TOTAL / 2;
    coder->symbols = symbols;
    coder->grid.cells = PLANE_CELLS;
}

static bool find_base(const struct window *window, int32_t *ret_base)
{
    for (int row = window->first_row; row <= window->last_row; row++)
        for (int col = window->first_col; col <= window->last_col; col++) {
            int32_t symbol = *window_at(window, row, col);
            if (symbol != SYMBOL_NONE) {
                *ret_base = symbol;
                return true;
            }
        }
    return false;
}

static void load_parent(struct coder *coder, const struct tile_parent *parent)
{
    load_plane(coder, PLANE_KNOWN, parent_window(parent, PLANE_KNOWN));
    if (parent->same_columns)
        load_plane(coder, PLANE_COLUMN, parent_window(parent, PLANE_COLUMN));
}

static bool base_from_parent(const struct tile_parent *parent, int32_t *ret_base)
{
    if (!parent)
        return false;
    struct window window = parent_window(parent, PLANE_KNOWN);
    return find_base(&window, ret_base);
}

/* True for posts of the parent: they are not in the payload. */
static bool is_inherited(const struct tile_parent *parent, int row, int col)
{
    return parent && row % 2 == 0 && (col % 2 == 0 || parent->same_columns);
}

static const int32_t *inherited(const struct tile_parent *parent, int row, int col)
{
    int from_row = parent->row_half * PLANE_CELLS + row / 2;
    int from_col = parent->same_columns ? col : parent->col_half * PLANE_CELLS + col / 2;
    return parent->symbols + from_row * TILE_POSTS + from_col;
}

static size_t encode_raw(const int32_t *symbols, const struct tile_parent *parent,
                         uint8_t *ret_payload)
{
    size_t size = HEADER_SIZE;
    ret_payload[0] = MODE_RAW;
    ret_payload[1] = 0;
    for (int row = 0; row < TILE_POSTS; row++)
        for (int col = 0; col < TILE_POSTS; col++)
            if (!is_inherited(parent, row, col))
                for (int byte = 0; byte < 4; byte++)
                    ret_payload[size++] =
                        (uint8_t)((uint32_t)symbols[row * TILE_POSTS + col] >> 8 * byte);
    return size;
}

static void survey(struct coder *coder, bool *ret_empty)
{
    int64_t farthest = 0;
    bool empty = true;
    for (int i = 0; i < TILE_POST_COUNT; i++) {
        if (coder->symbols[i] == SYMBOL_NONE) {
            coder->masked = true;
            continue;
        }
        empty = false;
        int64_t away = llabs((int64_t)coder->symbols[i] - coder->base);
        farthest = away > farthest ? away : farthest;
    }
    coder->shift = 0;
    while (farthest >> coder->shift > GRID_VALUE_MAX)
        coder->shift++;
    *ret_empty = empty;
}

size_t symbols_encode(const int32_t *symbols, const struct tile_parent *parent,
                      uint8_t *ret_payload)
{
    uint32_t items[ITEMS_MAX];
    struct coder coder;
    coder_init(&coder, (int32_t *)(uintptr_t)symbols);
    coder.encoding = true;
    coder.masked = false;
    coder.encoder = (struct entropy_encoder){.items = items, .limit = ITEMS_MAX};
    coder.base = 0;
    bool empty, known_base = base_from_parent(parent, &coder.base);
    if (!known_base)
        find_base(&(struct window){symbols, TILE_POSTS, 1, 0, TILE_CELLS, 0, TILE_CELLS},
                  &coder.base);
    survey(&coder, &empty);
    ret_payload[0] = empty ? MODE_EMPTY : (uint8_t)(MODE_CODED | coder.masked << 2);
    ret_payload[1] = (uint8_t)coder.shift;
    if (empty)
        return HEADER_SIZE;
    size_t head = HEADER_SIZE;
    for (int byte = 0; !known_base && byte < BASE_SIZE; byte++)
        ret_payload[head++] = (uint8_t)((uint32_t)coder.base >> 8 * byte);
    if (parent)
        load_parent(&coder, parent);
    coder.set = 0;
    ret_payload[0] |= (uint8_t)(coder.set << 4);
    if (!code_tile(&coder, parent))
        return encode_raw(symbols, parent, ret_payload);
    size_t room = 4 * TILE_POST_COUNT;
    size_t body = entropy_encoder_write(&coder.encoder, ret_payload + head, room - head);
    return body ? head + body : encode_raw(symbols, parent, ret_payload);
}

static int decode_raw(const uint8_t *payload, size_t size, const struct tile_parent *parent,
                      int32_t *ret_symbols, struct diag *diag)
{
    size_t at = HEADER_SIZE;
    for (int row = 0; row < TILE_POSTS; row++)
        for (int col = 0; col < TILE_POSTS; col++) {
            if (is_inherited(parent, row, col))
                continue;
            if (size - at < 4)
                return diag_set(diag, -EBADMSG, "payload of %zu bytes is cut", size);
            ret_symbols[row * TILE_POSTS + col] =
                (int32_t)((uint32_t)payload[at] | (uint32_t)payload[at + 1] << 8 |
                          (uint32_t)payload[at + 2] << 16 | (uint32_t)payload[at + 3] << 24);
            at += 4;
        }
    return at == size ? 0 : diag_set(diag, -EBADMSG, "payload has bytes too many");
}

int symbols_decode(const uint8_t *payload, size_t size, const struct tile_parent *parent,
                   int32_t *ret_symbols, struct diag *diag)
{
    if (size < HEADER_SIZE || size > SYMBOL_PAYLOAD_MAX)
        return diag_set(diag, -EBADMSG, "a payload has no %zu bytes", size);
    unsigned mode = payload[0] & 3;
    if (mode == 3 || payload[0] & 8 || payload[1] > SHIFT_MAX)
        return diag_set(diag, -EBADMSG, "payload header is not valid");
    for (int row = 0, i = 0; row < TILE_POSTS; row++)
        for (int col = 0; col < TILE_POSTS; col++, i++)
            ret_symbols[i] = mode == MODE_EMPTY               ? SYMBOL_NONE
                             : is_inherited(parent, row, col) ? *inherited(parent, row, col)
                                                              : 0;
    if (mode == MODE_EMPTY)
        return 0;
    if (mode == MODE_RAW)
        return decode_raw(payload, size, parent, ret_symbols, diag);
    struct coder coder;
    coder_init(&coder, ret_symbols);
    coder.encoding = false;
    coder.masked = payload[0] & 4;
    coder.set = payload[0] >> 4;
    coder.shift = payload[1];
    size_t head = HEADER_SIZE;
    if (!base_from_parent(parent, &coder.base)) {
        if (size < head + BASE_SIZE)
            return diag_set(diag, -EBADMSG, "payload of %zu bytes is cut", size);
        coder.base = (int32_t)((uint32_t)payload[2] | (uint32_t)payload[3] << 8 |
                               (uint32_t)payload[4] << 16 | (uint32_t)payload[5] << 24);
        head += BASE_SIZE;
    }
    if (size < head + ENTROPY_SIZE_MIN)
        return diag_set(diag, -EBADMSG, "payload of %zu bytes is cut", size);
    uint8_t padded[SYMBOL_PAYLOAD_MAX + ENTROPY_PADDING];
    memcpy(padded, payload + head, size - head);
    memset(padded + size - head, 0, ENTROPY_PADDING);
    entropy_decoder_init(&coder.decoder, padded, size - head);
    if (parent)
        load_parent(&coder, parent);
    if (!code_tile(&coder, parent) || !entropy_decoder_done(&coder.decoder))
        return diag_set(diag, -EBADMSG, "payload does not end where its tile does");
    return 0;
}
