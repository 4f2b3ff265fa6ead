#include "terrain/source.h"

#include <stddef.h>

void terrain_source_destroy(struct terrain_source *source)
{
    if (source)
        source->ops->destroy(source);
}

struct terrain_counts terrain_source_counts(struct terrain_source *source)
{
    struct terrain_counts counts = {0};
    if (source->ops->counts)
        source->ops->counts(source, &counts);
    return counts;
}
