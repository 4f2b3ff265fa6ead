/* The payload of a tile, from docs/height-codec.md alone. Written to be compared with that page
 * line by line, not to be fast. */
#include "tests/independent_reader.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/independent_entropy.h"

#define SIDE_MAX   69 /* of a plane with its margins */
#define VALUE_MAX  ((1 << 18) - 1)
#define ERROR_MAX  (1 << 20)
#define TAPS_MAX   24
#define FORMS_MAX  5
#define ERRORS_MAX 12

enum plane { PLANE_K, PLANE_X, PLANE_R, PLANE_C, PLANES };

/* Lines of the tables. */
enum phase_name { PHASE_X, PHASE_R, PHASE_C, PHASE_R_SAME, PHASE_X_SAME, PHASES };

static const int predictors[16][PHASES][TAPS_MAX] = {
#include "terrain/data/symbol_predictors.txt"
};
static const int form_weights[PHASES][FORMS_MAX] = {
#include "terrain/data/symbol_forms.txt"
};
static const int error_weights[PHASES][ERRORS_MAX] = {
#include "terrain/data/symbol_errors.txt"
};
/* The section "Lists" as it stands in the page. */
static const struct {
    enum plane plane;
    const char *around, *taps, *forms, *errors;
} lists[PHASES] = {
    [PHASE_X] = {PLANE_X, "K0,0 K1,1 K0,1 K1,0",
                 "X0,-1 K0,0 K0,1 K1,0 K1,1 K0,-1 K0,2 K1,-1 K1,2 K-1,0 K-1,1 K2,0 K2,1 K-1,-1 "
                 "K-1,2 K2,-1 K2,2 X-1,-1 X-1,0 X-1,1",
                 "K0,0 K1,1 K0,1 K1,0; K0,0 K0,0 K1,1 K1,1; K0,1 K0,1 K1,0 K1,0; K0,-1 K1,2 K0,0 "
                 "K1,1; K-1,1 K2,0 K0,1 K1,0",
                 "X0,-1 X-1,0 X-1,-1 X-1,1 X-2,0"},
    [PHASE_R] = {PLANE_R, "K0,0 K1,0 X0,-1 X0,0",
                 "R0,-1 K0,0 K1,0 X0,-1 X0,0 K0,-1 K0,1 K1,-1 K1,1 K-1,0 K2,0 X0,-2 X0,1 X-1,-1 "
                 "X-1,0 X1,-1 X1,0 R-1,-1 R-1,0 R-1,1",
                 "K0,0 K1,0 X0,-1 X0,0; K0,0 K0,0 K1,0 K1,0; X0,-1 X0,-1 X0,0 X0,0",
                 "R0,-1 X0,-1 X0,0 X-1,-1 X-1,0 X1,-1 X1,0 R-1,0 R-1,-1 R-1,1"},
    [PHASE_C] = {PLANE_C, "K0,0 K0,1 X-1,0 X0,0",
                 "C0,-1 K0,0 K0,1 X-1,0 X0,0 K-1,0 K1,0 K-1,1 K1,1 K0,-1 K0,2 X-2,0 X1,0 X-1,-1 "
                 "X0,-1 X-1,1 X0,1 C-1,-1 C-1,0 C-1,1 R-1,0 R-1,1 R0,0 R0,1",
                 "K0,0 K0,1 X-1,0 X0,0; X-1,0 X-1,0 X0,0 X0,0; K0,0 K0,0 K0,1 K0,1",
                 "C0,-1 X-1,0 X0,0 R-1,0 R-1,1 R0,0 R0,1 C-1,0 C-1,-1 C-1,1"},
    [PHASE_R_SAME] = {PLANE_R, "K0,0 K1,0 K0,0 K1,0", "R0,-1 K0,0 K1,0 K-1,0 K2,0",
                      "K0,0 K1,0 K-1,0 K2,0; K0,0 K0,0 K1,0 K1,0", "R0,-1 R-1,0"},
    [PHASE_X_SAME] = {PLANE_X, "C0,0 C1,0 C0,0 C1,0", "X0,-1 C0,0 C1,0 C-1,0 C2,0",
                      "C0,0 C1,0 R0,0 R0,1; C0,0 C0,0 C1,0 C1,0", "X0,-1 X-1,0 R0,0 R0,1"},
};

