#include "daemon/check_config.h"

#include <argp.h>
#include <errno.h>
#include <jansson.h>
#include <stdbool.h>
#include <sysexits.h>

#include "daemon/cli.h"

struct check_options {
    const char *path;
    bool json;
};

static error_t parse_option(int key, char *argument, struct argp_state *state)
{
    struct check_options *options = state->input;
    switch (key) {
    case 'j':
        options->json = true;
        return 0;
    default:
        return cli_argument(key, argument, state, "FILE", &options->path);
    }
}

static const struct argp_option options_known[] = {
    {"json", 'j', NULL, 0, "the errors as JSON", 0},
    {0},
};

static const struct argp parser = {
    .options = options_known,
    .parser = parse_option,
    .args_doc = "FILE",
    .doc = "Say what is wrong with a configuration file, with file, line and column.\vExit status: "
           "0 nothing is wrong, 64 bad usage, 66 the file cannot be read, 78 the file is wrong.",
};

void check_config_print(FILE *out, const struct config_errors *errors)
{
    for (size_t i = 0; i < errors->count; i++)
        fprintf(out, "%s\n", errors->list[i].text);
    if (errors->dropped)
        fprintf(out, "and %zu more errors\n", errors->dropped);
}

int check_config_exit_status(int r)
{
    switch (r) {
    case 0:
        return EX_OK;
    case -EBADMSG:
    case -EFBIG:
        return EX_CONFIG;
    case -ENOMEM: /* no complaint can say so: it would need memory, too */
        fputs("otwd: out of memory while the configuration is read\n", stderr);
        return EX_OSERR;
    default:
        return EX_NOINPUT;
    }
}

static void print_json(const char *path, const struct config_errors *errors)
{
    json_t *list = json_array();
    for (size_t i = 0; i < errors->count; i++)
        json_array_append_new(list, json_pack("{s:i,s:i,s:o}", "line", (int)errors->list[i].line,
                                              "column", (int)errors->list[i].column, "message",
                                              cli_json_text(errors->list[i].text)));
    json_t *object = json_pack("{s:o,s:o,s:I}", "file", cli_json_text(path), "errors", list,
                               "dropped", (json_int_t)errors->dropped);
    json_dumpf(object, stdout, JSON_INDENT(2));
    putchar('\n');
    json_decref(object);
}

int check_config_main(int argc, char **argv)
{
    struct check_options options = {0};
    struct config config = {0};
    struct config_errors errors = {0};
    cli_parse(&parser, "check-config", argc, argv, &options);
    int r = config_load(options.path, &config, &errors);
    if (options.json)
        print_json(options.path, &errors);
    else if (!cli_quiet())
        check_config_print(stderr, &errors);
    if (r == 0 && !options.json && !cli_quiet())
        printf("%s: nothing is wrong\n", options.path);
    config_finish(&config);
    config_errors_finish(&errors);
    return check_config_exit_status(r);
}
