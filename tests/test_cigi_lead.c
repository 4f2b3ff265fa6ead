/* What a CIGI host has of the channel while it drives, and what is left of it when another does. */
#include "daemon/cigi_lead.h"

#include "daemon/service_internal.h"
#include "io/cigi_host.h"
#include "tests/check.h"

#define VIEW         3
#define NOON_UTC_NS  (1782043200LL * NSEC_PER_SEC) /* 2026-06-21 12:00 */
#define CONFIGURED_M 40000.0

static struct service service;
static struct config_source configs[2] = {{.name = "first", .view = VIEW},
                                          {.name = "second", .view = VIEW}};
static struct cigi_lead leads[2];
static struct cigi_host hosts[2];
static nsec_t now_ns; /* at which messages come and frames are seen */

/* A message of a host, with one packet more. */
static void say(int host, const struct cigi_packet *packet)
{
    static uint8_t data[CIGI_MESSAGE_MAX];
    struct cigi_session *session = leads[host].session;
    struct cigi_writer writer;
    struct rejection why = {.text = ""};
    cigi_host_begin(&hosts[host], now_ns, data, &writer);
    CHECK(cigi_write(&writer, packet));
    int r = cigi_session_receive(session, data, writer.size, now_ns, &why);
    if (r != 0)
        CHECK_FAIL("%d: %s", r, why.text);
    cigi_session_begin(session, now_ns, NULL);
    size_t size = cigi_session_message(session, now_ns, data);
    CHECK_INT(cigi_host_receive(&hosts[host], data, size, NULL, &why), 0);
}

static void say_visibility(int host, float visibility_m)
{
    say(host, &(struct cigi_packet){.kind = CIGI_ATMOSPHERE,
                                    .atmosphere = {.enable = 1, .visibility_m = visibility_m}});
}

static void say_time(int host, uint8_t hour, uint8_t runs)
{
    say(host,
        &(struct cigi_packet){
            .kind = CIGI_CELESTIAL,
            .celestial = {.hour = hour, .ephemeris = runs, .date_valid = 1, .date = 6212026}});
}

static void say_hour(int host, uint8_t hour)
{
    say_time(host, hour, 1);
}

static void say_right_edge(int host, float right_deg)
{
    say(host,
        &(struct cigi_packet){.kind = CIGI_VIEW_DEFINITION,
                              .view_definition = {.view = VIEW, .use = 8, .right = right_deg}});
}

static void begin(void)
{
    now_ns = NSEC_PER_SEC;
    service = (struct service){.config = {.environment = {.visibility_m = CONFIGURED_M}}};
    service.config.environment.time_utc_ns = NOON_UTC_NS;
    service.render_params.channel.geometry = (struct channel_geometry){
        .left_deg = -30, .right_deg = 30, .bottom_deg = -20, .top_deg = 20};
    service.input.geometry = service.render_params.channel.geometry;
    service.input.visibility_m = CONFIGURED_M;
    service_reset_time(&service);
    for (unsigned i = 0; i < 2; i++) {
        const struct cigi_session_params params = {.one_database = true, .view = {.view = VIEW}};
        service.slots[i] =
            (struct source_slot){.service = &service, .config = &configs[i], .index = i};
        leads[i] = (struct cigi_lead){.slot = &service.slots[i]};
        hosts[i] = (struct cigi_host){.format = {3, 3, false}, .frame = 1};
        CHECK_INT(cigi_session_create(&params, &leads[i].session), 0);
        say_visibility((int)i, i ? 2000.0f : 1000.0f);
        say_hour((int)i, i ? 2 : 1);
        say_right_edge((int)i, i ? 12.0f : 11.0f);
    }
}

static void end(void)
{
    for (int i = 0; i < 2; i++)
        cigi_session_destroy(leads[i].session);
}

/* Of the day, as the picture has it now. */
static double hour_shown(void)
{
    nsec_t utc_ns = now_ns + service.input.utc_offset_ns;
    return seconds_from_ns(utc_ns % (86400 * NSEC_PER_SEC)) / 3600.0;
}

static void check_shown(double visibility_m, double hour, double right_deg)
{
    CHECK_NEAR(service.input.visibility_m, visibility_m, 1e-3);
    CHECK_NEAR(hour_shown(), hour, 1e-6);
    CHECK_NEAR(service.input.geometry.right_deg, right_deg, 1e-6);
}

static void a_host_that_leads_has_the_view_the_air_and_the_sky(void)
{
    begin();
    cigi_lead_take(&leads[0]);
    check_shown(1000.0, 1.0, 11.0);
    service.input.wait_ns = 1;
    cigi_lead_drop(&leads[1]); /* does not lead */
    check_shown(1000.0, 1.0, 11.0);
    cigi_lead_drop(&leads[0]);
    CHECK_NEAR(service.input.visibility_m, CONFIGURED_M, 0.0);
    CHECK_NEAR(service.input.geometry.right_deg, 30.0, 0.0);
    CHECK_INT(service.input.wait_ns, 0);
    CHECK_INT((service.input.utc_offset_ns + clock_monotonic_ns() - NOON_UTC_NS) / NSEC_PER_SEC, 0);
    end();
}