struct place {
    int plane, i, j;
};

struct phase {
    struct place around[4], taps[TAPS_MAX], forms[4 * FORMS_MAX], errors[ERRORS_MAX];
    int tap_count, form_count, error_count;
};

struct decoder {
    struct phase phases[PHASES];
    struct entropy entropy;
    int flat_bits[PHASES], mask_bits[20], repeat_bits[2];
    int set, shift, m;
    int32_t base;
    int32_t value[PLANES][SIDE_MAX][SIDE_MAX], error[PLANES][SIDE_MAX][SIDE_MAX];
    bool has[READER_POSTS][READER_POSTS];
    int32_t *symbols;
};

static int parse_places(const char *text, struct place *ret_places)
{
    int count = 0;
    while (*text) {
        char name;
        int i, j, length;
        if (sscanf(text, " %c%d,%d%n", &name, &i, &j, &length) != 3)
            abort();
        int plane = (int)(strchr("KXRC", name) - "KXRC");
        ret_places[count++] = (struct place){plane, i, j};
        text += length + (text[length] == ';');
    }
    return count;
}

static void parse_lists(struct decoder *d)
{
    for (int p = 0; p < PHASES; p++) {
        struct phase *phase = &d->phases[p];
        parse_places(lists[p].around, phase->around);
        phase->tap_count = parse_places(lists[p].taps, phase->taps);
        phase->form_count = parse_places(lists[p].forms, phase->forms) / 4;
        phase->error_count = parse_places(lists[p].errors, phase->errors);
    }
}

static int64_t min64(int64_t a, int64_t b)
{
    return a < b ? a : b;
}

static int32_t in_range(int64_t value)
{
    return (int32_t)(value < -VALUE_MAX ? -VALUE_MAX : value > VALUE_MAX ? VALUE_MAX : value);
}

static int floor_log2(uint64_t value)
{
    int bits = -1;
    for (; value; value >>= 1)
        bits++;
    return bits;
}

static void fresh_bits(struct decoder *d)
{
    for (int i = 0; i < PHASES; i++)
        d->flat_bits[i] = ENTROPY_BIT_START;
    for (int i = 0; i < 20; i++)
        d->mask_bits[i] = ENTROPY_BIT_START;
    d->repeat_bits[0] = d->repeat_bits[1] = ENTROPY_BIT_START;
}

/* Planes */

static int plane_rows(const struct decoder *d, int plane)
{
    return plane == PLANE_K || plane == PLANE_C ? d->m + 1 : d->m;
}

static int plane_cols(const struct decoder *d, int plane)
{
    return plane == PLANE_K || plane == PLANE_R ? d->m + 1 : d->m;
}

static int32_t *value_at(struct decoder *d, int plane, int i, int j)
{
    return &d->value[plane][i + 2][j + 2];
}

static int32_t *error_at(struct decoder *d, int plane, int i, int j)
{
    return &d->error[plane][i + 2][j + 2];
}

static int32_t value_of(const struct decoder *d, int32_t symbol)
{
    return in_range(((int64_t)symbol - d->base) >> d->shift);
}

/* Where a plane's posts are in 129 x 129 symbols: post (i, j) at (row + i step, col + j stride). */
struct window {
    const int32_t *symbols;
    int row, col, step, stride;
    int first_row, last_row, first_col, last_col; /* those that are there */
};

static struct window window_of(const struct decoder *d, int plane, const int32_t *symbols, int row,
                               int col, int step, int stride)
{
    struct window w = {symbols, row, col, step, stride, -2, 0, -2, 0};
    w.last_row = plane_rows(d, plane) + 1;
    w.last_col = plane_cols(d, plane) + 1;
    while (row + w.first_row * step < 0)
        w.first_row++;
    while (row + w.last_row * step >= READER_POSTS)
        w.last_row--;
    while (col + w.first_col * stride < 0)
        w.first_col++;
    while (col + w.last_col * stride >= READER_POSTS)
        w.last_col--;
    return w;
}

static int32_t window_symbol(const struct window *w, int i, int j)
{
    return w->symbols[(w->row + i * w->step) * READER_POSTS + w->col + j * w->stride];
}

