/* The defaults: every leaf of the schema that the document does not have. */
#include "config/document.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

#include "config/schema.h"

static void set_word(const cyaml_schema_value_t *schema, void *data, const char *text)
{
    for (uint32_t i = 0; i < schema->enumeration.count; i++) {
        if (strcmp(schema->enumeration.strings[i].str, text) != 0)
            continue;
        int value = (int)schema->enumeration.strings[i].val;
        memcpy(data, &value, sizeof(value));
        return;
    }
    assert(!"the default is no word of the schema");
}

static void set_leaf(const cyaml_schema_value_t *schema, void *data, const char *text)
{
    switch (schema->type) {
    case CYAML_UINT:
        *(unsigned *)data = (unsigned)strtoul(text, NULL, 10);
        break;
    case CYAML_FLOAT:
        *(double *)data = strtod(text, NULL);
        break;
    case CYAML_BOOL:
        *(bool *)data = strcmp(text, "true") == 0;
        break;
    case CYAML_ENUM:
        set_word(schema, data, text);
        break;
    default:
        assert(schema->type == CYAML_STRING && strlen(text) < schema->data_size);
        memcpy(data, text, strlen(text) + 1);
        break;
    }
}

static void apply(struct document *document, const cyaml_schema_field_t *fields, yaml_node_t *node,
                  const char *path, char *data);

static void apply_items(struct document *document, const cyaml_schema_field_t *field,
                        yaml_node_t *sequence, const char *path, char *data)
{
    const cyaml_schema_value_t *entry = field->value.sequence.entry;
    char *items, below[160];
    memcpy(&items, data + field->data_offset, sizeof(items));
    snprintf(below, sizeof(below), "%.150s[]", path);
    yaml_node_t *item;
    if (entry->type != CYAML_MAPPING)
        return;
    for (size_t i = 0; (item = document_item(document, sequence, i)); i++)
        apply(document, entry->mapping.fields, item, below, items + i * entry->data_size);
}

static void apply(struct document *document, const cyaml_schema_field_t *fields, yaml_node_t *node,
                  const char *path, char *data)
{
    for (const cyaml_schema_field_t *field = fields; field->key; field++) {
        char below[160];
        snprintf(below, sizeof(below), "%s%s%s", path, *path ? "." : "", field->key);
        yaml_node_t *value = document_get(document, node, field->key, NULL);
        if (field->value.type == CYAML_MAPPING) {
            apply(document, field->value.mapping.fields, value, below, data + field->data_offset);
        } else if (field->value.type == CYAML_SEQUENCE) {
            apply_items(document, field, value, below, data);
        } else if (!value) {
            const struct config_key *key = config_key_find(below);
            assert(key);
            if (key->fallback)
                set_leaf(&field->value, data + field->data_offset, key->fallback);
        }
    }
}

void document_apply_defaults(struct document *document, const cyaml_schema_value_t *schema,
                             void *data)
{
    apply(document, schema->mapping.fields, document_root(document), "", data);
}
