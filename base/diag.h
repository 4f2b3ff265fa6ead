/* What went wrong, in words for the operator.
 *
 * Functions below daemon/ return 0 or -errno and never log. Where the number alone would not tell
 * the operator which thing is at fault and where, the function also takes a `struct diag` and
 * leaves one sentence in it: the file and line, the source's name, the byte offset. */
#pragma once

#define DIAG_TEXT_MAX 512

struct diag {
    char text[DIAG_TEXT_MAX];
};

/* Writes the formatted sentence (cut to DIAG_TEXT_MAX - 1 bytes) and returns `code`, so that a
 * caller can write `return diag_set(diag, -EINVAL, ...)`. `diag` may be NULL. */
int diag_set(struct diag *diag, int code, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* Puts "prefix: " before what is there already; cut to fit. */
void diag_prefix(struct diag *diag, const char *format, ...) __attribute__((format(printf, 2, 3)));
