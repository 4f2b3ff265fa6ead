#include "daemon/entities.h"

#define DIS_DOMAIN_LAND 1

static struct config_entity look_of(const struct cigi_seen *seen, const struct entity_types *types)
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
                           struct render_entity *ret_entities)
{
    for (size_t i = 0; i < traffic->count; i++) {
        const struct cigi_seen *seen = &traffic->list[i];
        const struct config_entity look = look_of(seen, types);
        ret_entities[i] = (struct render_entity){
            .ecef_m = {seen->ecef_m[0], seen->ecef_m[1], seen->ecef_m[2]},
            .ecef_from_body = seen->ecef_from_body,
            .shape = look.shape == CONFIG_SHAPE_VEHICLE ? ENTITY_BOX : ENTITY_ARROW,
            .length_m = (float)look.length_m,
            .width_m = (float)look.width_m,
            .height_m = (float)look.height_m,
            .alpha = (float)seen->alpha / 255.0f,
        };
    }
}
