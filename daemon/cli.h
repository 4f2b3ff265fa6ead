/* What the subcommands share: exit statuses, numbers on the command line. */
#pragma once

#include <argp.h>
#include <jansson.h>
#include <stdbool.h>

#include "base/diag.h"

/* The exit status of sysexits.h that an error of ours stands for. */
int cli_exit_status(int error);

/* Prints "otwd: sentence" on stderr and returns the exit status for `error`. */
int cli_fail(int error, const struct diag *diag);

/* A text of the world (a path) as JSON: bytes that are no UTF-8 become U+FFFD. A new reference. */
json_t *cli_json_text(const char *text);

/* Prints a report on stdout, over several lines. Takes the reference; NULL prints nothing (no
 * memory). */
void cli_print_json(json_t *report);

/* Numbers of an option within limits; anything else is an argp_error (status 64). */
double cli_number(struct argp_state *state, const char *option, const char *text, double least,
                  double most);

/* "1024x576". */
void cli_size(struct argp_state *state, const char *text, int *ret_width, int *ret_height);

/* The end of an argp parser: takes the one argument that the subcommand has, called `name` in
 * sentences; NULL: it has none. Returns 0, or ARGP_ERR_UNKNOWN for any other key. */
error_t cli_argument(int key, char *argument, struct argp_state *state, const char *name,
                     const char **ret_argument);

/* Runs argp over a subcommand, which has -q and -v beside its own options: argv[0] is "otwd NAME"
 * in usage lines. */
void cli_parse(const struct argp *parser, const char *name, int argc, char **argv, void *input);

/* The same, without a word on what is wrong: for options that have to be known before the rest. */
void cli_parse_before(const struct argp *parser, int argc, char **argv, void *input);

/* Takes -q or -v where another parser has read it; false: the key is neither. */
bool cli_take_talk(int key);

/* Whether -q was given: nothing is said but what is wrong, and what was asked for as JSON. */
bool cli_quiet(void);

/* Whether -v was given. */
bool cli_verbose(void);

/* The end of a program: the status that it exits with, as output that was lost is a failure,
 * however well the rest went. With -v says on stderr what the command took: time, processor time,
 * memory. */
int cli_conclude(int status);
