/* The grid and the step that a new database gets from its first sources. */
#include <errno.h>
#include <math.h>

#include "terrain/height_step.h"
#include "terrain/import_internal.h"

#define DEFAULT_ERROR_M 0.5
#define UNASKED_ERROR_M 0.25 /* what is kept where nobody asked: half of what is promised */

/* The next density that rasters on no grid share with those on common ones. */
static double round_density(double density)
{
    double multiple = density > 60.0 ? 60.0 : density > 12.0 ? 12.0 : 1.0;
    double posts = ceil(density / multiple * (1.0 - 1e-6)) * multiple;
    return fmin(fmax(posts, 1.0), GRID_POSTS_PER_DEGREE_MAX);
}

/* As fine as the finest source, and a multiple of the finest one that lies on a grid; of two that
 * are as fine, that whose posts lie on the equator's and Greenwich's side goes first. */
static struct grid_shape choose_grid(const struct import_job *job)
{
    struct grid_shape best = {.posts_per_degree = 0.0};
    double finest = 1.0;
    for (size_t i = 0; i < job->source_count; i++) {
        const struct raster_facts *facts = &job->sources[i].facts;
        struct grid_shape own;
        if (!raster_own_shape(facts, &own)) {
            finest = fmax(finest, facts->density);
            continue;
        }
        bool plain = own.lat_phase == 0.0 && own.lon_phase == 0.0;
        bool best_plain = best.lat_phase == 0.0 && best.lon_phase == 0.0;
        finest = fmax(finest, own.posts_per_degree);
        if (own.posts_per_degree > best.posts_per_degree ||
            (own.posts_per_degree == best.posts_per_degree && plain && !best_plain))
            best = own;
    }
    if (finest > 16.0 * best.posts_per_degree) /* also where there is none */
        return (struct grid_shape){.posts_per_degree = round_density(finest)};
    double times = ceil(finest / best.posts_per_degree * (1.0 - 1e-6));
    if (times > 1.0) /* every post of the coarser grid is one of the finer */
        best = (struct grid_shape){.posts_per_degree = best.posts_per_degree * times,
                                   .lat_phase = fmod(best.lat_phase * times, 1.0),
                                   .lon_phase = fmod(best.lon_phase * times, 1.0)};
    return best;
}

static unsigned choose_bias(const struct import_job *job, const struct grid_shape *shape)
{
    struct grid grid;
    unsigned bias = 0;
    grid_init(&grid, shape);
    for (size_t i = 0; i < job->source_count; i++) {
        const struct raster_facts *facts = &job->sources[i].facts;
        if (!raster_fits(facts, shape) || raster_level(facts, &grid) >= BLOCK_LEVELS)
            continue;
        unsigned wanted = raster_lon_bias(facts, shape);
        bias = wanted > bias ? wanted : bias;
    }
    return bias;
}

/* The unit of what is stored of a source: none where it is resampled or its datum changes. */
static double stored_unit_m(const struct import_source *source)
{
    return source->exact ? source->facts.unit_m : 0.0;
}

static void place_sources(struct import_job *job, const struct grid *grid)
{
    for (size_t i = 0; i < job->source_count; i++) {
        struct import_source *source = &job->sources[i];
        source->level = raster_level(&source->facts, grid);
        source->exact =
            source->options->vertical == IMPORT_EGM96 &&
            raster_is_exact(&source->facts, grid, source->level / BLOCK_LEVELS * BLOCK_LEVELS);
    }
}

static double choose_step(const struct import_job *job)
{
    double error_m = job->params->max_error_m ? *job->params->max_error_m : UNASKED_ERROR_M;
    double unit_m = -1.0;
    bool one_unit = true;
    for (size_t i = 0; i < job->source_count; i++) {
        double own = stored_unit_m(&job->sources[i]);
        one_unit &= own > 0.0 && (unit_m < 0.0 || own == unit_m);
        unit_m = own;
    }
    double step_m = height_step_for(error_m, one_unit ? unit_m : 0.0);
    /* What sources blend into is no whole number of units. */
    if (job->params->feather_posts &&
        height_step_error_m(step_m, 0.0) > job->database.max_error_m * (1.0 + 1e-12))
        step_m = height_step_for(error_m, 0.0);
    return step_m;
}

static int check_step(const struct import_job *job, struct diag *diag)
{
    const struct database_params *database = &job->database;
    for (size_t i = 0; i < job->source_count; i++) {
        const struct import_source *source = &job->sources[i];
        double unit_m = job->params->feather_posts ? 0.0 : stored_unit_m(source);
        double error_m = height_step_error_m(database->step_m, unit_m);
        if (!source->done && error_m > database->max_error_m * (1.0 + 1e-12))
            return diag_set(diag, -EINVAL,
                            "%s: the steps of %s are %g m, for whole heights; this source would be "
                            "stored with errors of up to %g m: put all sources into a new database "
                            "together, which gets steps that fit them",
                            source->path, job->params->database, database->step_m, error_m);
    }
    return 0;
}

int import_choose_grid(struct import_job *job, struct diag *diag)
{
    struct database_params *database = &job->database;
    const double *asked_m = job->params->max_error_m;
    struct grid grid;
    if (job->old) {
        int r = database_get_params(job->old, database, diag);
        if (r == 0 && asked_m && *asked_m != database->max_error_m)
            r = diag_set(diag, -EINVAL, "%s was made with --max-error %g; it cannot take %g",
                         job->params->database, database->max_error_m, *asked_m);
        if (r < 0)
            return r;
        place_sources(job, database_grid(job->old));
        return check_step(job, diag);
    }
    database->max_error_m = asked_m ? *asked_m : DEFAULT_ERROR_M;
    database->grid = choose_grid(job);
    database->grid.lon_bias = choose_bias(job, &database->grid);
    grid_init(&grid, &database->grid);
    place_sources(job, &grid);
    database->step_m = choose_step(job);
    return 0;
}
