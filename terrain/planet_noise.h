/* The noise that refines the embedded planet: ridges and valleys from 9 km down to metres.
 *
 * Gradient noise (Perlin 2002) summed octave by octave, where each octave is bent by those before
 * it (de Carpentier's "Swiss turbulence") and grows on heights but not in valleys (Musgrave's
 * ridged multifractal, in "Texturing and Modeling", chapter 16). Integer hashes and + - * / sqrt
 * only, in a fixed order: the same bits on every machine.
 *
 * The lattice lies in latitude and longitude, in cells of 5 minutes: x periodic, y northwards. In
 * bands of latitude x is shrunk so that its cells stay near square on the ground. */
#pragma once

#define PLANET_NOISE_POSTS   64 /* at most, in one call */
#define PLANET_NOISE_OCTAVES 13
#define PLANET_NOISE_BANDS   7

struct planet_noise_band {
    double shrink;   /* of x */
    double from_deg; /* latitude, north or south, at which the band takes over */
};

extern const struct planet_noise_band planet_noise_bands[PLANET_NOISE_BANDS];

/* How much of each octave a grid of some spacing may show: 1 for all, 0 for none. An octave with 0
 * ends the sum. */
struct planet_noise_filter {
    float share[PLANET_NOISE_OCTAVES];
};

/* For posts `spacing_cells` apart. Octave i has its features 2^-i cells apart; one is shown whole
 * where four posts fall on that, not at all where one does. */
struct planet_noise_filter planet_noise_filter_for(double spacing_cells);

struct planet_noise {
    float ridged[PLANET_NOISE_POSTS];  /* sharp crests over smooth valleys; mean about 0 */
    float rolling[PLANET_NOISE_POSTS]; /* hills, as much up as down */
    float bend_x[PLANET_NOISE_POSTS];  /* how far the coarse grid is to be looked up beside */
    float bend_y[PLANET_NOISE_POSTS];  /* the post, in cells (x after shrinking) */
};

/* `count` posts at x[] (0 <= x < 4320 * shrink of the band) and y[]. */
void planet_noise_at(const double *x, const double *y, int count, int band,
                     const struct planet_noise_filter *filter, struct planet_noise *ret);
