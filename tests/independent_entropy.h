/* The section "Entropy coder" of docs/height-codec.md. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#define ENTROPY_BIT_START (1 << 14) /* of an adaptive bit */

/* A model: 32 beginnings. */
struct model {
    int begin[32];
};

struct entropy {
    const uint8_t *at, *end;
    bool overrun; /* more was asked for than there is */
    uint32_t x;
    struct model slow[224], fast[672], escape_slow, escape_fast;
};

/* Bytes with the state before the words; at least 4. All models are fresh. */
void entropy_begin(struct entropy *entropy, const uint8_t *bytes, uint32_t size);
/* True where all is used up and the state is what it has to be. */
bool entropy_is_at_end(const struct entropy *entropy);

uint64_t entropy_raw_bits(struct entropy *entropy, int count);
bool entropy_bit(struct entropy *entropy, int *m);
/* 0 .. 31. */
int entropy_symbol(struct entropy *entropy, struct model *slow, struct model *fast);
