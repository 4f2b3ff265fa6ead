/* What no single key shows. Every check finds its place in the document again by name, so that the
 * complaint stands at the line that the operator has to change. */
#include "config/check_can.h"

#include <arpa/inet.h>
#include <errno.h>
#include <math.h>
#include <net/if.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/un.h>

#include "config/schema.h"
#include "render/view.h"

static yaml_node_t *section(struct document *document, const char *name)
{
    return document_get(document, document_root(document), name, NULL);
}

/* The first of two keys of a mapping that the file has; the mapping itself where it has neither. */
static yaml_node_t *either(struct document *document, yaml_node_t *mapping, const char *first,
                           const char *second)
{
    yaml_node_t *node = document_get(document, mapping, first, NULL);
    if (!node)
        node = document_get(document, mapping, second, NULL);
    return node ? node : mapping;
}

static bool is_plain_name(const char *name)
{
    static const char letters[] =
        "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_.-";
    return *name && strspn(name, letters) == strlen(name);
}

static void check_channel(struct document *document, const struct config_channel *channel)
{
    yaml_node_t *node = section(document, "channel");
    yaml_node_t *frustum = document_get(document, node, "frustum", NULL);
    const struct config_frustum *f = &channel->frustum;
    if (!is_plain_name(channel->name))
        document_complain(document, document_get(document, node, "name", NULL),
                          "channel.name is '%s'; letters, digits, '_', '-' and '.' make a name",
                          channel->name);
    if (f->right_deg - f->left_deg < VIEW_NARROWEST_DEG)
        document_complain(
            document, either(document, frustum, "right_deg", "left_deg"),
            "channel.frustum: left_deg %g must be less than right_deg %g, by %g at least",
            f->left_deg, f->right_deg, VIEW_NARROWEST_DEG);
    if (f->top_deg - f->bottom_deg < VIEW_NARROWEST_DEG)
        document_complain(
            document, either(document, frustum, "top_deg", "bottom_deg"),
            "channel.frustum: bottom_deg %g must be less than top_deg %g, by %g at least",
            f->bottom_deg, f->top_deg, VIEW_NARROWEST_DEG);
}

static void check_terrain(struct document *document, const struct config_terrain *terrain)
{
    yaml_node_t *node = section(document, "terrain");
    if (terrain->technique != CONFIG_TECHNIQUE_CLIPMAP)
        document_complain(document, document_get(document, node, "technique", NULL),
                          "terrain.technique: '%s' is not supported by this version; use clipmap",
                          config_technique_name(terrain->technique));
    if (!terrain->geoid[0])
        document_complain(document, document_get(document, node, "geoid", NULL),
                          "terrain.geoid is empty; it must be egm96 or the path of a geoid grid");
    if (terrain->allow_dig && !terrain->database[0])
        document_complain(document, document_get(document, node, "allow_dig", NULL),
                          "terrain.allow_dig: there is no terrain.database to dig in");
}

static void check_environment(struct document *document, struct config_environment *environment)
{
    yaml_node_t *node = section(document, "environment");
    if (environment->time_utc[0] &&
        clock_parse_utc(environment->time_utc, &environment->time_utc_ns) < 0)
        document_complain(document, document_get(document, node, "time_utc", NULL),
                          "environment.time_utc is '%s'; it must be like 2024-06-21T12:00:00Z",
                          environment->time_utc);
}

static void check_address(struct document *document, yaml_node_t *node, const char *shown,
                          const char *text)
{
    union address address;
    if (address_parse(text, &address, NULL) < 0 || address_port(&address) == 0)
        document_complain(document, node,
                          "%s is '%s'; it must be a numeric address and a port, like "
                          "127.0.0.1:5500 or [::1]:5500",
                          shown, text);
}

