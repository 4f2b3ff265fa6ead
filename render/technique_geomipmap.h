/* The technique `geomipmap`: Wagner, "Terrain geomorphing in the vertex shader" (ShaderX2, 2004).
 * docs/techniques/geomipmap.md. */
#pragma once

#include "render/technique.h"

extern const struct technique_ops technique_geomipmap, technique_geomipmap_static,
    technique_geomipmap_sent;
