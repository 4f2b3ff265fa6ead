/* The list of entity types: each type once, each with a size. */
#include "config/document.h"

struct config_entity config_entity_default(enum config_shape shape)
{
    if (shape == CONFIG_SHAPE_VEHICLE)
        return (struct config_entity){
            .shape = shape, .length_m = 6.0, .width_m = 2.5, .height_m = 2.5};
    return (struct config_entity){
        .shape = shape, .length_m = 15.0, .width_m = 12.0, .height_m = 4.0};
}

/* What is not given is in proportion to the length. */
static void settle_size(struct config_entity *entity)
{
    const struct config_entity usual = config_entity_default(entity->shape);
    if (entity->length_m == 0.0)
        entity->length_m = usual.length_m;
    double scale = entity->length_m / usual.length_m;
    if (entity->width_m == 0.0)
        entity->width_m = scale * usual.width_m;
    if (entity->height_m == 0.0)
        entity->height_m = scale * usual.height_m;
}

void document_check_entities(struct document *document, struct config *config)
{
    yaml_node_t *list = document_get(document, document_root(document), "entities", NULL);
    for (unsigned i = 0; i < config->entities_count; i++) {
        struct config_entity *entity = &config->entities[i];
        yaml_node_t *node = document_item(document, list, i);
        yaml_node_t *type = document_get(document, node, "type", NULL);
        if (!type)
            document_complain(document, node, "entities[%u].type is missing", i);
        for (unsigned k = 0; k < i && type; k++)
            if (config->entities[k].type == entity->type)
                document_complain(document, type, "entities[%u].type: entities[%u] is already %u",
                                  i, k, entity->type);
        settle_size(entity);
    }
}