/* READER_NO_DATA where no post of the window has data. */
static int32_t first_symbol(const struct window *w)
{
    for (int i = w->first_row; i <= w->last_row; i++)
        for (int j = w->first_col; j <= w->last_col; j++)
            if (window_symbol(w, i, j) != READER_NO_DATA)
                return window_symbol(w, i, j);
    return READER_NO_DATA;
}

/* False where the row has no data. */
static bool load_row(struct decoder *d, int plane, const struct window *w, int i)
{
    int first = w->first_col;
    while (first <= w->last_col && window_symbol(w, i, first) == READER_NO_DATA)
        first++;
    if (first > w->last_col)
        return false;
    int32_t value = value_of(d, window_symbol(w, i, first));
    for (int j = w->first_col; j <= w->last_col; j++) {
        if (window_symbol(w, i, j) != READER_NO_DATA)
            value = value_of(d, window_symbol(w, i, j));
        *value_at(d, plane, i, j) = value;
    }
    return true;
}

static void extend(struct decoder *d, int plane, const struct window *w)
{
    int rows = plane_rows(d, plane), cols = plane_cols(d, plane);
    for (int i = w->first_row; i <= w->last_row; i++) {
        int64_t a = *value_at(d, plane, i, w->first_col);
        int64_t b = *value_at(d, plane, i, w->first_col + 1);
        for (int k = 1; w->first_col - k >= -2; k++)
            *value_at(d, plane, i, w->first_col - k) = in_range(a + k * (a - b));
        a = *value_at(d, plane, i, w->last_col);
        b = *value_at(d, plane, i, w->last_col - 1);
        for (int k = 1; w->last_col + k <= cols + 1; k++)
            *value_at(d, plane, i, w->last_col + k) = in_range(a + k * (a - b));
    }
    for (int j = -2; j <= cols + 1; j++) {
        int64_t a = *value_at(d, plane, w->first_row, j);
        int64_t b = *value_at(d, plane, w->first_row + 1, j);
        for (int k = 1; w->first_row - k >= -2; k++)
            *value_at(d, plane, w->first_row - k, j) = in_range(a + k * (a - b));
        a = *value_at(d, plane, w->last_row, j);
        b = *value_at(d, plane, w->last_row - 1, j);
        for (int k = 1; w->last_row + k <= rows + 1; k++)
            *value_at(d, plane, w->last_row + k, j) = in_range(a + k * (a - b));
    }
}

static void load(struct decoder *d, int plane, const struct window *w)
{
    memset(d->value[plane], 0, sizeof(d->value[plane]));
    memset(d->error[plane], 0, sizeof(d->error[plane]));
    int first = w->first_row;
    while (first <= w->last_row && !load_row(d, plane, w, first))
        first++;
    if (first > w->last_row)
        return;
    for (int i = w->first_row; i < first; i++)
        memcpy(d->value[plane][i + 2], d->value[plane][first + 2], sizeof(d->value[plane][0]));
    for (int i = first + 1; i <= w->last_row; i++)
        if (!load_row(d, plane, w, i))
            memcpy(d->value[plane][i + 2], d->value[plane][i + 1], sizeof(d->value[plane][0]));
    extend(d, plane, w);
}

/* Mask */

static bool inside(int at)
{
    return at >= 0 && at < READER_POSTS;
}

static bool has_or_opposite(const struct decoder *d, int r, int c, int dr, int dc)
{
    if (!inside(r + dr))
        dr = -dr;
    if (!inside(c + dc))
        dc = -dc;
    return d->has[r + dr][c + dc];
}

static int mask_context(const struct decoder *d, int plane, bool same_columns, int r, int c, int s)
{
    static const int diagonal[4][2] = {{-1, -1}, {-1, 1}, {1, -1}, {1, 1}};
    static const int straight[4][2] = {{-1, 0}, {1, 0}, {0, -1}, {0, 1}};
    static const int vertical[4][2] = {{-1, 0}, {1, 0}, {-1, 0}, {1, 0}};
    const int(*around)[2] = same_columns ? vertical : plane == PLANE_X ? diagonal : straight;
    int n = 0;
    for (int i = 0; i < 4; i++)
        n += has_or_opposite(d, r, c, around[i][0] * s, around[i][1] * s);
    int w = c - 2 * s < 0 || d->has[r][c - 2 * s];
    int l = r - 2 * s < 0 || d->has[r - 2 * s][c];
    return 4 * n + 2 * w + l;
}

