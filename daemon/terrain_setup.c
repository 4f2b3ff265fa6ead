#include "daemon/terrain_setup.h"

#include <string.h>

#include "geo/egm96.h"
#include "geo/geographic.h"
#include "terrain/database.h"
#include "terrain/imagery.h"
#include "terrain/planet.h"
#include "terrain/tile_cache.h"

int geoid_setup_open(const char *name, struct geoid **ret_geoid, struct diag *diag)
{
    if (strcmp(name, "none") == 0) {
        *ret_geoid = NULL;
        return 0;
    }
    if (strcmp(name, "egm96") != 0)
        return geoid_open(name, ret_geoid, diag);
    return egm96_open(ret_geoid, diag);
}

/* Imagery takes a quarter of the memory for tiles. */
#define IMAGERY_SHARE 4

/* The imagery of a database, or NULL where it has none. */
static int open_imagery(const char *path, size_t cache_bytes, struct imagery **ret_imagery,
                        struct diag *diag)
{
    struct imagery *imagery = NULL;
    struct imagery_facts facts;
    int r = imagery_open(path, (unsigned)(cache_bytes / IMAGE_BYTES), &imagery, diag);
    if (r < 0)
        return r;
    imagery_get_facts(imagery, &facts);
    if (!facts.has_colour && !facts.has_water) {
        imagery_close(imagery);
        imagery = NULL;
    }
    *ret_imagery = imagery;
    return 0;
}

int terrain_setup_open(const char *terrain_path, const char *geoid, unsigned cache_mib,
                       struct terrain_setup *ret_setup, struct diag *diag)
{
    size_t cache_bytes = (size_t)cache_mib << 20;
    struct terrain_setup setup = {0};
    int r = geoid_setup_open(geoid, &setup.geoid, diag);
    if (r == 0 && terrain_path[0] != '\0') {
        r = open_imagery(terrain_path, cache_bytes / IMAGERY_SHARE, &setup.imagery, diag);
        if (setup.imagery)
            cache_bytes -= cache_bytes / IMAGERY_SHARE;
        if (r == 0)
            r = database_source_open(terrain_path,
                                     (unsigned)(cache_bytes / TILE_CACHE_BYTES_PER_TILE),
                                     &setup.source, diag);
        if (r == 0)
            r = planet_open(&setup.fallback, diag);
    } else if (r == 0) {
        r = planet_open(&setup.source, diag);
    }
    if (r < 0) {
        terrain_setup_close(&setup);
        return r;
    }
    *ret_setup = setup;
    return 0;
}

void terrain_setup_close(struct terrain_setup *setup)
{
    terrain_source_destroy(setup->source);
    terrain_source_destroy(setup->fallback);
    imagery_close(setup->imagery);
    geoid_close(setup->geoid);
    *setup = (struct terrain_setup){0};
}
