/* Trains the tables of the height codec on rasters and writes them as terrain/data has them:
 *
 *   train_symbol_codec FOLDER FILE:WIDTH:HEIGHT:STEP:NODATA...
 *
 * FILE holds rows of float32 (gdal_translate -of ENVI -ot Float32 makes such). Only every second
 * tile is trained on, so that the others can tell how well the tables do on what they have not
 * seen.
 *
 * Three things are fitted, round by round, each to what the other ones are: sets of linear
 * predictors (weighted least squares within clusters of tiles), the weights of the activity
 * (maximum likelihood of Laplace distributions), and the models' first frequencies (counts). */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/symbol_models.h"
#include "terrain/symbol_predict.h"

#define TRAINED_PHASES   3
#define FEATURES         (FORMS_MAX + ERROR_TAPS_MAX)
#define ROUNDS           4
#define WEIGHTS_SIZE_MAX 6.5
#define FEATURES_KEPT    4000000

/* Normal equations of one phase of one tile. */
struct equations {
    double a[TAPS_MAX][TAPS_MAX], b[TAPS_MAX], c, count;
};

struct trained_tile {
    struct equations phases[TRAINED_PHASES];
    unsigned set;
};

struct features {
    float part[FEATURES], error;
};

struct trainer {
    struct trained_tile *tiles;
    size_t tile_count, tile_limit;
    double weights[PREDICTOR_SETS][TRAINED_PHASES][TAPS_MAX];
    double parts[TRAINED_PHASES][FEATURES]; /* weights of forms, then of errors */
    struct features *features[TRAINED_PHASES];
    size_t feature_count[TRAINED_PHASES];
    double slow[MODEL_SLOW_COUNT][ENTROPY_SYMBOLS], fast[MODEL_FAST_COUNT][ENTROPY_SYMBOLS];
    double escapes[ENTROPY_SYMBOLS];
    int round;
};

struct raster {
    int32_t *symbols;
    int width, height;
};

static void *must(void *memory)
{
    if (!memory) {
        fprintf(stderr, "out of memory\n");
        exit(71);
    }
    return memory;
}

static struct raster raster_read(const char *spec)
{
    char path[512];
    struct raster raster;
    double step, nodata;
    if (sscanf(spec, "%511[^:]:%d:%d:%lf:%lf", path, &raster.width, &raster.height, &step,
               &nodata) != 5) {
        fprintf(stderr, "%s: not FILE:WIDTH:HEIGHT:STEP:NODATA\n", spec);
        exit(64);
    }
    size_t count = (size_t)raster.width * (size_t)raster.height;
    float *heights = must(malloc(count * sizeof(*heights)));
    raster.symbols = must(malloc(count * sizeof(*raster.symbols)));
    FILE *file = fopen(path, "rb");
    if (!file || fread(heights, sizeof(*heights), count, file) != count) {
        fprintf(stderr, "%s: does not have %zu floats\n", path, count);
        exit(66);
    }
    fclose(file);
    for (size_t i = 0; i < count; i++) /* rows come from the north */
        raster.symbols[i] =
            heights[(raster.height - 1 - (int)(i / (size_t)raster.width)) * raster.width +
                    (int)(i % (size_t)raster.width)] == (float)nodata
                ? SYMBOL_NONE
                : (int32_t)lrint(
                      heights[(raster.height - 1 - (int)(i / (size_t)raster.width)) * raster.width +
                              (int)(i % (size_t)raster.width)] /
                      step);
    free(heights);
    return raster;
}

static struct raster raster_halved(const struct raster *fine)
{
    struct raster half = {.width = (fine->width + 1) / 2, .height = (fine->height + 1) / 2};
    half.symbols = must(calloc((size_t)half.width * (size_t)half.height, sizeof(int32_t)));
    for (int row = 0; row < half.height; row++)
        for (int col = 0; col < half.width; col++)
            half.symbols[row * half.width + col] = fine->symbols[2 * row * fine->width + 2 * col];
    return half;
}

