/* The technique `quadtree`: Yusov 2012, "Real-Time Deformable Terrain Rendering with DirectX 11"
 * (docs/techniques/quadtree.md): patches of a quadtree in texture arrays, drawn by one call as
 * blocks which the GPU tessellates. */
#pragma once

#include "render/technique.h"

extern const struct technique_ops technique_quadtree, technique_quadtree_5, technique_quadtree_9,
    technique_quadtree_33, technique_quadtree_apart, technique_quadtree_dug;
