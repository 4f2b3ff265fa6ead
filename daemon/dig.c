/* `otwd dig DB ...`: the ground of a database, changed for good. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <sysexits.h>
#include <unistd.h>

#include "daemon/cli.h"
#include "daemon/commands.h"
#include "daemon/dig_client.h"
#include "daemon/dig_list.h"
#include "daemon/dig_options.h"
#include "daemon/import_exec.h"
#include "terrain/dig_writer.h"

static bool is_remote(const struct dig_options *options)
{
    return strncmp(options->target, "udp://", 6) == 0;
}

/* All that a pipe gives, at most `size` bytes. */
static size_t read_all(int in, uint8_t *ret_bytes, size_t size)
{
    size_t used = 0;
    ssize_t n;
    while (used < size &&
           ((n = read(in, ret_bytes + used, size - used)) > 0 || (n < 0 && errno == EINTR)))
        used += n > 0 ? (size_t)n : 0;
    return used;
}

static void become_import(const struct dig_options *options, int out)
{
    char scale[32];
    const char *arguments[10] = {"otwd-import", "--stamp", options->raster, "--scale", scale};
    int count = 5;
    snprintf(scale, sizeof(scale), "%.17g", options->scale);
    if (options->crs) {
        arguments[count++] = "--crs";
        arguments[count++] = options->crs;
    }
    if (options->nodata) {
        arguments[count++] = "--nodata";
        arguments[count++] = options->nodata;
    }
    dup2(out, STDOUT_FILENO);
    close(out);
    _exit(import_exec((char **)arguments));
}

/* The stamp of a raster comes through a pipe from the program that links GDAL. Returns the exit
 * status to end with, which that program has explained. */
static int read_raster(struct dig_options *options)
{
    int pipes[2], status = 0;
    struct diag diag = {0};
    uint8_t *bytes = malloc(STAMP_BYTES_MAX);
    if (!bytes || pipe(pipes) < 0) {
        free(bytes);
        return EX_OSERR;
    }
    fflush(stdout);
    pid_t child = fork();
    if (child == 0)
        become_import(options, pipes[1]);
    close(pipes[1]);
    size_t size = read_all(pipes[0], bytes, STAMP_BYTES_MAX);
    close(pipes[0]);
    if (child < 0 || waitpid(child, &status, 0) < 0 || !WIFEXITED(status))
        status = EX_OSERR << 8;
    int r = WEXITSTATUS(status);
    if (r == EX_OK && stamp_decode(bytes, size, &options->stamp, &diag) < 0)
        r = cli_fail(-EBADMSG, &diag);
    free(bytes);
    return r;
}

static void tell_done(const struct dig_options *options, unsigned long long id)
{
    if (options->json)
        printf("{\"stamp\": %llu, \"undone\": %u}\n", id, options->undo);
    else if (!cli_quiet() && options->undo)
        printf("%s: %u undone\n", options->target, options->undo);
    else if (!cli_quiet())
        printf("%s: stamp %llu, %s\n", options->target, id, stamp_kind_name(options->stamp.kind));
}

static int ask(const struct dig_options *options)
{
    struct diag diag = {0};
    uint8_t *body = malloc(STAMP_BYTES_MAX);
    struct dig_message answer, request = {.kind = options->undo ? DIG_UNDO : DIG_ADD,
                                          .count = options->undo,
                                          .body = body};
    if (!body)
        return EX_OSERR;
    if (!options->undo)
        request.size = stamp_encode(&options->stamp, body);
    int r = dig_client_ask(options->target, &request, &answer, &diag);
    if (r == 0 && answer.status != DIG_STATUS_DONE)
        r = diag_set(&diag, -ECONNREFUSED, "%s: %s", options->target, answer.text);
    free(body);
    if (r < 0)
        return cli_fail(r, &diag);
    tell_done(options, (unsigned long long)answer.id);
    return EX_OK;
}

static int dig_here(const struct dig_options *options, struct diag *diag)
{
    struct dig_writer *writer = NULL;
    int64_t id = 0;
    int r = dig_writer_open(options->target, &writer, diag);
    if (r == 0)
        r = options->undo ? dig_writer_undo(writer, options->undo, 0, diag)
                          : dig_writer_add(writer, &options->stamp, 0, &id, diag);
    bool done = r == 0;
    while (r >= 0 && (r = dig_writer_settle(writer, diag)) > 0)
        ;
    dig_writer_close(writer);
    if (done)
        tell_done(options, (unsigned long long)id);
    return r;
}

int dig_main(int argc, char **argv)
{
    struct dig_options options;
    struct diag diag = {0};
    dig_parse_options(argc, argv, &options);
    int status = options.raster ? read_raster(&options) : EX_OK;
    if (status != EX_OK)
        return status;
    if (is_remote(&options) && !options.list) {
        status = ask(&options);
    } else {
        int r = options.list ? dig_list(options.target, options.json, &diag)
                             : dig_here(&options, &diag);
        status = r == -EACCES ? EX_IOERR : r < 0 ? cli_exit_status(r) : EX_OK;
        if (r < 0)
            fprintf(stderr, "otwd: %s\n", diag.text[0] ? diag.text : strerror(-r));
    }
    stamp_finish(&options.stamp);
    return status;
}
