/* `otwd info DB`: what a terrain database holds. */
#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <sysexits.h>

#include "daemon/cli.h"
#include "daemon/commands.h"
#include "terrain/imagery.h"

struct info_options {
    const char *database;
    bool json;
};

static const struct argp_option known[] = {
    {"json", 'j', NULL, 0, "as JSON", 0},
    {0},
};

static error_t parse_option(int key, char *argument, struct argp_state *state)
{
    struct info_options *options = state->input;
    switch (key) {
    case 'j':
        options->json = true;
        return 0;
    default:
        return cli_argument(key, argument, state, "DB", &options->database);
    }
}

static const struct argp parser = {
    .options = known,
    .parser = parse_option,
    .args_doc = "DB",
    .doc = "Extent, levels, error bound and size of a terrain database."
           "\vExit status: 0 shown, 64 bad usage, 65 not a terrain database, 66 no such file.",
};

static void print_info(const struct database_info *info)
{
    printf("%s: terrain database, format %d\n", info->path, info->version);
    printf("extent        %.6f to %.6f N, %.6f to %.6f E\n", info->south_deg, info->north_deg,
           info->west_deg, info->east_deg);
    printf("heights       %.1f to %.1f m above EGM96, error at most %g m, ", info->min_m,
           info->max_m, info->max_error_m);
    if (info->step_m > 0.0)
        printf("steps of %g m\n", info->step_m);
    else
        printf("lossless\n");
    printf("spacing       %.6g x %.6g arc seconds (latitude x longitude), %.10g posts a degree\n",
           info->finest_lat_step_deg * 3600.0, info->finest_lon_step_deg * 3600.0,
           info->grid.posts_per_degree);
    printf("size          %llu bytes, %llu posts, %.3f bytes a post\n",
           (unsigned long long)info->file_bytes, (unsigned long long)info->posts,
           info->bytes_per_post);
    for (int level = 0; level < info->levels; level++)
        printf("level %-2d      %llu tiles, %llu bytes, error at most %.1f m\n", level,
               (unsigned long long)info->level[level].tiles,
               (unsigned long long)info->level[level].bytes, info->level[level].error_m);
    if (info->stamps + info->stamps_undone)
        printf("dug           %llu stamps (%llu more undone), %llu tiles, %llu bytes\n",
               (unsigned long long)info->stamps, (unsigned long long)info->stamps_undone,
               (unsigned long long)info->dug_tiles, (unsigned long long)info->dug_bytes);
    for (size_t i = 0; i < info->source_count; i++) {
        const struct database_source_info *s = &info->sources[i];
        printf("source        %s, %d x %d, %s, priority %d, %s\n", s->name, s->width, s->height,
               s->vertical, s->priority, s->exact ? "posts as they came" : "resampled");
    }
}

static const char *kind_name(enum image_kind kind)
{
    return kind == IMAGE_WATER ? "water" : "colour";
}

static double texel_deg(const struct database_info *info, int level)
{
    return ldexp(0.5, level) / info->grid.posts_per_degree;
}

static int print_layers(struct database *database, const struct database_info *info,
                        const struct database_layers *layers, struct diag *diag)
{
    struct imagery_level_info levels[IMAGERY_LEVELS_MAX];
    int r = 0;
    for (size_t i = 0; r == 0 && i < layers->count; i++) {
        const struct database_layer *layer = &layers->layers[i];
        printf("layer         %s, %s, priority %d, texels of %.6g arc seconds\n", layer->name,
               kind_name(layer->kind), layer->priority, texel_deg(info, layer->level) * 3600.0);
        r = imagery_count_tiles(database, layer, levels, diag);
        for (int j = 0; r == 0 && j < IMAGERY_LEVELS_MAX; j++)
            if (levels[j].tiles)
                printf("  level %-4d  %llu tiles, %llu bytes\n", layer->level + j,
                       (unsigned long long)levels[j].tiles, (unsigned long long)levels[j].bytes);
        for (size_t j = 0; j < layers->image_count; j++)
            if (layers->images[j].layer == layer->id)
                printf("  image       %s, %d x %d\n", layers->images[j].name,
                       layers->images[j].width, layers->images[j].height);
    }
    return r;
}

static json_t *json_images(const struct database_layers *layers, int layer)
{
    json_t *list = json_array();
    for (size_t i = 0; i < layers->image_count; i++) {
        const struct database_image *image = &layers->images[i];
        if (image->layer == layer)
            json_array_append_new(list,
                                  json_pack("{s:o,s:i,s:i,s:I}", "name", cli_json_text(image->name),
                                            "width", image->width, "height", image->height, "bytes",
                                            (json_int_t)image->bytes));
    }
    return list;
}

