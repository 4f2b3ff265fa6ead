/* Reads a running daemon's health over Modbus/TCP, for `otwd status`. Blocks; not for the daemon.
 */
#pragma once

#include "base/diag.h"
#include "io/health.h"

/* Reads the whole map of `server` ("ADDRESS:PORT") in one transaction a table, each within
 * `timeout_ms`. Returns 0; -EINVAL for an address that is none; -EPROTO where the peer answers but
 * is no otwd of this map version; else -errno of the connection. */
int modbus_client_read(const char *server, unsigned unit, unsigned timeout_ms,
                       struct health *ret_health, struct diag *diag);