static void raster_tile(const struct raster *raster, int tile_row, int tile_col,
                        int32_t *ret_symbols)
{
    for (int i = 0; i < TILE_POST_COUNT; i++) {
        int row = tile_row * TILE_CELLS + i / TILE_POSTS;
        int col = tile_col * TILE_CELLS + i % TILE_POSTS;
        ret_symbols[i] = row < raster->height && col < raster->width
                             ? raster->symbols[row * raster->width + col]
                             : SYMBOL_NONE;
    }
}

static int32_t tap_value(const int32_t (*planes)[PLANE_SIZE], struct tap tap, int row, int col)
{
    return planes[tap.plane][plane_index(row + tap.row, col + tap.col)];
}

/* What adds up to the activity of a post, in steps. */
static void find_parts(const struct symbol_grid *grid, const struct phase_shape *shape, int row,
                       int col, float *ret_parts)
{
    memset(ret_parts, 0, FEATURES * sizeof(*ret_parts));
    for (int f = 0; f < shape->form_count; f++) {
        const struct tap *form = shape->forms[f];
        ret_parts[f] = fabsf((float)(tap_value(grid->value, form[0], row, col) +
                                     tap_value(grid->value, form[1], row, col) -
                                     tap_value(grid->value, form[2], row, col) -
                                     tap_value(grid->value, form[3], row, col)));
    }
    for (int t = 0; t < shape->error_count; t++)
        ret_parts[FORMS_MAX + t] =
            (float)tap_value(grid->error, shape->errors[t], row, col) / 16.0f;
}

static void count_symbol(struct trainer *trainer, enum phase phase, double activity, double forms,
                         double prediction, int32_t value)
{
    int32_t nearest = (int32_t)floor(prediction + 0.5);
    int32_t offset = (int32_t)floor((prediction - nearest) * 1024.0), flip = offset >> 31;
    struct model_choice choice =
        model_choose((int32_t)(activity * 4096.0), (int32_t)(forms * 4096.0), offset ^ flip,
                     phase_shapes[phase].plane - PLANE_CENTRE);
    int32_t difference = ((value - nearest) ^ flip) - flip;
    int32_t quotient = (difference + ((1 << choice.low_bits) >> 1)) >> choice.low_bits;
    bool escape = abs(quotient) > MODEL_MIDDLE;
    int symbol = escape ? MODEL_ESCAPE : quotient + MODEL_MIDDLE;
    trainer->slow[choice.slow][symbol]++;
    trainer->fast[choice.fast][symbol]++;
    int beyond = abs(quotient) - MODEL_MIDDLE - 1;
    if (escape)
        trainer->escapes[beyond ? 32 - __builtin_clz((unsigned)beyond) : 0]++;
}

/* Takes in a post that has data, and returns how far off its prediction is, in steps. */
static double train_post(struct trainer *trainer, struct trained_tile *tile,
                         const struct symbol_grid *grid, enum phase phase, int row, int col,
                         int32_t value)
{
    const struct phase_shape *shape = &phase_shapes[phase];
    double x[TAPS_MAX], around = 0, prediction = 0, activity = 0, forms = 0;
    float parts[FEATURES];
    for (int t = 0; t < 4; t++)
        around += tap_value(grid->value, shape->around[t], row, col) / 4.0;
    for (int t = 0; t < shape->tap_count; t++) {
        x[t] = tap_value(grid->value, shape->taps[t], row, col) - around;
        prediction += trainer->weights[tile->set][phase][t] * x[t];
    }
    find_parts(grid, shape, row, col, parts);
    for (int f = 0; f < FEATURES; f++) {
        if (f == FORMS_MAX)
            forms = activity;
        activity += trainer->parts[phase][f] * (double)parts[f];
    }
    double y = value - around, error = fabs(y - prediction);
    double weight = 1.0 / ((activity + 0.3) * (activity + 0.3));
    struct equations *equations = &tile->phases[phase];
    for (int i = 0; i < shape->tap_count; i++) {
        for (int j = 0; j <= i; j++)
            equations->a[i][j] += weight * x[i] * x[j];
        equations->b[i] += weight * x[i] * y;
    }
    equations->c += weight * y * y;
    equations->count++;
    size_t kept = trainer->feature_count[phase];
    if (kept < FEATURES_KEPT && random() % 4 == 0) {
        memcpy(trainer->features[phase][kept].part, parts, sizeof(parts));
        trainer->features[phase][kept].error = (float)error;
        trainer->feature_count[phase]++;
    }
    count_symbol(trainer, phase, activity, forms, around + prediction, value);
    return error;
}

