/* otwd's own pose datagram, version 1.0: docs/wire.md specifies it. Pure; any thread. */
#pragma once

#include "io/decode.h"

#define NATIVE_MAGIC         0x4F545750u /* "OTWP" */
#define NATIVE_VERSION_MAJOR 1
#define NATIVE_VERSION_MINOR 0
#define NATIVE_SIZE          128 /* bytes of version 1.0; later minor versions are longer */

enum native_flag {
    NATIVE_POSITION = 1 << 0,
    NATIVE_ATTITUDE = 1 << 1,
    NATIVE_VELOCITY = 1 << 2,
    NATIVE_RATES = 1 << 3,
    NATIVE_ALTITUDE_EGM96 = 1 << 8, /* else above the ellipsoid */
};

/* Reads one datagram. The major version must be ours; of a longer one of the same major version
 * the known prefix is read. Returns 0 or -EBADMSG. */
int native_decode(const void *data, size_t size, struct pose_sample *ret_sample,
                  struct rejection *ret_rejection);

/* Writes `sample` as version 1.0. */
void native_encode(const struct pose_sample *sample, uint8_t ret_data[NATIVE_SIZE]);

/* True where the datagram begins with our magic: whose it is, not whether it is sound. */
bool native_recognises(const void *data, size_t size);
