#include "base/diag.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

/* In brackets, for tests/sanitize/model.h has a macro of the name. */
int(diag_set)(struct diag *diag, int code, const char *format, ...)
{
    if (diag) {
        va_list args;
        va_start(args, format);
        vsnprintf(diag->text, sizeof(diag->text), format, args);
        va_end(args);
    }
    return code;
}

void diag_prefix(struct diag *diag, const char *format, ...)
{
    if (!diag)
        return;
    char old[DIAG_TEXT_MAX];
    memcpy(old, diag->text, sizeof(old));
    va_list args;
    va_start(args, format);
    int used = vsnprintf(diag->text, sizeof(diag->text), format, args);
    va_end(args);
    if (used >= 0 && (size_t)used < sizeof(diag->text))
        snprintf(diag->text + used, sizeof(diag->text) - (size_t)used, ": %s", old);
}
