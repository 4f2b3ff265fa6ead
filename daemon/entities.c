#include "daemon/entities.h"

#include <math.h>

#define DIS_DOMAIN_LAND 1
#define CARRIED_S       0.1

static struct config_entity look_of(const struct traffic_entity *seen,
                                    const struct entity_types *types)
{
    if (seen->enumerated)
        return config_entity_default(seen->domain == DIS_DOMAIN_LAND ? CONFIG_SHAPE_VEHICLE
                                                                     : CONFIG_SHAPE_AIRCRAFT);
    for (unsigned i = 0; i < types->count; i++)
        if (types->list[i].type == seen->type)
            return types->list[i];
    return config_entity_default(CONFIG_SHAPE_AIRCRAFT);
}

void entities_from_traffic(const struct traffic *traffic, const struct entity_types *types,
                           nsec_t frame_ns, struct render_entity *ret_entities)
{
    double dt_s = seconds_from_ns(frame_ns - traffic->time_ns);
    dt_s = fmin(fmax(dt_s, -CARRIED_S), CARRIED_S);
    for (size_t i = 0; i < traffic->count; i++) {
        const struct traffic_entity *seen = &traffic->list[i];
        const struct config_entity look = look_of(seen, types);
        ret_entities[i] = (struct render_entity){
            .ecef_from_body = seen->ecef_from_body,
            .shape = look.shape == CONFIG_SHAPE_VEHICLE ? ENTITY_BOX : ENTITY_ARROW,
            .length_m = (float)look.length_m,
            .width_m = (float)look.width_m,
            .height_m = (float)look.height_m,
            .alpha = (float)seen->alpha / 255.0f,
        };
        for (int k = 0; k < 3; k++)
            ret_entities[i].ecef_m[k] = seen->ecef_m[k] + seen->ecef_mps[k] * dt_s;
    }
}
