#include "daemon/inherited.h"

#include <stdlib.h>
#include <string.h>
#include <systemd/sd-daemon.h>

int inherited_socket(const char *name)
{
    char **names = NULL;
    int found = -1, count = sd_listen_fds_with_names(0, &names);
    for (int i = 0; i < count; i++) {
        if (found < 0 && strcmp(names[i], name) == 0)
            found = SD_LISTEN_FDS_START + i;
        free(names[i]);
    }
    free(names);
    return found;
}
