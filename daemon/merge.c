/* `otwd merge DB SHARD...`: the shards of an import into one terrain database. */
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sysexits.h>

#include "daemon/cli.h"
#include "daemon/commands.h"
#include "daemon/stop.h"
#include "terrain/merge.h"

enum { OPT_JSON = 256 };

struct merge_options {
    const char *database, **shards;
    size_t count;
    unsigned jobs;
    bool json;
};

static const struct argp_option known[] = {
    {"jobs", 'j', "N", 0, "threads (one for each processor)", 0},
    {"json", OPT_JSON, NULL, 0, "print what was made as JSON", 0},
    {0},
};

static error_t parse_option(int key, char *argument, struct argp_state *state)
{
    struct merge_options *options = state->input;
    switch (key) {
    case 'j':
        options->jobs = (unsigned)cli_number(state, "jobs", argument, 1, 64);
        return 0;
    case OPT_JSON:
        options->json = true;
        return 0;
    case ARGP_KEY_ARG:
        if (!options->database)
            options->database = argument;
        else
            options->shards[options->count++] = argument;
        return 0;
    case ARGP_KEY_END:
        if (options->count == 0)
            argp_error(state, "DB and its shards are missing");
        return 0;
    default:
        return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp parser = {
    .options = known,
    .parser = parse_option,
    .args_doc = "DB SHARD...",
    .doc = "Put the shards of one import (otwd import --shard I/N) together, all of them in any "
           "order: bit for bit the database that a single import makes."
           "\vExit status: 0 made, 64 bad usage or files that do not belong together, 65 not "
           "shards, 66 no such file, 74 input or output failed, 75 interrupted.",
};

static bool on_progress(void *user, uint64_t done, uint64_t total)
{
    return stop_asked();
}

int merge_main(int argc, char **argv)
{
    struct merge_options options = {.shards = calloc((size_t)argc + 1, sizeof(char *))};
    struct diag diag = {0};
    if (!options.shards)
        return EX_OSERR;
    cli_parse(&parser, "merge", argc, argv, &options);
    stop_on_signals();
    signal(SIGXFSZ, SIG_IGN); /* a file that may not grow is an error like a full disk */
    int r = merge_shards(options.database, options.shards, options.count, options.jobs, on_progress,
                         NULL, &diag);
    if (r == 0 && options.json)
        cli_print_json(json_pack("{s:o,s:I}", "database", cli_json_text(options.database), "shards",
                                 (json_int_t)options.count));
    else if (r == 0 && !cli_quiet())
        printf("%s: %zu shards\n", options.database, options.count);
    free(options.shards);
    return r < 0 ? cli_fail(r, &diag) : EX_OK;
}
