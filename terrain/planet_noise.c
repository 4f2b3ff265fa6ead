#include "terrain/planet_noise.h"

#include "terrain/planet_grid.h"

#include <math.h>
#include <stdint.h>

/* Each octave's lattice is turned against the last one's, so that no direction shows. A turn
 * (x + t y, y - t x) maps whole periods to whole lattice steps, for all periods are multiples of 3.
 */
static const double turns[4] = {2.0 / 3.0, -1.0 / 3.0, -2.0 / 3.0, 1.0 / 3.0};

/* Height of an octave over that of the one before. */
static const float gains[PLANET_NOISE_OCTAVES] = {1.0f,  0.80f, 0.58f, 0.50f, 0.46f, 0.44f, 0.44f,
                                                  0.43f, 0.43f, 0.43f, 0.43f, 0.43f, 0.43f};

/* Which way an octave pushes the coarse grid aside. */
static const float bend_directions[4][2] = {
    {0.8f, 0.6f}, {-0.6f, 0.8f}, {0.6f, 0.8f}, {-0.8f, 0.6f}};

#define RIDGE_ROUNDING 0.06f /* of |noise|: how blunt a crest is */
#define RIDGE_MEAN     0.42f /* of the squared ridge signal */
#define FIRST_LIFT     0.35f
#define FIRST_SWIRL    0.02f
#define RIDGE_BEND     0.05f /* how far an octave pushes the next ones aside, in its cells */
#define COARSE_BEND    0.35f /* the same for the coarse grid */
#define COARSE_BENDERS 7     /* octaves that bend the coarse grid */
#define VALLEY_CALM    1.9f  /* signal above 1 / this keeps the next octave whole */
#define VALLEY_LEAST   0.15f /* share of the next octave at the bottom of a valley */

/* The shrinking follows the cosine of latitude; a border lies where the cosine is the geometric
 * mean of two. */
const struct planet_noise_band planet_noise_bands[PLANET_NOISE_BANDS] = {
    {1.0, 0.0},   {0.75, 30.0},   {0.5, 52.2},   {0.375, 65.0},
    {0.25, 72.2}, {0.1875, 77.5}, {0.125, 81.2},
};

struct planet_noise_filter planet_noise_filter_for(double spacing_cells)
{
    struct planet_noise_filter filter;
    double posts = 1.0 / spacing_cells; /* on a feature */
    for (int i = 0; i < PLANET_NOISE_OCTAVES; i++) {
        filter.share[i] = posts < 1.0 ? 0.0f : posts > 4.0 ? 1.0f : (float)((posts - 1.0) / 3.0);
        posts *= 0.5;
    }
    return filter;
}

#define LANES 8 /* posts that are done at once; those of a call are filled up to so many */

/* What posts carry from octave to octave. */
struct chain {
    double x[LANES], y[LANES];            /* of the post */
    float shift_x[LANES], shift_y[LANES]; /* cells */
    float weight[LANES];
    float ridged[LANES], rolling[LANES], bend_x[LANES], bend_y[LANES]; /* the sums so far */
};

/* One octave's noise and its slope along the axes of the planet, per lattice step. */
struct octave {
    float value[LANES], slope_x[LANES], slope_y[LANES];
};

static inline uint32_t mixed(uint32_t h)
{
    h ^= h >> 15;
    h *= 0x2c1b3c6du;
    h ^= h >> 12;
    h *= 0x297a2d39u;
    return h ^ h >> 15;
}

/* Two signed halves of a hash, -1..1. */
static inline float gradient_u(uint32_t h)
{
    return (float)((int32_t)h >> 16) * (1.0f / 32768.0f);
}

static inline float gradient_v(uint32_t h)
{
    return (float)((int32_t)(h << 16) >> 16) * (1.0f / 32768.0f);
}

/* Into planet_noise_at, so that its wider vectors are theirs. */
#define INLINED inline __attribute__((always_inline))

struct lattice {
    double scale, turn;    /* u = scale (x + turn y), v = scale (y - turn x) + lift */
    double offset_u, lift; /* lift and offset keep u and v positive, and octaves out of step */
    double turns_per_step; /* 1 / period */
    int32_t period, slip;  /* the lattice repeats at (u + period, v - slip) */
    uint32_t seed;
};

