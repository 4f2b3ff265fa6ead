/* Every node against the schema and the limits: the pass that finds all errors, not only the first.
 *
 * A path is built on the way down, twice: as the operator writes it ("sources[1].listen", for the
 * sentence) and with the indices left out ("sources[].listen", to find the key's limits). */
#include "config/document.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "config/schema.h"

#define PATH_MAX_BYTES 160

struct place {
    char shown[PATH_MAX_BYTES];
    char key[PATH_MAX_BYTES];
};

static void check_node(struct document *document, const cyaml_schema_value_t *schema,
                       yaml_node_t *node, const struct place *place);

static struct place place_below(const struct place *above, const char *name)
{
    struct place below;
    const char *dot = above->key[0] ? "." : "";
    snprintf(below.shown, sizeof(below.shown), "%.100s%s%.50s", above->shown, dot, name);
    snprintf(below.key, sizeof(below.key), "%.100s%s%.50s", above->key, dot, name);
    return below;
}

static struct place place_item(const struct place *above, size_t index)
{
    struct place item;
    snprintf(item.shown, sizeof(item.shown), "%.130s[%zu]", above->shown, index);
    snprintf(item.key, sizeof(item.key), "%.130s[]", above->key);
    return item;
}

static const char *kind_of(const yaml_node_t *node)
{
    switch (node->type) {
    case YAML_SCALAR_NODE:
        return node->data.scalar.length ? "a single value" : "nothing";
    case YAML_SEQUENCE_NODE:
        return "a list";
    case YAML_MAPPING_NODE:
        return "keys and values";
    default:
        return "nothing";
    }
}

/* Levenshtein's distance, for words of up to 31 bytes. */
static unsigned distance(const char *a, const char *b)
{
    size_t la = strlen(a), lb = strlen(b);
    if (la > 31 || lb > 31)
        return 99;
    unsigned row[32];
    for (size_t j = 0; j <= lb; j++)
        row[j] = (unsigned)j;
    for (size_t i = 1; i <= la; i++) {
        unsigned diagonal = row[0];
        row[0] = (unsigned)i;
        for (size_t j = 1; j <= lb; j++) {
            unsigned change = diagonal + (a[i - 1] != b[j - 1]);
            diagonal = row[j];
            unsigned shift = 1 + (row[j] < row[j - 1] ? row[j] : row[j - 1]);
            row[j] = change < shift ? change : shift;
        }
    }
    return row[lb];
}

/* The same quantity with the unit missing or another one: "visibility_km" for "visibility_m". */
static bool same_stem(const char *a, const char *b)
{
    const char *ua = strrchr(a, '_'), *ub = strrchr(b, '_');
    size_t la = ua ? (size_t)(ua - a) : strlen(a), lb = ub ? (size_t)(ub - b) : strlen(b);
    return strncmp(a, b, lb) == 0 && (la == lb || strlen(a) == lb);
}

static const char *nearest_key(const cyaml_schema_field_t *fields, const char *name)
{
    const char *best = NULL;
    unsigned best_distance = 3; /* more than two slips of the finger are another word */
    for (; fields->key; fields++) {
        unsigned d = same_stem(name, fields->key) ? 0 : distance(name, fields->key);
        if (d < best_distance) {
            best_distance = d;
            best = fields->key;
        }
    }
    return best;
}

static const cyaml_schema_field_t *find_field(const cyaml_schema_field_t *fields, const char *name)
{
    for (; fields->key; fields++)
        if (strcmp(fields->key, name) == 0)
            return fields;
    return NULL;
}

static void check_pair(struct document *document, const cyaml_schema_field_t *fields,
                       yaml_node_t *mapping, yaml_node_t *key, yaml_node_t *value,
                       const struct place *place)
{
    if (key->type != YAML_SCALAR_NODE) {
        document_complain(document, key, "a key must be a single word, not %s", kind_of(key));
        return;
    }
    const char *name = (const char *)key->data.scalar.value;
    struct place below = place_below(place, name);
    yaml_node_t *first;
    document_get(document, mapping, name, &first);
    const cyaml_schema_field_t *field = find_field(fields, name);
    const char *near = nearest_key(fields, name);
    document->harmless += !field;
    if (!field && near)
        document_complain(document, key, "unknown key '%s'; did you mean '%s'?", below.shown, near);
    else if (!field)
        document_complain(document, key, "unknown key '%s'", below.shown);
    else if (first != key)
        document_complain(document, key, "'%s' is given twice, first in line %zu", below.shown,
                          first->start_mark.line + 1);
    else
        check_node(document, &field->value, value, &below);
}

static void check_mapping(struct document *document, const cyaml_schema_value_t *schema,
                          yaml_node_t *node, const struct place *place)
{
    const char *name = place->shown[0] ? place->shown : "the file";
    if (node->type != YAML_MAPPING_NODE) {
        document_complain(document, node, "%s must hold keys and values, not %s", name,
                          kind_of(node));
        return;
    }
    for (yaml_node_pair_t *pair = node->data.mapping.pairs.start;
         pair < node->data.mapping.pairs.top; pair++)
        check_pair(document, schema->mapping.fields, node,
                   yaml_document_get_node(&document->yaml, pair->key),
                   yaml_document_get_node(&document->yaml, pair->value), place);
}