static void check_swap_lock(struct document *document, const struct config_swap_lock *lock)
{
    yaml_node_t *node = section(document, "swap_lock");
    union address group;
    struct in_addr interface;
    if (!lock->group[0])
        return;
    if (address_parse(lock->group, &group, NULL) < 0 || address_port(&group) == 0 ||
        group.any.sa_family != AF_INET || !IN_MULTICAST(ntohl(group.v4.sin_addr.s_addr)))
        document_complain(document, document_get(document, node, "group", NULL),
                          "swap_lock.group is '%s'; it must be a multicast group and a port, like "
                          "239.192.0.1:8010",
                          lock->group);
    if (inet_pton(AF_INET, lock->interface, &interface) != 1)
        document_complain(document, document_get(document, node, "interface", NULL),
                          "swap_lock.interface is '%s'; it must be the address of an interface of "
                          "this machine, like 192.168.10.21",
                          lock->interface);
    if (lock->channel > lock->channels)
        document_complain(document, either(document, node, "channel", "channels"),
                          "swap_lock: channel %u of %u channels", lock->channel, lock->channels);
}

/* A state comes every five seconds at the least; IEEE 1278.1 gives up after 2.4 times that. */
#define DIS_TIMEOUT_MS 12000

/* One source on its way through the checks. */
struct source_check {
    struct document *document;
    struct config *config;
    struct config_source *source;
    yaml_node_t *node;
    unsigned index;
};

static void refuse_key(const struct source_check *check, const char *key, const char *why)
{
    yaml_node_t *name;
    if (document_get(check->document, check->node, key, &name))
        document_complain(check->document, name, "sources[%u].%s: %s %s", check->index, key,
                          config_source_type_name(check->source->type), why);
}

bool config_source_is_bus(const struct config_source *source)
{
    return source->type == CONFIG_SOURCE_CANAEROSPACE || source->type == CONFIG_SOURCE_CAN_TABLE;
}

static void settle_source(const struct source_check *check)
{
    static const char *const ports[] = {
        [CONFIG_SOURCE_NATIVE] = "127.0.0.1:5600",
        [CONFIG_SOURCE_FLIGHTGEAR] = "127.0.0.1:5500",
        [CONFIG_SOURCE_CIGI] = "127.0.0.1:8004",
        [CONFIG_SOURCE_XPLANE] = "127.0.0.1:49003",
        [CONFIG_SOURCE_DIS] = "127.0.0.1:3000",
        [CONFIG_SOURCE_CANAEROSPACE] = "",
        [CONFIG_SOURCE_CAN_TABLE] = "",
    };
    struct config_source *source = check->source;
    if (!document_get(check->document, check->node, "name", NULL))
        snprintf(source->name, sizeof(source->name), "source%u", check->index + 1);
    if (!document_get(check->document, check->node, "priority", NULL))
        source->priority = check->index + 1;
    if (config_source_is_bus(source) &&
        !document_get(check->document, check->node, "interface", NULL))
        strcpy(source->interface, "can0");
    if (!config_source_is_bus(source) &&
        !document_get(check->document, check->node, "listen", NULL))
        snprintf(source->listen, sizeof(source->listen), "%s", ports[source->type]);
    if (source->type == CONFIG_SOURCE_CIGI &&
        !document_get(check->document, check->node, "reply", NULL))
        strcpy(source->reply, "127.0.0.1:8005");
    if (source->type == CONFIG_SOURCE_XPLANE &&
        !document_get(check->document, check->node, "subscribe", NULL))
        strcpy(source->subscribe, "127.0.0.1:49000");
    if (source->type == CONFIG_SOURCE_DIS &&
        !document_get(check->document, check->node, "timeout_ms", NULL))
        source->timeout_ms = DIS_TIMEOUT_MS;
}

/* Whoever is asked to send may send. */
static void allow_subscribed(struct config_source *source)
{
    union address address;
    const char *host = source->subscribe[0] == '[' ? source->subscribe + 1 : source->subscribe;
    const char *end = strrchr(host, ':');
    if (address_parse(source->subscribe, &address, NULL) < 0 || !end)
        return;
    size_t length = (size_t)(end - host) - (host != source->subscribe);
    memcpy(source->allow[source->allow_count++].range, host, length);
}

static int settle_allow(const struct source_check *check)
{
    struct config_source *source = check->source;
    if (config_source_is_bus(source) || document_get(check->document, check->node, "allow", NULL))
        return 0;
    source->allow = calloc(3, sizeof(*source->allow));
    if (!source->allow)
        return -ENOMEM;
    strcpy(source->allow[0].range, "127.0.0.0/8");
    strcpy(source->allow[1].range, "::1");
    source->allow_count = 2;
    allow_subscribed(source);
    return 0;
}

