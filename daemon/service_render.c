/* The window and the thread that draws: how they start, and start anew. */
#include "daemon/service_internal.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/epoll.h>
#include <sysexits.h>
#include <unistd.h>

#include "daemon/config_channel.h"
#include "daemon/terrain_setup.h"

#define START_LAT_DEG  47.0
#define START_LON_DEG  8.0
#define START_HEIGHT_M 3000.0 /* above the ground */

#define RESET_AGAIN_NS                                                                             \
    (60 * NSEC_PER_SEC) /* a GPU that is reset sooner is not worth a third try                     \
                         */

/* Above the middle of the database, or above the Alps. */
static void start_pose(struct terrain_source *source, bool planet, struct pose *ret_pose)
{
    struct geodetic at = {START_LAT_DEG, START_LON_DEG, 0.0};
    double ground_m = NAN;
    if (!planet) {
        struct terrain_facts facts;
        source->ops->facts(source, &facts);
        at.lat_deg = (facts.south_deg + facts.north_deg) / 2.0;
        at.lon_deg = longitude_normalised_deg((facts.west_deg + facts.east_deg) / 2.0);
    }
    source->ops->sample_point(source, at.lat_deg, at.lon_deg, &ground_m);
    at.height_m = START_HEIGHT_M + (isnan(ground_m) ? 0.0 : ground_m);
    *ret_pose = (struct pose){.valid = POSE_POSITION | POSE_ATTITUDE, .position = at};
}

/* Looks whether the database can be opened at all; where it cannot, the planet takes its place. */
static int choose_terrain(struct service *service, struct channel_params *channel,
                          struct pose *ret_start, struct diag *diag)
{
    struct terrain_setup terrain;
    struct diag why;
    int r = terrain_setup_open(channel->terrain_path, "none", channel->cache_mib, &terrain, &why);
    if (r < 0 && channel->terrain_path[0]) {
        service_set_fault(service, FAULT_TERRAIN_MISSING, true, why.text);
        channel->terrain_path = "";
        r = terrain_setup_open("", "none", channel->cache_mib, &terrain, &why);
    }
    if (r < 0)
        return diag_set(diag, r, "%s", why.text);
    start_pose(terrain.source, !channel->terrain_path[0], ret_start);
    terrain_setup_close(&terrain);
    return 0;
}

/* Xlib ends the process with exit(1) when its server goes away; systemd and the crew shall see our
 * own status and sentence. */
static bool window_guarded;

static void on_exit_with_window(void)
{
    if (!window_guarded)
        return;
    log_fault(FAULT_WINDOW_LOST, NULL, "the display server went away");
    _exit(EX_UNAVAILABLE);
}

int service_open_window(struct service *service, struct diag *diag)
{
    const struct config_display *display = &service->config.display;
    const struct window_params params = {.title = service->config.channel.name,
                                         .width = (int)display->width,
                                         .height = (int)display->height,
                                         .monitor = display->monitor,
                                         .fullscreen = display->fullscreen};
    if (display->backend != CONFIG_BACKEND_WINDOW)
        return 0;
    int r = window_create(&params, &service->window, diag);
    if (r == 0 && !service->lost_ns)
        atexit(on_exit_with_window);
    window_guarded = r == 0;
    return r;
}

void service_close_window(struct service *service)
{
    window_guarded = false;
    window_destroy(service->window);
    service->window = NULL;
}

static int on_render(sd_event_source *event, int fd, uint32_t revents, void *data);

/* Draws from what the service has as its input. */
static int start_thread(struct service *service, struct diag *diag)
{
    service->render_params.channel.window = service->window;
    service->render_params.first = service->input;
    int r = render_thread_start(&service->render_params, &service->render, diag);
    if (r == 0 &&
        sd_event_add_io(service->loop, &service->render_event, render_thread_fd(service->render),
                        EPOLLIN, on_render, service) < 0)
        r = diag_set(diag, -EIO, "the event loop does not take the render thread");
    if (r == 0 && service_watch_begin(service) < 0)
        r = diag_set(diag, -EIO, "the event loop does not take the render thread");
    return r;
}

