#include "terrain/source.h"

#include <stddef.h>

void terrain_source_destroy(struct terrain_source *source)
{
    if (source)
        source->ops->destroy(source);
}
