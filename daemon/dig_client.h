/* Asking a running otwd to dig. */
#pragma once

#include "io/dig_message.h"

/* Sends a request to "udp://HOST:PORT" until it is answered, again after half a second, and gives
 * up after ten tries. Sets session and request. Returns 0 and the answer, or -ETIMEDOUT,
 * -ECONNREFUSED or another -errno with a sentence. Blocks. */
int dig_client_ask(const char *url, struct dig_message *request, struct dig_message *ret_answer,
                   struct diag *diag);