static INLINED struct lattice lattice_of(int octave, int band)
{
    double scale = (double)(1 << octave), turn = turns[octave & 3];
    double period = scale * PLANET_COLS * planet_noise_bands[band].shrink;
    return (struct lattice){
        .scale = scale,
        .turn = turn,
        .offset_u = scale * 4096.0 + 0.37 + 0.21 * octave,
        .lift = scale * 8192.0 + 0.71 + 0.13 * octave,
        .turns_per_step = 1.0 / period,
        .period = (int32_t)period,
        .slip = (int32_t)nearbyint(turn * period),
        .seed = mixed(0x9e3779b9u * (uint32_t)(octave + 1)) + (uint32_t)band * 0x632be5abu,
    };
}

static INLINED void evaluate_octave(const struct lattice *l, const struct chain *restrict chain,
                                    struct octave *restrict ret)
{
    for (int j = 0; j < LANES; j++) {
        double px = chain->x[j] + (double)chain->shift_x[j];
        double py = chain->y[j] + (double)chain->shift_y[j];
        double u = l->scale * (px + l->turn * py) + l->offset_u;
        double v = l->scale * (py - l->turn * px) + l->lift;
        int32_t iu = (int32_t)u, iv = (int32_t)v;
        float fu = (float)(u - (double)iu), fv = (float)(v - (double)iv);
        /* The lattice point's one name: brought back by whole turns round the planet. */
        int32_t turns_round = (int32_t)(((double)iu + 0.5) * l->turns_per_step);
        int32_t u0 = iu - turns_round * l->period, v0 = iv + turns_round * l->slip;
        int32_t wraps = u0 + 1 == l->period;
        int32_t u1 = wraps ? 0 : u0 + 1, v1 = wraps ? v0 + l->slip : v0;
        uint32_t a0 = (uint32_t)u0 * 0x9e3779b1u + l->seed,
                 a1 = (uint32_t)u1 * 0x9e3779b1u + l->seed;
        uint32_t b0 = (uint32_t)v0 * 0x85ebca77u, b1 = (uint32_t)v1 * 0x85ebca77u;
        uint32_t h00 = mixed(a0 ^ b0), h01 = mixed(a0 ^ (b0 + 0x85ebca77u));
        uint32_t h10 = mixed(a1 ^ b1), h11 = mixed(a1 ^ (b1 + 0x85ebca77u));

        float gu = fu - 1.0f, gv = fv - 1.0f;
        float p00 = gradient_u(h00), q00 = gradient_v(h00), n00 = p00 * fu + q00 * fv;
        float p10 = gradient_u(h10), q10 = gradient_v(h10), n10 = p10 * gu + q10 * fv;
        float p01 = gradient_u(h01), q01 = gradient_v(h01), n01 = p01 * fu + q01 * gv;
        float p11 = gradient_u(h11), q11 = gradient_v(h11), n11 = p11 * gu + q11 * gv;
        float su = fu * fu * fu * (fu * (fu * 6.0f - 15.0f) + 10.0f);
        float sv = fv * fv * fv * (fv * (fv * 6.0f - 15.0f) + 10.0f);
        float du = 30.0f * fu * fu * (fu * (fu - 2.0f) + 1.0f);
        float dv = 30.0f * fv * fv * (fv * (fv - 2.0f) + 1.0f);
        float k1 = n10 - n00, k2 = n01 - n00, k3 = n11 - n10 - n01 + n00;
        float nu = p00 + su * (p10 - p00) + sv * (p01 - p00) + su * sv * (p11 - p10 - p01 + p00) +
                   du * (k1 + sv * k3);
        float nv = q00 + su * (q10 - q00) + sv * (q01 - q00) + su * sv * (q11 - q10 - q01 + q00) +
                   dv * (k2 + su * k3);
        float turn = (float)l->turn;
        ret->value[j] = 2.0f * (n00 + su * k1 + sv * k2 + su * sv * k3);
        ret->slope_x[j] = 2.0f * (nu - turn * nv);
        ret->slope_y[j] = 2.0f * (turn * nu + nv);
    }
}

/* All octaves, as hills, and what they push the coarse grid aside. */
static INLINED void add_hills(const struct octave *restrict o, int octave, float shown, float share,
                              struct chain *restrict chain)
{
    const float *aside = bend_directions[octave & 3];
    float bend = octave < COARSE_BENDERS ? COARSE_BEND * share / (float)(1 << octave) : 0.0f;
    for (int j = 0; j < LANES; j++) {
        chain->rolling[j] += shown * o->value[j];
        chain->bend_x[j] += bend * aside[0] * o->value[j];
        chain->bend_y[j] += bend * aside[1] * o->value[j];
    }
}