static void check_interface(const struct source_check *check)
{
    const char *name = check->source->interface;
    yaml_node_t *node = document_get(check->document, check->node, "interface", NULL);
    size_t path_max = sizeof(((struct sockaddr_un *)NULL)->sun_path) - 1;
    if (strncmp(name, "sim:", 4) == 0) {
        if (name[4] == '\0' || strlen(name + 4) > path_max)
            document_complain(check->document, node,
                              "sources[%u].interface: sim: needs the path of a socket, at most %zu "
                              "bytes",
                              check->index, path_max);
    } else if (!is_plain_name(name) || strlen(name) >= IFNAMSIZ) {
        document_complain(check->document, node,
                          "sources[%u].interface is '%s'; it must be an interface like can0, or "
                          "sim:PATH",
                          check->index, name);
    }
}

static void check_allow(const struct source_check *check)
{
    yaml_node_t *list = document_get(check->document, check->node, "allow", NULL);
    struct allow_list allowed = {0};
    if (check->source->allow_count == 0)
        document_complain(check->document, list,
                          "sources[%u].allow is empty; list the senders, or 0.0.0.0/0 and ::/0 for "
                          "anyone",
                          check->index);
    for (unsigned i = 0; i < check->source->allow_count; i++) {
        const char *text = check->source->allow[i].range;
        if (allow_list_add(&allowed, text, NULL) < 0)
            document_complain(check->document, document_item(check->document, list, i),
                              "sources[%u].allow[%u] is '%s'; it must be an address like "
                              "192.168.1.20 or a network like 192.168.1.0/24",
                              check->index, i, text);
    }
}

static bool same_text(const char *a, const char *b)
{
    return *a && strcmp(a, b) == 0;
}

static void check_cigi(const struct source_check *check)
{
    const struct config_source *source = check->source;
    double tenths = source->version * 10.0;
    char shown[64];
    refuse_key(check, "altitude", "counts heights from the ellipsoid");
    snprintf(shown, sizeof(shown), "sources[%u].reply", check->index);
    check_address(check->document, document_get(check->document, check->node, "reply", NULL), shown,
                  source->reply);
    if ((source->version > 3.35 && source->version < 4.0) ||
        fabs(tenths - nearbyint(tenths)) > 1e-6)
        document_complain(check->document,
                          document_get(check->document, check->node, "version", NULL),
                          "sources[%u].version is %g; it must be 3.0, 3.1, 3.2, 3.3 or 4.0",
                          check->index, source->version);
    if (same_text(source->reply, source->listen))
        document_complain(check->document, either(check->document, check->node, "reply", "listen"),
                          "sources[%u].reply: %s is where the source itself listens", check->index,
                          source->reply);
}

static void check_xplane(const struct source_check *check)
{
    const struct config_source *source = check->source;
    char shown[64];
    if (source->type != CONFIG_SOURCE_XPLANE) {
        refuse_key(check, "subscribe", "sends without being asked");
        refuse_key(check, "rate_hz", "sends without being asked");
        return;
    }
    snprintf(shown, sizeof(shown), "sources[%u].subscribe", check->index);
    if (source->subscribe[0])
        check_address(check->document,
                      document_get(check->document, check->node, "subscribe", NULL), shown,
                      source->subscribe);
}

static void check_dis(const struct source_check *check)
{
    struct config_source *source = check->source;
    if (source->type != CONFIG_SOURCE_DIS) {
        refuse_key(check, "entity", "knows one aircraft only");
        refuse_key(check, "exercise", "knows no exercises");
    } else if (dis_id_parse(source->entity, &source->entity_id) < 0) {
        document_complain(check->document,
                          document_get(check->document, check->node, "entity", NULL),
                          "sources[%u].entity is '%s'; it must be SITE:APPLICATION:ENTITY, like "
                          "1:1:1",
                          check->index, source->entity);
    }
    if (source->type == CONFIG_SOURCE_DIS && source->altitude == CONFIG_ALTITUDE_EGM96)
        refuse_key(check, "altitude", "tells places from the Earth's centre, not altitudes");
}