/* IG Messages of the next message to a host. */
static int say_parallel(int host, float right_m)
{
    static uint8_t data[CIGI_MESSAGE_MAX];
    struct cigi_packet packet = {.kind = CIGI_VIEW_DEFINITION,
                                 .view_definition = {.view = VIEW,
                                                     .use = 0x3f,
                                                     .mirror = CIGI_MIRROR_HORIZONTAL,
                                                     .orthographic = 1,
                                                     .near_m = 100.0f,
                                                     .far_m = 9000.0f,
                                                     .left = -2000.0f,
                                                     .right = right_m,
                                                     .top = 500.0f,
                                                     .bottom = -700.0f}};
    struct cigi_reader reader;
    struct rejection why;
    int messages = 0;
    say(host, &packet);
    cigi_lead_take(&leads[host]);
    size_t size = cigi_session_message(leads[host].session, now_ns, data);
    CHECK_INT(cigi_host_receive(&hosts[host], data, size, &reader, &why), 0);
    for (int r; (r = cigi_read(&reader, &packet, &why)) != CIGI_END;)
        messages += r == CIGI_PACKET && packet.kind == CIGI_MESSAGE;
    return messages;
}

static void an_orthographic_view_is_the_hosts(void)
{
    begin();
    cigi_lead_take(&leads[0]);
    CHECK_INT(say_parallel(0, 3000.0f), 0);
    const struct channel_geometry *geometry = &service.input.geometry;
    CHECK(geometry->parallel && geometry->mirror_x && !geometry->mirror_y);
    CHECK_NEAR(geometry->left_m, -2000.0, 0.0);
    CHECK_NEAR(geometry->right_m, 3000.0, 0.0);
    CHECK_NEAR(geometry->bottom_m, -700.0, 0.0);
    CHECK_NEAR(geometry->top_m, 500.0, 0.0);
    CHECK_NEAR(geometry->near_m, 100.0, 0.0);
    CHECK_NEAR(geometry->far_m, 9000.0, 0.0);
    CHECK_INT(say_parallel(0, 2e6f), 1); /* wider than can be drawn */
    CHECK_NEAR(geometry->right_m, 3000.0, 0.0);
    cigi_lead_drop(&leads[0]);
    CHECK(!geometry->parallel);
    end();
}

/* Whichever of the two is told first that the frame has begun. */
static void a_host_that_takes_over_keeps_what_it_has(void)
{
    begin();
    cigi_lead_take(&leads[0]);
    cigi_lead_take(&leads[1]);
    check_shown(2000.0, 2.0, 12.0);
    cigi_lead_drop(&leads[0]);
    cigi_lead_take(&leads[1]);
    check_shown(2000.0, 2.0, 12.0);
    cigi_lead_take(&leads[0]);
    check_shown(1000.0, 1.0, 11.0);
    end();
}

static void a_control_holds_until_the_host_changes_the_same_thing(void)
{
    begin();
    cigi_lead_take(&leads[0]);
    service.input.visibility_m = 77.0;
    say_hour(0, 5);
    cigi_lead_take(&leads[0]);
    check_shown(77.0, 5.0, 11.0);
    say_visibility(0, 3000.0f);
    cigi_lead_take(&leads[0]);
    check_shown(3000.0, 5.0, 11.0);
    end();
}

static void take_after(nsec_t passed_ns)
{
    now_ns += passed_ns;
    cigi_session_begin(leads[0].session, now_ns, NULL);
    cigi_lead_take(&leads[0]);
}

static void time_that_stands_does_until_the_operator_sets_another(void)
{
    begin();
    take_after(60 * NSEC_PER_SEC);
    CHECK_NEAR(hour_shown(), 1.0 + 1.0 / 60.0, 1e-6); /* it runs */
    say_time(0, 6, 0);
    for (int i = 0; i < 3; i++) {
        take_after(60 * NSEC_PER_SEC);
        CHECK_NEAR(hour_shown(), 6.0, 1e-6);
    }
    service_set_time(&service, 18 * 3600 * NSEC_PER_SEC - now_ns);
    take_after(NSEC_PER_SEC);
    CHECK_NEAR(hour_shown(), 18.0 + 1.0 / 3600.0, 1e-6);
    say_time(0, 7, 0);
    take_after(60 * NSEC_PER_SEC);
    take_after(60 * NSEC_PER_SEC);
    CHECK_NEAR(hour_shown(), 7.0, 1e-6);
    say_time(0, 7, 1);
    take_after(60 * NSEC_PER_SEC);
    CHECK_NEAR(hour_shown(), 7.0 + 1.0 / 60.0, 1e-6);
    end();
}

static void after_a_new_configuration_the_host_has_it_all_again(void)
{
    begin();
    cigi_lead_take(&leads[0]);
    service.input.visibility_m = CONFIGURED_M;
    service_reset_time(&service);
    cigi_lead_take_all(&leads[0]);
    check_shown(1000.0, 1.0, 11.0);
    end();
}

int main(void)
{
    static const struct check_test tests[] = {
        {"an orthographic view is the host's", an_orthographic_view_is_the_hosts},
        {"a host that leads has the view, the air and the sky",
         a_host_that_leads_has_the_view_the_air_and_the_sky},
        {"a host that takes over keeps what it has", a_host_that_takes_over_keeps_what_it_has},
        {"a control holds until the host changes the same thing",
         a_control_holds_until_the_host_changes_the_same_thing},
        {"time that stands does, until the operator sets another",
         time_that_stands_does_until_the_operator_sets_another},
        {"after a new configuration the host has it all again",
         after_a_new_configuration_the_host_has_it_all_again},
    };
    return CHECK_MAIN(tests);
}
