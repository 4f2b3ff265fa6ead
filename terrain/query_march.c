#include "terrain/query_march.h"

#include <math.h>

#define LEAST_STEP_M 25.0
#define MOST_PART    0.5         /* of the clearance, that a step may be */
#define PLANNED_PART (1.0 / 3.0) /* of it, over level ground */
#define STEPS        8           /* places that are looked at together: hardly dearer than one */
#define EVEN_M       8.0         /* in longer brackets the ground is no straight line */
#define NUDGE        1e-8        /* of a step */

/* Of the line. */
struct place {
    double s, clear_m; /* above the ground */
};

/* Of the line at places that are looked at together; near the ground exact. */
static void look_at(struct query *query, const struct piece *piece, const double *s, int count,
                    double *ret_clear_m)
{
    double lat_deg[STEPS] = {0}, lon_deg[STEPS] = {0};
    float ground_m[STEPS];
    for (int i = 0; i < count; i++) {
        lat_deg[i] = fmin(fmax(curve_at(&piece->lat_deg, s[i]), -90.0), 90.0);
        lon_deg[i] = curve_at(&piece->lon_deg, s[i]);
    }
    query_fallbacks_m(query, lat_deg, lon_deg, count, ground_m);
    for (int i = 0; i < count; i++) {
        ret_clear_m[i] = curve_at(&piece->height_m, s[i]) - (double)ground_m[i];
        if (fabs(ret_clear_m[i]) <= piece->error_m)
            ret_clear_m[i] = piece_height_m(query, piece, s[i]) - (double)ground_m[i];
    }
}

/* Where the line would meet the ground, were it a cubic through the places around: Neville's scheme
 * for the inverse. */
static double guess_hit(const struct place *around, int count)
{
    double s[4] = {around[0].s};
    for (int i = 1; i < count; i++)
        s[i] = around[i].s;
    for (int wide = 1; wide < count; wide++)
        for (int i = 0; i + wide < count; i++) {
            double low = around[i].clear_m, high = around[i + wide].clear_m;
            s[i] = (s[i + 1] * low - s[i] * high) / (low - high);
        }
    return s[0];
}

/* Places between two: evenly where they are far apart, else the nearer to where the line seems to
 * meet the ground the denser. */
static void plan_places(const struct piece *piece, const struct place *above,
                        const struct place *under, double guess, double ret_s[STEPS])
{
    static const double beside[STEPS] = {-0.2, -0.05, -0.01, -0.002, 0.002, 0.01, 0.05, 0.2};
    double width = under->s - above->s, least = 0.4 * QUERY_HIT_M / piece->length_m;
    bool evenly = width * piece->length_m > EVEN_M || !(guess > above->s && guess < under->s);
    for (int i = 0; i < STEPS; i++) {
        double s = evenly ? above->s + width * (i + 1) / (STEPS + 1) : guess + width * beside[i];
        ret_s[i] = fmin(fmax(s, above->s + least), under->s - least);
    }
}

/* Makes the height exact from one place to another near it: so near that the geoid is as much off
 * what it is along the piece at both. */
static void level_geoid(const struct query *query, struct piece *piece, double begin, double end)
{
    double off_m = piece_height_m(query, piece, begin) - curve_at(&piece->height_m, begin);
    double later_m = piece_height_m(query, piece, end) - curve_at(&piece->height_m, end);
    if (fabs(later_m - off_m) > RAY_ERROR_M)
        return;
    piece->height_m.c[0] += 0.5 * (off_m + later_m);
    piece->error_m = 0.0;
}

static double narrow(struct query *query, const struct piece *piece, struct place above,
                     struct place under)
{
    struct place places[STEPS + 2] = {above, under};
    struct piece sharp = *piece;
    int count = 2, hit = 1; /* the first one that is not above */
    level_geoid(query, &sharp, above.s, under.s);
    for (;;) {
        double s[STEPS], clear_m[STEPS];
        int first = hit > 1 ? hit - 2 : 0, last = hit + 1 < count ? hit + 1 : hit;
        above = places[hit - 1];
        under = places[hit];
        if ((under.s - above.s) * piece->length_m <= QUERY_HIT_M)
            return under.s;
        plan_places(piece, &above, &under, guess_hit(places + first, last - first + 1), s);
        look_at(query, &sharp, s, STEPS, clear_m);
        count = STEPS + 2;
        places[0] = above;
        for (int i = 0; i < STEPS; i++)
            places[i + 1] = (struct place){s[i], clear_m[i]};
        places[count - 1] = under;
        for (hit = 1; hit < count - 1 && !(places[hit].clear_m <= 0.0); hit++)
            ;
    }
}

/* Where to look next, `clear_m` above the ground at `s`: as it would be over level ground. Returns
 * how many places there are until `end`. */
static int plan_steps(const struct piece *piece, double s, double clear_m, double end,
                      double ret_s[STEPS])
{
    double rise_m = piece->height_m.c[1] + 2.0 * piece->height_m.c[2] * s; /* along the piece */
    int count = 0;
    while (count < STEPS && s < end) {
        double step = fmax(clear_m * PLANNED_PART, LEAST_STEP_M) / piece->length_m;
        s = fmin(s + step, end);
        clear_m += fmin(rise_m, 0.0) * step;
        ret_s[count++] = s;
    }
    return count;
}

double march_hit(struct query *query, const struct piece *piece, double begin, double end,
                 double *clear_m)
{
    double s = begin, ahead[STEPS], ahead_m[STEPS];
    if (!query->fallback)
        return INFINITY;
    if (isnan(*clear_m))
        look_at(query, piece, &begin, 1, clear_m);
    if (*clear_m <= 0.0)
        return begin;
    while (s < end) {
        int count = plan_steps(piece, s, *clear_m, end, ahead);
        look_at(query, piece, ahead, count, ahead_m);
        for (int i = 0; i < count; i++) {
            double most_m = fmax(MOST_PART * *clear_m, LEAST_STEP_M) * (1.0 + NUDGE);
            if ((ahead[i] - s) * piece->length_m > most_m)
                break;
            if (ahead_m[i] <= 0.0)
                return narrow(query, piece, (struct place){s, *clear_m},
                              (struct place){ahead[i], ahead_m[i]});
            *clear_m = ahead_m[i];
            s = ahead[i];
        }
    }
    return INFINITY;
}