static void check_sequence(struct document *document, const cyaml_schema_value_t *schema,
                           yaml_node_t *node, const struct place *place)
{
    if (node->type != YAML_SEQUENCE_NODE) {
        document_complain(document, node, "%s must be a list, not %s", place->shown, kind_of(node));
        return;
    }
    yaml_node_t *item;
    for (size_t i = 0; (item = document_item(document, node, i)); i++) {
        if (i == schema->sequence.max) {
            document_complain(document, item, "%s holds more than %u entries", place->shown,
                              schema->sequence.max);
            return;
        }
        struct place below = place_item(place, i);
        check_node(document, schema->sequence.entry, item, &below);
    }
}

static bool is_one_of(const char *text, const char *const *words)
{
    for (; *words; words++)
        if (strcasecmp(text, *words) == 0)
            return true;
    return false;
}

static bool is_whole_number(const char *text)
{
    if (strcmp(text, "0") == 0)
        return true;
    return *text >= '1' && *text <= '9' && strspn(text, "0123456789") == strlen(text) &&
           strlen(text) <= 10;
}

static bool parse_finite(const char *text, double *ret_value)
{
    char *end;
    if (strspn(text, "+-.0123456789eE") != strlen(text))
        return false;
    *ret_value = strtod(text, &end);
    return *text && *end == '\0' && isfinite(*ret_value);
}

static void check_limits(struct document *document, yaml_node_t *node, const struct place *place,
                         double value)
{
    const struct config_key *key = config_key_find(place->key);
    if (!key || (key->min == 0 && key->max == 0) || (value >= key->min && value <= key->max))
        return;
    document->harmless += value >= 0 && value <= UINT32_MAX; /* libcyaml can hold it */
    document_complain(document, node, "%s is %s; it must lie between %.12g and %.12g%s%s",
                      place->shown, (const char *)node->data.scalar.value, key->min, key->max,
                      key->unit ? " " : "", key->unit ? key->unit : "");
}

static void check_number(struct document *document, const cyaml_schema_value_t *schema,
                         yaml_node_t *node, const struct place *place)
{
    const char *text = (const char *)node->data.scalar.value;
    bool whole = schema->type == CYAML_UINT;
    double value;
    if (!parse_finite(text, &value) || node->data.scalar.style != YAML_PLAIN_SCALAR_STYLE)
        document_complain(document, node, "%s is '%s'; it must be a %s", place->shown, text,
                          whole ? "whole number" : "number");
    else if (whole && !is_whole_number(text) && value >= 0)
        document_complain(document, node, "%s is '%s'; it must be a whole number", place->shown,
                          text);
    else
        check_limits(document, node, place, value);
}

static void check_word(struct document *document, const cyaml_schema_value_t *schema,
                       yaml_node_t *node, const struct place *place)
{
    const char *text = (const char *)node->data.scalar.value;
    char list[256] = "";
    size_t used = 0;
    for (uint32_t i = 0; i < schema->enumeration.count; i++) {
        const char *word = schema->enumeration.strings[i].str;
        if (strcmp(text, word) == 0)
            return;
        if (used < sizeof(list))
            used += (size_t)snprintf(list + used, sizeof(list) - used, "%s%s", i ? ", " : "", word);
    }
    document_complain(document, node, "%s is '%s'; it must be one of %s", place->shown, text, list);
}

static void check_string(struct document *document, const cyaml_schema_value_t *schema,
                         yaml_node_t *node, const struct place *place)
{
    size_t length = node->data.scalar.length;
    if (strlen((const char *)node->data.scalar.value) != length)
        document_complain(document, node, "%s holds a zero byte", place->shown);
    else if (length > schema->string.max)
        document_complain(document, node, "%s is %zu bytes long; at most %u are allowed",
                          place->shown, length, schema->string.max);
}

static void check_scalar(struct document *document, const cyaml_schema_value_t *schema,
                         yaml_node_t *node, const struct place *place)
{
    static const char *const booleans[] = {"true", "false", "yes", "no", "on", "off", NULL};
    const char *text = (const char *)node->data.scalar.value;
    switch (schema->type) {
    case CYAML_UINT:
    case CYAML_FLOAT:
        check_number(document, schema, node, place);
        break;
    case CYAML_ENUM:
        check_word(document, schema, node, place);
        break;
    case CYAML_BOOL:
        if (!is_one_of(text, booleans))
            document_complain(document, node, "%s is '%s'; it must be true or false", place->shown,
                              text);
        break;
    default:
        check_string(document, schema, node, place);
        break;
    }
}

static void check_node(struct document *document, const cyaml_schema_value_t *schema,
                       yaml_node_t *node, const struct place *place)
{
    if (schema->type == CYAML_MAPPING)
        check_mapping(document, schema, node, place);
    else if (schema->type == CYAML_SEQUENCE)
        check_sequence(document, schema, node, place);
    else if (node->type != YAML_SCALAR_NODE)
        document_complain(document, node, "%s must be a single value, not %s", place->shown,
                          kind_of(node));
    else
        check_scalar(document, schema, node, place);
}

void document_check_shape(struct document *document, const cyaml_schema_value_t *schema)
{
    yaml_node_t *root = document_root(document);
    struct place top = {0};
    if (root)
        check_node(document, schema, root, &top);
}
