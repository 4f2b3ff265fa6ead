#include "daemon/import_report.h"

#include <jansson.h>
#include <stdio.h>
#include <string.h>

#include "daemon/cli.h"
#include "terrain/height_step.h"
#include "terrain/imagery.h"
#include "terrain/import_raster.h"

static void print_json(json_t *root)
{
    json_dumpf(root, stdout, JSON_REAL_PRECISION(15));
    putchar('\n');
    json_decref(root);
}

static json_t *json_counts(const struct import_result *result, json_t *beyond)
{
    return json_pack("{s:I,s:I,s:b,s:O}", "sources_imported", (json_int_t)result->imported,
                     "sources_skipped", (json_int_t)result->skipped, "resumed", result->resumed,
                     "beyond", beyond);
}

static void print_counts(const struct import_result *result)
{
    printf("%zu imported, %zu were there already", result->imported, result->skipped);
}

static int report_heights(const struct arguments *arguments, const struct import_result *result,
                          json_t *beyond, struct database *database, struct diag *diag)
{
    struct database_info info;
    int r = database_info(database, &info, diag);
    if (r < 0)
        return r;
    if (arguments->json) {
        json_t *root = json_counts(result, beyond);
        json_object_update_new(
            root, json_pack("{s:f,s:i,s:I,s:f,s:I,s:f,s:f,s:f,s:f,s:f}", "posts_per_degree",
                            info.grid.posts_per_degree, "levels", info.levels, "posts",
                            (json_int_t)info.posts, "max_error_m", info.max_error_m, "bytes",
                            (json_int_t)info.file_bytes, "bytes_per_post", info.bytes_per_post,
                            "south_deg", info.south_deg, "west_deg", info.west_deg, "north_deg",
                            info.north_deg, "east_deg", info.east_deg));
        print_json(root);
    } else if (!cli_quiet()) {
        print_counts(result);
        printf("; %d levels, %llu posts, %llu bytes, %.3f bytes a post\n", info.levels,
               (unsigned long long)info.posts, (unsigned long long)info.file_bytes,
               info.bytes_per_post);
    }
    database_info_finish(&info);
    return 0;
}

/* Tiles and bytes of the layer of that name, all levels. */
static int count_layer(struct database *database, const char *name,
                       struct imagery_level_info *ret_all, struct diag *diag)
{
    struct database_layers layers;
    struct imagery_level_info levels[IMAGERY_LEVELS_MAX], all = {0};
    int r = database_list_layers(database, &layers, diag);
    if (r < 0)
        return r;
    for (size_t i = 0; r == 0 && i < layers.count; i++) {
        if (strcmp(layers.layers[i].name, name) != 0)
            continue;
        r = imagery_count_tiles(database, &layers.layers[i], levels, diag);
        for (int level = 0; r == 0 && level < IMAGERY_LEVELS_MAX; level++) {
            all.tiles += levels[level].tiles;
            all.bytes += levels[level].bytes;
        }
    }
    database_layers_finish(&layers);
    *ret_all = all;
    return r;
}

static int report_imagery(const struct arguments *arguments, const struct import_result *result,
                          json_t *beyond, struct database *database, struct diag *diag)
{
    struct imagery_level_info all;
    int r = count_layer(database, result->layer, &all, diag);
    if (r < 0)
        return r;
    if (arguments->json) {
        json_t *root = json_counts(result, beyond);
        json_object_update_new(
            root, json_pack("{s:o,s:I,s:I}", "layer", cli_json_text(result->layer), "tiles",
                            (json_int_t)all.tiles, "bytes", (json_int_t)all.bytes));
        print_json(root);
    } else if (!cli_quiet()) {
        print_counts(result);
        printf("; layer %s: %llu tiles, %llu bytes\n", result->layer, (unsigned long long)all.tiles,
               (unsigned long long)all.bytes);
    }
    return 0;
}

int import_report(const struct arguments *arguments, const struct import_result *result,
                  json_t *beyond, struct diag *diag)
{
    const struct import_params *params = &arguments->import;
    struct database *database = NULL;
    if (params->shard_count) {
        if (!cli_quiet())
            printf("shard %u/%u: %s\n", params->shard + 1, params->shard_count, params->database);
        return 0;
    }
    int r = database_open(params->database, &database, diag);
    if (r == 0)
        r = params->imagery ? report_imagery(arguments, result, beyond, database, diag)
                            : report_heights(arguments, result, beyond, database, diag);
    database_close(database);
    return r;
}

void import_report_beyond(json_t *list, const char *source, const struct raster_beyond *beyond)
{
    fprintf(
        stderr,
        "otwd-import: %s: %llu heights beyond %g .. %g m are taken for voids, the first %g m at "
        "row %d column %d\n",
        source, (unsigned long long)beyond->count, HEIGHT_MIN_M, HEIGHT_MAX_M, beyond->height_m,
        beyond->row, beyond->column);
    json_array_append_new(list, json_pack("{s:o,s:I,s:f,s:i,s:i}", "source", cli_json_text(source),
                                          "heights", (json_int_t)beyond->count, "first_m",
                                          beyond->height_m, "row", beyond->row, "column",
                                          beyond->column));
}

static void print_comparison(const char *source, const struct import_comparison *comparison)
{
    printf("%s: %llu posts (%s), worst difference %.9g m, at most %g m allowed: %llu beyond; %llu "
           "posts have other heights there\n",
           source, (unsigned long long)comparison->posts,
           comparison->exact ? "its own" : "resampled", comparison->worst_m,
           comparison->max_error_m, (unsigned long long)comparison->beyond,
           (unsigned long long)comparison->elsewhere);
    if (comparison->feathered)
        printf("%s: %llu posts are feathered into others and not compared\n", source,
               (unsigned long long)comparison->feathered);
}

int import_report_comparison(void *user, const char *source,
                             const struct import_comparison *comparison)
{
    struct verification *verification = user;
    const struct arguments *arguments = verification->arguments;
    verification->beyond += comparison->beyond;
    if (arguments->json)
        print_json(json_pack("{s:o,s:b,s:I,s:I,s:I,s:I,s:f,s:f}", "source", cli_json_text(source),
                             "exact", comparison->exact, "posts", (json_int_t)comparison->posts,
                             "elsewhere", (json_int_t)comparison->elsewhere, "feathered",
                             (json_int_t)comparison->feathered, "beyond",
                             (json_int_t)comparison->beyond, "worst_m", comparison->worst_m,
                             "max_error_m", comparison->max_error_m));
    else if (!cli_quiet())
        print_comparison(source, comparison);
    if (comparison->beyond && !cli_quiet())
        fprintf(stderr, "otwd-import: %s: %s\n", source, comparison->first.text);
    return 0;
}
