#include "tests/independent_entropy.h"

#include <string.h>

static const int slow_models[224][32] = {
#include "terrain/data/symbol_slow.txt"
};
static const int fast_models[672][32] = {
#include "terrain/data/symbol_fast.txt"
};
static const int escape_model[1][32] = {
#include "terrain/data/symbol_escapes.txt"
};

static void consume(struct entropy *entropy, uint32_t begin, uint32_t frequency)
{
    entropy->x = frequency * (entropy->x >> 15) + (entropy->x & 32767) - begin;
    while (entropy->x < 65536 && !entropy->overrun) {
        entropy->overrun = entropy->end - entropy->at < 2;
        if (!entropy->overrun) {
            entropy->x = entropy->x << 16 | entropy->at[0] | (uint32_t)entropy->at[1] << 8;
            entropy->at += 2;
        }
    }
}

uint64_t entropy_raw_bits(struct entropy *entropy, int count)
{
    uint64_t value = 0;
    while (count > 0) {
        int n = count < 15 ? count : 15;
        uint32_t chunk = (entropy->x & 32767) >> (15 - n);
        consume(entropy, chunk << (15 - n), 1u << (15 - n));
        value = value << n | chunk;
        count -= n;
    }
    return value;
}

bool entropy_bit(struct entropy *entropy, int *m)
{
    bool one = (int)(entropy->x & 32767) < *m;
    if (one) {
        consume(entropy, 0, (uint32_t)*m);
        *m += (32767 - *m) >> 4;
    } else {
        consume(entropy, (uint32_t)*m, (uint32_t)(32768 - *m));
        *m -= (*m - 1) >> 4;
    }
    return one;
}

static int begin_of(const struct model *slow, const struct model *fast, int s)
{
    return s == 32 ? 32768 : (slow->begin[s] + fast->begin[s] + 1) / 2;
}

static void adapt(struct model *model, int symbol, int rate)
{
    for (int i = 0; i < 32; i++)
        model->begin[i] += ((i <= symbol ? i : i + 32768 - 32) - model->begin[i]) >> rate;
}

int entropy_symbol(struct entropy *entropy, struct model *slow, struct model *fast)
{
    int at = (int)(entropy->x & 32767), s = 0;
    while (begin_of(slow, fast, s + 1) <= at)
        s++;
    int begin = begin_of(slow, fast, s);
    consume(entropy, (uint32_t)begin, (uint32_t)(begin_of(slow, fast, s + 1) - begin));
    adapt(slow, s, 8);
    adapt(fast, s, 7);
    return s;
}

void entropy_begin(struct entropy *entropy, const uint8_t *bytes, uint32_t size)
{
    entropy->x =
        bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
    entropy->at = bytes + 4;
    entropy->end = bytes + size;
    entropy->overrun = false;
    memcpy(entropy->slow, slow_models, sizeof(entropy->slow));
    memcpy(entropy->fast, fast_models, sizeof(entropy->fast));
    memcpy(&entropy->escape_slow, escape_model, sizeof(entropy->escape_slow));
    memcpy(&entropy->escape_fast, escape_model, sizeof(entropy->escape_fast));
}

bool entropy_is_at_end(const struct entropy *entropy)
{
    return !entropy->overrun && entropy->x == 65536 && entropy->at == entropy->end;
}
