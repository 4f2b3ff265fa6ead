#include "terrain/image_encode.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <webp/encode.h>

static bool configure(WebPConfig *config, int quality)
{
    bool lossless = quality == IMAGE_QUALITY_LOSSLESS;
    if (!WebPConfigInit(config))
        return false;
    config->lossless = lossless;
    config->exact = lossless;
    config->quality = lossless ? 75.0f : (float)quality; /* lossless: how hard it tries */
    config->method = 4;
    config->alpha_quality = 100; /* lossless */
    return WebPValidateConfig(config);
}

int image_encode(struct image_record *record, const uint8_t *rgba, int quality)
{
    WebPConfig config;
    WebPPicture picture;
    WebPMemoryWriter writer;
    if (!configure(&config, quality) || !WebPPictureInit(&picture))
        return -ENOMEM;
    WebPMemoryWriterInit(&writer);
    picture.use_argb = config.lossless;
    picture.width = picture.height = IMAGE_SIDE;
    picture.writer = WebPMemoryWrite;
    picture.custom_ptr = &writer;
    uint8_t *payload = NULL;
    if (WebPPictureImportRGBA(&picture, rgba, 4 * IMAGE_SIDE) && WebPEncode(&config, &picture) &&
        writer.size <= IMAGE_PAYLOAD_MAX)
        payload = malloc(writer.size);
    if (payload) {
        memcpy(payload, writer.mem, writer.size);
        free(record->payload);
        record->payload = payload;
        record->size = writer.size;
    }
    WebPMemoryWriterClear(&writer);
    WebPPictureFree(&picture);
    return payload ? 0 : -ENOMEM;
}
