/* The image generator's side of a CIGI connection: a state machine without sockets and without a
 * clock.
 *
 * What the daemon does, on one thread:
 *   for each datagram of the host    cigi_session_receive(), cigi_session_place(), and questions
 *   once a frame                     cigi_session_message(), sent to the host as one datagram
 *   as each frame begins             cigi_session_begin(), and questions; then the scene says what
 *                                    to draw (io/cigi_scene.h: own-ship is entity 0, the eye its
 *                                    view's)
 *   questions                        cigi_session_questions(), and for each, then or in a later
 *                                    frame, cigi_session_answer()
 *   when it happens                  cigi_session_set_status(), cigi_session_database_loaded()
 * In synchronous operation the message is sent on the display's tick and the host answers it
 * (cigi_link.answers); in asynchronous operation the host sends as it likes. The session is the
 * same.
 *
 * Nothing here allocates after cigi_session_create(). docs/cigi.md says what is done with each
 * field. Sources: CIGI 3.3 ICD; SISO-STD-013-2014. */
#pragma once

#include "io/cigi_codec.h"
#include "io/cigi_requests.h"
#include "io/cigi_scene.h"
#include "io/sample_clock.h"

struct cigi_session_params {
    uint8_t major, minor; /* spoken until a host has spoken; 0 = 3.3 */
    bool one_database;    /* there is but one: the number is always 0 and nothing is loaded */
    /* The channel's own view, until the host defines it. Half-angles of 0: 30 by 20 degrees. */
    struct cigi_view_definition view;
    double eye_m[3]; /* likewise, in the axes of own-ship, and in which direction it looks */
    struct attitude direction;
    bool synchronous; /* a place holds for the frame that its message starts, whatever its rates */
    bool of_several;  /* others hear the same host: what it says of a view that is not there is
                         theirs, and skipped */
    /* Limits; 0 = 1024 entities, parts and components, 256 views and regions, 1000 requests. */
    struct cigi_scene_limits limits;
    size_t requests;
    unsigned patience_frames; /* for which an answer is waited for; 0 = 60 */
};

struct cigi_counters {
    uint64_t messages, packets; /* used */
    uint64_t messages_refused;  /* as a whole; also in `rejected` */
    uint64_t packets_ignored;   /* because of the mode */
    uint64_t skipped, unknown;  /* packets of the standard that otwd does not use; others */
    uint64_t rejected[REJECT_REASONS];
    uint64_t lost, restarts; /* by the host's frame numbers */
    uint64_t behind;         /* messages that answer an older frame of ours, or none */
    uint64_t requests, responses;
};

/* How the connection stands. */
struct cigi_link {
    bool heard;                /* a host has spoken */
    struct cigi_format format; /* its version and byte order, or what is spoken until then */
    enum cigi_mode mode;
    uint32_t host_frame;    /* the last, as it counts; wraps */
    uint32_t ig_frame;      /* of the next message; wraps */
    uint32_t ig_frame_seen; /* the last of ours that the host had seen when it spoke; wraps */
    /* The last message answers our last Start of Frame, by its frame number; or the host is one
     * that does not go by these. */
    bool answers;
    bool timestamp_valid; /* host_ns is the host's clock */
    nsec_t host_ns; /* its time stamps, carried on over their wrap; from its first, never below */
    nsec_t receive_ns; /* of the last message */
    nsec_t valid_ns;   /* when that was which it tells: by its time stamp, on our clock */
    struct cigi_counters counters;
};

struct cigi_session;

/* Returns 0 or -ENOMEM. */
int cigi_session_create(const struct cigi_session_params *params,
                        struct cigi_session **ret_session);
/* Legal on NULL. */
void cigi_session_destroy(struct cigi_session *session);

#define CIGI_PARTLY 1

/* Takes a datagram of the host. Returns 0; CIGI_PARTLY: some of its packets were refused, the first
 * of them for the reason told; -EBADMSG: nothing of it was used. All are counted. */
int cigi_session_receive(struct cigi_session *session, const void *data, size_t size,
                         nsec_t receive_ns, struct rejection *ret_rejection);

/* What has been asked since gets its place in the scene, so that questions come up before the next
 * frame begins. `ground` is asked for clamped entities, within the call; it may be NULL. */
void cigi_session_place(struct cigi_session *session, const struct cigi_ground *ground);

/* What the scene has is shown as of `now_ns`: entities with rates are moved. A part of
 * cigi_session_begin(); in synchronous operation also of a message that starts a frame. */
void cigi_session_advance(struct cigi_session *session, nsec_t now_ns);

/* A frame begins, to be shown as of `now_ns`: entities with rates are moved, periodic requests fall
 * due, and all get their places, as above. */
void cigi_session_begin(struct cigi_session *session, nsec_t now_ns,
                        const struct cigi_ground *ground);

/* The questions that have come up since the last call; returns how many. */
size_t cigi_session_questions(struct cigi_session *session, struct cigi_question *ret_questions,
                              size_t capacity);

/* Returns 0, or -ENOENT where nobody waits for it any more. */
int cigi_session_answer(struct cigi_session *session, uint32_t token,
                        const struct cigi_answer *answer);

/* Makes this frame's message: Start of Frame, what is answered, messages. Returns its size. */
size_t cigi_session_message(struct cigi_session *session, nsec_t now_ns,
                            uint8_t ret_data[CIGI_MESSAGE_MAX]);

/* What Start of Frame says of us: the code of the severest active fault that is more than a notice
 * (docs/faults.md), 0 for none; and for 4.0 enum cigi_condition bits. */
void cigi_session_set_status(struct cigi_session *session, unsigned fault, unsigned condition);

/* The IG status of 3.x that stands for a fault: 101 .. 139 are 1 .. 39, 201 .. 239 are 41 .. 79. */
uint8_t cigi_status_from_fault(unsigned fault);

/* The database that the host wants, where its loading has not been told to have ended; else 0. */
int cigi_session_database_wanted(const struct cigi_session *session);
/* Its loading has ended; `loaded` is false where it cannot be had. */
void cigi_session_database_loaded(struct cigi_session *session, int number, bool loaded);

/* An IG Message, sent with the next message. Of too many the later are dropped. */
void cigi_session_say(struct cigi_session *session, uint16_t id, const char *text);
#define CIGI_SAY_REFUSED 104 /* id of those about refused packets: the fault POSE_REJECTED */

/* Both live as long as the session. */
const struct cigi_scene *cigi_session_scene(const struct cigi_session *session);
const struct cigi_link *cigi_session_link(const struct cigi_session *session);