static void mask_plane(struct decoder *d, int plane, bool same_columns, int s)
{
    int row0 = plane == PLANE_C ? 0 : s, col0 = plane == PLANE_R ? 0 : s;
    bool repeated = false;
    for (int r = row0; r < READER_POSTS; r += 2 * s) {
        repeated = r > row0 && entropy_bit(&d->entropy, &d->repeat_bits[repeated]);
        for (int c = col0; c < READER_POSTS; c += 2 * s)
            d->has[r][c] =
                repeated
                    ? d->has[r - 2 * s][c]
                    : entropy_bit(&d->entropy,
                                  &d->mask_bits[mask_context(d, plane, same_columns, r, c, s)]);
    }
}

static void read_mask(struct decoder *d, bool parent, bool same_columns)
{
    if (!parent)
        for (int r = 0; r < READER_POSTS; r += 128)
            for (int c = 0; c < READER_POSTS; c += 128)
                d->has[r][c] = entropy_bit(&d->entropy, &d->mask_bits[0]);
    for (int s = parent ? 1 : 64; s >= 1; s /= 2) {
        if (same_columns) {
            mask_plane(d, PLANE_R, true, s);
            mask_plane(d, PLANE_X, true, s);
            continue;
        }
        mask_plane(d, PLANE_X, false, s);
        mask_plane(d, PLANE_R, false, s);
        mask_plane(d, PLANE_C, false, s);
    }
}

/* Phases */

static int64_t form(struct decoder *d, const struct place *p, int i, int j)
{
    int64_t v[4];
    for (int n = 0; n < 4; n++)
        v[n] = *value_at(d, p[n].plane, i + p[n].i, j + p[n].j);
    return llabs(v[0] + v[1] - v[2] - v[3]);
}

static void fill_margin(struct decoder *d, int plane, const struct phase *phase)
{
    int width = plane == PLANE_X ? 2 : 1, rows = plane_rows(d, plane), cols = plane_cols(d, plane);
    for (int i = -width; i < rows + width; i++)
        for (int j = -width; j < cols + width; j++) {
            if (i >= 0 && i < rows && j >= 0 && j < cols)
                continue;
            int64_t sum = 2;
            for (int n = 0; n < 4; n++) {
                const struct place *p = &phase->around[n];
                sum += *value_at(d, p->plane, i + p->i, j + p->j);
            }
            *value_at(d, plane, i, j) = (int32_t)(sum >> 2);
            *error_at(d, plane, i, j) = (int32_t)min64(8 * form(d, phase->around, i, j), ERROR_MAX);
        }
}

static int64_t sum_of_forms(struct decoder *d, int p, int i, int j)
{
    const struct phase *phase = &d->phases[p];
    int64_t sum = 0;
    for (int n = 0; n < phase->form_count; n++)
        sum += form_weights[p][n] * min64(16 * form(d, phase->forms + 4 * n, i, j), ERROR_MAX);
    return sum;
}

static int64_t sum_of_errors(struct decoder *d, int p, int first, int i, int j)
{
    const struct phase *phase = &d->phases[p];
    int64_t sum = 0;
    for (int n = first; n < phase->error_count; n++) {
        const struct place *e = &phase->errors[n];
        sum += (int64_t)error_weights[p][n] * *error_at(d, e->plane, i + e->i, j + e->j);
    }
    return sum;
}

static int64_t escape(struct decoder *d)
{
    int bits = entropy_symbol(&d->entropy, &d->entropy.escape_slow, &d->entropy.escape_fast);
    bool negative = entropy_raw_bits(&d->entropy, 1);
    int64_t w =
        bits == 0 ? 0 : (int64_t)(1ull << (bits - 1) | entropy_raw_bits(&d->entropy, bits - 1));
    return negative ? -(w + 16) : w + 16;
}

