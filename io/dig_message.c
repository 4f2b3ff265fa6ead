#include "io/dig_message.h"

#include <errno.h>
#include <string.h>

#include "base/bytes.h"

bool dig_message_recognises(const void *data, size_t size)
{
    struct byte_reader reader = byte_reader_over(data, size);
    return read_u32be(&reader) == DIG_MAGIC && !reader.overrun;
}

static int take_rest(struct byte_reader *reader, struct dig_message *message, struct diag *diag)
{
    size_t rest = reader->size - reader->offset;
    const uint8_t *data = reader->data + reader->offset;
    switch (message->kind) {
    case DIG_ADD:
        message->body = data;
        message->size = rest;
        return rest > 0 ? 0 : diag_set(diag, -EBADMSG, "a request to dig without a stamp");
    case DIG_UNDO:
        return message->count > 0 ? 0 : diag_set(diag, -EBADMSG, "a request to undo nothing");
    case DIG_ANSWER:
        if (message->status > DIG_STATUS_BUSY)
            return diag_set(diag, -EBADMSG, "an answer of status %d", (int)message->status);
        rest = rest < DIG_TEXT_MAX ? rest : DIG_TEXT_MAX - 1;
        memcpy(message->text, data, rest);
        return 0;
    }
    return diag_set(diag, -EBADMSG, "%d is no kind of request", (int)message->kind);
}

int dig_message_decode(const void *data, size_t size, struct dig_message *ret_message,
                       struct diag *diag)
{
    struct byte_reader reader = byte_reader_over(data, size);
    struct dig_message message = {.count = 0};
    uint32_t magic = read_u32be(&reader), major = read_u8(&reader);
    read_u8(&reader); /* minor */
    uint32_t told = read_u16be(&reader);
    message.session = read_u32be(&reader);
    message.request = read_u32be(&reader);
    message.kind = (enum dig_kind)read_u8(&reader);
    message.status = (enum dig_status)read_u8(&reader);
    read_u16be(&reader);
    message.count = read_u32be(&reader);
    message.id = read_u64be(&reader);
    if (reader.overrun || magic != DIG_MAGIC)
        return diag_set(diag, -EBADMSG, "%zu bytes are no request to dig", size);
    if (major != DIG_VERSION_MAJOR)
        return diag_set(diag, -EPROTONOSUPPORT, "a request to dig of version %u, not %d", major,
                        DIG_VERSION_MAJOR);
    if (told != size)
        return diag_set(diag, -EBADMSG, "a request to dig of %u bytes in a datagram of %zu", told,
                        size);
    if (message.session == 0 || message.session > DIG_SESSION_MAX)
        return diag_set(diag, -EBADMSG, "a request to dig of session %u: it may be 1 to %d",
                        message.session, DIG_SESSION_MAX);
    int r = take_rest(&reader, &message, diag);
    if (r == 0)
        *ret_message = message;
    return r;
}

size_t dig_message_encode(const struct dig_message *message, uint8_t ret_data[DIG_MESSAGE_MAX])
{
    struct byte_writer writer = {.data = ret_data, .size = DIG_HEAD};
    const void *rest = message->kind == DIG_ADD ? (const void *)message->body : message->text;
    size_t rest_size = message->kind == DIG_ADD      ? message->size
                       : message->kind == DIG_ANSWER ? strlen(message->text)
                                                     : 0;
    if (rest_size > DIG_MESSAGE_MAX - DIG_HEAD)
        return 0;
    byte_writer_put(&writer, DIG_MAGIC, 4, true);
    byte_writer_put(&writer, DIG_VERSION_MAJOR, 1, true);
    byte_writer_put(&writer, 0, 1, true);
    byte_writer_put(&writer, DIG_HEAD + rest_size, 2, true);
    byte_writer_put(&writer, message->session, 4, true);
    byte_writer_put(&writer, message->request, 4, true);
    byte_writer_put(&writer, message->kind, 1, true);
    byte_writer_put(&writer, message->status, 1, true);
    byte_writer_put(&writer, 0, 2, true);
    byte_writer_put(&writer, message->count, 4, true);
    byte_writer_put(&writer, message->id, 8, true);
    if (rest_size)
        memcpy(ret_data + DIG_HEAD, rest, rest_size);
    return DIG_HEAD + rest_size;
}
