#include "io/cigi_scene.h"

#include <errno.h>
#include <math.h>
#include <string.h>
#include <time.h>

#include "geo/frames.h"
#include "io/cigi_scene_internal.h"

#define YEAR_LEAST 1950
#define YEAR_MOST  2199

int cigi_scene_init(struct cigi_scene *scene, const struct cigi_scene_limits *limits,
                    const struct cigi_view *own_view)
{
    *scene = (struct cigi_scene){.own_view = *own_view};
    int r = cigi_table_init(&scene->entities, sizeof(struct cigi_entity), limits->entities);
    if (r == 0)
        r = cigi_table_init(&scene->parts, sizeof(struct cigi_part), limits->parts);
    if (r == 0)
        r = cigi_table_init(&scene->views, sizeof(struct cigi_view), limits->views);
    if (r == 0)
        r = cigi_table_init(&scene->components, sizeof(struct cigi_component_state),
                            limits->components);
    if (r == 0)
        r = cigi_table_init(&scene->regions, sizeof(struct cigi_region_state), limits->regions);
    if (r == 0)
        cigi_scene_reset(scene);
    else
        cigi_scene_finish(scene);
    return r;
}

void cigi_scene_finish(struct cigi_scene *scene)
{
    cigi_table_finish(&scene->entities);
    cigi_table_finish(&scene->parts);
    cigi_table_finish(&scene->views);
    cigi_table_finish(&scene->components);
    cigi_table_finish(&scene->regions);
}

void cigi_scene_reset(struct cigi_scene *scene)
{
    struct cigi_scene fresh = {
        .entities = scene->entities,
        .parts = scene->parts,
        .views = scene->views,
        .components = scene->components,
        .regions = scene->regions,
        .own_view = scene->own_view,
        /* The International Standard Atmosphere at sea level, in clear air. */
        .atmosphere = {.temperature_c = 15.0f, .visibility_m = 1e5f, .pressure_hpa = 1013.25f},
        .celestial = {.sun = 1, .ephemeris = 1},
        .now_ns = scene->now_ns,
        .told_ns = scene->told_ns,
    };
    fresh.entities.count = fresh.parts.count = fresh.views.count = 0;
    fresh.components.count = fresh.regions.count = 0;
    *scene = fresh;
    struct cigi_view *view = cigi_table_put(&scene->views, scene->own_view.id);
    *view = scene->own_view;
}

const struct cigi_entity *cigi_scene_entity(const struct cigi_scene *scene, uint16_t entity)
{
    return cigi_table_find(&scene->entities, entity);
}

const struct cigi_view *cigi_scene_view(const struct cigi_scene *scene, uint16_t view)
{
    return cigi_table_find(&scene->views, view);
}

uint64_t cigi_part_number(uint16_t entity, uint8_t part)
{
    return (uint64_t)entity << 8 | part;
}

const struct cigi_part *cigi_scene_part(const struct cigi_scene *scene, uint16_t entity,
                                        uint8_t part)
{
    return cigi_table_find(&scene->parts, cigi_part_number(entity, part));
}

int cigi_table_full(const char *what, const struct cigi_table *table,
                    struct rejection *ret_rejection)
{
    return reject(ret_rejection, REJECT_LIMIT, 0, "there are %zu %s already", table->count, what);
}

int cigi_bad_place(const char *what, const double place[3], struct rejection *ret_rejection)
{
    return reject(ret_rejection, REJECT_RANGE, 0, "%s at latitude %g, longitude %g, height %g m",
                  what, place[0], place[1], place[2]);
}

struct attitude cigi_attitude_from_angles(double roll_deg, double pitch_deg, double yaw_deg)
{
    struct attitude attitude = {longitude_normalised_deg(roll_deg), pitch_deg,
                                heading_normalised_deg(yaw_deg)};
    if (fabs(pitch_deg) > 90.0)
        attitude = attitude_from_ned_quaternion(ned_quaternion_from_attitude(&attitude));
    return attitude;
}

void cigi_take_offset(uint8_t use, const float offset_m[3], const float angles_deg[3],
                      double offset[3], struct attitude *attitude)
{
    struct attitude a = *attitude;
    for (int i = 0; i < 3; i++) {
        if (use & 1 << i)
            offset[i] = offset_m[i];
    }
    if (use & CIGI_USE_ROLL)
        a.roll_deg = angles_deg[0];
    if (use & CIGI_USE_PITCH)
        a.pitch_deg = angles_deg[1];
    if (use & CIGI_USE_YAW)
        a.heading_deg = angles_deg[2];
    *attitude = cigi_attitude_from_angles(a.roll_deg, a.pitch_deg, a.heading_deg);
}

