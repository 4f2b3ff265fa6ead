/* The technique `reference`: every triangle of the field that may be in the picture. The ground
 * truth of the others, and the plainest example of one. */
#pragma once

#include "render/technique.h"

extern const struct technique_ops technique_reference;