static void train_phase(struct trainer *trainer, struct trained_tile *tile,
                        struct symbol_grid *grid, enum phase phase, const int32_t *symbols)
{
    enum plane plane = phase_shapes[phase].plane;
    grid_fill_margin(grid, phase);
    for (int row = 0; row < plane_rows(grid, plane); row++)
        for (int col = 0; col < plane_cols(grid, plane); col++) {
            int32_t symbol = symbols[(2 * row + (phase != PHASE_COLUMN)) * TILE_POSTS + 2 * col +
                                     (phase != PHASE_ROW)];
            int32_t *value = &grid->value[plane][plane_index(row, col)];
            int32_t *error = &grid->error[plane][plane_index(row, col)];
            if (symbol == SYMBOL_NONE) {
                int32_t sum = 2;
                for (int t = 0; t < 4; t++)
                    sum += tap_value(grid->value, phase_shapes[phase].around[t], row, col);
                *value = sum >> 2;
                *error = 0;
                continue;
            }
            *value = grid_value(grid, symbol);
            double off = train_post(trainer, tile, grid, phase, row, col, *value);
            *error = (int32_t)(16.0 * off);
        }
}

static void train_tile(struct trainer *trainer, struct trained_tile *tile, const int32_t *symbols,
                       const struct tile_parent *parent)
{
    static struct symbol_grid grid;
    memset(&grid, 0, sizeof(grid));
    memset(tile->phases, 0, sizeof(tile->phases));
    struct window window = window_of_parent(parent, PLANE_KNOWN);
    if (!window_first(&window, &grid.base))
        return;
    grid.cells = PLANE_CELLS;
    grid_load(&grid, PLANE_KNOWN, window);
    for (int phase = 0; phase < TRAINED_PHASES; phase++)
        train_phase(trainer, tile, &grid, (enum phase)phase, symbols);
}

static size_t train_raster(struct trainer *trainer, const struct raster *fine, size_t index)
{
    if (fine->width <= TILE_POSTS && fine->height <= TILE_POSTS)
        return index;
    struct raster half = raster_halved(fine);
    for (int row = 0; row * TILE_CELLS < fine->height - 1; row++)
        for (int col = 0; col * TILE_CELLS < fine->width - 1; col++) {
            static int32_t symbols[TILE_POST_COUNT], above[TILE_POST_COUNT];
            if ((row + col) % 2 == 0)
                continue;
            if (index == trainer->tile_limit) {
                trainer->tile_limit = 2 * trainer->tile_limit + 256;
                trainer->tiles =
                    must(realloc(trainer->tiles, trainer->tile_limit * sizeof(*trainer->tiles)));
            }
            raster_tile(fine, row, col, symbols);
            raster_tile(&half, row / 2, col / 2, above);
            struct tile_parent parent = {above, row % 2, col % 2, false};
            if (trainer->round == 0)
                trainer->tiles[index].set = (unsigned)random() % PREDICTOR_SETS;
            train_tile(trainer, &trainer->tiles[index++], symbols, &parent);
        }
    index = train_raster(trainer, &half, index);
    free(half.symbols);
    return index;
}

/* Cholesky; `a`'s lower half. */
static void solve(int n, double a[TAPS_MAX][TAPS_MAX], const double *b, double *ret_x)
{
    for (int i = 0; i < n; i++)
        for (int j = 0; j <= i; j++) {
            double sum = a[i][j];
            for (int k = 0; k < j; k++)
                sum -= a[i][k] * a[j][k];
            a[i][j] = i == j ? sqrt(fmax(sum, 1e-9)) : sum / a[j][j];
        }
    for (int i = 0; i < n; i++) {
        ret_x[i] = b[i];
        for (int k = 0; k < i; k++)
            ret_x[i] -= a[i][k] * ret_x[k];
        ret_x[i] /= a[i][i];
    }
    for (int i = n - 1; i >= 0; i--) {
        for (int k = i + 1; k < n; k++)
            ret_x[i] -= a[k][i] * ret_x[k];
        ret_x[i] /= a[i][i];
    }
}

