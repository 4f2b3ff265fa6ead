/* The embedded planet: the real Earth at 5 minutes of arc (NOAA ETOPO5), refined by noise down to a
 * metre, without any file. The sea is flat at 0 m: where the grid is below sea level, and only
 * there or along its shores, the height is exactly 0. The same bits on every machine. */
#pragma once

#include "base/diag.h"
#include "terrain/source.h"

/* Takes about 0.2 s and 35 MB of memory. Returns 0, -ENOMEM, or -EBADMSG where the grid in the
 * program does not decode. The source's sample and sample_point return 0 for any finite
 * numbers, and -EINVAL for others; they never give NaN. */
int planet_open(struct terrain_source **ret, struct diag *diag);
