#include "terrain/source.h"

#include <assert.h>
#include <stddef.h>

void terrain_source_destroy(struct terrain_source *source)
{
    if (source)
        source->ops->destroy(source);
}

int terrain_source_share(struct terrain_source *source, struct terrain_source **ret_source)
{
    assert(source->ops->share);
    return source->ops->share(source, ret_source);
}

struct terrain_counts terrain_source_counts(struct terrain_source *source)
{
    struct terrain_counts counts = {0};
    if (source->ops->counts)
        source->ops->counts(source, &counts);
    return counts;
}
