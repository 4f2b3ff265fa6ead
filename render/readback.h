/* Brings pixels to main memory without stalling the frame: a ring of pixel buffers, each guarded by
 * a fence, persistently mapped. Belongs to the GL thread. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#include "base/diag.h"

#define READBACK_SLOTS 3

enum readback_what {
    READBACK_COLOUR, /* RGBA, 8 bits each, rows from the bottom */
    READBACK_DEPTH,  /* 32-bit floats as drawn: near / distance along the view axis, 0 = sky */
};

struct readback;

int readback_create(int width, int height, enum readback_what what, struct readback **ret_readback,
                    struct diag *diag);
void readback_destroy(struct readback *readback);

/* Starts copying from a framebuffer object; false where all slots are in use. */
bool readback_start(struct readback *readback, unsigned framebuffer, uint64_t frame);

/* The oldest copy, once it is there: its pixels (valid until readback_release) and frame number;
 * NULL where none is under way or, unless `wait`, none is complete. */
const void *readback_take(struct readback *readback, bool wait, uint64_t *ret_frame);
void readback_release(struct readback *readback);

/* Copies the pixels at once, waiting for them: for measurements. No copy may be under way. -EIO
 * where the GPU is lost. */
int readback_copy(struct readback *readback, unsigned framebuffer, void *ret_pixels);
