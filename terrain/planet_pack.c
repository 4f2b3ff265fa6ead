/* Makes terrain/data/earth.bin: planet_pack RAW OUT.
 *
 * RAW: 4320 x 2161 posts, int16 of this machine, rows from the north pole, columns from 180 W, the
 * layout of ETOPO5 (docs/decisions/0001-embedded-planet.md has the commands). OUT: "OTWPLNT1";
 * little-endian u16 columns, rows, count of levels; that many i16 levels in metres; then an .xz
 * stream of one byte a post, the index of its level less its prediction from the neighbours west,
 * north and north-west (the median predictor of JPEG-LS, ISO 14495-1, A.4.1), modulo 256.
 *
 * Heights are rounded to levels that lie 1 m apart at the shore and 2.5 % of the height more
 * further up: the noise that refines the grid is larger than the rounding. The drawn sea is flat,
 * so six levels do for its floor. No post changes between land and sea. */
#include <errno.h>
#include <lzma.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define COLS   4320
#define ROWS   2161
#define POSTS  (COLS * ROWS)
#define LOWEST (-32768)

struct levels {
    int16_t metres[256];
    int count;
};

static struct levels make_levels(void)
{
    struct levels l = {.metres = {-400, -150, -70, -30, -12, -4, 0}, .count = 7};
    double height_m = 1.0;
    while (height_m < 8900.0 && l.count < 256) {
        l.metres[l.count++] = (int16_t)(height_m + 0.5);
        height_m += 1.0 + 0.025 * height_m;
    }
    return l;
}

/* The nearest level on the same side of the shore. */
static uint8_t nearest_level(const struct levels *l, int height_m)
{
    int best = -1;
    for (int i = 0; i < l->count; i++) {
        int level_m = l->metres[i];
        if ((level_m > 0) != (height_m > 0) || (level_m < 0) != (height_m < 0))
            continue;
        if (best < 0 || abs(level_m - height_m) < abs(l->metres[best] - height_m))
            best = i;
    }
    return (uint8_t)best;
}

static void quantise(const struct levels *l, const int16_t *heights_m, uint8_t *ret_codes)
{
    static uint8_t code_of[65536];
    for (int h = LOWEST; h <= 32767; h++)
        code_of[h - LOWEST] = nearest_level(l, h);
    for (int i = 0; i < POSTS; i++)
        ret_codes[i] = code_of[heights_m[i] - LOWEST];
}

static int median_prediction(int west, int north, int corner)
{
    int low = west < north ? west : north, high = west < north ? north : west;
    return corner >= high ? low : corner <= low ? high : west + north - corner;
}

static void predict(const uint8_t *codes, uint8_t *ret_residuals)
{
    for (int row = 0; row < ROWS; row++) {
        for (int col = 0; col < COLS; col++) {
            const uint8_t *at = codes + (size_t)row * COLS + col;
            int north = row ? at[-COLS] : 0;
            int west = col ? at[-1] : north, corner = row && col ? at[-COLS - 1] : north;
            ret_residuals[at - codes] = (uint8_t)(*at - median_prediction(west, north, corner));
        }
    }
}

static int compress(const uint8_t *residuals, uint8_t *ret_bytes, size_t capacity, size_t *ret_size)
{
    lzma_options_lzma options;
    if (lzma_lzma_preset(&options, 9 | LZMA_PRESET_EXTREME))
        return -EINVAL;
    options.pb = 0; /* bytes have no alignment */
    const lzma_filter filters[] = {{LZMA_FILTER_LZMA2, &options}, {LZMA_VLI_UNKNOWN, NULL}};
    size_t size = 0;
    if (lzma_stream_buffer_encode((lzma_filter *)filters, LZMA_CHECK_CRC32, NULL, residuals, POSTS,
                                  ret_bytes, &size, capacity) != LZMA_OK)
        return -ENOMEM;
    *ret_size = size;
    return 0;
}

static void put_u16le(FILE *file, int value)
{
    fputc(value & 0xff, file);
    fputc(value >> 8 & 0xff, file);
}

static int write_planet(const char *path, const struct levels *l, const uint8_t *bytes, size_t size)
{
    FILE *file = fopen(path, "wbe");
    if (!file)
        return -errno;
    fputs("OTWPLNT1", file);
    put_u16le(file, COLS);
    put_u16le(file, ROWS);
    put_u16le(file, l->count);
    for (int i = 0; i < l->count; i++)
        put_u16le(file, l->metres[i]);
    fwrite(bytes, 1, size, file);
    int failed = ferror(file);
    return fclose(file) || failed ? -EIO : 0;
}

static int read_raw(const char *path, int16_t *ret_heights_m)
{
    FILE *file = fopen(path, "rbe");
    if (!file)
        return -errno;
    size_t got = fread(ret_heights_m, sizeof(int16_t), POSTS, file);
    int more = fgetc(file) != EOF;
    fclose(file);
    return got == POSTS && !more ? 0 : -EBADMSG;
}

int main(int argc, char **argv)
{
    if (argc != 3) {
        fprintf(stderr, "usage: planet_pack RAW OUT\n");
        return 64;
    }
    static int16_t heights_m[POSTS];
    static uint8_t codes[POSTS], residuals[POSTS], packed[2 * POSTS];
    size_t size = 0;
    int r = read_raw(argv[1], heights_m);
    if (r < 0) {
        fprintf(stderr, "planet_pack: %s: %s\n", argv[1],
                r == -EBADMSG ? "not 4320 x 2161 int16 posts" : strerror(-r));
        return 66;
    }
    struct levels levels = make_levels();
    quantise(&levels, heights_m, codes);
    predict(codes, residuals);
    r = compress(residuals, packed, sizeof(packed), &size);
    if (r == 0)
        r = write_planet(argv[2], &levels, packed, size);
    if (r < 0) {
        fprintf(stderr, "planet_pack: %s: %s\n", argv[2], strerror(-r));
        return 74;
    }
    printf("%d levels, %zu bytes\n", levels.count, size);
    return 0;
}
