#include "daemon/cli.h"

#include <assert.h>
#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sysexits.h>

#include "base/clock.h"

#define CHILDREN_MAX 4 /* parsers that a subcommand shares with others */

static bool quiet, verbose;
static nsec_t began_ns; /* when -v was read */

int cli_exit_status(int error)
{
    switch (-error) {
    case 0:
        return EX_OK;
    case EINVAL:
    case EEXIST:
    case E2BIG:
    case ENAMETOOLONG:
        return EX_USAGE;
    case ENOENT:
    case ENOTDIR:
    case EACCES:
    case EISDIR:
        return EX_NOINPUT;
    case EBADMSG:
    case EPROTONOSUPPORT:
    case ERANGE:
    case EFBIG:
        return EX_DATAERR;
    case ENODEV:
    case ENOTSUP:
    case EADDRINUSE:
    case EADDRNOTAVAIL:
    case ECONNREFUSED:
    case EHOSTUNREACH:
    case ETIMEDOUT:
    case ENETDOWN:
        return EX_UNAVAILABLE;
    case ECANCELED:
    case ESTALE: /* what was read has changed */
    case EBUSY:  /* another writes it, or its import is not finished */
        return EX_TEMPFAIL;
    case ENOMEM:
        return EX_OSERR;
    case ENOTRECOVERABLE: /* what cannot be wrong is */
        return EX_SOFTWARE;
    default:
        return EX_IOERR;
    }
}

int cli_fail(int error, const struct diag *diag)
{
    fprintf(stderr, "otwd: %s\n", diag->text[0] ? diag->text : strerror(-error));
    return cli_exit_status(error);
}

/* The length of the UTF-8 sequence that begins here; 0 where none does. */
static size_t sequence_length(const char *text)
{
    const unsigned char lead = (unsigned char)text[0];
    size_t length = lead < 0x80 ? 1 : lead >> 5 == 6 ? 2 : lead >> 4 == 14 ? 3 : 4;
    for (size_t i = 1; i < length; i++)
        if (((unsigned char)text[i] & 0xc0) != 0x80)
            return 0;
    json_t *probe =
        json_stringn(text, length); /* it knows what is too long and what is no letter */
    json_decref(probe);
    return probe ? length : 0;
}

void cli_print_json(json_t *report)
{
    if (!report)
        return;
    json_dumpf(report, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(7));
    putchar('\n');
    json_decref(report);
}

json_t *cli_json_text(const char *text)
{
    json_t *whole = json_string(text);
    if (whole)
        return whole;
    char *clean = malloc(3 * strlen(text) + 1), *out = clean;
    while (clean && *text) {
        size_t length = sequence_length(text);
        memcpy(out, length ? text : "\xef\xbf\xbd", length ? length : 3);
        out += length ? length : 3;
        text += length ? length : 1;
    }
    whole = clean ? json_stringn(clean, (size_t)(out - clean)) : NULL;
    free(clean);
    return whole;
}

double cli_number(struct argp_state *state, const char *option, const char *text, double least,
                  double most)
{
    char *end;
    double value = strtod(text, &end);
    if (end == text || *end != '\0' || !(value >= least && value <= most))
        argp_error(state, "--%s takes a number from %g to %g, not \"%s\"", option, least, most,
                   text);
    return value;
}

void cli_size(struct argp_state *state, const char *text, int *ret_width, int *ret_height)
{
    char rest;
    int width, height;
    if (sscanf(text, "%dx%d%c", &width, &height, &rest) != 2 || width < 16 || height < 16 ||
        width > 16384 || height > 16384)
        argp_error(state, "--size takes WIDTHxHEIGHT, each from 16 to 16384, not \"%s\"", text);
    *ret_width = width;
    *ret_height = height;
}

error_t cli_argument(int key, char *argument, struct argp_state *state, const char *name,
                     const char **ret_argument)
{
    if (key == ARGP_KEY_ARG && !name)
        argp_error(state, "unexpected argument \"%s\"", argument);
    else if (key == ARGP_KEY_ARG && *ret_argument)
        argp_error(state, "one %s at a time", name);
    else if (key == ARGP_KEY_ARG)
        *ret_argument = argument;
    else if (key == ARGP_KEY_END && name && !*ret_argument)
        argp_error(state, "%s is missing", name);
    else if (key != ARGP_KEY_END)
        return ARGP_ERR_UNKNOWN;
    return 0;
}

bool cli_take_talk(int key)
{
    quiet |= key == 'q';
    verbose |= key == 'v';
    if (key == 'v')
        began_ns = clock_monotonic_ns();
    return key == 'q' || key == 'v';
}

bool cli_quiet(void)
{
    return quiet;
}

bool cli_verbose(void)
{
    return verbose;
}

static void tell_costs(void)
{
    struct rusage usage;
    if (!verbose || getrusage(RUSAGE_SELF, &usage) < 0)
        return;
    double cpu_s = (double)(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
                   1e-6 * (double)(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
    fprintf(stderr, "otwd: %.2f s, %.2f s of processor time, at most %ld MiB of memory\n",
            seconds_from_ns(clock_monotonic_ns() - began_ns), cpu_s, usage.ru_maxrss / 1024);
}

int cli_conclude(int status)
{
    if (fflush(stdout) != 0 || ferror(stdout)) {
        fprintf(stderr, "otwd: standard output: %s\n", strerror(errno));
        status = status == EX_OK ? EX_IOERR : status;
    }
    tell_costs();
    return status;
}

static error_t parse_talk(int key, char *argument, struct argp_state *state)
{
    return cli_take_talk(key) ? 0 : ARGP_ERR_UNKNOWN;
}

static const struct argp_option talk_options[] = {
    {"quiet", 'q', NULL, 0, "say only what is wrong", -1},
    {"verbose", 'v', NULL, 0, "say more on standard error, at last what the command took", -1},
    {0},
};

static const struct argp talk = {.options = talk_options, .parser = parse_talk};

static void parse(const struct argp *parser, unsigned flags, int argc, char **argv, void *input)
{
    struct argp_child children[CHILDREN_MAX + 2] = {0};
    struct argp whole = *parser;
    int count = 0;
    for (; parser->children && parser->children[count].argp; count++)
        children[count] = parser->children[count];
    assert(count <= CHILDREN_MAX);
    children[count] = (struct argp_child){.argp = &talk};
    whole.children = children;
    argp_parse(&whole, argc, argv, flags, NULL, input);
}

void cli_parse(const struct argp *parser, const char *name, int argc, char **argv, void *input)
{
    static char shown[64];
    snprintf(shown, sizeof(shown), "otwd %s", name);
    argv[0] = shown;
    parse(parser, 0, argc, argv, input);
}

void cli_parse_before(const struct argp *parser, int argc, char **argv, void *input)
{
    parse(parser, ARGP_SILENT, argc, argv, input);
}
