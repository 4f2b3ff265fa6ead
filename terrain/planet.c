#include "terrain/planet.h"

#include "terrain/planet_grid.h"
#include "terrain/planet_noise.h"

#include <errno.h>
#include <math.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdlib.h>

#define FINEST_STEP_DEG (1.0 / (PLANET_CELLS_PER_DEG * 8192))

/* Height of the first octave's noise over the relief about it, and where there is none. */
#define NOISE_PER_RELIEF 1.5f
#define NOISE_LEAST_M    1.5f

/* Relief from which hills turn into ridges, and where they are nothing else. */
#define RIDGES_FROM_M 20.0f
#define RIDGES_ALL_M  120.0f

/* Half of the width in which the noise of one band of latitude fades into the next. */
#define BAND_FADE_DEG 0.5
#define POLE_FADE_DEG 1.0

struct planet {
    struct terrain_source source; /* first */
    struct planet_grid grid;
    atomic_uint users;
};

/* What neighbouring posts look up alike. */
struct patches {
    struct planet_patch height, relief; /* or, of a coarser mip, `height` alone */
};

/* What all posts of a row have in common. */
struct row {
    double y_cells;
    int band;
    float share[2]; /* of that band and of the next; the second is 0 away from the borders */
    float pole;     /* 1, falling to 0 at the poles, where all longitudes meet */
};

static double smoothstep(double from, double to, double at)
{
    double t = (at - from) / (to - from);
    t = t < 0.0 ? 0.0 : t > 1.0 ? 1.0 : t;
    return t * t * (3.0 - 2.0 * t);
}

static struct row row_at(double y_cells)
{
    double top = PLANET_ROWS - 1;
    double y = y_cells < 0.0 ? 0.0 : y_cells > top ? top : y_cells;
    double lat_deg = fabs(y / PLANET_CELLS_PER_DEG - 90.0);
    struct row row = {.y_cells = y, .share = {1.0f, 0.0f}};
    for (int i = 1; i < PLANET_NOISE_BANDS; i++) {
        double border = planet_noise_bands[i].from_deg;
        if (lat_deg >= border + BAND_FADE_DEG) {
            row.band = i;
        } else if (lat_deg > border - BAND_FADE_DEG) {
            float t = (float)smoothstep(border - BAND_FADE_DEG, border + BAND_FADE_DEG, lat_deg);
            /* Two unlike noises of these shares are as rough as one. */
            float length = sqrtf(t * t + (1.0f - t) * (1.0f - t));
            row.share[0] = (1.0f - t) / length;
            row.share[1] = t / length;
        }
    }
    row.pole = (float)smoothstep(0.0, POLE_FADE_DEG, 90.0 - lat_deg);
    return row;
}

/* 0 <= result < PLANET_COLS */
static double wrapped_cells(double x)
{
    if (x >= 0.0 && x < PLANET_COLS)
        return x;
    double wrapped = x - floor(x / PLANET_COLS) * PLANET_COLS;
    return wrapped < PLANET_COLS ? wrapped : 0.0;
}

/* Posts that are sampled together: they share the bands of noise and their shares. */
struct batch {
    int count;
    struct row row; /* the bands of all */
    double x_cells[PLANET_NOISE_POSTS], y_cells[PLANET_NOISE_POSTS];
    float pole[PLANET_NOISE_POSTS];
    double spacing; /* in cells */
};

struct noise_sum {
    float ridged[PLANET_NOISE_POSTS], rolling[PLANET_NOISE_POSTS];
    float bend_x[PLANET_NOISE_POSTS], bend_y[PLANET_NOISE_POSTS];
};

/* `which` of the two: 0 begins the sum. */
static void add_band(const struct batch *batch, int which, struct noise_sum *sum)
{
    int band = batch->row.band + which;
    double narrow = planet_noise_bands[band].shrink, x[PLANET_NOISE_POSTS];
    float share = batch->row.share[which], wide = (float)(1.0 / narrow);
    for (int j = 0; j < batch->count; j++)
        x[j] = batch->x_cells[j] * narrow;
    struct planet_noise_filter filter = planet_noise_filter_for(batch->spacing);
    struct planet_noise noise;
    planet_noise_at(x, batch->y_cells, batch->count, band, &filter, &noise);
    for (int j = 0; j < batch->count; j++) {
        bool begins = which == 0;
        float bend = share * batch->pole[j];
        sum->ridged[j] = (begins ? 0.0f : sum->ridged[j]) + share * noise.ridged[j];
        sum->rolling[j] = (begins ? 0.0f : sum->rolling[j]) + share * noise.rolling[j];
        sum->bend_x[j] = (begins ? 0.0f : sum->bend_x[j]) + bend * wide * noise.bend_x[j];
        sum->bend_y[j] = (begins ? 0.0f : sum->bend_y[j]) + bend * noise.bend_y[j];
    }
}

