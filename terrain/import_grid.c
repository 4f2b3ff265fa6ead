/* The grid and the step that a new database gets from its first sources. */
#include <errno.h>
#include <math.h>

#include "terrain/height_step.h"
#include "terrain/import_internal.h"

#define DEFAULT_ERROR_M 0.5

/* The next density that rasters on no grid share with those on common ones. */
static int32_t round_density(double density)
{
    double multiple = density > 60.0 ? 60.0 : density > 12.0 ? 12.0 : 1.0;
    double posts = ceil(density / multiple * (1.0 - 1e-6)) * multiple;
    return (int32_t)fmin(fmax(posts, 1.0), GRID_POSTS_PER_DEGREE_MAX);
}

/* As fine as the finest source, and a multiple of the finest one that lies on a grid. */
static int32_t choose_density(const struct import_job *job)
{
    double finest = 1.0;
    int32_t own = 1;
    for (size_t i = 0; i < job->source_count; i++) {
        const struct raster_facts *facts = &job->sources[i].facts;
        int32_t density = raster_own_density(facts);
        own = density > own ? density : own;
        finest = fmax(finest, density ? density : facts->density);
    }
    if (own == 1 || finest > 16.0 * own)
        return round_density(finest);
    double posts = own * ceil(finest / own * (1.0 - 1e-6));
    return (int32_t)fmin(posts, GRID_POSTS_PER_DEGREE_MAX);
}

static unsigned choose_bias(const struct import_job *job, int32_t posts_per_degree)
{
    struct grid grid;
    unsigned bias = 0;
    grid_init(&grid, posts_per_degree, 0);
    for (size_t i = 0; i < job->source_count; i++) {
        const struct raster_facts *facts = &job->sources[i].facts;
        int32_t own = raster_own_density(facts);
        if (!own || posts_per_degree % own || raster_level(facts, &grid) >= BLOCK_LEVELS)
            continue;
        unsigned wanted = raster_lon_bias(facts, posts_per_degree);
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
    double error_m = job->database.max_error_m, unit_m = -1.0;
    bool one_unit = true;
    for (size_t i = 0; i < job->source_count; i++) {
        double own = stored_unit_m(&job->sources[i]);
        one_unit &= own > 0.0 && (unit_m < 0.0 || own == unit_m);
        unit_m = own;
    }
    return height_step_for(error_m, one_unit ? unit_m : 0.0);
}

static int check_step(const struct import_job *job, struct diag *diag)
{
    const struct database_params *database = &job->database;
    for (size_t i = 0; i < job->source_count; i++) {
        const struct import_source *source = &job->sources[i];
        double error_m = height_step_error_m(database->step_m, stored_unit_m(source));
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
    database->posts_per_degree = choose_density(job);
    database->lon_bias = choose_bias(job, database->posts_per_degree);
    grid_init(&grid, database->posts_per_degree, database->lon_bias);
    place_sources(job, &grid);
    database->step_m = choose_step(job);
    return 0;
}
