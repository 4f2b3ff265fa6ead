#include "io/can_bus.h"

#include <assert.h>
#include <errno.h>
#include <stdio.h>
#include <string.h>

#define RETRY_FIRST_NS (100 * NSEC_PER_MSEC)
#define RETRY_LAST_NS  NSEC_PER_SEC

static const struct {
    const char *scheme;
    int (*create)(struct can_bus **ret_bus);
} schemes[] = {{"can:", can_socket_create}, {"sim:", can_sim_create}};

static void go_down(struct can_bus *bus)
{
    bus->ops->disconnect(bus);
    bus->state = CAN_STATE_NONE;
    if (!bus->retry_pause_ns)
        bus->retry_pause_ns = RETRY_FIRST_NS;
    else if (bus->retry_pause_ns < RETRY_LAST_NS)
        bus->retry_pause_ns *= 2;
    bus->retry_at_ns = clock_monotonic_ns() + bus->retry_pause_ns;
}

static int go_up(struct can_bus *bus, struct diag *diag)
{
    int r = bus->ops->connect(bus, diag);
    if (r < 0) {
        go_down(bus);
        return r;
    }
    bus->generation++;
    bus->state = CAN_STATE_ACTIVE;
    return 0;
}

int can_bus_create(const char *url, const struct can_bus_params *params, struct can_bus **ret_bus,
                   struct diag *diag)
{
    size_t i = 0, count = sizeof(schemes) / sizeof(schemes[0]);
    while (i < count && strncmp(url, schemes[i].scheme, strlen(schemes[i].scheme)) != 0)
        i++;
    if (i == count)
        return diag_set(diag, -EINVAL, "\"%s\" is neither can:INTERFACE nor sim:PATH", url);
    const char *name = url + strlen(schemes[i].scheme);
    struct can_bus *bus;
    if (!*name || strlen(name) >= sizeof(bus->name))
        return diag_set(diag, -EINVAL, "\"%s\" names no bus that can be", url);
    int r = schemes[i].create(&bus);
    if (r < 0)
        return diag_set(diag, r, "no memory for the bus %s", url);
    snprintf(bus->name, sizeof(bus->name), "%s", name);
    assert(params->id_count <= CAN_BUS_IDS_MAX);
    if (params->id_count)
        memcpy(bus->ids, params->ids, params->id_count * sizeof(bus->ids[0]));
    bus->id_count = params->id_count;
    bus->serve = params->serve;
    *ret_bus = bus;
    return go_up(bus, diag) < 0 ? CAN_BUS_DOWN : 0;
}

void can_bus_destroy(struct can_bus *bus)
{
    if (!bus)
        return;
    bus->ops->disconnect(bus);
    bus->ops->destroy(bus);
}

int can_bus_receive(struct can_bus *bus, struct can_frame *ret_frame, nsec_t *ret_receive_ns,
                    struct diag *diag)
{
    if (bus->fd < 0)
        return 0;
    int r = bus->ops->receive(bus, ret_frame, ret_receive_ns);
    if (r > 0) {
        bus->frames_received++;
        bus->retry_pause_ns = 0;
    }
    if (r < 0) {
        go_down(bus);
        diag_set(diag, r, "the bus %s went down: %s", bus->name, strerror(-r));
    }
    return r;
}

int can_bus_send(struct can_bus *bus, const struct can_frame *frame)
{
    if (bus->fd < 0)
        return -ENETDOWN;
    int r = bus->ops->send(bus, frame);
    if (r < 0 && r != -EAGAIN)
        go_down(bus);
    return r;
}

int can_bus_service(struct can_bus *bus, nsec_t now_ns)
{
    if (bus->fd >= 0 || now_ns < bus->retry_at_ns)
        return 0;
    return go_up(bus, NULL) == 0;
}
