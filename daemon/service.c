#include "daemon/service_internal.h"

#include <errno.h>
#include <math.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sysexits.h>
#include <unistd.h>

#include "daemon/config_channel.h"
#include "daemon/terrain_setup.h"

#define TICK_NS (NSEC_PER_SEC / 20)

#define START_LAT_DEG  47.0
#define START_LON_DEG  8.0
#define START_HEIGHT_M 3000.0 /* above the ground */

void service_publish(struct service *service)
{
    if (service->follow_clock)
        service->input.utc_offset_ns = clock_realtime_ns() - clock_monotonic_ns();
    if (service->render)
        render_thread_publish(service->render, &service->input);
}

void service_set_fault(struct service *service, enum fault_code code, bool active,
                       const char *sentence)
{
    if (active && fault_raise(&service->faults, code))
        log_fault(code, NULL, "%s", sentence);
    else if (!active && fault_clear(&service->faults, code))
        log_fault_cleared(code, NULL);
}

void service_fail(struct service *service, enum fault_code code, const char *sentence)
{
    service_set_fault(service, code, true, sentence);
    service->status = EX_UNAVAILABLE;
    service->stopping = true;
    notify_stopping();
    sd_event_exit(service->loop, 0);
}

static int on_signal(sd_event_source *event, const struct signalfd_siginfo *info, void *data)
{
    struct service *service = data;
    if (info->ssi_signo == SIGHUP) {
        service_reload(service);
        return 0;
    }
    log_notice("stopping: %s", strsignal((int)info->ssi_signo));
    service->stopping = true;
    notify_stopping();
    health_publish(service, clock_monotonic_ns());
    return sd_event_exit(service->loop, 0);
}

static int on_render(sd_event_source *event, int fd, uint32_t revents, void *data)
{
    struct service *service = data;
    struct diag diag = {0};
    enum render_state state = render_thread_state(service->render, &diag);
    if (state == RENDER_FAILED) {
        service_fail(service, FAULT_RENDERER_FAILED, diag.text);
    } else if (state == RENDER_RUNNING && !service->rendering) {
        const struct gl_facts *gl = render_thread_gl(service->render);
        service->rendering = true;
        log_info("drawing with OpenGL %s on %s", gl->version, gl->renderer);
        service_set_fault(service, FAULT_SOFTWARE_RENDERER, gl->software,
                          "no GPU is in use: the frames are drawn by the CPU");
    }
    return 0;
}

static int on_tick(sd_event_source *event, uint64_t usec, void *data)
{
    struct service *service = data;
    nsec_t now_ns = clock_monotonic_ns();
    service_modbus_tick(service, now_ns);
    sources_tick(service, now_ns);
    health_tick(service, now_ns);
    if (service->window && window_poll(service->window))
        service_fail(service, FAULT_WINDOW_LOST, "the window was closed");
    uint64_t next_usec = (uint64_t)((now_ns + TICK_NS) / NSEC_PER_USEC);
    int r = sd_event_source_set_time(event, next_usec);
    return r < 0 ? r : sd_event_source_set_enabled(event, SD_EVENT_ONESHOT);
}

/* All threads inherit the mask: signals reach nobody but the loop. */
static int make_loop(struct service *service, struct diag *diag)
{
    static const int signals[] = {SIGTERM, SIGINT, SIGHUP};
    sigset_t mask;
    sigemptyset(&mask);
    for (size_t i = 0; i < sizeof(signals) / sizeof(signals[0]); i++)
        sigaddset(&mask, signals[i]);
    sigprocmask(SIG_BLOCK, &mask, NULL);
    signal(SIGPIPE, SIG_IGN);
    int r = sd_event_new(&service->loop);
    for (size_t i = 0; r >= 0 && i < sizeof(signals) / sizeof(signals[0]); i++)
        r = sd_event_add_signal(service->loop, NULL, signals[i], on_signal, service);
    if (r >= 0)
        r = sd_event_add_time(service->loop, NULL, CLOCK_MONOTONIC, 0, 1000, on_tick, service);
    return r < 0 ? diag_set(diag, r, "no event loop: %s", strerror(-r)) : 0;
}

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

static int open_window(struct service *service, struct diag *diag)
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
    if (r == 0) {
        window_guarded = true;
        atexit(on_exit_with_window);
    }
    return r;
}

