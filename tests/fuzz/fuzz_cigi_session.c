/* Whatever a host sends: the session answers with one Start of Frame a frame, all of it well
 * formed. The input is a sequence of datagrams, each behind its size in two bytes. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "io/cigi_session.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static int flat_ground(void *context, double lat_deg, double lon_deg, double *ret_height_m,
                       double ret_normal_enu[3])
{
    if (lat_deg < -90.0 || lat_deg > 90.0)
        abort();
    *ret_height_m = 100.0;
    memcpy(ret_normal_enu, (double[3]){0.0, 0.0, 1.0}, 3 * sizeof(double));
    return lon_deg > 100.0 ? -1 : 0;
}

static void check_message(struct cigi_session *session, nsec_t now_ns)
{
    static uint8_t data[CIGI_MESSAGE_MAX];
    struct cigi_reader reader;
    struct cigi_packet packet;
    size_t size = cigi_session_message(session, now_ns, data);
    int starts = 0;
    if (cigi_read_begin(data, size, &reader, NULL) < 0)
        abort();
    for (int r; (r = cigi_read(&reader, &packet, NULL)) != CIGI_END;) {
        if (r != CIGI_PACKET)
            abort();
        starts += packet.kind == CIGI_START_OF_FRAME;
    }
    if (starts != 1)
        abort();
}

static void run_frame(struct cigi_session *session, nsec_t now_ns)
{
    static const struct cigi_ground ground = {.at = flat_ground};
    struct cigi_question questions[16];
    struct pose pose;
    cigi_session_begin(session, now_ns, &ground);
    size_t count = cigi_session_questions(session, questions, 16);
    for (size_t i = 0; i < count; i++) {
        struct cigi_answer answer = {
            .known = true, .hit = i & 1, .height_m = 5.0, .normal_enu = {0.0, 0.0, 1.0}};
        pose = (struct pose){.valid = POSE_POSITION, .position = questions[i].from};
        if (!pose_is_sane(&pose) || cigi_session_answer(session, questions[i].token, &answer) < 0)
            abort();
    }
    const struct cigi_scene *scene = cigi_session_scene(session);
    for (size_t i = 0; i < scene->views.count; i++) {
        const struct cigi_view *view = cigi_table_at(&scene->views, i);
        if (cigi_scene_eye_pose(scene, (uint16_t)view->id, &ground, &pose) == 0 &&
            !pose_is_sane(&pose))
            abort();
    }
    struct cigi_seen seen[8];
    size_t others = cigi_scene_seen(scene, 0, &ground, seen, 8);
    for (size_t i = 0; i < others; i++)
        for (int k = 0; k < 3; k++)
            if (!(fabs(seen[i].ecef_m[k]) < 1e9))
                abort();
    check_message(session, now_ns);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct cigi_session_params params = {
        .limits = {.entities = 8, .parts = 4, .components = 4, .views = 4, .regions = 2},
        .requests = 8,
        .patience_frames = 2};
    struct cigi_session *session;
    nsec_t now_ns = 0;
    if (cigi_session_create(&params, &session) < 0)
        return 0;
    while (size >= 2) {
        size_t datagram = (size_t)data[0] | (size_t)data[1] << 8;
        data += 2;
        size -= 2;
        datagram = datagram < size ? datagram : size;
        now_ns += NSEC_PER_SEC / 60;
        cigi_session_receive(session, data, datagram, now_ns, NULL);
        run_frame(session, now_ns);
        data += datagram;
        size -= datagram;
    }
    cigi_session_destroy(session);
    return 0;
}
