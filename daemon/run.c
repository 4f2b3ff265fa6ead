/* `otwd run`: the daemon in the foreground. */
#include <stdio.h>
#include <sysexits.h>

#include "daemon/check_config.h"
#include "daemon/cli.h"
#include "daemon/commands.h"
#include "daemon/log.h"
#include "daemon/service.h"
#include "daemon/version.h"

struct run_options {
    const char *config_path;
};

static const struct argp_option known[] = {
    {"config", 'c', "FILE", 0, "the configuration (default: every key has its default)", 0},
    {0},
};

static error_t parse_option(int key, char *argument, struct argp_state *state)
{
    struct run_options *options = state->input;
    switch (key) {
    case 'c':
        options->config_path = argument;
        return 0;
    default:
        return cli_argument(key, argument, state, NULL, NULL);
    }
}

static const struct argp parser = {
    .options = known,
    .parser = parse_option,
    .doc =
        "Run the daemon in the foreground, as systemd starts it, until SIGTERM or SIGINT. SIGHUP "
        "reads the configuration again."
        "\vExit status: 0 stopped, 64 bad usage, 66 the configuration or the geoid is missing, "
        "69 no OpenGL 4.5, no display, or the GPU or the window has failed, 78 a bad "
        "configuration.",
};

int run_main(int argc, char **argv)
{
    struct run_options options = {0};
    struct config config = {0};
    struct config_errors errors = {0};
    struct service *service = NULL;
    struct service_params params = {.config = &config};
    cli_parse(&parser, "run", argc, argv, &options);
    int r = config_load(options.config_path, &config, &errors);
    check_config_print(stderr, &errors);
    config_errors_finish(&errors);
    if (r < 0)
        return check_config_exit_status(r);
    enum log_level level = cli_verbose() ? LOG_LEVEL_DEBUG
                           : cli_quiet() ? LOG_LEVEL_WARNING
                                         : LOG_LEVEL_INFO;
    log_init(&(struct log_params){.level = level, .channel = config.channel.name});
    log_info("otwd %s (%s)", OTWD_VERSION, OTWD_COMMIT);
    params.config_path = options.config_path;
    int status = service_create(&params, &service);
    if (status != EX_OK)
        return status;
    status = service_run(service);
    service_destroy(service);
    log_notice("stopped");
    return status;
}
