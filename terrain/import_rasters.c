#include "terrain/import_rasters.h"

int import_rasters_get(struct import_rasters *rasters, const struct import_job *job, size_t index,
                       struct raster **ret_raster, struct diag *diag)
{
    const struct import_source *source = &job->sources[index];
    struct import_open_raster *oldest = &rasters->open[0];
    int most = job->params->imagery ? IMPORT_IMAGES_OPEN : IMPORT_RASTERS_OPEN;
    for (int i = 0; i < most; i++) {
        struct import_open_raster *open = &rasters->open[i];
        if (open->raster && open->source == index) {
            open->used = ++rasters->clock;
            *ret_raster = open->raster;
            return 0;
        }
        oldest = open->used < oldest->used ? open : oldest;
    }
    raster_close(oldest->raster);
    *oldest = (struct import_open_raster){.source = index, .used = ++rasters->clock};
    struct raster_options options = import_raster_options(job, source);
    int r = import_check_source(source, diag);
    if (r == 0)
        r = raster_open(source->path, &options, &oldest->raster, diag);
    *ret_raster = oldest->raster;
    return r;
}

void import_rasters_finish(struct import_rasters *rasters)
{
    for (int i = 0; i < IMPORT_RASTERS_OPEN; i++)
        raster_close(rasters->open[i].raster);
}
