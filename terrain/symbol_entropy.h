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

/* How fast a model follows what comes. */
#define ENTROPY_RATE 8
#define ENTROPY_REST (ENTROPY_TOTAL - ENTROPY_SYMBOLS)

/* Moves the beginnings up to `symbol`'s towards 0, 1, 2 ... and those after it towards the total.
 */
static inline void entropy_adapt(union entropy_model *model, int symbol)
{
    static const entropy_lanes first = {0, 1, 2, 3, 4, 5, 6, 7};
    entropy_lanes place = first;
    for (int i = 0; i < ENTROPY_SYMBOLS / 8; i++, place += 8) {
        entropy_lanes target = place + ((place > (int16_t)symbol) & (int16_t)ENTROPY_REST);
        model->lanes[i] += (target - model->lanes[i]) >> ENTROPY_RATE;
    }
}

static inline uint32_t entropy_end(const union entropy_model *model, int symbol)
{
    return symbol == ENTROPY_SYMBOLS - 1 ? ENTROPY_TOTAL : (uint32_t)model->begin[symbol + 1];
}

static inline void entropy_put_symbol(struct entropy_encoder *encoder, union entropy_model *model,
                                      int symbol)
{
    uint32_t begin = (uint32_t)model->begin[symbol];
    entropy_put(encoder, begin, entropy_end(model, symbol) - begin);
    entropy_adapt(model, symbol);
}

/* Which symbol begins last at or before the slot. */
static inline int entropy_find(const union entropy_model *model, uint32_t slot)
{
#ifdef __SSE2__
    const __m128i *begin = (const __m128i *)(const void *)model->lanes;
    __m128i at = _mm_set1_epi16((int16_t)slot);
    __m128i low = _mm_packs_epi16(_mm_cmpgt_epi16(begin[0], at), _mm_cmpgt_epi16(begin[1], at));
    __m128i high = _mm_packs_epi16(_mm_cmpgt_epi16(begin[2], at), _mm_cmpgt_epi16(begin[3], at));
    uint32_t later = (uint32_t)_mm_movemask_epi8(low) | (uint32_t)_mm_movemask_epi8(high) << 16;
    return 31 - __builtin_clz(~later);
#else
    int symbol = 0;
    for (int step = ENTROPY_SYMBOLS / 2; step > 0; step /= 2)
        symbol += model->begin[symbol + step] <= (int32_t)slot ? step : 0;
    return symbol;
#endif
}

static inline int entropy_take_symbol(struct entropy_decoder *decoder, union entropy_model *model)
{
    int symbol = entropy_find(model, entropy_slot(decoder));
    uint32_t begin = (uint32_t)model->begin[symbol];
    entropy_advance(decoder, begin, entropy_end(model, symbol) - begin);
    entropy_adapt(model, symbol);
    return symbol;
}