/* How strong the noise may be over a coarse height: so strong as the relief has it inland, but not
 * so strong that it drowns low land or lifts the sea's floor out of the water. */
static float noise_height_m(float coarse_m, float relief_m, float pole)
{
    float full_m = NOISE_PER_RELIEF * relief_m + NOISE_LEAST_M;
    float room_m = 2.0f + 0.1f * full_m + (coarse_m > 0.0f ? coarse_m : -0.7f * coarse_m);
    return pole * full_m * room_m / (room_m + 0.6f * full_m);
}

/* What grid and noise come to. */
static void shape_posts(const struct planet *p, const struct batch *batch,
                        const struct noise_sum *noise, struct patches *patches, float *ret_height_m)
{
    double x[PLANET_NOISE_POSTS], y[PLANET_NOISE_POSTS];
    float coarse_m[PLANET_NOISE_POSTS], relief[PLANET_NOISE_POSTS];
    for (int j = 0; j < batch->count; j++) {
        x[j] = wrapped_cells(batch->x_cells[j] + (double)noise->bend_x[j]);
        y[j] = batch->y_cells[j] + (double)noise->bend_y[j];
    }
    planet_raster_interpolate(&p->grid.height_m[0], x, y, batch->count, &patches->height, coarse_m);
    planet_raster_interpolate(&p->grid.relief, x, y, batch->count, &patches->relief, relief);
    for (int j = 0; j < batch->count; j++) {
        float relief_m = relief[j] * (1.0f / PLANET_RELIEF_PER_M);
        relief_m = relief_m > 0.0f ? relief_m : 0.0f;
        float ridges = (float)smoothstep(RIDGES_FROM_M, RIDGES_ALL_M, relief_m);
        float shape = noise->rolling[j] + ridges * (noise->ridged[j] - noise->rolling[j]);
        float height_m =
            coarse_m[j] + noise_height_m(coarse_m[j], relief_m, batch->pole[j]) * shape;
        ret_height_m[j] = height_m > 0.0f ? height_m : 0.0f;
    }
}

/* True where neither the grid nor the noise can raise land: no land within two cells. */
static bool open_sea(const struct planet *p, double x_cells, double y_cells)
{
    const struct planet_raster *heights = &p->grid.height_m[0], *relief = &p->grid.relief;
    int col = (int)x_cells, row = (int)y_cells;
    if (heights->posts[(size_t)row * PLANET_COLS + (size_t)col] >= 0)
        return false;
    int west = col / 2, south = row / 2;
    int east = west + 1 < relief->cols ? west + 1 : 0,
        north = south + 1 < relief->rows ? south + 1 : south;
    const int16_t *s = relief->posts + (size_t)south * (size_t)relief->cols;
    const int16_t *n = relief->posts + (size_t)north * (size_t)relief->cols;
    return !(s[west] | s[east] | n[west] | n[east]);
}

static void sample_fine(const struct planet *p, const struct batch *batch, struct patches *patches,
                        float *ret_height_m)
{
    int land = 0, count = batch->count;
    bool sea[PLANET_NOISE_POSTS];
    for (int j = 0; j < count; j++) {
        sea[j] = open_sea(p, batch->x_cells[j], batch->y_cells[j]);
        ret_height_m[j] = 0.0f;
        land += !sea[j];
    }
    if (land == 0)
        return;
    struct noise_sum sum;
    add_band(batch, 0, &sum);
    if (batch->row.share[1] > 0.0f)
        add_band(batch, 1, &sum);
    shape_posts(p, batch, &sum, patches, ret_height_m);
    for (int j = 0; j < count; j++)
        if (sea[j])
            ret_height_m[j] = 0.0f;
}

/* Grids coarser than the planet's own: no noise, an averaged raster. */
static void sample_coarse(const struct planet *p, const struct batch *batch, int mip,
                          struct patches *patches, float *ret_height_m)
{
    planet_raster_interpolate(&p->grid.height_m[mip], batch->x_cells, batch->y_cells, batch->count,
                              &patches->height, ret_height_m);
    for (int j = 0; j < batch->count; j++)
        ret_height_m[j] = ret_height_m[j] > 0.0f ? ret_height_m[j] : 0.0f;
}