/* The first octave makes no ridges, for the coarse grid has the great ones: it lifts some of them
 * over others and swirls those to come. */
static INLINED void begin_ridges(const struct octave *restrict o, float share,
                                 struct chain *restrict chain)
{
    for (int j = 0; j < LANES; j++) {
        chain->ridged[j] += FIRST_LIFT * share * o->value[j];
        chain->shift_x[j] += FIRST_SWIRL * share * o->slope_y[j];
        chain->shift_y[j] -= FIRST_SWIRL * share * o->slope_x[j];
    }
}

static INLINED void add_ridges(const struct octave *restrict o, int octave, float shown,
                               float share, struct chain *restrict chain)
{
    float cell = 1.0f / (float)(1 << octave);
    float ridge_bend = RIDGE_BEND * cell * share;
    for (int j = 0; j < LANES; j++) {
        float n = o->value[j];
        float away = sqrtf(n * n + RIDGE_ROUNDING * RIDGE_ROUNDING);
        float ridge = 1.0f + RIDGE_ROUNDING - away;
        ridge = ridge > 0.0f ? ridge : 0.0f;
        float signal = ridge * ridge, weight = chain->weight[j];
        chain->ridged[j] += shown * weight * (signal - RIDGE_MEAN);
        chain->shift_x[j] -= ridge_bend * weight * n * o->slope_x[j];
        chain->shift_y[j] -= ridge_bend * weight * n * o->slope_y[j];
        float calm = VALLEY_CALM * signal;
        calm = calm < 1.0f ? calm : 1.0f;
        chain->weight[j] = weight * (VALLEY_LEAST + (1.0f - VALLEY_LEAST) * calm * (2.0f - calm));
    }
}

/* Posts from `first` on; the last one for those that are not there. */
static INLINED void begin_chain(const double *x, const double *y, int first, int count,
                                struct chain *ret)
{
    for (int j = 0; j < LANES; j++) {
        int post = first + j < count ? first + j : count - 1;
        ret->x[j] = x[post];
        ret->y[j] = y[post];
        ret->weight[j] = 1.0f;
        ret->shift_x[j] = ret->shift_y[j] = 0.0f;
        ret->ridged[j] = ret->rolling[j] = ret->bend_x[j] = ret->bend_y[j] = 0.0f;
    }
}

static INLINED void end_chain(const struct chain *chain, int first, struct planet_noise *ret)
{
    for (int j = 0; j < LANES; j++) {
        ret->ridged[first + j] = chain->ridged[j];
        ret->rolling[first + j] = chain->rolling[j];
        ret->bend_x[first + j] = chain->bend_x[j];
        ret->bend_y[first + j] = chain->bend_y[j];
    }
}

/* Wider vectors where the machine has them; without fused operations the bits stay the same. */
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) &&                             \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define WIDE __attribute__((target_clones("avx2", "default")))
#else
#define WIDE
#endif
WIDE void planet_noise_at(const double *x, const double *y, int count, int band,
                          const struct planet_noise_filter *filter, struct planet_noise *ret)
{
    struct chain chains[PLANET_NOISE_POSTS / LANES];
    int used = (count + LANES - 1) / LANES;
    for (int c = 0; c < used; c++)
        begin_chain(x, y, c * LANES, count, &chains[c]);
    float amplitude = 1.0f;
    for (int i = 0; i < PLANET_NOISE_OCTAVES && filter->share[i] > 0.0f; i++) {
        struct lattice lattice = lattice_of(i, band);
        amplitude *= gains[i];
        float share = filter->share[i], shown = amplitude * share;
        for (int c = 0; c < used; c++) { /* beside each other: each octave waits for the last */
            struct octave octave;
            evaluate_octave(&lattice, &chains[c], &octave);
            add_hills(&octave, i, shown, share, &chains[c]);
            if (i == 0)
                begin_ridges(&octave, share, &chains[c]);
            else
                add_ridges(&octave, i, shown, share, &chains[c]);
        }
    }
    for (int c = 0; c < used; c++)
        end_chain(&chains[c], c * LANES, ret);
}
