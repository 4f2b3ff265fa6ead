/* The technique `cdlod`: Strugar, "Continuous distance-dependent level of detail for rendering
 * heightmaps" (Journal of Graphics, GPU, and Game Tools 14(4), 2009), as Houska's survey (2019,
 * section 2.3.8) describes it. docs/techniques/cdlod.md. */
#pragma once

#include "render/technique.h"

extern const struct technique_ops technique_cdlod;
