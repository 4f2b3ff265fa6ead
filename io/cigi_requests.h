/* What a CIGI host asks: heights, lines of sight, positions, the weather. Part of io/cigi_session.
 *
 * What the scene knows is answered at once; what the ground must be asked becomes a question to the
 * daemon, and is answered in the message of the frame in which the daemon has answered. */
#pragma once

#include "io/cigi_codec.h"
#include "io/cigi_scene.h"

enum cigi_ask {
    CIGI_ASK_GROUND, /* the ground at `from` */
    CIGI_ASK_SEA,    /* the surface of the sea at `from` */
    CIGI_ASK_SIGHT,  /* what the straight line between `from` and `to` meets first */
};

struct cigi_question {
    uint32_t token; /* the answer has the same */
    enum cigi_ask ask;
    bool detailed;            /* normal and material are asked, too */
    struct geodetic from, to; /* anywhere within 1e8 m of the ellipsoid */
};

struct cigi_answer {
    bool known;           /* the database has the place, or the line could be judged */
    bool hit;             /* of a line */
    double height_m;      /* of ground or sea, above the ellipsoid */
    double distance_m;    /* along the line, where hit */
    struct geodetic at;   /* where hit */
    double normal_enu[3]; /* unit, where detailed */
    uint32_t material;    /* where detailed */
};

struct cigi_requests {
    struct cigi_table periodic; /* struct cigi_periodic */
    struct cigi_pending *pending;
    size_t count, limit;
    uint32_t last_token;
    unsigned patience; /* frames */
};

/* At most `limit` at a time, and as many periodic ones. What the daemon has not answered in
 * `patience` frames is told to be invalid. Returns 0 or -ENOMEM. */
int cigi_requests_init(struct cigi_requests *requests, size_t limit, unsigned patience);
/* Legal on zeros. */
void cigi_requests_finish(struct cigi_requests *requests);
void cigi_requests_reset(struct cigi_requests *requests);

/* Returns 0; 1 where the packet is no request; -EBADMSG: REJECT_LIMIT, REJECT_FIELD. */
int cigi_requests_take(struct cigi_requests *requests, const struct cigi_packet *packet,
                       struct rejection *ret_rejection);

/* A frame begins: periodic requests fall due, and those that have waited too long are answered. */
void cigi_requests_begin(struct cigi_requests *requests, const struct cigi_scene *scene,
                         uint64_t rejected[REJECT_REASONS]);

/* Those that have no place yet get it in the scene, as of the frame of the host that asked. Those
 * that have none are answered as invalid and counted by reason. */
void cigi_requests_place(struct cigi_requests *requests, const struct cigi_scene *scene,
                         const struct cigi_ground *ground, uint32_t host_frame,
                         uint64_t rejected[REJECT_REASONS]);

/* As cigi_session_questions() and cigi_session_answer(). */
size_t cigi_requests_questions(struct cigi_requests *requests, struct cigi_question *ret_questions,
                               size_t capacity);
int cigi_requests_answer(struct cigi_requests *requests, uint32_t token,
                         const struct cigi_answer *answer);

/* Writes what is answered, and forgets it; what has no room waits. Returns how many requests. */
size_t cigi_requests_write(struct cigi_requests *requests, const struct cigi_scene *scene,
                           struct cigi_writer *writer);
