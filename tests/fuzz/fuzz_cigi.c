/* Whatever is read stays within the message, ends, and is written as it was read again. The same as
 * the answer to a host. */
#include <stdlib.h>
#include <string.h>

#include "io/cigi_host.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void check_packet(const struct cigi_packet *packet, struct cigi_format format)
{
    uint8_t once[256], twice[256];
    struct cigi_packet head = {.kind = CIGI_IG_CONTROL}, again;
    struct cigi_writer first = {.data = once, .capacity = sizeof(once), .format = format};
    struct cigi_writer second = {.data = twice, .capacity = sizeof(twice), .format = format};
    struct cigi_reader reader;
    if (!cigi_write(&first, &head) || !cigi_write(&first, packet))
        abort();
    if (cigi_read_begin(once, first.size, &reader, NULL) < 0 ||
        cigi_read(&reader, &again, NULL) != CIGI_PACKET ||
        cigi_read(&reader, &again, NULL) != CIGI_PACKET || again.kind != packet->kind)
        abort();
    if (!cigi_write(&second, &head) || !cigi_write(&second, &again) || second.size != first.size ||
        memcmp(once, twice, first.size) != 0)
        abort();
}

/* A host of each version: what it takes for an answer it goes on from. */
static void answer(const uint8_t *data, size_t size)
{
    static const struct cigi_format formats[] = {{.major = 3, .minor = 3}, {.major = 4}};
    static uint8_t next[CIGI_MESSAGE_MAX];
    for (int i = 0; i < 2; i++) {
        struct cigi_host host = {.format = formats[i], .database = 5, .frame = 1};
        struct cigi_reader reader;
        struct cigi_writer writer;
        struct rejection why;
        int r = cigi_host_receive(&host, data, size, &reader, &why);
        if (r < 0 ? why.offset > size : reader.offset > size)
            abort();
        cigi_host_begin(&host, NSEC_PER_SEC, next, &writer);
        if (cigi_read_begin(next, writer.size, &reader, NULL) < 0)
            abort();
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct cigi_reader reader;
    struct cigi_packet packet;
    struct rejection why;
    answer(data, size);
    if (cigi_read_begin(data, size, &reader, &why) < 0)
        return why.offset > size ? abort(), 0 : 0;
    for (int r; (r = cigi_read(&reader, &packet, &why)) != CIGI_END;) {
        if (reader.offset > size || (r < 0 && why.offset > size))
            abort();
        if (r != CIGI_PACKET)
            continue;
        check_packet(&packet, reader.format);
        struct cigi_format swapped = reader.format;
        swapped.big = !swapped.big;
        check_packet(&packet, swapped);
    }
    return 0;
}
