/* The techniques `clipmap-classic`: Asirvatham and Hoppe, "Terrain rendering using GPU-based
 * geometry clipmaps" (GPU Gems 2, 2005), and `clipmap-classic-sent`: the same with all vertices
 * sent by the CPU in each frame, as table 1 of Song et al. (2016) counts them.
 * docs/techniques/clipmap-classic.md. */
#pragma once

#include "render/technique.h"

extern const struct technique_ops technique_clipmap_classic;
extern const struct technique_ops technique_clipmap_classic_sent;
