#include "terrain/symbol_entropy.h"

#include <assert.h>
#include <string.h>

void entropy_decoder_init(struct entropy_decoder *decoder, const uint8_t *data, size_t size)
{
    *decoder = (struct entropy_decoder){.next = data + ENTROPY_SIZE_MIN, .end = data + size};
    for (int byte = 0; byte < ENTROPY_SIZE_MIN; byte++)
        decoder->state |= (uint32_t)data[byte] << 8 * byte;
}

bool entropy_decoder_done(const struct entropy_decoder *decoder)
{
    return decoder->next == decoder->end && decoder->state == ENTROPY_LOW;
}

size_t entropy_encoder_write(const struct entropy_encoder *encoder, uint8_t *ret_data, size_t size)
{
    uint32_t state = ENTROPY_LOW;
    size_t at = size;
    for (size_t i = encoder->count; i-- > 0;) {
        uint32_t begin = encoder->items[i] >> 16, frequency = encoder->items[i] & 0xffff;
        assert(frequency > 0);
        if (state >> (32 - ENTROPY_BITS) >= frequency) {
            if (at < 2)
                return 0;
            ret_data[--at] = (uint8_t)(state >> 8);
            ret_data[--at] = (uint8_t)state;
            state >>= 16;
        }
        state = (state / frequency << ENTROPY_BITS) + state % frequency + begin;
    }
    if (at < 4)
        return 0;
    for (int byte = 3; byte >= 0; byte--)
        ret_data[--at] = (uint8_t)(state >> 8 * byte);
    memmove(ret_data, ret_data + at, size - at);
    return size - at;
}
