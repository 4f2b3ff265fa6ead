/* Sockets that systemd opened for this process: sd_listen_fds(3), systemd.socket(5). */
#pragma once

/* The descriptor of the socket unit's FileDescriptorName= `name`; -1 where there is none. It stays
 * open as long as the process: duplicate it. Event loop. */
int inherited_socket(const char *name);
