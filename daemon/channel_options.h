/* The options of a subcommand that say what is drawn: terrain, geoid, size, pixel error, technique.
 *
 * A child of the subcommand's parser (`.children = channel_children`), which hands it the struct
 * channel_params that they are to change, at ARGP_KEY_INIT: state->child_inputs[0]. */
#pragma once

#include <argp.h>

extern const struct argp_child channel_children[];

/* The same for what compares techniques: without --technique. */
extern const struct argp_child channel_compared_children[];
