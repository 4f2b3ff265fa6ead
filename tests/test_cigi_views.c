/* A channel's own view, and those of others, as a CIGI host speaks of them. */
#include "tests/cigi_session_fixture.h"

static const struct cigi_format little_3 = {3, 3, false};

/* Of channels in step each has a view, and hears what the host says of all. */
static void test_views_of_others(void)
{
    for (int several = 0; several < 2; several++) {
        struct cigi_session_params params = {
            .one_database = true, .of_several = several, .view = {.view = 2}};
        struct cigi_packet turn = {.kind = CIGI_VIEW_CONTROL, .view_control = {.use = 0x20}};
        struct cigi_packet no_entity = {.kind = CIGI_RATE, .rate = {.entity = 9}};
        pair_start(&params, little_3);
        pair_open();
        for (uint16_t view = 1; view <= 3; view++) {
            turn.view_control.view = view;
            turn.view_control.yaw_deg = (float)view;
            pair_put(&turn);
        }
        CHECK_INT(pair_exchange(NULL), several ? 0 : CIGI_PARTLY);
        const struct cigi_view *own = cigi_scene_view(cigi_session_scene(talk.session), 2);
        CHECK_NEAR(own->attitude.heading_deg, 2.0, 0.0);
        CHECK_INT(pair_link()->counters.skipped, several ? 2 : 0);
        CHECK_INT(pair_link()->counters.rejected[REJECT_REFERENCE], several ? 0 : 2);
        pair_open();
        pair_put(&no_entity);
        CHECK_INT(pair_exchange(NULL), CIGI_PARTLY);
        pair_end();
    }
}

/* Where the channel's eye is until the host says so, and again after a reset. */
static void test_own_eye(void)
{
    struct cigi_session_params params = {.one_database = true,
                                         .view = {.view = 3},
                                         .eye_m = {4.5, -0.5, -1.25},
                                         .direction = {1.0, 2.0, 300.0}};
    struct cigi_packet turn = {.kind = CIGI_VIEW_CONTROL,
                               .view_control = {.view = 3, .use = 0x20, .yaw_deg = 60.0f}};
    pair_start(&params, little_3);
    for (int i = 0; i < 2; i++) {
        pair_open();
        CHECK_INT(pair_exchange(NULL), 0);
        const struct cigi_view *view = cigi_scene_view(cigi_session_scene(talk.session), 3);
        CHECK(view->offset_m[0] == 4.5 && view->offset_m[2] == -1.25);
        CHECK_NEAR(view->attitude.heading_deg, 300.0, 0.0);
        pair_open();
        pair_put(&turn);
        CHECK_INT(pair_exchange(NULL), 0);
        view = cigi_scene_view(cigi_session_scene(talk.session), 3);
        CHECK_NEAR(view->attitude.heading_deg, 60.0, 1e-5);
        CHECK(view->offset_m[0] == 4.5 && view->attitude.pitch_deg == 2.0);
        pair_open();
        talk.host_data[4] &= 0xfc; /* Standby */
        CHECK_INT(pair_exchange(NULL), 0);
    }
    pair_end();
}

int main(void)
{
    static const struct check_test tests[] = {
        {"the channel's own eye, until the host moves it", test_own_eye},
        {"what is said of other channels' views is theirs", test_views_of_others},
    };
    return CHECK_MAIN(tests);
}
