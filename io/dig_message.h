/* Digging over the wire: the datagrams of otwd's own protocol that change the ground, and the one
 * that answers them. docs/wire.md specifies them. What a stamp's bytes say is terrain's business
 * (terrain/stamp.h). Pure; any thread. */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/diag.h"

#define DIG_MAGIC         0x4F545744u /* "OTWD" */
#define DIG_VERSION_MAJOR 1
#define DIG_HEAD          32
#define DIG_MESSAGE_MAX   65507 /* what a UDP datagram holds */
#define DIG_TEXT_MAX      256
#define DIG_SESSION_MAX   INT32_MAX /* from 1 */

enum dig_kind {
    DIG_ADD = 1,
    DIG_UNDO = 2,
    DIG_ANSWER = 128,
};

enum dig_status {
    DIG_STATUS_DONE = 0,    /* it is on the disk */
    DIG_STATUS_REFUSED = 1, /* it cannot be done; the text says why */
    DIG_STATUS_BUSY = 2,    /* there is too much before it: ask again */
};

struct dig_message {
    enum dig_kind kind;
    uint32_t session; /* another number each time that a sender starts */
    uint32_t request; /* the answer has the same */
    /* Of a request to add. */
    const uint8_t *body; /* in the datagram */
    size_t size;
    uint32_t count; /* of a request to undo: stamps */
    /* Of an answer. */
    enum dig_status status;
    uint64_t id; /* of the stamp */
    char text[DIG_TEXT_MAX];
};

/* True where the datagram begins with our magic. */
bool dig_message_recognises(const void *data, size_t size);

/* Reads a datagram. 0, -EPROTONOSUPPORT, or -EBADMSG, with a sentence. */
int dig_message_decode(const void *data, size_t size, struct dig_message *ret_message,
                       struct diag *diag);

/* Writes one; returns its size, or 0 where the body does not fit. */
size_t dig_message_encode(const struct dig_message *message, uint8_t ret_data[DIG_MESSAGE_MAX]);
