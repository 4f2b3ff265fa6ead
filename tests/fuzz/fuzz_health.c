/* What a daemon answers, as `otwd status` reads it: every register and bit, then the text of the
 * swap lock. What was read is written as it was read again. */
#include <stdlib.h>
#include <string.h>

#include "io/health.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void check_registers(const uint16_t *registers, const uint8_t *bits)
{
    struct health health, again;
    uint16_t once[HEALTH_REGISTERS], twice[HEALTH_REGISTERS];
    uint8_t once_bits[HEALTH_BITS], twice_bits[HEALTH_BITS];
    health_decode(registers, bits, &health);
    if (!health_state_name(health.state) || !health_can_name(health.can_state))
        abort();
    health_encode(&health, once, once_bits);
    health_decode(once, once_bits, &again);
    health_encode(&again, twice, twice_bits);
    if (memcmp(once, twice, sizeof(once)) != 0 || memcmp(once_bits, twice_bits, HEALTH_BITS) != 0)
        abort();
}

static void check_text(const char *text)
{
    struct health_swap swap, again;
    char once[HEALTH_SWAP_TEXT_MAX], twice[HEALTH_SWAP_TEXT_MAX];
    if (health_swap_parse(text, &swap) < 0)
        return;
    health_swap_format(&swap, once);
    if (health_swap_parse(once, &again) < 0 && once[0])
        abort();
    health_swap_format(&again, twice);
    if (once[0] && strcmp(once, twice) != 0)
        abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    uint16_t registers[HEALTH_REGISTERS] = {0};
    uint8_t bits[HEALTH_BITS] = {0};
    char text[1024] = "";
    size_t used = size < sizeof(registers) ? size : sizeof(registers);
    memcpy(registers, data, used);
    for (size_t i = 0; i < HEALTH_BITS && used < size; i++)
        bits[i] = data[used++];
    if (size - used < sizeof(text))
        memcpy(text, data + used, size - used);
    check_registers(registers, bits);
    check_text(text);
    return 0;
}
