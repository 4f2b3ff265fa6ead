#include "io/swap_lock.h"

#include <stdlib.h>

#include "base/bytes.h"
#include "io/crc32.h"

#define VERSION_MAJOR 1
#define CRC_OFFSET    28
#define TELLS         4  /* how often a ready frame is told within the time-out */
#define REORDERED     64 /* frames by which a message may be older than the one before it */

void swap_message_encode(const struct swap_message *message, uint8_t ret_data[SWAP_MESSAGE_SIZE])
{
    struct byte_writer writer = {.data = ret_data, .size = SWAP_MESSAGE_SIZE};
    byte_writer_put(&writer, SWAP_MAGIC, 4, true);
    byte_writer_put(&writer, VERSION_MAJOR, 1, true);
    byte_writer_put(&writer, 0, 1, true);
    byte_writer_put(&writer, SWAP_MESSAGE_SIZE, 2, true);
    byte_writer_put(&writer, message->kind, 1, true);
    byte_writer_put(&writer, message->label.base, 1, true);
    byte_writer_put(&writer, message->channel, 1, true);
    byte_writer_put(&writer, message->channels, 1, true);
    byte_writer_put(&writer, message->label.number, 4, true);
    byte_writer_put(&writer, (uint64_t)message->realtime_ns, 8, true);
    byte_writer_put(&writer, message->session, 4, true);
    byte_writer_put(&writer, crc32_of_bytes(0, ret_data, CRC_OFFSET), 4, true);
}

static int check_head(struct byte_reader *in, struct rejection *ret_rejection)
{
    if (in->size < SWAP_MESSAGE_SIZE)
        return reject(ret_rejection, REJECT_SHORT, in->size, "it ends at byte %zu of %d", in->size,
                      SWAP_MESSAGE_SIZE);
    uint32_t magic = read_u32be(in);
    unsigned major = read_u8(in);
    read_u8(in); /* minor: may append */
    unsigned size = read_u16be(in);
    if (magic != SWAP_MAGIC)
        return reject(ret_rejection, REJECT_MAGIC, 0, "it begins with %08x, not with %08x", magic,
                      SWAP_MAGIC);
    if (major != VERSION_MAJOR)
        return reject(ret_rejection, REJECT_VERSION, 4, "version %u, not %d", major, VERSION_MAJOR);
    if (size != in->size)
        return reject(ret_rejection, REJECT_LENGTH, 6, "it says %u bytes and has %zu", size,
                      in->size);
    return 0;
}

int swap_message_decode(const void *data, size_t size, struct swap_message *ret_message,
                        struct rejection *ret_rejection)
{
    struct byte_reader in = byte_reader_over(data, size);
    int r = check_head(&in, ret_rejection);
    if (r < 0)
        return r;
    struct swap_message message;
    unsigned kind = read_u8(&in), base = read_u8(&in);
    message.kind = (enum swap_kind)kind;
    message.label.base = (enum swap_base)base;
    message.channel = read_u8(&in);
    message.channels = read_u8(&in);
    message.label.number = read_u32be(&in);
    message.realtime_ns = (nsec_t)read_u64be(&in);
    message.session = read_u32be(&in);
    if (read_u32be(&in) != crc32_of_bytes(0, data, CRC_OFFSET))
        return reject(ret_rejection, REJECT_FIELD, CRC_OFFSET, "its checksum is wrong");
    if (kind < SWAP_READY || kind > SWAP_LEAVE || base > SWAP_HOST || message.channel == 0 ||
        message.channel > message.channels || message.channels > SWAP_CHANNELS_MAX)
        return reject(ret_rejection, REJECT_FIELD, 8, "kind %u, base %u, channel %u of %u", kind,
                      base, message.channel, message.channels);
    *ret_message = message;
    return 0;
}

static bool same(struct swap_label a, struct swap_label b)
{
    return a.base == b.base && a.number == b.number;
}

/* By how many frames `a` is later than `b`, of the same base. */
static int32_t later(struct swap_label a, struct swap_label b)
{
    return (int32_t)(a.number - b.number);
}

/* `a` is `b` or shortly after it. */
static bool reaches(struct swap_label a, struct swap_label b)
{
    return a.base == b.base && later(a, b) >= 0 && later(a, b) <= REORDERED;
}

void swap_lock_init(struct swap_lock *lock, const struct swap_params *params)
{
    *lock = (struct swap_lock){.params = *params};
    for (unsigned i = 0; i < params->channels; i++)
        lock->peers[i].in = i + 1 != params->channel;
}

