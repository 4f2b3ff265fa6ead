#include "daemon/stop.h"

#include <signal.h>

static atomic_bool asked;

static void on_signal(int number)
{
    atomic_store(&asked, true);
}

const atomic_bool *stop_on_signals(void)
{
    const struct sigaction action = {.sa_handler = on_signal,
                                     .sa_flags = SA_RESTART | SA_RESETHAND};
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    return &asked;
}

bool stop_asked(void)
{
    return atomic_load(&asked);
}
