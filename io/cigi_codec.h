/* CIGI messages: a datagram is a message, a message is packets on boundaries of 8 bytes, the first
 * of which says version and byte order. Versions 3.0 to 3.3 and 4.0, either byte order.
 *
 * Pure functions; any thread. io/cigi_packets.h says what packets there are, docs/cigi.md what
 * becomes of them. */
#pragma once

#include "io/cigi_packets.h"
#include "io/decode.h"

#define CIGI_MESSAGE_MAX 65504 /* what a UDP datagram holds, in whole packets */

struct cigi_format {
    uint8_t major, minor; /* 3.0 .. 3.3, 4.0 */
    bool big;             /* most significant byte first */
};

/* Where a reader is in a message. */
struct cigi_reader {
    const uint8_t *data; /* borrowed */
    size_t size, offset; /* of what comes next */
    struct cigi_format format;
};

/* What is first in the message: IG Control, or Start of Frame. Returns 0, or -EBADMSG for what is
 * no CIGI (REJECT_SHORT, REJECT_MAGIC), another version of it (REJECT_VERSION), or one whose byte
 * order cannot be told (REJECT_FIELD); the reader is then untouched. */
int cigi_read_begin(const void *data, size_t size, struct cigi_reader *ret_reader,
                    struct rejection *ret_rejection);

enum cigi_read {
    CIGI_END,
    CIGI_PACKET,
    CIGI_SKIPPED, /* a packet of the standard that otwd passes over; ret_rejection->text says which
                   */
    CIGI_UNKNOWN, /* one that the standard does not have; likewise */
};

/* The next packet. Returns enum cigi_read; or -EBADMSG for a packet that is refused: shorter than
 * its kind (REJECT_SHORT), with a number that is none (REJECT_NOT_FINITE) or lies beyond the Earth
 * (REJECT_RANGE). The reader then stands at the next one, so that reading goes on; unless the size
 * of the packet cannot be (REJECT_LENGTH), which ends the message. */
int cigi_read(struct cigi_reader *reader, struct cigi_packet *ret_packet,
              struct rejection *ret_rejection);

/* Writes packets one after the other. */
struct cigi_writer {
    uint8_t *data;         /* borrowed */
    size_t capacity, size; /* size: of what was written */
    struct cigi_format format;
};

/* Appends a packet, with what belongs to the version in IG Control and Start of Frame. False where
 * the version does not have it or there is no room. */
bool cigi_write(struct cigi_writer *writer, const struct cigi_packet *packet);
