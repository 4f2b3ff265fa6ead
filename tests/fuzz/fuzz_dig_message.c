/* Whatever decodes stays within the datagram and comes back from its own bytes. */
#include <stdlib.h>
#include <string.h>

#include "io/dig_message.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static uint8_t bytes[DIG_MESSAGE_MAX];
    struct dig_message message, again;
    if (dig_message_decode(data, size, &message, NULL) < 0)
        return 0;
    if (message.kind == DIG_ADD &&
        (message.body < data || message.body + message.size != data + size))
        abort();
    size_t encoded = dig_message_encode(&message, bytes);
    if (encoded == 0 || dig_message_decode(bytes, encoded, &again, NULL) < 0 ||
        again.request != message.request || again.kind != message.kind)
        abort();
    return 0;
}
