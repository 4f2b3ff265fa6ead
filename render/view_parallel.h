/* What render/view has of views by parallel rays. */
#pragma once

#include "render/view.h"

/* Edges and eye of a view whose eye and axes are those of the aircraft's channel. */
void view_set_parallel(struct view *view, const struct channel_geometry *geometry);