static double tile_cost(const struct trainer *trainer, const struct trained_tile *tile,
                        unsigned set)
{
    double cost = 0;
    for (int phase = 0; phase < TRAINED_PHASES; phase++) {
        const struct equations *e = &tile->phases[phase];
        const double *w = trainer->weights[set][phase];
        double sum = e->c;
        for (int i = 0; i < phase_shapes[phase].tap_count; i++) {
            sum += w[i] * (w[i] * e->a[i][i] - 2 * e->b[i]);
            for (int j = 0; j < i; j++)
                sum += 2 * w[i] * w[j] * e->a[i][j];
        }
        if (e->count > 0)
            cost += e->count * log(fmax(sum, 0) / e->count + 1e-3);
    }
    return cost;
}

static void fit_set(struct trainer *trainer, unsigned set, int phase)
{
    struct equations sum = {.count = 0};
    int taps = phase_shapes[phase].tap_count;
    for (size_t t = 0; t < trainer->tile_count; t++) {
        const struct equations *e = &trainer->tiles[t].phases[phase];
        if (trainer->tiles[t].set != set)
            continue;
        for (int i = 0; i < taps; i++) {
            for (int j = 0; j <= i; j++)
                sum.a[i][j] += e->a[i][j];
            sum.b[i] += e->b[i];
        }
        sum.count += e->count;
    }
    if (sum.count == 0)
        return;
    /* Large weights would overflow on wild heights, and fit noise. */
    double ridge = 1e-4, *weights = trainer->weights[set][phase], size;
    do {
        struct equations damped = sum;
        double total = 0;
        for (int i = 0; i < taps; i++)
            damped.a[i][i] += 1 + ridge * sum.a[i][i];
        solve(taps, damped.a, damped.b, weights);
        size = 0;
        for (int i = 0; i < taps; i++) {
            total += weights[i];
            size += fabs(weights[i]);
        }
        size += fabs(1 - total);
        ridge *= 4;
    } while (size > WEIGHTS_SIZE_MAX);
}

/* Clusters of tiles, each with its own weights. */
static void fit_predictors(struct trainer *trainer)
{
    for (int i = 0; i < 40; i++) {
        int moved = 0;
        for (unsigned set = 0; set < PREDICTOR_SETS; set++)
            for (int phase = 0; phase < TRAINED_PHASES; phase++)
                fit_set(trainer, set, phase);
        for (size_t t = 0; t < trainer->tile_count; t++) {
            unsigned best = 0;
            double least = INFINITY;
            for (unsigned set = 0; set < PREDICTOR_SETS; set++) {
                double cost = tile_cost(trainer, &trainer->tiles[t], set);
                if (cost < least) {
                    least = cost;
                    best = set;
                }
            }
            moved += trainer->tiles[t].set != best;
            trainer->tiles[t].set = best;
        }
        if (moved == 0)
            break;
    }
}

/* Adam on the logarithms of the weights, so that they stay positive. */
static void fit_activity(struct trainer *trainer, int phase)
{
    double u[FEATURES], m[FEATURES] = {0}, v[FEATURES] = {0};
    for (int f = 0; f < FEATURES; f++)
        u[f] = log(fmax(trainer->parts[phase][f], 1e-3));
    for (int step = 0; step < 6000; step++) {
        double gradient[FEATURES] = {0};
        for (int k = 0; k < 256; k++) {
            const struct features *sample =
                &trainer->features[phase][(size_t)random() % trainer->feature_count[phase]];
            double scale = 1.0 / 64;
            for (int f = 0; f < FEATURES; f++)
                scale += exp(u[f]) * (double)sample->part[f];
            double slope = 1 / scale - (double)sample->error / (scale * scale);
            for (int f = 0; f < FEATURES; f++)
                gradient[f] += slope * exp(u[f]) * (double)sample->part[f] / 256;
        }
        double rate = step < 4000 ? 0.03 : 0.005;
        for (int f = 0; f < FEATURES; f++) {
            m[f] = 0.9 * m[f] + 0.1 * gradient[f];
            v[f] = 0.99 * v[f] + 0.01 * gradient[f] * gradient[f];
            u[f] -= rate * m[f] / (sqrt(v[f]) + 1e-8);
            u[f] = fmax(u[f], -8);
        }
    }
    for (int f = 0; f < FEATURES; f++)
        trainer->parts[phase][f] = exp(u[f]);
}

