/* What otwd-import is asked to do: options, and lists of sources. */
#include "daemon/import_options.h"

#include <argp.h>
#include <errno.h>
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "daemon/cli.h"

static const char usage[] =
    "usage: otwd import SRC... -o DB [options]\n"
    "\n"
    "Puts elevation rasters (any that GDAL reads, zipped ones too) into a terrain database.\n"
    "With --imagery the rasters are images, with --water masks of water, for a database with "
    "heights.\n"
    "An existing database is added to; an interrupted import goes on when it is run again.\n"
    "\n"
    "  -o, --output DB        the database\n"
    "      --max-error M      largest error of a stored height, metres (0.5; 0 = lossless)\n"
    "      --vertical V       heights of the source are above egm96 (default), egm2008, egm84,\n"
    "                         ellipsoid\n"
    "      --geoid FILE       grid of that geoid (egm2008, egm84), any that GDAL reads, in place "
    "of\n"
    "                         one that is found where GeographicLib and PROJ look\n"
    "      --crs CRS          for rasters that have no usable coordinate system of their own:\n"
    "                         EPSG:4326, ...\n"
    "      --nodata VALUE     this value means missing data, whatever the raster says\n"
    "      --sea M            heights at or below this are sea: lower sources say how deep it is\n"
    "      --priority N       covers sources of lower priority (0); later ones cover equal ones\n"
    "      --sources FILE     a list of sources: PATH [key=value...] a line, keys vertical, "
    "geoid,\n"
    "                         crs, nodata, sea, priority in place of the options above\n"
    "      --fill POSTS       fill voids that are enclosed and at most so many posts wide (100);\n"
    "                         0: none\n"
    "      --feather POSTS    sources blend into lower ones over so many posts (0: not at all)\n"
    "      --imagery          the sources are images, not elevation\n"
    "      --water            the sources are masks: what is not 0 is water\n"
    "      --layer NAME       the layer that they go into (imagery, water); --priority is then "
    "the\n"
    "                         layer's\n"
    "      --quality N        of the stored images, 1 to 100 (85); 100 is lossless\n"
    "  -j, --jobs N           threads (one for each processor)\n"
    "      --shard I/N        only the I-th of N parts of the work; otwd merge puts the files "
    "together\n"
    "      --json             print the result as JSON\n"
    "  -q, --quiet            say only what is wrong\n"
    "  -v, --verbose          say at last what it took\n"
    "  -h, --help  --version\n";

enum long_option {
    OPTION_MAX_ERROR = 1000,
    OPTION_VERTICAL,
    OPTION_GEOID,
    OPTION_CRS,
    OPTION_NODATA,
    OPTION_PRIORITY,
    OPTION_SOURCES,
    OPTION_FILL,
    OPTION_FEATHER,
    OPTION_SEA,
    OPTION_SHARD,
    OPTION_IMAGERY,
    OPTION_WATER,
    OPTION_LAYER,
    OPTION_QUALITY,
    OPTION_VERIFY,
    OPTION_JSON,
    OPTION_VERSION,
};

static const struct option long_options[] = {
    {"output", required_argument, NULL, 'o'},
    {"max-error", required_argument, NULL, OPTION_MAX_ERROR},
    {"vertical", required_argument, NULL, OPTION_VERTICAL},
    {"geoid", required_argument, NULL, OPTION_GEOID},
    {"crs", required_argument, NULL, OPTION_CRS},
    {"nodata", required_argument, NULL, OPTION_NODATA},
    {"priority", required_argument, NULL, OPTION_PRIORITY},
    {"jobs", required_argument, NULL, 'j'},
    {"sources", required_argument, NULL, OPTION_SOURCES},
    {"fill", required_argument, NULL, OPTION_FILL},
    {"feather", required_argument, NULL, OPTION_FEATHER},
    {"sea", required_argument, NULL, OPTION_SEA},
    {"verify", required_argument, NULL, OPTION_VERIFY}, /* for otwd verify --against */
    {"shard", required_argument, NULL, OPTION_SHARD},
    {"imagery", no_argument, NULL, OPTION_IMAGERY},
    {"water", no_argument, NULL, OPTION_WATER},
    {"layer", required_argument, NULL, OPTION_LAYER},
    {"quality", required_argument, NULL, OPTION_QUALITY},
    {"json", no_argument, NULL, OPTION_JSON},
    {"quiet", no_argument, NULL, 'q'},
    {"verbose", no_argument, NULL, 'v'},
    {"help", no_argument, NULL, 'h'},
    {"version", no_argument, NULL, OPTION_VERSION},
    {NULL, 0, NULL, 0},
};

static int bad_value(const char *option, const char *value, const char *expected)
{
    fprintf(stderr, "otwd-import: %s %s: expected %s\n", option, value, expected);
    return EX_USAGE;
}

static bool number_from_text(const char *text, double low, double high, double *ret_value)
{
    char *end = NULL;
    double value = strtod(text, &end);
    if (end == text || *end || !(value >= low && value <= high))
        return false;
    *ret_value = value;
    return true;
}

