/* What the parts of the daemon share. All of it belongs to the event loop's thread. */
#pragma once

#include <systemd/sd-event.h>

#include "daemon/dig_thread.h"
#include "daemon/health_collect.h"
#include "daemon/log.h"
#include "daemon/query_thread.h"
#include "daemon/recorder.h"
#include "daemon/render_thread.h"
#include "daemon/service.h"
#include "daemon/service_cigi.h"
#include "geo/geographic.h"
#include "io/arbiter.h"
#include "io/modbus_server.h"
#include "io/source.h"
#include "render/window.h"

struct cigi_lead;
struct service;

/* A source of the configuration, open or waiting to be. */
struct source_slot {
    struct service *service;
    const struct config_source *config;
    unsigned index;             /* in the configuration and in the arbiter */
    struct pose_source *source; /* NULL while it cannot be opened */
    struct cigi_source *cigi;   /* of sources of that type, as long as `source` */
    sd_event_source *event;     /* NULL also while it is not waited for, for it cannot be read */
    sd_event_source *rest;      /* a timer; there as long as `event` */
    bool rests;                 /* in a flood: that is waited for, and `event` is not */
    nsec_t retry_ns;
    /* When it last could not be read, refused a packet, or lost one to a full queue; 0 = never. */
    nsec_t failed_ns, refused_ns, overrun_ns;
    nsec_t pass_ns;  /* when the next pose may go on to the picture */
    nsec_t flood_ns; /* since when flood_packets came */
    int flood_packets;
    uint64_t refused;  /* packets, late ones not counted, that were seen */
    uint64_t overrun;  /* packets lost to a full queue that were seen */
    bool failed, lost; /* as logged */
    bool others;       /* that all is about others was told */
};

/* Values of the counters that the operator reset. */
struct counter_base {
    uint64_t frames, missed, accepted, rejected, lost, can_frames, terrain_errors, recorded;
};

/* What sources that a new configuration closed had counted. */
struct source_totals {
    uint64_t accepted, rejected, lost, can_frames;
};

/* What the swap lock told last. */
struct swap_watch {
    nsec_t
        complete_ns;   /* when all channels were in step last, or the first frame came; 0 = never */
    nsec_t failed_ns;  /* when it last failed at something; 0 = never */
    uint64_t troubles; /* that were seen */
};

struct service {
    struct config config;
    const char *config_path;
    uint32_t generation; /* of the configuration */
    sd_event *loop;
    struct geoid *geoid; /* of the sources; the terrain loader has its own */
    struct window *window;

    struct source_slot slots[ARBITER_SOURCES_MAX];
    unsigned slot_count;
    struct source_totals closed;
    struct arbiter arbiter;
    int driving;              /* whose pose was published last */
    struct cigi_lead *leader; /* the CIGI host whose view, air and sky are in `input`, or NULL */
    bool has_pose;

    struct render_thread *render;
    struct render_params render_params; /* what it was started with, for starting it anew */
    sd_event_source *render_event, *begin_event;
    unsigned rebuilds;            /* how often the GPU was lost */
    nsec_t lost_ns;               /* when it last was; 0 = never */
    struct render_input input;    /* as published last */
    bool rendering;               /* its channel runs */
    struct dig_thread *dig;       /* NULL where nobody may dig, or nobody can */
    struct query_thread *queries; /* NULL where no source asks of the ground */
    sd_event_source *queries_event;
    struct cigi_ground ground; /* theirs */
    struct recorder *recorder;
    struct modbus_server *modbus;
    sd_event_source *modbus_event;
    nsec_t modbus_retry_ns;

    struct notify notify;
    struct fault_set faults;
    struct health health;
    struct health_collect collect;
    struct counter_base base;
    nsec_t start_ns, second_ns; /* when the once-a-second work is due */
    struct swap_watch swap;
    nsec_t behind_ns; /* when the recorder last dropped a record; 0 = never */
    uint64_t recorder_dropped;
    nsec_t snapshot_ns;
    bool follow_clock; /* the sun goes by the system clock */
    bool ready, stopping;
    int status; /* to exit with */
};

/* service.c */
void service_publish(struct service *service);
void service_fail(struct service *service, enum fault_code code, const char *sentence);
/* Raises or clears, and logs where that changes anything. `sentence` is for raising. */
void service_set_fault(struct service *service, enum fault_code code, bool active,
                       const char *sentence);

/* The sun stands where that offset from monotonic time to UTC puts it; or where the configuration
 * does. */
void service_set_time(struct service *service, nsec_t utc_offset_ns);
void service_reset_time(struct service *service);

/* service_render.c */
int service_open_window(struct service *service, struct diag *diag);
void service_close_window(struct service *service);
/* Chooses the terrain and starts the thread that draws. */
int service_start_render(struct service *service, struct diag *diag);
/* Takes up what the render thread has told: that it draws, or has failed. */
void service_render_tick(struct service *service);
void service_stop_render(struct service *service);

/* service_sources.c */
void sources_init(struct service *service);
/* Takes the sources of another configuration, which is left with the old ones: those that are the
 * same, and in the same place of the list, stay open. */
void sources_reload(struct service *service, struct config *next);
/* Opens what is due; looks who is live; hands a change of the driving source to the picture. */
void sources_tick(struct service *service, nsec_t now_ns);
void sources_close(struct service *service);
/* A new pose of a source: it drives where that source is the best. */
void source_take_pose(struct source_slot *slot, const struct pose *pose);
/* The pose goes to the picture and to the recording, without being a sign of life. A source that
 * tells no attitude leaves it as it was. */
void sources_drive(struct service *service, int index, const struct pose *pose);
/* Fills what the sources tell. */
void sources_fill(const struct service *service, nsec_t now_ns, struct health *health);

/* service_dig.c */
/* Opens the database for digging where the configuration allows it; where that fails, a fault. */
void service_open_dig(struct service *service, const char *database);
/* Hands a request on, or answers why not. */
void service_dig(struct source_slot *slot, const struct dig_message *request,
                 const union address *sender);

/* service_health.c */
void health_tick(struct service *service, nsec_t now_ns);
/* The whole map from now on, to Modbus. */
void health_publish(struct service *service, nsec_t now_ns);

/* service_swap.c */
/* The faults of the swap lock, where there is one. */
void swap_tick(struct service *service, nsec_t now_ns);
/* Logs what it has counted. */
void swap_tell(const struct service *service);

/* service_control.c; the prefix keeps clear of libmodbus's names, such as modbus_close() */
void service_modbus_tick(struct service *service, nsec_t now_ns);
void service_modbus_close(struct service *service);
/* SIGHUP */
void service_reload(struct service *service);

/* config_service.c: the configuration as the parts' parameters. */
/* `source`: the index of the one that drives, or negative. A host that leads each frame
 * (synchronous CIGI) says itself where things are in it. */
struct motion_params config_motion(const struct config *config, int source);
struct intake_params config_intake(const struct config_source *source, struct geoid *geoid);
