#include "daemon/progress.h"

#include <stdio.h>
#include <unistd.h>

#include "daemon/cli.h"

void progress_init(struct progress *progress)
{
    *progress = (struct progress){cli_quiet(), isatty(STDERR_FILENO), clock_monotonic_ns()};
}

void progress_tell(struct progress *progress, const char *what, int done, int of)
{
    if (progress->quiet)
        return;
    if (progress->terminal)
        fprintf(stderr, "\r\033[K%s: %d of %d", what, done, of);
    if (done < of)
        return;
    nsec_t now_ns = clock_monotonic_ns();
    double spent_s = seconds_from_ns(now_ns - progress->began_ns);
    progress->began_ns = now_ns;
    if (progress->terminal)
        fprintf(stderr, " in %.1f s\n", spent_s);
    else
        fprintf(stderr, "%s: done in %.1f s\n", what, spent_s);
}