static int json_layers(struct database *database, const struct database_info *info,
                       const struct database_layers *layers, json_t *list, struct diag *diag)
{
    struct imagery_level_info levels[IMAGERY_LEVELS_MAX];
    int r = 0;
    for (size_t i = 0; r == 0 && i < layers->count; i++) {
        const struct database_layer *layer = &layers->layers[i];
        json_t *counts = json_array();
        r = imagery_count_tiles(database, layer, levels, diag);
        for (int j = 0; r == 0 && j < IMAGERY_LEVELS_MAX; j++)
            if (levels[j].tiles)
                json_array_append_new(counts, json_pack("{s:i,s:I,s:I}", "level", layer->level + j,
                                                        "tiles", (json_int_t)levels[j].tiles,
                                                        "bytes", (json_int_t)levels[j].bytes));
        json_array_append_new(list, json_pack("{s:o,s:s,s:i,s:f,s:o,s:o}", "name",
                                              cli_json_text(layer->name), "kind",
                                              kind_name(layer->kind), "priority", layer->priority,
                                              "texel_deg", texel_deg(info, layer->level), "levels",
                                              counts, "images", json_images(layers, layer->id)));
    }
    return r;
}

static json_t *json_sources(const struct database_info *info)
{
    json_t *list = json_array();
    for (size_t i = 0; i < info->source_count; i++) {
        const struct database_source_info *s = &info->sources[i];
        json_array_append_new(
            list, json_pack("{s:o,s:s,s:i,s:b,s:i,s:i,s:I}", "name", cli_json_text(s->name),
                            "vertical", s->vertical, "priority", s->priority, "exact", s->exact,
                            "width", s->width, "height", s->height, "bytes", (json_int_t)s->bytes));
    }
    return list;
}

static int print_json(struct database *database, const struct database_info *info,
                      const struct database_layers *layers, struct diag *diag)
{
    json_t *levels = json_array(), *imagery = json_array();
    int r = json_layers(database, info, layers, imagery, diag);
    for (int level = 0; level < info->levels; level++)
        json_array_append_new(levels, json_pack("{s:I,s:I,s:f}", "tiles",
                                                (json_int_t)info->level[level].tiles, "bytes",
                                                (json_int_t)info->level[level].bytes, "error_m",
                                                info->level[level].error_m));
    json_t *root = json_pack(
        "{s:o,s:i,s:f,s:{s:f,s:f,s:f,s:f},s:f,s:f,s:f,s:f,s:f,s:I,s:I,s:f,s:o,s:o,s:o,s:{s:I,s:I,s:"
        "I,s:I}}",
        "path", cli_json_text(info->path), "format", info->version, "posts_per_degree",
        info->grid.posts_per_degree, "extent_deg", "south", info->south_deg, "west", info->west_deg,
        "north", info->north_deg, "east", info->east_deg, "lat_step_deg", info->finest_lat_step_deg,
        "lon_step_deg", info->finest_lon_step_deg, "min_m", info->min_m, "max_m", info->max_m,
        "max_error_m", info->max_error_m, "posts", (json_int_t)info->posts, "file_bytes",
        (json_int_t)info->file_bytes, "bytes_per_post", info->bytes_per_post, "levels", levels,
        "sources", json_sources(info), "layers", imagery, "dug", "stamps", (json_int_t)info->stamps,
        "undone", (json_int_t)info->stamps_undone, "tiles", (json_int_t)info->dug_tiles, "bytes",
        (json_int_t)info->dug_bytes);
    json_dumpf(root, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(12));
    putchar('\n');
    json_decref(root);
    return r;
}

int info_main(int argc, char **argv)
{
    struct info_options options = {0};
    cli_parse(&parser, "info", argc, argv, &options);
    struct diag diag = {0};
    struct database *database = NULL;
    struct database_info info = {0};
    struct database_layers layers = {.count = 0};
    int r = database_open(options.database, &database, &diag);
    if (r == 0)
        r = database_info(database, &info, &diag);
    if (r == 0)
        r = database_list_layers(database, &layers, &diag);
    if (r == 0 && options.json) {
        r = print_json(database, &info, &layers, &diag);
    } else if (r == 0 && !cli_quiet()) {
        print_info(&info);
        r = print_layers(database, &info, &layers, &diag);
    }
    database_layers_finish(&layers);
    database_info_finish(&info);
    database_close(database);
    return r < 0 ? cli_fail(r, &diag) : EX_OK;
}