/* `o` in 0 .. 511. */
static int64_t difference(struct decoder *d, int plane, int64_t f, int64_t a, int o)
{
    uint64_t z = (uint64_t)(a >> 4) | 4, g = (uint64_t)(f >> 4) | 4;
    int e = floor_log2(z), h = floor_log2(g), u = (int)(z >> (e - 2) & 3);
    int share = 2 * h + (int)(g >> (h - 1) & 1) - 2 * e - u / 2 + 6;
    share = share < 0 ? 0 : share > 7 ? 7 : share;
    int place = 3 * share + (plane == PLANE_X ? 0 : plane == PLANE_R ? 1 : 2);
    int v = 5 * o / 512, k = e < 10 ? 0 : e - 9;
    int slow = 5 * (4 * (e - 2) + u) + v, fast = 3 * (24 * (e - 2) + place) + (v + 1) / 2;
    if (k > 0) {
        slow = 160 + 4 * (int)min64(k - 1, 15) + u;
        fast = 576 + 24 * u + place;
    }
    int n = k + d->shift;
    int64_t q = entropy_symbol(&d->entropy, &d->entropy.slow[slow], &d->entropy.fast[fast]) - 15;
    if (q == 16)
        q = escape(d);
    int64_t y = (int64_t)((uint64_t)q << n | entropy_raw_bits(&d->entropy, n));
    return y - (1ll << n) / 2;
}

static void read_post(struct decoder *d, int p, int i, int j, bool flat)
{
    const struct phase *phase = &d->phases[p];
    int plane = lists[p].plane, step = 64 / d->m;
    int r = step * (2 * i + (plane != PLANE_C)), c = step * (2 * j + (plane != PLANE_R));
    int64_t prediction = 0;
    for (int n = 0; n < phase->tap_count; n++) {
        const struct place *t = &phase->taps[n];
        prediction +=
            (int64_t)predictors[d->set][p][n] * *value_at(d, t->plane, i + t->i, j + t->j);
    }
    int64_t nearest = (prediction + 512) >> 10;
    if (!d->has[r][c]) {
        *value_at(d, plane, i, j) = in_range(nearest);
        *error_at(d, plane, i, j) = 0;
        d->symbols[r * READER_POSTS + c] = READER_NO_DATA;
        return;
    }
    int64_t delta = 0;
    if (!flat) {
        int64_t f = sum_of_forms(d, p, i, j), a = f + sum_of_errors(d, p, 0, i, j);
        int o = (int)(prediction - 1024 * nearest);
        delta = o < 0 ? -difference(d, plane, f, a, -o - 1) : difference(d, plane, f, a, o);
    }
    uint32_t predicted = (uint32_t)d->base + ((uint32_t)nearest << d->shift);
    int32_t symbol = (int32_t)(predicted + (uint32_t)delta);
    int32_t value = value_of(d, symbol);
    d->symbols[r * READER_POSTS + c] = symbol;
    *value_at(d, plane, i, j) = value;
    *error_at(d, plane, i, j) =
        (int32_t)min64(llabs(1024 * (int64_t)value - prediction) >> 6, ERROR_MAX);
}

static void read_phase(struct decoder *d, int p)
{
    int plane = lists[p].plane;
    fill_margin(d, plane, &d->phases[p]);
    for (int i = 0; i < plane_rows(d, plane); i++) {
        bool flat = true;
        for (int j = 0; flat && j < plane_cols(d, plane); j++)
            flat = sum_of_forms(d, p, i, j) + sum_of_errors(d, p, 1, i, j) == 0;
        flat = flat && entropy_bit(&d->entropy, &d->flat_bits[p]);
        for (int j = 0; j < plane_cols(d, plane); j++)
            read_post(d, p, i, j, flat);
    }
}

static void read_alone(struct decoder *d)
{
    for (int r = 0; r < READER_POSTS; r += 128)
        for (int c = 0; c < READER_POSTS; c += 128)
            d->symbols[r * READER_POSTS + c] =
                d->has[r][c] ? (int32_t)(uint32_t)entropy_raw_bits(&d->entropy, 32)
                             : READER_NO_DATA;
    for (d->m = 1; d->m <= 64; d->m *= 2) {
        struct window w = window_of(d, PLANE_K, d->symbols, 0, 0, 128 / d->m, 128 / d->m);
        load(d, PLANE_K, &w);
        memset(d->error, 0, sizeof(d->error));
        read_phase(d, PHASE_X);
        read_phase(d, PHASE_R);
        read_phase(d, PHASE_C);
    }
}