static bool whole_from_text(const char *text, long low, long high, long *ret_value)
{
    char *end = NULL;
    errno = 0;
    long value = strtol(text, &end, 10);
    if (end == text || *end || errno || value < low || value > high)
        return false;
    *ret_value = value;
    return true;
}

static bool shard_from_text(const char *text, unsigned *ret_shard, unsigned *ret_count)
{
    unsigned number, count;
    char end;
    if (sscanf(text, "%u/%u%c", &number, &count, &end) != 2 || number < 1 || number > count ||
        count > 65536)
        return false;
    *ret_shard = number - 1;
    *ret_count = count;
    return true;
}

static int add_input(struct arguments *arguments, const char *path,
                     const struct import_options *options)
{
    struct import_input *inputs =
        realloc(arguments->inputs, (arguments->import.input_count + 1) * sizeof(*inputs));
    if (!inputs)
        return EX_OSERR;
    inputs[arguments->import.input_count++] = (struct import_input){path, *options};
    arguments->inputs = inputs;
    return 0;
}

/* The next word of a line, cut out of it: up to white space, or in double quotes. NULL at its end.
 */
static char *next_word(char **at)
{
    char *out, *begin = *at + strspn(*at, " \t\r\n");
    bool quoted = false;
    if (!*begin || *begin == '#')
        return NULL;
    for (*at = out = begin; **at && (quoted || !strchr(" \t\r\n", **at)); ++*at)
        if (**at == '"')
            quoted = !quoted;
        else
            *out++ = **at;
    *at += **at != '\0';
    *out = '\0';
    return begin;
}

/* One key=value of a line; false where it is none. */
static bool take_word(char *word, struct import_options *options)
{
    char *value = strchr(word, '=');
    long whole = 0;
    if (!value)
        return false;
    *value++ = '\0';
    if (strcmp(word, "vertical") == 0)
        return import_vertical_from_name(value, &options->vertical) == 0;
    if (strcmp(word, "geoid") == 0)
        options->geoid_path = value;
    else if (strcmp(word, "crs") == 0)
        options->crs = value;
    else if (strcmp(word, "nodata") == 0)
        return options->has_nodata = number_from_text(value, -HUGE_VAL, HUGE_VAL, &options->nodata);
    else if (strcmp(word, "sea") == 0)
        return options->has_sea = number_from_text(value, -12000.0, 9500.0, &options->sea_m);
    else if (strcmp(word, "priority") == 0 && whole_from_text(value, -1000000, 1000000, &whole))
        options->priority = (int)whole;
    else
        return false;
    return true;
}

static int take_line(const char *list, int number, char *line, struct arguments *arguments)
{
    struct import_options options = arguments->options;
    char *at = line, *path = next_word(&at), *word;
    while (path && (word = next_word(&at)))
        if (!take_word(word, &options)) {
            fprintf(stderr,
                    "otwd-import: %s:%d: \"%s\" is no vertical=, geoid=, crs=, nodata=, sea= or "
                    "priority= with a value that it can have\n",
                    list, number, word);
            return EX_DATAERR;
        }
    return path ? add_input(arguments, path, &options) : 0;
}

/* Paths and options point into the lines of lists. */
static int keep_line(struct arguments *arguments, char *line)
{
    char **lines = realloc(arguments->lines, (arguments->line_count + 1) * sizeof(*lines));
    if (!lines) {
        free(line);
        return EX_OSERR;
    }
    arguments->lines = lines;
    lines[arguments->line_count++] = line;
    return 0;
}

static int read_list(const char *path, struct arguments *arguments)
{
    FILE *file = fopen(path, "r");
    if (!file) {
        fprintf(stderr, "otwd-import: %s: %s\n", path, strerror(errno));
        return EX_NOINPUT;
    }
    int r = 0;
    for (int number = 1; r == 0; number++) {
        size_t size = 0;
        char *line = NULL;
        if (getline(&line, &size, file) < 0) {
            free(line);
            break;
        }
        r = keep_line(arguments, line);
        if (r == 0)
            r = take_line(path, number, line, arguments);
    }
    fclose(file);
    return r;
}

/* Options that say how sources are read, and which. */
static int take_source_option(struct arguments *arguments, int option)
{
    struct import_options *options = &arguments->options;
    long whole = 0;
    switch (option) {
    case OPTION_VERTICAL:
        if (import_vertical_from_name(optarg, &options->vertical) == 0)
            return 0;
        return bad_value("--vertical", optarg, "egm96, egm2008, egm84 or ellipsoid");
    case OPTION_GEOID:
        options->geoid_path = optarg;
        return 0;
    case OPTION_CRS:
        options->crs = optarg;
        return 0;
    case OPTION_SEA:
        options->has_sea = true;
        if (number_from_text(optarg, -12000.0, 9500.0, &options->sea_m))
            return 0;
        return bad_value("--sea", optarg, "metres, -12000 to 9500");
    case OPTION_NODATA:
        options->has_nodata = true;
        if (number_from_text(optarg, -HUGE_VAL, HUGE_VAL, &options->nodata))
            return 0;
        return bad_value("--nodata", optarg, "a number");
    case OPTION_PRIORITY:
        if (!whole_from_text(optarg, -1000000, 1000000, &whole))
            return bad_value("--priority", optarg, "a whole number, -1000000 to 1000000");
        options->priority = arguments->layer_priority = (int)whole;
        arguments->imagery.priority = &arguments->layer_priority;
        return 0;
    default: /* a list */
        return read_list(optarg, arguments);
    }
}