static void open_recorder(struct service *service)
{
    const struct config_record *record = &service->config.record;
    const struct recorder_params params = {.directory = record->directory,
                                           .max_mib = record->max_mib};
    struct diag diag;
    service->health.recorder_good = true;
    if (!record->directory[0])
        return;
    int r = recorder_open(&params, &service->recorder, &diag);
    service->health.recorder_good = r == 0;
    service_set_fault(service, FAULT_RECORDER_FAILED, r < 0, diag.text);
}

static int start_render(struct service *service, struct diag *diag)
{
    const struct config *config = &service->config;
    struct render_params params = {.rate_hz = config->display.rate_hz,
                                   .pixel_error_most = config->terrain.pixel_error_most,
                                   .notify = &service->notify};
    params.channel.window = service->window;
    config_to_channel(config, &params.channel);
    if (service->recorder)
        params.snapshot_directory = config->record.directory;
    struct pose start;
    int r = choose_terrain(service, &params.channel, &start, diag);
    if (r < 0)
        return r;
    service_open_dig(service, params.channel.terrain_path);
    if (service->dig)
        params.channel.dig = dig_thread_ground(service->dig);
    service->follow_clock = config->environment.time_utc_ns == 0;
    service->input = (struct render_input){
        .pose = start,
        .policy = config_pose_policy(config),
        .visibility_m = config->environment.visibility_m,
        .utc_offset_ns = config->environment.time_utc_ns - clock_monotonic_ns(),
    };
    service_publish(service); /* the offset of the system clock */
    params.first = service->input;
    r = render_thread_start(&params, &service->render, diag);
    if (r == 0 && sd_event_add_io(service->loop, NULL, render_thread_fd(service->render), EPOLLIN,
                                  on_render, service) < 0)
        r = diag_set(diag, -EIO, "the event loop does not take the render thread");
    return r;
}

static int refuse(enum fault_code code, int status, const struct diag *diag)
{
    log_fault(code, NULL, "%s", diag->text);
    return status;
}

/* 0 or the status to exit with. */
static int open_parts(struct service *service)
{
    struct diag diag = {0};
    if (make_loop(service, &diag) < 0) {
        log_error("%s", diag.text);
        return EX_OSERR;
    }
    if (geoid_setup_open(service->config.terrain.geoid, &service->geoid, &diag) < 0)
        return refuse(FAULT_GEOID_MISSING, EX_NOINPUT, &diag);
    if (open_window(service, &diag) < 0)
        return refuse(FAULT_WINDOW_LOST, EX_UNAVAILABLE, &diag);
    open_recorder(service);
    if (start_render(service, &diag) < 0)
        return refuse(FAULT_RENDERER_FAILED, EX_UNAVAILABLE, &diag);
    sources_init(service);
    return EX_OK;
}

int service_create(const struct service_params *params, struct service **ret_service)
{
    struct service *service = calloc(1, sizeof(*service));
    if (!service) {
        config_finish(params->config);
        log_error("no memory for the daemon");
        return EX_OSERR;
    }
    service->config = *params->config;
    *params->config = (struct config){0};
    service->config_path = params->config_path;
    service->generation = 1;
    service->start_ns = clock_monotonic_ns();
    health_collect_init(&service->collect);
    notify_init(&service->notify, service->start_ns);
    int status = open_parts(service);
    if (status != EX_OK)
        service_destroy(service);
    else
        *ret_service = service;
    return status;
}

int service_run(struct service *service)
{
    int r = sd_event_loop(service->loop);
    if (r < 0) {
        log_error("the event loop has failed: %s", strerror(-r));
        return EX_SOFTWARE;
    }
    return service->status;
}

void service_destroy(struct service *service)
{
    struct diag diag;
    if (!service)
        return;
    sources_close(service);
    if (render_thread_stop(service->render, &diag) < 0)
        log_error("a snapshot was not written: %s", diag.text);
    dig_thread_stop(service->dig); /* nobody draws its ground any more */
    service_modbus_close(service);
    recorder_close(service->recorder);
    window_guarded = false;
    window_destroy(service->window);
    geoid_close(service->geoid);
    sd_event_unref(service->loop);
    config_finish(&service->config);
    free(service);
}