static void check_can(const struct source_check *check)
{
    struct config_source *source = check->source;
    if (source->type != CONFIG_SOURCE_CANAEROSPACE) {
        refuse_key(check, "allow_transmit", "has nothing to transmit");
        refuse_key(check, "redundancy", "knows no redundancy channels");
    }
    if (source->type == CONFIG_SOURCE_CAN_TABLE)
        document_check_can_table(check->document, check->node, check->index, source);
    else
        refuse_key(check, "fields", "defines its own fields");
}

static void check_wire(const struct source_check *check)
{
    const struct config_source *source = check->source;
    char shown[64];
    if (config_source_is_bus(source)) {
        refuse_key(check, "listen", "reads a CAN bus; give it an interface");
        refuse_key(check, "allow", "reads a CAN bus, which has no sender addresses");
        check_interface(check);
    } else {
        refuse_key(check, "interface", "arrives over UDP; give it a listen address");
        snprintf(shown, sizeof(shown), "sources[%u].listen", check->index);
        check_address(check->document, document_get(check->document, check->node, "listen", NULL),
                      shown, source->listen);
        check_allow(check);
    }
    check_xplane(check);
    check_dis(check);
    check_can(check);
    if (source->type == CONFIG_SOURCE_CIGI) {
        check_cigi(check);
        return;
    }
    refuse_key(check, "reply", "sends no replies");
    refuse_key(check, "version", "finds its version in the packets");
    refuse_key(check, "view", "knows no views");
    refuse_key(check, "database", "knows no databases");
    refuse_key(check, "sync_wait_ms", "is not waited for");
}

static void check_duplicates(const struct source_check *check)
{
    yaml_node_t *key = check->node;
    for (unsigned i = 0; i < check->index; i++) {
        const struct config_source *other = &check->config->sources[i];
        if (same_text(check->source->name, other->name))
            document_complain(check->document, either(check->document, key, "name", "name"),
                              "sources[%u].name: '%s' is already the name of sources[%u]",
                              check->index, other->name, i);
        if (same_text(check->source->listen, other->listen))
            document_complain(check->document, either(check->document, key, "listen", "type"),
                              "sources[%u].listen: %s is already taken by source '%s'",
                              check->index, other->listen, other->name);
    }
}

static int check_source(struct source_check *check)
{
    settle_source(check);
    int r = settle_allow(check);
    if (r < 0)
        return r;
    if (!is_plain_name(check->source->name))
        document_complain(check->document, either(check->document, check->node, "name", "name"),
                          "sources[%u].name is '%s'; letters, digits, '_', '-' and '.' make a name",
                          check->index, check->source->name);
    check_wire(check);
    check_duplicates(check);
    return 0;
}

/* A channel that nobody configured still hears a host on the same machine. */
static int default_source(struct config *config)
{
    config->sources = calloc(1, sizeof(*config->sources));
    if (!config->sources)
        return -ENOMEM;
    config->sources_count = 1;
    config->sources[0].timeout_ms =
        (unsigned)atoi(config_key_find("sources[].timeout_ms")->fallback);
    return 0;
}

static int check_sources(struct document *document, struct config *config)
{
    yaml_node_t *list = section(document, "sources");
    int r = list ? 0 : default_source(config);
    for (unsigned i = 0; i < config->sources_count && r == 0; i++) {
        struct source_check check = {
            .document = document,
            .config = config,
            .source = &config->sources[i],
            .node = document_item(document, list, i),
            .index = i,
        };
        r = check_source(&check);
    }
    return r;
}

int document_check_meaning(struct document *document, struct config *config)
{
    check_channel(document, &config->channel);
    check_swap_lock(document, &config->swap_lock);
    check_terrain(document, &config->terrain);
    check_environment(document, &config->environment);
    document_check_entities(document, config);
    if (config->health.modbus.listen[0]) {
        yaml_node_t *modbus = document_get(document, section(document, "health"), "modbus", NULL);
        check_address(document, document_get(document, modbus, "listen", NULL),
                      "health.modbus.listen", config->health.modbus.listen);
    }
    return check_sources(document, config);
}