/* What was shown `back` frames ago; NULL where nothing was. */
static const struct swap_shown *shown_before(const struct swap_lock *lock, unsigned back)
{
    if (back >= SWAP_HISTORY || back >= lock->shown)
        return NULL;
    return &lock->history[(lock->shown - 1 - back) % SWAP_HISTORY];
}

static const struct swap_shown *find_shown(const struct swap_lock *lock, struct swap_label label)
{
    const struct swap_shown *shown;
    for (unsigned i = 0; (shown = shown_before(lock, i)); i++)
        if (same(shown->label, label))
            return shown;
    return NULL;
}

/* A channel that says this would not have been waited for in vain: it is at least at what was shown
 * a time-out ago, or later than all that was shown. */
static bool is_timely(const struct swap_lock *lock, struct swap_label label, nsec_t now_ns)
{
    const struct swap_shown *shown = shown_before(lock, 0);
    if (!shown || reaches(label, lock->label) ||
        (reaches(label, shown->label) && !same(label, shown->label)))
        return true;
    for (unsigned i = 0; (shown = shown_before(lock, i)); i++)
        if (now_ns - shown->monotonic_ns <= lock->params.timeout_ns && reaches(label, shown->label))
            return true;
    return false;
}

static void measure_skew(struct swap_lock *lock, const struct swap_peer *peer, nsec_t realtime_ns)
{
    nsec_t skew_ns = llabs(peer->shown_realtime_ns - realtime_ns);
    if (skew_ns > lock->counts.skew_worst_ns)
        lock->counts.skew_worst_ns = skew_ns;
}

static void note_shown(struct swap_lock *lock, struct swap_peer *peer,
                       const struct swap_message *message)
{
    const struct swap_shown *shown = find_shown(lock, message->label);
    bool again = peer->has_shown && same(peer->shown, message->label);
    peer->has_shown = true;
    peer->shown = message->label;
    peer->shown_realtime_ns = message->realtime_ns;
    if (shown && peer->in && !again)
        measure_skew(lock, peer, shown->realtime_ns);
}

static void give_up(struct swap_peer *peer)
{
    *peer = (struct swap_peer){.session = peer->session};
}

static void hear(struct swap_lock *lock, struct swap_peer *peer, const struct swap_message *message,
                 nsec_t now_ns)
{
    if (peer->heard && peer->session != message->session)
        *peer = (struct swap_peer){.in = peer->in};
    peer->session = message->session;
    peer->heard = true;
    peer->heard_ns = now_ns;
    peer->passes = message->kind == SWAP_PASS;
    if (message->kind == SWAP_LEAVE)
        give_up(peer);
    if (message->kind == SWAP_LEAVE || message->kind == SWAP_PASS)
        return;
    if (peer->has_ready && reaches(peer->ready, message->label) &&
        !same(peer->ready, message->label))
        return; /* overtaken by a later one */
    peer->has_ready = true;
    peer->ready = message->label;
    peer->in = peer->in || is_timely(lock, message->label, now_ns);
    if (message->kind == SWAP_SHOW)
        note_shown(lock, peer, message);
}

void swap_lock_take(struct swap_lock *lock, const struct swap_message *message, nsec_t now_ns)
{
    const struct swap_params *own = &lock->params;
    if (message->session == own->session && message->channel == own->channel)
        return;
    if (message->channels != own->channels)
        lock->counts.strangers++;
    else if (message->channel == own->channel)
        lock->counts.namesakes++;
    else
        hear(lock, &lock->peers[message->channel - 1], message, now_ns);
}

bool swap_lock_was_shown(const struct swap_lock *lock, struct swap_label label)
{
    const struct swap_shown *last = shown_before(lock, 0);
    return last && same(last->label, label);
}

void swap_lock_begin(struct swap_lock *lock, struct swap_label label, nsec_t now_ns)
{
    lock->label = label;
    lock->since_ns = lock->told_ns = now_ns;
}

/* What is counted otherwise cannot be waited for. */
static bool holds_up(const struct swap_lock *lock, const struct swap_peer *peer)
{
    if (!peer->in || peer->passes)
        return false;
    return !peer->has_ready ||
           (peer->ready.base == lock->label.base && later(peer->ready, lock->label) < 0);
}

static bool all_ready(const struct swap_lock *lock)
{
    for (unsigned i = 0; i < lock->params.channels; i++)
        if (holds_up(lock, &lock->peers[i]))
            return false;
    return true;
}

static bool shown_elsewhere(const struct swap_lock *lock)
{
    for (unsigned i = 0; i < lock->params.channels; i++) {
        const struct swap_peer *peer = &lock->peers[i];
        if (peer->in && peer->has_shown && reaches(peer->shown, lock->label))
            return true;
    }
    return false;
}

