/* `otwd height DB [LAT LON]`: terrain height at a place, or at every place of standard input. */
#include <ctype.h>
#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sysexits.h>

#include "daemon/cli.h"
#include "daemon/commands.h"
#include "daemon/terrain_setup.h"
#include "geo/geographic.h"
#include "terrain/database.h"
#include "terrain/query.h"

#define ARGUMENTS_MAX 16

enum { OPT_DATUM = 256, OPT_NORMAL };

struct height_options {
    const char *database, *lat, *lon;
    bool ellipsoid, normal, json;
};

static const struct argp_option known[] = {
    {"datum", OPT_DATUM, "egm96|ellipsoid", 0, "what the answer is above (default egm96)", 0},
    {"json", 'j', NULL, 0, "an object a line", 0},
    {"normal", OPT_NORMAL, NULL, 0, "also the surface's unit normal: east north up", 0},
    {0},
};

static error_t parse_option(int key, char *argument, struct argp_state *state)
{
    struct height_options *options = state->input;
    switch (key) {
    case OPT_DATUM:
        if (strcmp(argument, "egm96") != 0 && strcmp(argument, "ellipsoid") != 0)
            argp_error(state, "--datum takes egm96 or ellipsoid, not \"%s\"", argument);
        options->ellipsoid = argument[1] == 'l';
        return 0;
    case 'j':
        options->json = true;
        return 0;
    case OPT_NORMAL:
        options->normal = true;
        return 0;
    case ARGP_KEY_ARG:
        if (state->arg_num == 0)
            options->database = argument;
        else if (state->arg_num == 1)
            options->lat = argument;
        else if (state->arg_num == 2)
            options->lon = argument;
        else
            argp_error(state, "too many arguments");
        return 0;
    case ARGP_KEY_END:
        if (!options->database || (options->lat && !options->lon))
            argp_error(state, "DB, or DB LAT LON");
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp parser = {
    .options = known,
    .parser = parse_option,
    .args_doc = "DB [LAT LON]",
    .doc = "The height of the terrain, in metres. Without coordinates reads \"lat lon\" lines from "
           "standard input and answers each with a line; \"nan\" where there is no data."
           "\vExit status: 0 answered, 64 bad usage, 65 a bad database or line, 66 no such file.",
};

static void print_text(const struct query_answer *answer, bool normal)
{
    if (isnan(answer->height_m))
        fputs("nan", stdout);
    else
        printf("%.3f", answer->height_m);
    if (normal)
        printf(" %.6f %.6f %.6f", (double)answer->normal_enu[0], (double)answer->normal_enu[1],
               (double)answer->normal_enu[2]);
    putchar('\n');
}

/* Where there is no data the height is null. */
static void print_object(const struct query_answer *answer, double lat_deg, double lon_deg,
                         bool normal)
{
    json_t *height = isnan(answer->height_m) ? json_null() : json_real(answer->height_m);
    json_t *root =
        json_pack("{s:f,s:f,s:o}", "lat_deg", lat_deg, "lon_deg", lon_deg, "height_m", height);
    if (root && normal)
        json_object_set_new(root, "normal_enu",
                            json_pack("[f,f,f]", (double)answer->normal_enu[0],
                                      (double)answer->normal_enu[1],
                                      (double)answer->normal_enu[2]));
    json_dumpf(root, stdout, JSON_REAL_PRECISION(10));
    putchar('\n');
    json_decref(root);
}

static int answer(struct query *query, struct geoid *geoid, const struct height_options *options,
                  double lat_deg, double lon_deg)
{
    struct query_answer answer;
    int r = query_height(query, lat_deg, lon_deg, options->normal ? QUERY_NORMAL : 0, &answer);
    if (r < 0)
        return r;
    if (geoid)
        answer.height_m += geoid_undulation_m(geoid, lat_deg, longitude_normalised_deg(lon_deg));
    if (options->json)
        print_object(&answer, lat_deg, lon_deg, options->normal);
    else
        print_text(&answer, options->normal);
    fflush(stdout); /* whoever asks through a pipe waits for this line */
    return 0;
}

/* "lat lon" within the Earth, nothing after. */
static bool parse_place(const char *text, double *ret_lat_deg, double *ret_lon_deg)
{
    char rest;
    return sscanf(text, "%lf%*[ ,\t]%lf %c", ret_lat_deg, ret_lon_deg, &rest) == 2 &&
           fabs(*ret_lat_deg) <= 90.0 && fabs(*ret_lon_deg) <= 360.0;
}

static int answer_lines(struct query *query, struct geoid *geoid,
                        const struct height_options *options, struct diag *diag)
{
    char line[256];
    double lat_deg, lon_deg;
    for (unsigned long number = 1; fgets(line, sizeof(line), stdin); number++) {
        if (!parse_place(line, &lat_deg, &lon_deg))
            return diag_set(diag, -EBADMSG,
                            "standard input:%lu: expected latitude and longitude in degrees",
                            number);
        int r = answer(query, geoid, options, lat_deg, lon_deg);
        if (r < 0)
            return diag_set(diag, r, "%s: cannot read the terrain", options->database);
    }
    return 0;
}

static bool is_number(const char *text)
{
    char *end;
    strtod(text, &end);
    return end != text && *end == '\0' && !isalpha((unsigned char)*text);
}

/* Numbers go last and in their order, behind "--", so that negative ones are not taken for options,
 * wherever those stand. `ret_argv` has room for two more than there are. */
static int guard_numbers(int argc, char **argv, char **ret_argv)
{
    char *numbers[ARGUMENTS_MAX];
    int count = 0, number_count = 0, i;
    for (i = 0; i < argc && strcmp(argv[i], "--") != 0; i++) {
        bool is_value = i > 0 && strcmp(argv[i - 1], "--datum") == 0;
        if (i > 0 && !is_value && is_number(argv[i]))
            numbers[number_count++] = argv[i];
        else
            ret_argv[count++] = argv[i];
    }
    ret_argv[count++] = (char *)"--";
    for (int n = 0; n < number_count; n++)
        ret_argv[count++] = numbers[n];
    while (++i < argc)
        ret_argv[count++] = argv[i];
    ret_argv[count] = NULL;
    return count;
}

int height_main(int argc, char **argv)
{
    struct height_options options = {0};
    char *guarded[ARGUMENTS_MAX + 2];
    if (argc > ARGUMENTS_MAX)
        argc = ARGUMENTS_MAX; /* more than any valid call has: argp complains of the rest */
    argc = guard_numbers(argc, argv, guarded);
    argv = guarded;
    cli_parse(&parser, "height", argc, argv, &options);
    struct diag diag = {0};
    struct terrain_source *source = NULL;
    struct query *query = NULL;
    struct geoid *geoid = NULL;
    int r = database_source_open(options.database, 256, &source, &diag);
    if (r == 0 && (r = query_create(&(struct query_params){.database = source}, &query)) < 0)
        diag_set(&diag, r, "no memory for questions about the ground");
    if (r == 0 && options.ellipsoid)
        r = geoid_setup_open("egm96", &geoid, &diag);
    if (r == 0 && options.lat) {
        char place[128];
        double lat_deg, lon_deg;
        snprintf(place, sizeof(place), "%s %s", options.lat, options.lon);
        r = parse_place(place, &lat_deg, &lon_deg)
                ? answer(query, geoid, &options, lat_deg, lon_deg)
                : diag_set(&diag, -EINVAL,
                           "\"%s\" is no place: latitude -90 to 90, longitude -360 to 360", place);
    } else if (r == 0) {
        r = answer_lines(query, geoid, &options, &diag);
    }
    geoid_close(geoid);
    query_destroy(query);
    terrain_source_destroy(source);
    return r < 0 ? cli_fail(r, &diag) : EX_OK;
}
