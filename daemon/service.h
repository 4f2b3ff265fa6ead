/* The daemon: everything wired to one sd-event loop in the main thread. */
#pragma once

#include "config/config.h"

struct service_params {
    struct config *config;   /* ownership passes, also on failure */
    const char *config_path; /* for SIGHUP; NULL = the defaults */
};

struct service;

/* Opens what must be there: the geoid, a window where one is asked for, the render thread. A
 * source, a Modbus port, a database or a recording that cannot be opened is a fault, logged; all
 * but the database are tried again or done without. Returns 0, or after logging why an exit status
 * of sysexits.h: 66 without a geoid, 69 without a display, 71 where the system refuses. */
int service_create(const struct service_params *params, struct service **ret_service);

/* Until SIGTERM or SIGINT (returns 0) or something without which there is no picture has failed
 * (logged; returns 69). */
int service_run(struct service *service);

/* Ends all threads and closes everything. Legal on NULL. */
void service_destroy(struct service *service);