static bool is_late(const struct swap_lock *lock, nsec_t now_ns)
{
    return now_ns - lock->since_ns >= lock->params.timeout_ns;
}

bool swap_lock_may_show(const struct swap_lock *lock, nsec_t now_ns)
{
    return is_late(lock, now_ns) || all_ready(lock) || shown_elsewhere(lock);
}

nsec_t swap_lock_next_ns(const struct swap_lock *lock)
{
    nsec_t tell_ns = lock->told_ns + lock->params.timeout_ns / TELLS;
    nsec_t end_ns = lock->since_ns + lock->params.timeout_ns;
    return tell_ns < end_ns ? tell_ns : end_ns;
}

bool swap_lock_retell(struct swap_lock *lock, nsec_t now_ns)
{
    if (now_ns - lock->told_ns < lock->params.timeout_ns / TELLS)
        return false;
    lock->told_ns = now_ns;
    return true;
}

/* A channel in step has shown this frame, or the one that we showed before it, last. */
static bool is_in_step(const struct swap_lock *lock)
{
    const struct swap_shown *last = shown_before(lock, 0);
    for (unsigned i = 0; last && i < lock->params.channels; i++) {
        const struct swap_peer *peer = &lock->peers[i];
        if (peer->in && peer->has_shown && !same(peer->shown, lock->label) &&
            !same(peer->shown, last->label))
            return false;
    }
    return true;
}

/* Only those who count frames by the same base make one picture. */
static bool counts_alike(const struct swap_lock *lock, const struct swap_peer *peer)
{
    return !peer->has_ready || peer->ready.base == lock->label.base;
}

/* A channel that counts ticks where another hears the host cannot speak to it for all. */
static bool misses_the_host(const struct swap_lock *lock, nsec_t now_ns)
{
    for (unsigned i = 0; lock->label.base == SWAP_TICKS && i < lock->params.channels; i++) {
        const struct swap_peer *peer = &lock->peers[i];
        if (peer->heard && now_ns - peer->heard_ns < lock->params.timeout_ns &&
            !counts_alike(lock, peer))
            return true;
    }
    return false;
}

void swap_lock_show(struct swap_lock *lock, nsec_t now_ns, nsec_t realtime_ns)
{
    bool late = is_late(lock, now_ns) && !all_ready(lock) && !shown_elsewhere(lock);
    lock->counts.frames++;
    lock->counts.timeouts += late;
    lock->counts.out_of_step += !is_in_step(lock);
    lock->counts.present = 1;
    lock->may_speak = !misses_the_host(lock, now_ns);
    for (unsigned i = 0; i < lock->params.channels; i++) {
        struct swap_peer *peer = &lock->peers[i];
        if (holds_up(lock, peer) || !counts_alike(lock, peer))
            give_up(peer); /* it joins again by its next message that is in time */
        if (peer->in && peer->has_shown && same(peer->shown, lock->label))
            measure_skew(lock, peer, realtime_ns);
        lock->counts.present += peer->in;
        peer->passes = false;
    }
    lock->history[lock->shown++ % SWAP_HISTORY] =
        (struct swap_shown){lock->label, now_ns, realtime_ns};
}

void swap_lock_pass(struct swap_lock *lock, nsec_t now_ns)
{
    lock->counts.present = 1;
    for (unsigned i = 0; i < lock->params.channels; i++) {
        struct swap_peer *peer = &lock->peers[i];
        if (peer->in && now_ns - peer->heard_ns >= lock->params.timeout_ns)
            give_up(peer);
        lock->counts.present += peer->in;
    }
}

unsigned swap_lock_ahead(const struct swap_lock *lock)
{
    const struct swap_shown *last = shown_before(lock, 0);
    int32_t most = 0;
    for (unsigned i = 0; last && i < lock->params.channels; i++) {
        const struct swap_peer *peer = &lock->peers[i];
        if (peer->in && peer->has_ready && reaches(peer->ready, last->label) &&
            later(peer->ready, last->label) > most)
            most = later(peer->ready, last->label);
    }
    return (unsigned)most;
}

bool swap_lock_speaks(const struct swap_lock *lock)
{
    for (unsigned i = 0; i + 1 < lock->params.channel; i++)
        if (lock->peers[i].in)
            return false;
    return lock->may_speak;
}

struct swap_message swap_lock_message(const struct swap_lock *lock, enum swap_kind kind,
                                      nsec_t realtime_ns)
{
    return (struct swap_message){.kind = kind,
                                 .label = lock->label,
                                 .channel = lock->params.channel,
                                 .channels = lock->params.channels,
                                 .session = lock->params.session,
                                 .realtime_ns = realtime_ns};
}
