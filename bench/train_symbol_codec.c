/* Trains the tables of the height codec on rasters and writes terrain/symbol_weights.c and
 * terrain/symbol_tables.c:
 *
 *   train_symbol_codec WEIGHTS.c TABLES.c FILE:WIDTH:HEIGHT:STEP:NODATA...
 *
 * FILE holds rows of float32 (gdal_translate -of ENVI -ot Float32 makes such). Only every second tile
 * is trained on, so that the others can tell how well the tables do on what they have not seen.
 *
 * Three things are fitted, round by round, each to what the other ones are: sets of linear
 * predictors (weighted least squares within clusters of tiles), the weights of the activity (maximum
 * likelihood of Laplace distributions), and the models' first frequencies (counts). */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/symbol_models.h"
#include "terrain/symbol_predict.h"

#define TRAINED_PHASES 3
#define FEATURES       (FORMS_MAX + ERROR_TAPS_MAX)
#define ROUNDS         3
#define FEATURES_KEPT  4000000

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
    double counts[MODEL_COUNT][ENTROPY_SYMBOLS], escapes[ENTROPY_SYMBOLS];
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
                : (int32_t)lrint(heights[(raster.height - 1 - (int)(i / (size_t)raster.width)) *
                                             raster.width +
                                         (int)(i % (size_t)raster.width)] /
                                 step);
    free(heights);
    return raster;
}