static void sample_batch(const struct planet *p, struct batch *batch, int mip,
                         struct patches *patches, float *ret_height_m)
{
    if (mip > 0)
        sample_coarse(p, batch, mip, patches, ret_height_m);
    else
        sample_fine(p, batch, patches, ret_height_m);
    batch->count = 0;
}

static bool same_bands(const struct row *a, const struct row *b)
{
    return a->band == b->band && a->share[0] == b->share[0] && a->share[1] == b->share[1];
}

static int mip_for(double spacing_cells)
{
    int mip = 0;
    while (mip < PLANET_MIPS - 1 && spacing_cells >= (double)(2 << mip))
        mip++;
    return mip;
}

static int planet_sample(struct terrain_source *source, const struct terrain_places *places,
                         float *ret_height_m)
{
    const struct planet *p = (const struct planet *)source;
    struct batch batch; /* not cleared: that would cost a tenth of a small one */
    batch.count = 0;
    batch.spacing = places->spacing_deg * PLANET_CELLS_PER_DEG;
    if (!(batch.spacing > 0.0) || !isfinite(batch.spacing))
        return -EINVAL;
    int mip = mip_for(batch.spacing);
    struct patches patches = {PLANET_PATCH_EMPTY, PLANET_PATCH_EMPTY};
    float *heights_m = ret_height_m; /* where the batch begins */
    for (int i = 0; i < places->count; i++) {
        struct row row = row_at((places->lat_deg[i] + 90.0) * PLANET_CELLS_PER_DEG);
        int count = batch.count;
        if (count == PLANET_NOISE_POSTS || (count > 0 && !same_bands(&batch.row, &row))) {
            sample_batch(p, &batch, mip, &patches, heights_m);
            heights_m += count;
            count = 0;
        }
        batch.row = row;
        batch.x_cells[count] = wrapped_cells((places->lon_deg[i] + 180.0) * PLANET_CELLS_PER_DEG);
        batch.y_cells[count] = row.y_cells;
        batch.pole[count] = row.pole;
        batch.count++;
    }
    sample_batch(p, &batch, mip, &patches, heights_m);
    return 0;
}

static int planet_sample_point(struct terrain_source *source, double lat_deg, double lon_deg,
                               double *ret_height_m)
{
    if (!(fabs(lat_deg) <= 90.0) || !(fabs(lon_deg) <= 1e6))
        return -EINVAL;
    const struct terrain_places place = {&lat_deg, &lon_deg, 1, FINEST_STEP_DEG};
    float height_m;
    int r = planet_sample(source, &place, &height_m);
    if (r == 0)
        *ret_height_m = (double)height_m;
    return r;
}

static void planet_facts(const struct terrain_source *source, struct terrain_facts *ret_facts)
{
    (void)source;
    *ret_facts = (struct terrain_facts){
        .finest_lat_step_deg = FINEST_STEP_DEG,
        .finest_lon_step_deg = FINEST_STEP_DEG,
        .south_deg = -90.0,
        .west_deg = -180.0,
        .north_deg = 90.0,
        .east_deg = 180.0,
        .name = "embedded planet",
    };
}

static void planet_destroy(struct terrain_source *source)
{
    struct planet *p = (struct planet *)source;
    if (atomic_fetch_sub(&p->users, 1) > 1)
        return;
    planet_grid_finish(&p->grid);
    free(p);
}

/* Nothing about it changes: all use the one. */
static int planet_share(struct terrain_source *source, struct terrain_source **ret_source)
{
    struct planet *p = (struct planet *)source;
    atomic_fetch_add(&p->users, 1);
    *ret_source = source;
    return 0;
}

int planet_open(struct terrain_source **ret, struct diag *diag)
{
    static const struct terrain_source_ops ops = {
        .sample = planet_sample,
        .sample_point = planet_sample_point,
        .facts = planet_facts,
        .destroy = planet_destroy,
        .share = planet_share,
    };
    struct planet *p = calloc(1, sizeof(*p));
    if (!p)
        return diag_set(diag, -ENOMEM, "embedded planet: out of memory");
    int r = planet_grid_init(&p->grid, diag);
    if (r < 0) {
        free(p);
        return r;
    }
    p->source.ops = &ops;
    p->users = 1;
    *ret = &p->source;
    return 0;
}
