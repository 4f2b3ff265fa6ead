/* Whatever decodes comes back from its own bytes, and no run of messages keeps a channel waiting.
 */
#include <stdlib.h>
#include <string.h>

#include "io/swap_lock.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void take(struct swap_lock *lock, const uint8_t *data, size_t size, nsec_t now_ns)
{
    uint8_t bytes[SWAP_MESSAGE_SIZE];
    struct swap_message message, again;
    if (swap_message_decode(data, size, &message, NULL) < 0)
        return;
    swap_message_encode(&message, bytes);
    if (swap_message_decode(bytes, sizeof(bytes), &again, NULL) < 0 ||
        again.label.number != message.label.number || again.kind != message.kind ||
        again.realtime_ns != message.realtime_ns)
        abort();
    swap_lock_take(lock, &message, now_ns);
}

/* The datagrams of an input follow each other without gaps. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const struct swap_params params = {
        .channel = 2, .channels = 3, .session = 1, .timeout_ns = 50 * NSEC_PER_MSEC};
    struct swap_lock lock;
    nsec_t now_ns = 0;
    swap_lock_init(&lock, &params);
    for (size_t at = 0; at < size; at += SWAP_MESSAGE_SIZE) {
        size_t part = size - at < SWAP_MESSAGE_SIZE ? size - at : SWAP_MESSAGE_SIZE;
        swap_lock_begin(&lock, (struct swap_label){SWAP_HOST, (uint32_t)at}, now_ns);
        take(&lock, data + at, part, now_ns);
        if (!swap_lock_may_show(&lock, now_ns) && swap_lock_next_ns(&lock) <= now_ns)
            abort();
        now_ns += params.timeout_ns;
        if (!swap_lock_may_show(&lock, now_ns))
            abort();
        swap_lock_show(&lock, now_ns, now_ns);
        if (lock.counts.present < 1 || lock.counts.present > params.channels)
            abort();
    }
    return 0;
}
