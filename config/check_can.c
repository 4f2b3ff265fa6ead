#include "config/check_can.h"

#include "config/schema.h"

/* One field of a table on its way through the checks. */
struct field_check {
    struct document *document;
    const struct config_source *source;
    struct config_can_field *field;
    yaml_node_t *node;
    char shown[48]; /* "sources[1].fields[2]" */
    unsigned index;
};

/* The value of a key; the field's mapping where it is not given. */
static yaml_node_t *place(const struct field_check *check, const char *key)
{
    yaml_node_t *node = document_get(check->document, check->node, key, NULL);
    return node ? node : check->node;
}

static bool has(const struct field_check *check, const char *key)
{
    return document_get(check->document, check->node, key, NULL) != NULL;
}

static void check_identity(const struct field_check *check)
{
    struct can_table_field *wire = &check->field->wire;
    if (!has(check, "id"))
        document_complain(check->document, check->node, "%s.id is missing", check->shown);
    else if (can_id_parse(check->field->id, &wire->can_id) < 0)
        document_complain(check->document, place(check, "id"),
                          "%s.id is '%s'; it must be 3 hexadecimal digits, or 8 of a 29-bit "
                          "identifier",
                          check->shown, check->field->id);
    if (!has(check, "field")) {
        document_complain(check->document, check->node, "%s.field is missing", check->shown);
        return;
    }
    for (unsigned i = 0; i < check->index; i++)
        if (check->source->fields[i].wire.quantity == wire->quantity)
            document_complain(check->document, place(check, "field"),
                              "%s.field: fields[%u] is already the %s", check->shown, i,
                              config_can_field_name(wire->quantity));
}

static void check_number(const struct field_check *check)
{
    const struct can_table_field *wire = &check->field->wire;
    double factor;
    bool within_limits = wire->bit < 64 && wire->bits <= 64; /* else told already */
    if (within_limits && wire->bit + wire->bits > 64)
        document_complain(check->document, place(check, has(check, "bits") ? "bits" : "bit"),
                          "%s: %u bits from bit %u are more than the 64 of a frame", check->shown,
                          wire->bits, wire->bit);
    if (wire->number == CAN_NUMBER_FLOAT && wire->bits != 32 && wire->bits != 64)
        document_complain(check->document, place(check, "bits"),
                          "%s.bits is %u; a float has 32 or 64", check->shown, wire->bits);
    if (wire->scale == 0.0)
        document_complain(check->document, place(check, "scale"), "%s.scale is 0", check->shown);
    if (can_unit_factor(wire->quantity, wire->unit, &factor) < 0)
        document_complain(check->document, place(check, "unit"), "%s.unit: a %s is not told in %s",
                          check->shown, config_can_field_name(wire->quantity),
                          config_can_unit_name(wire->unit));
}

static bool tells(const struct config_source *source, enum can_quantity quantity)
{
    for (unsigned i = 0; i < source->fields_count; i++)
        if (source->fields[i].wire.quantity == quantity)
            return true;
    return false;
}

static void check_position(struct document *document, yaml_node_t *list, unsigned index,
                           const struct config_source *source)
{
    const char *missing = !tells(source, CAN_GPS_LATITUDE)    ? "latitude"
                          : !tells(source, CAN_GPS_LONGITUDE) ? "longitude"
                          : !tells(source, CAN_GPS_HEIGHT) && !tells(source, CAN_TRUE_ALTITUDE)
                              ? "height or altitude"
                              : NULL;
    if (missing)
        document_complain(document, list,
                          "sources[%u].fields has no %s, without which there is no position", index,
                          missing);
}

void document_check_can_table(struct document *document, yaml_node_t *node, unsigned index,
                              struct config_source *source)
{
    yaml_node_t *list = document_get(document, node, "fields", NULL);
    for (unsigned i = 0; i < source->fields_count; i++) {
        struct field_check check = {.document = document,
                                    .source = source,
                                    .field = &source->fields[i],
                                    .node = document_item(document, list, i),
                                    .index = i};
        snprintf(check.shown, sizeof(check.shown), "sources[%u].fields[%u]", index, i);
        check_identity(&check);
        check_number(&check);
    }
    check_position(document, list ? list : node, index, source);
}
