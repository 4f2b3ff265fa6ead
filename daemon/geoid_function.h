/* The geoid in the form that io/ asks for it. */
#pragma once

#include "daemon/terrain_setup.h"
#include "geo/geographic.h"
#include "io/intake.h"

/* NULL stands for a geoid of undulation 0. The geoid has to outlive the use. */
struct geoid_function geoid_function_of(struct geoid *geoid);