static void write_line(FILE *file, const int *numbers, int count)
{
    fputc('{', file);
    for (int i = 0; i < count; i++)
        fprintf(file, "%s%d", i ? ", " : "", numbers[i]);
    fprintf(file, "},\n");
}

/* In whole numbers: the weights of a prediction add up to one exactly. */
static void write_weights(FILE *file, const double *weights, const struct phase_shape *shape)
{
    int whole[TAPS_MAX] = {0}, sum = 0, nearest = 0;
    double total = 0;
    for (int t = 0; t < shape->tap_count; t++)
        total += weights[t];
    for (int t = 0; t < shape->tap_count; t++) {
        double weight = weights[t];
        for (int a = 0; a < 4; a++)
            if (memcmp(&shape->around[a], &shape->taps[t], sizeof(struct tap)) == 0) {
                weight += (1 - total) / 4;
                nearest = t;
            }
        whole[t] = (int)lrint(weight * (1 << PREDICT_BITS));
        sum += whole[t];
    }
    whole[nearest] += (1 << PREDICT_BITS) - sum;
    write_line(file, whole, shape->tap_count);
}

static void write_predictors(FILE *file, const struct trainer *trainer)
{
    for (int set = 0; set < PREDICTOR_SETS; set++) {
        fprintf(file, "{\n");
        for (int phase = 0; phase < TRAINED_PHASES; phase++)
            write_weights(file, trainer->weights[set][phase], &phase_shapes[phase]);
        for (int phase = TRAINED_PHASES; phase < PHASE_COUNT; phase++)
            write_line(file, (int[]){0, 576, 576, -64, -64}, 5); /* cubic */
        fprintf(file, "},\n");
    }
}

/* The weights of the forms, or of the errors; those of the last two phases are by hand. */
static void write_parts(FILE *file, const struct trainer *trainer, int first, int count)
{
    for (int phase = 0; phase < TRAINED_PHASES; phase++) {
        int whole[FEATURES];
        for (int f = 0; f < count; f++)
            whole[f] = (int)lrint(trainer->parts[phase][first + f] * 256);
        write_line(file, whole, count);
    }
    for (int phase = TRAINED_PHASES; phase < PHASE_COUNT; phase++)
        write_line(file, first ? (int[]){64, 64, 32, 32} : (int[]){32, 8},
                   first ? phase_shapes[phase].error_count : 2);
}

/* Beginnings from counts, with at least one part for each symbol. Counts are mixed with a Laplace
 * distribution of `scale` where they are few. */
static void write_model(FILE *file, const double *counted, double scale, double offset)
{
    double counts[ENTROPY_SYMBOLS], total = 0, below = 0;
    int begins[ENTROPY_SYMBOLS];
    for (int s = 0; s < ENTROPY_SYMBOLS; s++) {
        double away = s == MODEL_ESCAPE ? MODEL_MIDDLE + 2 : fabs(s - MODEL_MIDDLE - offset);
        counts[s] = counted[s] + 20 * exp(-away / scale) / (2 * scale) + 0.01;
        total += counts[s];
    }
    for (int s = 0; s < ENTROPY_SYMBOLS; s++) {
        begins[s] = (int)(below / total * ENTROPY_REST) + s;
        below += counts[s];
    }
    write_line(file, begins, ENTROPY_SYMBOLS);
}