int service_start_render(struct service *service, struct diag *diag)
{
    const struct config *config = &service->config;
    struct channel_params channel = {0};
    struct pose start;
    config_to_channel(config, &channel);
    int r = choose_terrain(service, &channel, &start, diag);
    if (r < 0)
        return r;
    service_open_dig(service, channel.terrain_path);
    if (service->dig)
        channel.dig = dig_thread_ground(service->dig);
    service->render_params = (struct render_params){
        .channel = channel,
        .rate_hz = config->display.rate_hz,
        .pixel_error_most = config->terrain.pixel_error_most,
        .notify = &service->notify,
        .snapshot_directory = service->recorder ? config->record.directory : NULL,
        .entity_types = {config->entities, config->entities_count},
        .swap = {.group = config->swap_lock.group,
                 .interface = config->swap_lock.interface,
                 .channel = config->swap_lock.channel,
                 .channels = config->swap_lock.channels,
                 .timeout_ns = config->swap_lock.timeout_ms * NSEC_PER_MSEC}};
    service->input = (struct render_input){
        .pose = start,
        .geometry = channel.geometry,
        .motion = config_motion(config, ARBITER_NONE),
        .visibility_m = config->environment.visibility_m,
    };
    service_reset_time(service);
    service_publish(service); /* the offset of the system clock */
    return start_thread(service, diag);
}

void service_stop_render(struct service *service)
{
    struct diag diag;
    service->render_event = sd_event_source_disable_unref(service->render_event);
    service->begin_event = sd_event_source_disable_unref(service->begin_event);
    if (render_thread_stop(service->render, &diag) < 0)
        log_error("a snapshot was not written: %s", diag.text);
    service->render = NULL;
}

/* Everything that the GPU held is made anew, its context with it. The new thread counts from 0;
 * what the old one had counted is kept. */
static int rebuild(struct service *service, struct diag *diag)
{
    struct frame_sample *newest = &service->collect.newest;
    health_tick(service, clock_monotonic_ns()); /* its last frames */
    service_stop_render(service);
    service_close_window(service);
    service->base.frames -= newest->frame;
    service->base.missed -= newest->missed;
    service->base.terrain_errors -= newest->terrain_errors;
    newest->frame = newest->missed = newest->terrain_errors = 0;
    int r = service_open_window(service, diag);
    if (r == 0)
        r = start_thread(service, diag);
    if (r == 0)
        service_publish(service); /* view and visibility are no longer the configuration's */
    return r;
}

static void render_lost(struct service *service, const struct diag *why)
{
    nsec_t now_ns = clock_monotonic_ns();
    char sentence[DIAG_TEXT_MAX + 64];
    struct diag diag = {0};
    if (service->lost_ns && now_ns - service->lost_ns < RESET_AGAIN_NS) {
        snprintf(sentence, sizeof(sentence), "%s, again within a minute", why->text);
        service_fail(service, FAULT_RENDERER_FAILED, sentence);
        return;
    }
    service->lost_ns = now_ns;
    service->rendering = false;
    snprintf(sentence, sizeof(sentence), "%s: the renderer is made anew, for the %u. time",
             why->text, ++service->rebuilds);
    service_set_fault(service, FAULT_RENDERER_LOST, true, sentence);
    if (rebuild(service, &diag) < 0)
        service_fail(service, FAULT_RENDERER_FAILED, diag.text);
}

void service_render_tick(struct service *service)
{
    struct diag diag = {0};
    enum render_state state = render_thread_state(service->render, &diag);
    if (state == RENDER_FAILED) {
        service_fail(service, FAULT_RENDERER_FAILED, diag.text);
    } else if (state == RENDER_LOST) {
        render_lost(service, &diag);
    } else if (state == RENDER_RUNNING && !service->rendering) {
        const struct gl_facts *gl = render_thread_gl(service->render);
        service->rendering = true;
        log_info("drawing with OpenGL %s on %s", gl->version, gl->renderer);
        service_set_fault(service, FAULT_SOFTWARE_RENDERER, gl->software,
                          "no GPU is in use: the frames are drawn by the CPU");
        const char *note = render_thread_note(service->render);
        service_set_fault(service, FAULT_GPU_MEMORY_SHORT, note[0], note);
    }
}

static int on_render(sd_event_source *event, int fd, uint32_t revents, void *data)
{
    service_render_tick(data);
    return 0;
}
