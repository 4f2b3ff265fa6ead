/* One request of a CIGI host on its way to an answer. Private to io/cigi_requests. */
#pragma once

#include "io/cigi_requests.h"

struct cigi_pending {
    uint32_t token; /* ascending */
    struct cigi_packet request;
    struct cigi_question question;
    struct cigi_answer answer;
    struct cigi_position_response position; /* of CIGI_POSITION_REQUEST */
    bool placed, asked, ready;
    uint8_t frame_low; /* of the host frame whose scene was used */
    unsigned frames;   /* that it has waited */
};

/* Gives a request its place in the scene: its question, or `ready` where nobody need be asked.
 * Returns REJECT_NONE or why it has none. */
enum reject_reason cigi_pending_place(struct cigi_pending *pending, const struct cigi_scene *scene,
                                      const struct cigi_ground *ground);

/* Writes the answer. False where there is no room. */
bool cigi_pending_respond(const struct cigi_pending *pending, const struct cigi_scene *scene,
                          struct cigi_writer *writer);
