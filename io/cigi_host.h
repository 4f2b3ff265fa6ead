/* The host's side of a CIGI connection, as far as it takes to lead an image generator through its
 * modes and to fly it: what tests and senders speak. Without sockets and clock; one thread. */
#pragma once

#include "geo/pose.h"
#include "io/cigi_codec.h"

struct cigi_host {
    struct cigi_format format; /* that it speaks */
    uint8_t database;          /* that it wants; 0 none */
    uint32_t frame;            /* of the next message */
    /* Of the image generator. */
    struct cigi_start_of_frame seen; /* the last Start of Frame */
    bool has_seen;
    bool database_seen; /* -n or n has come */
    uint64_t gaps;      /* in its frame numbers */
};

/* Takes the Start of Frame of the image generator's message. Returns 0, or -EBADMSG where it does
 * not begin with one, is of another version than the host speaks, or has two. Where `ret_reader` is
 * not NULL it stands behind the Start of Frame. */
int cigi_host_receive(struct cigi_host *host, const void *data, size_t size,
                      struct cigi_reader *ret_reader, struct rejection *ret_rejection);

/* Begins a message: IG Control, which asks for Operate, then for the database, then acknowledges
 * it. cigi_host_put_pose() and cigi_write() add to it. */
void cigi_host_begin(struct cigi_host *host, nsec_t now_ns, uint8_t ret_data[CIGI_MESSAGE_MAX],
                     struct cigi_writer *ret_writer);

/* Adds an entity at a pose, active and of a type; 0 is own-ship. Where it has velocity, its rates,
 * too. False where there is no room. */
bool cigi_host_put_pose(const struct cigi_host *host, struct cigi_writer *writer, uint16_t entity,
                        uint16_t type, const struct pose *pose);