static void read_with_parent(struct decoder *d, const struct window *k, struct reader_half half)
{
    load(d, PLANE_K, k);
    if (!half.same_columns) {
        read_phase(d, PHASE_X);
        read_phase(d, PHASE_R);
        read_phase(d, PHASE_C);
        return;
    }
    struct window c = window_of(d, PLANE_C, k->symbols, k->row, 1, 1, 2);
    load(d, PLANE_C, &c);
    read_phase(d, PHASE_R_SAME);
    read_phase(d, PHASE_X_SAME);
}

static int32_t int32_at(const uint8_t *bytes)
{
    return (int32_t)(bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 |
                     (uint32_t)bytes[3] << 24);
}

/* The posts that are the parent's. The others have data until a mask says otherwise. */
static void take_from_parent(struct decoder *d, const int32_t *parent, struct reader_half half)
{
    memset(d->has, 1, sizeof(d->has));
    for (int r = 0; parent && r < READER_POSTS; r += 2)
        for (int c = 0; c < READER_POSTS; c += half.same_columns ? 1 : 2) {
            int col = half.same_columns ? c : 64 * half.col + c / 2;
            int32_t symbol = parent[(64 * half.row + r / 2) * READER_POSTS + col];
            d->symbols[r * READER_POSTS + c] = symbol;
            d->has[r][c] = symbol != READER_NO_DATA;
        }
}

/* Mode 0 (`bytes` NULL) and 2. */
static const char *read_raw(struct decoder *d, const uint8_t *bytes, uint32_t size, bool parent,
                            struct reader_half half)
{
    uint32_t at = 0;
    for (int r = 0; r < READER_POSTS; r++)
        for (int c = 0; c < READER_POSTS; c++) {
            if (parent && r % 2 == 0 && (half.same_columns || c % 2 == 0))
                continue;
            if (bytes && size - at < 4)
                return "a raw payload is too short";
            d->symbols[r * READER_POSTS + c] = bytes ? int32_at(bytes + at) : READER_NO_DATA;
            at += 4;
        }
    return bytes && at != size ? "a raw payload is too long" : NULL;
}

static const char *read_coded(struct decoder *d, const uint8_t *bytes, uint32_t size, bool mask,
                              const int32_t *parent, struct reader_half half)
{
    struct window k = {0};
    d->m = 64;
    d->base = READER_NO_DATA;
    if (parent) {
        k = half.same_columns ? window_of(d, PLANE_K, parent, 64 * half.row, 0, 1, 2)
                              : window_of(d, PLANE_K, parent, 64 * half.row, 64 * half.col, 1, 1);
        d->base = first_symbol(&k);
    }
    uint32_t head = d->base == READER_NO_DATA ? 4 : 0;
    if (size < head + 4)
        return "a coded payload is too short";
    if (head)
        d->base = int32_at(bytes);
    entropy_begin(&d->entropy, bytes + head, size - head);
    fresh_bits(d);
    if (mask)
        read_mask(d, parent, half.same_columns);
    if (parent)
        read_with_parent(d, &k, half);
    else
        read_alone(d);
    return entropy_is_at_end(&d->entropy) ? NULL : "a payload does not end where its posts do";
}

const char *reader_decode_payload(const uint8_t *payload, uint32_t size, const int32_t *parent,
                                  struct reader_half half, int32_t *ret_symbols)
{
    int mode = size > 0 ? payload[0] & 3 : 3;
    if (size < 2 || mode == 3 || payload[0] & 8)
        return "a payload begins with unknown bytes";
    struct decoder *d = calloc(1, sizeof(*d));
    if (!d)
        abort();
    parse_lists(d);
    d->symbols = ret_symbols;
    take_from_parent(d, parent, half);
    d->set = payload[0] >> 4;
    d->shift = payload[1];
    const char *fault;
    if (mode == 1)
        fault = d->shift > 14 ? "a payload's shift is above 14"
                              : read_coded(d, payload + 2, size - 2, payload[0] & 4, parent, half);
    else
        fault = read_raw(d, mode == 2 ? payload + 2 : NULL, size - 2, parent, half);
    free(d);
    return fault;
}
