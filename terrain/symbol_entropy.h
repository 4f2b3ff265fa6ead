/* Entropy coding of small whole numbers with adaptive frequencies: a range asymmetric numeral
 * system (Duda, arXiv:1311.2540) of one 32-bit state that moves 16 bits at a time.
 *
 * Frequencies add up to 2^15. A model holds where each of its 32 symbols begins; after every symbol
 * these beginnings move a part of the way towards where that symbol would have everything but one
 * part each for the others. */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#ifdef __SSE2__
#include <emmintrin.h>
#endif

#define ENTROPY_BITS     15
#define ENTROPY_TOTAL    (1 << ENTROPY_BITS)
#define ENTROPY_SYMBOLS  32
#define ENTROPY_SIZE_MIN 4
#define ENTROPY_LOW      (1u << 16) /* the state's least value, and its first */

typedef int16_t entropy_lanes __attribute__((vector_size(16)));
union entropy_model {
    int16_t begin[ENTROPY_SYMBOLS]; /* strictly increasing from 0 */
    entropy_lanes lanes[ENTROPY_SYMBOLS / 8];
};

/* One of two: likelier the larger. Begins at ENTROPY_TOTAL / 2. */
typedef uint16_t entropy_bit_model; /* frequency of a 1 */

/* Reads without looking at the end: ENTROPY_PADDING bytes beyond it must be there, and whoever
 * decodes asks entropy_decoder_overrun at least every ENTROPY_PADDING / 2 symbols. */
struct entropy_decoder {
    const uint8_t *next, *end;
    uint32_t state;
};
#define ENTROPY_PADDING 4096

/* What was coded, first to last; the state works backwards over it. */
struct entropy_encoder {
    uint32_t *items; /* begin << 16 | frequency */
    size_t count, limit;
};

/* `size` at least ENTROPY_SIZE_MIN. */
void entropy_decoder_init(struct entropy_decoder *decoder, const uint8_t *data, size_t size);

/* True where everything that was encoded has been decoded, and nothing more is there. */
bool entropy_decoder_done(const struct entropy_decoder *decoder);

/* Writes the items into at most `size` bytes. Returns how many, or 0 where they are too few. */
size_t entropy_encoder_write(const struct entropy_encoder *encoder, uint8_t *ret_data, size_t size);

static inline bool entropy_decoder_overrun(const struct entropy_decoder *decoder)
{
    return decoder->next > decoder->end;
}

static inline uint32_t entropy_slot(const struct entropy_decoder *decoder)
{
    return decoder->state & (ENTROPY_TOTAL - 1);
}

static inline void entropy_advance(struct entropy_decoder *decoder, uint32_t begin,
                                   uint32_t frequency)
{
    uint32_t state = frequency * (decoder->state >> ENTROPY_BITS) + entropy_slot(decoder) - begin;
    uint32_t refilled = state << 16 | decoder->next[0] | (uint32_t)decoder->next[1] << 8;
    bool refill = state < ENTROPY_LOW;
    decoder->state = refill ? refilled : state;
    decoder->next += refill ? 2 : 0;
}

static inline void entropy_put(struct entropy_encoder *encoder, uint32_t begin, uint32_t frequency)
{
    encoder->items[encoder->count++] = begin << 16 | frequency;
}

/* Up to ENTROPY_BITS bits as they are. */
static inline void entropy_put_raw(struct entropy_encoder *encoder, uint32_t value, unsigned bits)
{
    entropy_put(encoder, value << (ENTROPY_BITS - bits), 1u << (ENTROPY_BITS - bits));
}

static inline uint32_t entropy_take_raw(struct entropy_decoder *decoder, unsigned bits)
{
    uint32_t value = entropy_slot(decoder) >> (ENTROPY_BITS - bits);
    entropy_advance(decoder, value << (ENTROPY_BITS - bits), 1u << (ENTROPY_BITS - bits));
    return value;
}

/* How fast a bit's frequency follows what comes. */
#define ENTROPY_BIT_RATE 4

static inline void entropy_bit_adapt(entropy_bit_model *model, bool bit)
{
    if (bit)
        *model = (entropy_bit_model)(*model + ((ENTROPY_TOTAL - 1 - *model) >> ENTROPY_BIT_RATE));
    else
        *model = (entropy_bit_model)(*model - ((*model - 1) >> ENTROPY_BIT_RATE));
}

