/* otwd: a table of subcommands. */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sysexits.h>
#include <unistd.h>

#include "daemon/cli.h"
#include "daemon/commands.h"
#include "daemon/version.h"

struct command {
    const char *name;
    int (*main)(int argc, char **argv);
    const char *summary;
};

static const struct command commands[] = {
    {"run", run_main, "the daemon in the foreground"},
    {"replay", replay_main, "a recorded flight, headless"},
    {"demo", demo_main, "the embedded flight over the embedded terrain"},
    {"dig", dig_main, "change the ground of a terrain database for good"},
    {"import", import_main, "GDAL rasters into a terrain database"},
    {"merge", merge_main, "the shards of an import into one terrain database"},
    {"info", info_main, "what a terrain database holds"},
    {"verify", verify_main, "every tile of a terrain database decoded and checked"},
    {"height", height_main, "terrain height at a place"},
    {"send", send_main, "play a flight as a host would"},
    {"bench", bench_main, "techniques side by side"},
    {"status", status_main, "a running daemon's health"},
    {"check-config", check_config_main, "say what is wrong with a configuration"},
};
#define COMMANDS (sizeof(commands) / sizeof(commands[0]))

static void print_usage(FILE *out)
{
    fputs("Usage: otwd COMMAND [ARGUMENT...]\n\n"
          "The visual channel of a flight simulator.\n\n",
          out);
    for (size_t i = 0; i < COMMANDS; i++)
        fprintf(out, "  %-14s %s\n", commands[i].name, commands[i].summary);
    fputs("\n`otwd COMMAND --help` says more. See otwd(1).\n", out);
}

/* A standard stream that the parent closed is opened the wrong way round: no file of ours takes its
 * number and receives what is meant for it, and using it still fails. */
static void guard_streams(void)
{
    for (int fd = STDIN_FILENO; fd <= STDERR_FILENO; fd++)
        if (fcntl(fd, F_GETFD) < 0)
            open("/dev/null", fd == STDIN_FILENO ? O_WRONLY : O_RDONLY);
}

int main(int argc, char **argv)
{
    const char *name = argc > 1 ? argv[1] : "";
    guard_streams();
    argp_program_version = "otwd " OTWD_VERSION " (" OTWD_COMMIT ")";
    if (strcmp(name, "--version") == 0) {
        puts(argp_program_version);
        return cli_conclude(EX_OK);
    }
    if (strcmp(name, "--help") == 0 || strcmp(name, "-h") == 0 || strcmp(name, "help") == 0) {
        print_usage(stdout);
        return cli_conclude(EX_OK);
    }
    for (size_t i = 0; i < COMMANDS; i++)
        if (strcmp(name, commands[i].name) == 0)
            return cli_conclude(commands[i].main(argc - 1, argv + 1));
    if (*name)
        fprintf(stderr, "otwd: there is no command \"%s\"; `otwd --help` lists them\n", name);
    else
        print_usage(stderr);
    return EX_USAGE;
}