static void write_slow(FILE *file, const struct trainer *trainer)
{
    for (int model = 0; model < MODEL_SLOW_COUNT; model++) {
        int quarter = model / MODEL_OFFSETS, high = model - MODEL_SLOW_WHOLE;
        double scale = high < 0 ? exp2(quarter / 4 + 2) * (1 + (quarter % 4 + 0.5) / 4) / 256 + 0.05
                                : 2 + (high % 4 + 0.5) / 2;
        double offset = high < 0 ? (model % MODEL_OFFSETS + 0.5) / (2 * MODEL_OFFSETS) : 0;
        write_model(file, trainer->slow[model], scale, offset);
    }
}

static void write_fast(FILE *file, const struct trainer *trainer)
{
    for (int model = 0; model < MODEL_FAST_COUNT; model++) {
        bool whole = model < MODEL_FAST_WHOLE;
        int octave = model / (MODEL_SHARES * MODEL_PLANES * 3);
        double scale = whole ? exp2(octave + 2) * 1.5 / 256 + 0.05 : 3;
        write_model(file, trainer->fast[model], scale, whole ? model % 3 / 5.0 : 0);
    }
}

/* Escapes are no Laplace distribution around the middle: a wide one adds little to each. */
static void write_escapes(FILE *file, const struct trainer *trainer)
{
    double escapes[ENTROPY_SYMBOLS];
    for (int s = 0; s < ENTROPY_SYMBOLS; s++)
        escapes[s] = trainer->escapes[s] + 10 * exp2(-s / 2.0) + 0.1;
    write_model(file, escapes, 1000, 0);
}

static FILE *create(const char *folder, const char *name)
{
    char path[512];
    snprintf(path, sizeof(path), "%s/%s", folder, name);
    FILE *file = fopen(path, "w");
    if (!file) {
        perror(path);
        exit(73);
    }
    return file;
}

static void finish(FILE *file)
{
    if (fclose(file) != 0) {
        perror("cannot write");
        exit(74);
    }
}

static void write_tables(const char *folder, const struct trainer *trainer)
{
    FILE *file = create(folder, "symbol_predictors.txt");
    write_predictors(file, trainer);
    finish(file);
    file = create(folder, "symbol_forms.txt");
    write_parts(file, trainer, 0, FORMS_MAX);
    finish(file);
    file = create(folder, "symbol_errors.txt");
    write_parts(file, trainer, FORMS_MAX, ERROR_TAPS_MAX);
    finish(file);
    file = create(folder, "symbol_slow.txt");
    write_slow(file, trainer);
    finish(file);
    file = create(folder, "symbol_fast.txt");
    write_fast(file, trainer);
    finish(file);
    file = create(folder, "symbol_escapes.txt");
    write_escapes(file, trainer);
    finish(file);
}

int main(int argc, char **argv)
{
    if (argc < 3) {
        fprintf(stderr, "usage: %s FOLDER FILE:WIDTH:HEIGHT:STEP:NODATA...\n", argv[0]);
        return 64;
    }
    struct trainer *trainer = must(calloc(1, sizeof(*trainer)));
    for (int phase = 0; phase < TRAINED_PHASES; phase++) {
        trainer->features[phase] = must(malloc(FEATURES_KEPT * sizeof(struct features)));
        for (int f = 0; f < FEATURES; f++)
            trainer->parts[phase][f] = f < FORMS_MAX ? 0.03 : 0.1;
    }
    for (trainer->round = 0; trainer->round < ROUNDS; trainer->round++) {
        size_t tiles = 0;
        memset(trainer->feature_count, 0, sizeof(trainer->feature_count));
        memset(trainer->slow, 0, sizeof(trainer->slow));
        memset(trainer->fast, 0, sizeof(trainer->fast));
        memset(trainer->escapes, 0, sizeof(trainer->escapes));
        for (int i = 2; i < argc; i++) {
            struct raster raster = raster_read(argv[i]);
            tiles = train_raster(trainer, &raster, tiles);
            free(raster.symbols);
        }
        trainer->tile_count = tiles;
        if (trainer->round == ROUNDS - 1)
            break;
        fit_predictors(trainer);
        for (int phase = 0; phase < TRAINED_PHASES && trainer->round > 0; phase++)
            fit_activity(trainer, phase);
    }
    write_tables(argv[1], trainer);
    return 0;
}
