/* A host and an image generator that talk to each other without a network. */
#pragma once

#include "io/cigi_host.h"
#include "io/cigi_session.h"
#include "tests/check.h"

#define FIXTURE_FRAME_NS (NSEC_PER_SEC / 60)

struct cigi_pair {
    struct cigi_session *session;
    struct cigi_host host;
    nsec_t now_ns;
    struct cigi_writer writer; /* the host's message */
    struct rejection why;      /* of the last exchange */
    size_t ig_size;            /* of the image generator's last message */
    uint8_t host_data[CIGI_MESSAGE_MAX], ig_data[CIGI_MESSAGE_MAX];
};

static struct cigi_pair talk;

/* The host's message of this frame, to which packets may be added. */
static inline void pair_open(void)
{
    cigi_host_begin(&talk.host, talk.now_ns, talk.host_data, &talk.writer);
}

static inline void pair_put(const struct cigi_packet *packet)
{
    CHECK(cigi_write(&talk.writer, packet));
}

/* The host's message arrives. */
static inline int pair_send(void)
{
    return cigi_session_receive(talk.session, talk.host_data, talk.writer.size, talk.now_ns,
                                &talk.why);
}

/* The image generator's message arrives. */
static inline void pair_answer(void)
{
    struct rejection why = {.text = ""};
    talk.ig_size = cigi_session_message(talk.session, talk.now_ns, talk.ig_data);
    CHECK_INT(cigi_host_receive(&talk.host, talk.ig_data, talk.ig_size, NULL, &why), 0);
    if (why.text[0])
        CHECK_STRING(why.text, "");
}

/* The host sends; a frame begins, and goes out. */
static inline int pair_exchange(const struct cigi_ground *ground)
{
    int r = pair_send();
    cigi_session_begin(talk.session, talk.now_ns, ground);
    pair_answer();
    talk.now_ns += FIXTURE_FRAME_NS;
    return r;
}

/* Packets after the Start of Frame of the last message, of one kind; at most `capacity`. */
static inline size_t pair_responses(enum cigi_kind kind, struct cigi_packet *ret, size_t capacity)
{
    struct cigi_reader reader;
    struct cigi_packet packet;
    size_t count = 0;
    CHECK_INT(cigi_read_begin(talk.ig_data, talk.ig_size, &reader, NULL), 0);
    for (int r; (r = cigi_read(&reader, &packet, NULL)) != CIGI_END;) {
        CHECK_INT(r, CIGI_PACKET);
        if (packet.kind == kind && count < capacity)
            ret[count++] = packet;
    }
    return count;
}

static inline void pair_start(const struct cigi_session_params *params, struct cigi_format format)
{
    talk.host = (struct cigi_host){.format = format, .frame = 1};
    talk.now_ns = 1000 * NSEC_PER_SEC;
    CHECK_INT(cigi_session_create(params, &talk.session), 0);
}

/* In Operate, with one database. */
static inline void pair_operate(struct cigi_format format)
{
    struct cigi_session_params params = {.one_database = true, .view = {.view = 1}};
    pair_start(&params, format);
    pair_open();
    CHECK_INT(pair_exchange(NULL), 0);
}

static inline void pair_end(void)
{
    cigi_session_destroy(talk.session);
    talk.session = NULL;
}

static inline const struct cigi_link *pair_link(void)
{
    return cigi_session_link(talk.session);
}