static int take_component(struct cigi_scene *scene, const struct cigi_component *component,
                          struct rejection *ret_rejection)
{
    uint64_t number =
        (uint64_t)component->of << 32 | (uint64_t)component->instance << 16 | component->component;
    struct cigi_component_state *state = cigi_table_put(&scene->components, number);
    if (!state)
        return cigi_table_full("components", &scene->components, ret_rejection);
    state->component = *component;
    return 0;
}

static int utc_from_celestial(const struct cigi_celestial *sky, nsec_t *ret_utc_ns,
                              struct rejection *ret_rejection)
{
    static const uint8_t days[] = {31, 29, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31};
    unsigned month = sky->date / 1000000, day = sky->date / 10000 % 100, year = sky->date % 10000;
    if (month < 1 || month > 12 || day < 1 || day > days[month - 1] || year < YEAR_LEAST ||
        year > YEAR_MOST || sky->hour > 23 || sky->minute > 59 || sky->seconds < 0.0f ||
        sky->seconds >= 60.0f)
        return reject(ret_rejection, REJECT_RANGE, 0, "%08u, %02u:%02u:%g is no date and time",
                      sky->date, sky->hour, sky->minute, (double)sky->seconds);
    struct tm tm = {.tm_year = (int)year - 1900,
                    .tm_mon = (int)month - 1,
                    .tm_mday = (int)day,
                    .tm_hour = sky->hour,
                    .tm_min = sky->minute};
    *ret_utc_ns = (nsec_t)timegm(&tm) * NSEC_PER_SEC + ns_from_seconds((double)sky->seconds);
    return 0;
}

/* A host may repeat the same minute in every frame: only another one sets the clock. */
static int take_celestial(struct cigi_scene *scene, const struct cigi_celestial *sky,
                          nsec_t receive_ns, struct rejection *ret_rejection)
{
    const struct cigi_celestial *was = &scene->celestial;
    bool same = scene->has_utc && sky->date == was->date && sky->hour == was->hour &&
                sky->minute == was->minute && sky->seconds == was->seconds;
    struct cigi_celestial next = *sky;
    if (!sky->date_valid) {
        next.date = was->date;
        next.hour = was->hour;
        next.minute = was->minute;
        next.seconds = was->seconds;
    } else if (!same) {
        nsec_t utc_ns = 0;
        int r = utc_from_celestial(sky, &utc_ns, ret_rejection);
        if (r < 0)
            return r;
        /* cigi_scene_advance() adds what passes from now_ns on. */
        scene->utc_ns = sky->ephemeris ? utc_ns - (receive_ns - scene->now_ns) : utc_ns;
        scene->has_utc = true;
    }
    scene->celestial = next;
    return 0;
}

static int take_region(struct cigi_scene *scene, const struct cigi_region *region,
                       struct rejection *ret_rejection)
{
    double place[3] = {region->lat_deg, region->lon_deg, 0.0};
    if (region->state == CIGI_DESTROYED) {
        cigi_table_drop(&scene->regions, region->region, region->region);
        return 0;
    }
    if (!cigi_place_is_sane(place))
        return cigi_bad_place("a region", place, ret_rejection);
    struct cigi_region_state *state = cigi_table_put(&scene->regions, region->region);
    if (!state)
        return cigi_table_full("regions", &scene->regions, ret_rejection);
    state->region = *region;
    return 0;
}

int cigi_scene_take(struct cigi_scene *scene, const struct cigi_packet *packet,
                    bool entities_placed, nsec_t receive_ns, struct rejection *ret_rejection)
{
    int r = cigi_entities_take(scene, packet, entities_placed, receive_ns, ret_rejection);
    if (r > 0)
        r = cigi_views_take(scene, packet, ret_rejection);
    if (r <= 0)
        return r;
    switch (packet->kind) {
    case CIGI_COMPONENT:
    case CIGI_SHORT_COMPONENT:
        return take_component(scene, &packet->component, ret_rejection);
    case CIGI_CELESTIAL:
        return take_celestial(scene, &packet->celestial, receive_ns, ret_rejection);
    case CIGI_ATMOSPHERE:
        scene->atmosphere = packet->atmosphere;
        return 0;
    case CIGI_REGION:
        return take_region(scene, &packet->region, ret_rejection);
    default:
        return 1;
    }
}