static struct raster raster_halved(const struct raster *fine)
{
    struct raster half = {.width = (fine->width + 1) / 2, .height = (fine->height + 1) / 2};
    half.symbols = must(malloc((size_t)half.width * (size_t)half.height * sizeof(int32_t)));
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

static int32_t tap_value(const int32_t (*planes)[PLANE_ROWS * PLANE_STRIDE], struct tap tap,
                         int row, int col)
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

static void count_symbol(struct trainer *trainer, double activity, double prediction,
                         int32_t value)
{
    int32_t nearest = (int32_t)floor(prediction + 0.5);
    int32_t offset = (int32_t)floor((prediction - nearest) * 1024.0), flip = offset >> 31;
    struct model_choice choice = model_choose((int32_t)(activity * 4096.0), offset ^ flip);
    int32_t difference = ((value - nearest) ^ flip) - flip;
    int32_t quotient =
        (difference + ((1 << choice.low_bits) >> 1)) >> choice.low_bits;
    bool escape = abs(quotient) > MODEL_MIDDLE;
    trainer->counts[choice.model][escape ? MODEL_ESCAPE : quotient + MODEL_MIDDLE]++;
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
    double x[TAPS_MAX], around = 0, prediction = 0, activity = 1.0 / 64;
    float parts[FEATURES];
    for (int t = 0; t < 4; t++)
        around += tap_value(grid->value, shape->around[t], row, col) / 4.0;
    for (int t = 0; t < shape->tap_count; t++) {
        x[t] = tap_value(grid->value, shape->taps[t], row, col) - around;
        prediction += trainer->weights[tile->set][phase][t] * x[t];
    }
    find_parts(grid, shape, row, col, parts);
    for (int f = 0; f < FEATURES; f++)
        activity += trainer->parts[phase][f] * (double)parts[f];
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
    count_symbol(trainer, activity, around + prediction, value);
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
                trainer->tiles = must(realloc(trainer->tiles,
                                              trainer->tile_limit * sizeof(*trainer->tiles)));
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
    for (int i = 0; i < taps; i++)
        sum.a[i][i] += 1 + 1e-4 * sum.a[i][i];
    solve(taps, sum.a, sum.b, trainer->weights[set][phase]);
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
    fprintf(file, "{");
    for (int t = 0; t < shape->tap_count; t++)
        fprintf(file, "%d,", whole[t]);
    fprintf(file, "},");
}

static void write_parts(FILE *file, const char *name, const struct trainer *trainer, int first,
                        int count)
{
    fprintf(file, "const int16_t %s[PHASE_COUNT][%s] = {", name,
            first ? "ERROR_TAPS_MAX" : "FORMS_MAX");
    for (int phase = 0; phase < TRAINED_PHASES; phase++) {
        fprintf(file, "{");
        for (int f = 0; f < count; f++)
            fprintf(file, "%ld,", lrint(trainer->parts[phase][first + f] * 256));
        fprintf(file, "},");
    }
    fprintf(file, first ? "{64,64},{64,64,32,32}};\n" : "{32,8},{24,8}};\n");
}

static void write_predictors(FILE *file, const struct trainer *trainer)
{
    fprintf(file, "/* Written by bench/train_symbol_codec.c. */\n#include \"terrain/symbol_predict.h\""
                  "\n\nconst int16_t predictor_weights[PREDICTOR_SETS][PHASE_COUNT][TAPS_MAX]={");
    for (int set = 0; set < PREDICTOR_SETS; set++) {
        fprintf(file, "{");
        for (int phase = 0; phase < TRAINED_PHASES; phase++)
            write_weights(file, trainer->weights[set][phase], &phase_shapes[phase]);
        fprintf(file, "{0,576,576,-64,-64},{0,576,576,-64,-64}},\n");
    }
    fprintf(file, "};\n\n");
    write_parts(file, "form_weights", trainer, 0, FORMS_MAX);
    write_parts(file, "error_weights", trainer, FORMS_MAX, ERROR_TAPS_MAX);
}

/* Beginnings from counts, with at least one part for each symbol. */
static void write_model(FILE *file, const double *counts, double total, const char *after)
{
    double below = 0;
    fprintf(file, "{{");
    for (int s = 0; s < ENTROPY_SYMBOLS; s++) {
        fprintf(file, "%d,", (int)(below / total * ENTROPY_REST) + s);
        below += counts[s];
    }
    fprintf(file, "}}%s\n", after);
}

/* Counts are mixed with a Laplace distribution of the model's activity where they are few. */
static void write_model_of(FILE *file, const struct trainer *trainer, int model)
{
    double counts[ENTROPY_SYMBOLS], total = 0, scale, offset = 0;
    int quarter = model / MODEL_PHASES;
    if (quarter < MODEL_CLASSES) {
        scale = exp2(quarter / 4 + 2) * (1 + (quarter % 4 + 0.5) / 4) / 256 + 0.05;
        offset = (model % MODEL_PHASES + 0.5) / (2 * MODEL_PHASES);
    } else
        scale = 2 + ((model - MODEL_CLASSES * MODEL_PHASES) % 4 + 0.5) / 2;
    for (int s = 0; s < ENTROPY_SYMBOLS; s++) {
        double away = s == MODEL_ESCAPE ? MODEL_MIDDLE + 2 : fabs(s - MODEL_MIDDLE - offset);
        counts[s] = trainer->counts[model][s] + 20 * exp(-away / scale) / (2 * scale) + 0.01;
        total += counts[s];
    }
    write_model(file, counts, total, ",");
}

static void write_models(FILE *file, const struct trainer *trainer)
{
    double total = 0, escapes[ENTROPY_SYMBOLS];
    fprintf(file, "/* Written by bench/train_symbol_codec.c. */\n#include \"terrain/symbol_models.h\""
                  "\n\nconst union entropy_model model_first[MODEL_COUNT] = {\n");
    for (int model = 0; model < MODEL_COUNT; model++)
        write_model_of(file, trainer, model);
    fprintf(file, "};\n\nconst union entropy_model model_escape_first =");
    for (int s = 0; s < ENTROPY_SYMBOLS; s++)
        total += escapes[s] = trainer->escapes[s] + 10 * exp2(-s / 2.0) + 0.1;
    write_model(file, escapes, total, ";");
}

int main(int argc, char **argv)
{
    struct trainer *trainer = must(calloc(1, sizeof(*trainer)));
    if (argc < 4) {
        fprintf(stderr, "usage: %s WEIGHTS.c TABLES.c FILE:WIDTH:HEIGHT:STEP:NODATA...\n", argv[0]);
        return 64;
    }
    for (int phase = 0; phase < TRAINED_PHASES; phase++) {
        trainer->features[phase] = must(malloc(FEATURES_KEPT * sizeof(struct features)));
        for (int f = 0; f < FEATURES; f++)
            trainer->parts[phase][f] = f < FORMS_MAX ? 0.03 : 0.1;
    }
    for (trainer->round = 0; trainer->round < ROUNDS; trainer->round++) {
        size_t tiles = 0;
        memset(trainer->feature_count, 0, sizeof(trainer->feature_count));
        memset(trainer->counts, 0, sizeof(trainer->counts));
        memset(trainer->escapes, 0, sizeof(trainer->escapes));
        for (int i = 3; i < argc; i++) {
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
    FILE *weights = fopen(argv[1], "w"), *tables = fopen(argv[2], "w");
    if (!weights || !tables) {
        perror("cannot write");
        return 74;
    }
    write_predictors(weights, trainer);
    write_models(tables, trainer);
    return fclose(weights) | fclose(tables) ? 74 : 0;
}