/* Options that say that the sources are imagery, and what becomes of it. */
static int take_imagery_option(struct arguments *arguments, int option)
{
    long whole = 0;
    switch (option) {
    case OPTION_LAYER:
        arguments->imagery.layer = optarg;
        return 0;
    case OPTION_QUALITY:
        if (!whole_from_text(optarg, 1, 100, &whole))
            return bad_value("--quality", optarg, "a whole number, 1 to 100");
        arguments->imagery.quality = (int)whole;
        return 0;
    default: /* images or masks of water */
        arguments->imagery.water |= option == OPTION_WATER;
        arguments->import.imagery = &arguments->imagery;
        return 0;
    }
}

/* Options that say what becomes of the heights, and how the work is done. */
static int take_work_option(struct arguments *arguments, int option)
{
    struct import_params *import = &arguments->import;
    long whole = 0;
    switch (option) {
    case OPTION_MAX_ERROR:
        import->max_error_m = &arguments->max_error_m;
        if (number_from_text(optarg, 0.0, 1000.0, &arguments->max_error_m))
            return 0;
        return bad_value("--max-error", optarg, "metres, 0 to 1000");
    case OPTION_FILL:
        if (!whole_from_text(optarg, 0, IMPORT_FILL_MAX, &whole))
            return bad_value("--fill", optarg, "posts, 0 to 256");
        import->fill_posts = (int)whole;
        return 0;
    case OPTION_FEATHER:
        if (!whole_from_text(optarg, 0, IMPORT_FEATHER_MAX, &whole))
            return bad_value("--feather", optarg, "posts, 0 to 128");
        import->feather_posts = (int)whole;
        return 0;
    case OPTION_SHARD:
        if (shard_from_text(optarg, &import->shard, &import->shard_count))
            return 0;
        return bad_value("--shard", optarg, "I/N, 1/N to N/N");
    default: /* -j */
        if (!whole_from_text(optarg, 1, 64, &whole))
            return bad_value("--jobs", optarg, "a whole number, 1 to 64");
        import->jobs = (unsigned)whole;
        return 0;
    }
}

static int take_option(struct arguments *arguments, int option)
{
    switch (option) {
    case OPTION_VERTICAL:
    case OPTION_GEOID:
    case OPTION_CRS:
    case OPTION_NODATA:
    case OPTION_SEA:
    case OPTION_PRIORITY:
    case OPTION_SOURCES:
        return take_source_option(arguments, option);
    case OPTION_IMAGERY:
    case OPTION_WATER:
    case OPTION_LAYER:
    case OPTION_QUALITY:
        return take_imagery_option(arguments, option);
    case OPTION_MAX_ERROR:
    case OPTION_FILL:
    case OPTION_FEATHER:
    case OPTION_SHARD:
    case 'j':
        return take_work_option(arguments, option);
    case 'o':
        arguments->import.database = optarg;
        return 0;
    case OPTION_VERIFY:
        arguments->verified = optarg;
        return 0;
    case OPTION_JSON:
        arguments->json = true;
        return 0;
    case 'q':
    case 'v':
        cli_take_talk(option);
        return 0;
    case 'h':
        fputs(usage, stdout);
        arguments->done = true;
        return 0;
    case OPTION_VERSION:
        puts(argp_program_version);
        arguments->done = true;
        return 0;
    default: /* getopt has said what is wrong */
        return EX_USAGE;
    }
}

int import_parse_arguments(int argc, char **argv, struct arguments *arguments)
{
    int option, r = 0;
    while (r == 0 && !arguments->done &&
           (option = getopt_long(argc, argv, "o:j:qvh", long_options, NULL)) != -1)
        r = take_option(arguments, option);
    for (int i = optind; r == 0 && !arguments->done && i < argc; i++)
        r = add_input(arguments, argv[i], &arguments->options);
    arguments->import.inputs = arguments->inputs;
    if (r != 0 || arguments->done)
        return r;
    bool somewhere = arguments->import.database || arguments->verified;
    if (arguments->import.input_count == 0 || !somewhere) {
        fprintf(stderr, "otwd-import: %s (see --help)\n",
                somewhere ? "no source was given" : "no -o DB was given");
        return EX_USAGE;
    }
    return 0;
}

void import_finish_arguments(struct arguments *arguments)
{
    for (size_t i = 0; i < arguments->line_count; i++)
        free(arguments->lines[i]);
    free(arguments->lines);
    free(arguments->inputs);
}