static inline void entropy_put_bit(struct entropy_encoder *encoder, entropy_bit_model *model,
                                   bool bit)
{
    entropy_put(encoder, bit ? 0 : *model, bit ? *model : (uint32_t)(ENTROPY_TOTAL - *model));
    entropy_bit_adapt(model, bit);
}

static inline bool entropy_take_bit(struct entropy_decoder *decoder, entropy_bit_model *model)
{
    bool bit = entropy_slot(decoder) < *model;
    entropy_advance(decoder, bit ? 0 : *model, bit ? *model : (uint32_t)(ENTROPY_TOTAL - *model));
    entropy_bit_adapt(model, bit);
    return bit;
}

#define ENTROPY_REST (ENTROPY_TOTAL - ENTROPY_SYMBOLS)

/* Moves the beginnings up to `symbol`'s towards 0, 1, 2 ... and those after it towards the total,
 * by 2^-rate of the way. */
static inline void entropy_adapt(union entropy_model *model, int symbol, int rate)
{
    static const entropy_lanes first = {0, 1, 2, 3, 4, 5, 6, 7};
    entropy_lanes place = first;
    for (int i = 0; i < ENTROPY_SYMBOLS / 8; i++, place += 8) {
        entropy_lanes target = place + ((place > (int16_t)symbol) & (int16_t)ENTROPY_REST);
        model->lanes[i] += (target - model->lanes[i]) >> rate;
    }
}

/* Two models of the same symbol, and how fast each follows what comes: the mean of both counts. */
struct entropy_pair {
    union entropy_model *slow, *fast;
};
#define ENTROPY_SLOW 8
#define ENTROPY_FAST 7

static inline uint32_t entropy_begin(struct entropy_pair pair, int symbol)
{
    if (symbol == ENTROPY_SYMBOLS)
        return ENTROPY_TOTAL;
    return (uint32_t)(pair.slow->begin[symbol] + pair.fast->begin[symbol] + 1) >> 1;
}

static inline void entropy_adapt_pair(struct entropy_pair pair, int symbol)
{
    entropy_adapt(pair.slow, symbol, ENTROPY_SLOW);
    entropy_adapt(pair.fast, symbol, ENTROPY_FAST);
}

static inline void entropy_put_symbol(struct entropy_encoder *encoder, struct entropy_pair pair,
                                      int symbol)
{
    uint32_t begin = entropy_begin(pair, symbol);
    entropy_put(encoder, begin, entropy_begin(pair, symbol + 1) - begin);
    entropy_adapt_pair(pair, symbol);
}

/* Which symbol begins last at or before the slot. */
static inline int entropy_find(struct entropy_pair pair, uint32_t slot)
{
#ifdef __SSE2__
    const __m128i *slow = (const __m128i *)(const void *)pair.slow->lanes;
    const __m128i *fast = (const __m128i *)(const void *)pair.fast->lanes;
    __m128i at = _mm_set1_epi16((int16_t)slot), after[4];
    for (int i = 0; i < 4; i++)
        after[i] = _mm_cmpgt_epi16(_mm_avg_epu16(slow[i], fast[i]), at);
    uint32_t low = (uint32_t)_mm_movemask_epi8(_mm_packs_epi16(after[0], after[1]));
    uint32_t high = (uint32_t)_mm_movemask_epi8(_mm_packs_epi16(after[2], after[3]));
    return 31 - __builtin_clz(~(low | high << 16));
#else
    int16_t symbol = -1;
    for (int i = 0; i < ENTROPY_SYMBOLS; i++) { /* of all, so that the vectoriser can do it */
        uint16_t begin = (uint16_t)(pair.slow->begin[i] + pair.fast->begin[i] + 1) >> 1;
        symbol += (int16_t)begin <= (int16_t)slot;
    }
    return symbol;
#endif
}

static inline int entropy_take_symbol(struct entropy_decoder *decoder, struct entropy_pair pair)
{
    int symbol = entropy_find(pair, entropy_slot(decoder));
    uint32_t begin = entropy_begin(pair, symbol);
    entropy_advance(decoder, begin, entropy_begin(pair, symbol + 1) - begin);
    entropy_adapt_pair(pair, symbol);
    return symbol;
}
