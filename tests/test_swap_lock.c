/* The swap lock: its datagram, and channels that run on a simulated clock and network. */
#include "io/swap_lock.h"
#include "tests/check.h"

#define STEP_NS    (NSEC_PER_MSEC / 10)
#define PERIOD_NS  (16 * NSEC_PER_MSEC)
#define TIMEOUT_NS (50 * NSEC_PER_MSEC)
#define CHANNELS   3
#define IN_FLIGHT  4096

struct in_flight {
    nsec_t arrives_ns;
    unsigned to; /* 0 = free */
    struct swap_message message;
};

enum what { SLEEPS, DRAWS, WAITS };

struct channel {
    struct swap_lock lock;
    bool alive,
        blind; /* blind: hears no host, and counts ticks where the others count its frames */
    enum what what;
    nsec_t until_ns, draw_ns, wait_most_ns;
    struct swap_label drawn, shown;
    nsec_t shown_ns;
    unsigned ahead; /* of what was shown: a tick that others wait with */
};

/* Frames of all channels begin at multiples of a period, as the daemon's do. */
struct world {
    nsec_t now_ns, delay_ns;
    struct channel channels[CHANNELS];
    struct in_flight net[IN_FLIGHT];
    bool (*loses)(struct world *world, unsigned from, unsigned to, const struct swap_message *m);
    uint32_t random, first_number, sessions;
    enum swap_base base;
    nsec_t skew_most_ns; /* between two showings of one frame */
};

static uint32_t next_random(struct world *world)
{
    world->random = world->random * 1664525u + 1013904223u;
    return world->random >> 8;
}

static void send_to_all(struct world *world, unsigned from, enum swap_kind kind)
{
    struct swap_message message =
        swap_lock_message(&world->channels[from - 1].lock, kind, world->now_ns);
    for (unsigned to = 1, i = 0; to <= CHANNELS; to++) {
        if (world->loses && world->loses(world, from, to, &message))
            continue;
        while (i < IN_FLIGHT && world->net[i].to)
            i++;
        if (i < IN_FLIGHT)
            world->net[i] = (struct in_flight){world->now_ns + world->delay_ns, to, message};
    }
}

static void deliver(struct world *world)
{
    for (unsigned i = 0; i < IN_FLIGHT; i++) {
        struct in_flight *item = &world->net[i];
        if (item->to == 0 || item->arrives_ns > world->now_ns)
            continue;
        struct channel *channel = &world->channels[item->to - 1];
        if (channel->alive)
            swap_lock_take(&channel->lock, &item->message, world->now_ns);
        item->to = 0;
    }
}

static void start(struct world *world, unsigned number)
{
    struct channel *channel = &world->channels[number - 1];
    const struct swap_params params = {.channel = number,
                                       .channels = CHANNELS,
                                       .session = ++world->sessions,
                                       .timeout_ns = TIMEOUT_NS};
    *channel = (struct channel){.alive = true, .draw_ns = (nsec_t)(3 + number) * NSEC_PER_MSEC};
    swap_lock_init(&channel->lock, &params);
}

static struct world *make_world(void)
{
    static struct world world;
    world = (struct world){.delay_ns = STEP_NS, .random = 1};
    for (unsigned i = 1; i <= CHANNELS; i++)
        start(&world, i);
    return &world;
}

static struct swap_label label_now(const struct world *world, const struct channel *channel)
{
    uint32_t number = (uint32_t)(world->now_ns / PERIOD_NS) + world->first_number;
    return (struct swap_label){channel->blind ? SWAP_TICKS : world->base, number};
}

static void show(struct world *world, unsigned number)
{
    struct channel *channel = &world->channels[number - 1];
    nsec_t waited_ns = world->now_ns - channel->lock.since_ns;
    if (waited_ns > channel->wait_most_ns)
        channel->wait_most_ns = waited_ns;
    swap_lock_show(&channel->lock, world->now_ns, world->now_ns);
    send_to_all(world, number, SWAP_SHOW);
    channel->shown = channel->lock.label;
    channel->shown_ns = world->now_ns;
    channel->what = SLEEPS;
    channel->until_ns = (world->now_ns / PERIOD_NS + 1) * PERIOD_NS;
    channel->ahead = world->base == SWAP_TICKS ? swap_lock_ahead(&channel->lock) : 0;
    if (channel->ahead > 0)
        channel->until_ns = world->now_ns;
    for (unsigned i = 0; i < CHANNELS; i++) {
        const struct channel *other = &world->channels[i];
        if (other->alive && other->shown_ns && other->shown.number == channel->shown.number &&
            world->now_ns - other->shown_ns > world->skew_most_ns)
            world->skew_most_ns = world->now_ns - other->shown_ns;
    }
}

static void advance(struct world *world, unsigned number)
{
    struct channel *channel = &world->channels[number - 1];
    if (!channel->alive)
        return;
    if (channel->what == SLEEPS && world->now_ns >= channel->until_ns) {
        channel->what = DRAWS;
        channel->until_ns = world->now_ns + channel->draw_ns;
        channel->drawn = label_now(world, channel);
        if (channel->ahead > 0)
            channel->drawn.number = channel->shown.number + channel->ahead;
    } else if (channel->what == DRAWS && world->now_ns >= channel->until_ns) {
        channel->what = WAITS;
        swap_lock_begin(&channel->lock, channel->drawn, world->now_ns);
        send_to_all(world, number, SWAP_READY);
    }
    if (channel->what != WAITS)
        return;
    if (swap_lock_may_show(&channel->lock, world->now_ns))
        show(world, number);
    else if (swap_lock_retell(&channel->lock, world->now_ns))
        send_to_all(world, number, SWAP_READY);
}

static void run(struct world *world, nsec_t for_ns)
{
    for (nsec_t end_ns = world->now_ns + for_ns; world->now_ns < end_ns; world->now_ns += STEP_NS) {
        deliver(world);
        for (unsigned i = 1; i <= CHANNELS; i++)
            advance(world, i);
    }
}

static const struct swap_counts *counts(const struct world *world, unsigned channel)
{
    return &world->channels[channel - 1].lock.counts;
}

static void the_datagram_is_as_documented(void)
{
    const struct swap_message message = {.kind = SWAP_SHOW,
                                         .label = {SWAP_HOST, 0x01020304},
                                         .channel = 2,
                                         .channels = 3,
                                         .session = 0xcafe0001,
                                         .realtime_ns = 0x1122334455667788};
    uint8_t data[SWAP_MESSAGE_SIZE];
    struct swap_message back;
    swap_message_encode(&message, data);
    static const uint8_t expected[28] = {0x4f, 0x54, 0x57, 0x53, 1,    0,    0,    32,   2,    1,
                                         2,    3,    1,    2,    3,    4,    0x11, 0x22, 0x33, 0x44,
                                         0x55, 0x66, 0x77, 0x88, 0xca, 0xfe, 0x00, 0x01};
    CHECK_INT(memcmp(data, expected, sizeof(expected)), 0);
    CHECK_INT(swap_message_decode(data, sizeof(data), &back, NULL), 0);
    CHECK_INT(back.kind, message.kind);
    CHECK_INT(back.label.base, message.label.base);
    CHECK_INT(back.label.number, message.label.number);
    CHECK_INT(back.channel, 2);
    CHECK_INT(back.channels, 3);
    CHECK_INT(back.session, message.session);
    CHECK_INT(back.realtime_ns, message.realtime_ns);
}

static enum reject_reason reason_of(const uint8_t *data, size_t size)
{
    struct swap_message message;
    struct rejection why = {0};
    return swap_message_decode(data, size, &message, &why) < 0 ? why.reason : REJECT_NONE;
}

static void what_is_no_message_is_refused(void)
{
    struct swap_message message = {
        .kind = SWAP_READY, .channel = 1, .channels = 2, .session = 1, .label = {SWAP_TICKS, 5}};
    uint8_t good[SWAP_MESSAGE_SIZE], data[SWAP_MESSAGE_SIZE + 1] = {0};
    swap_message_encode(&message, good);
    CHECK_INT(reason_of(good, sizeof(good)), REJECT_NONE);
    CHECK_INT(reason_of(good, sizeof(good) - 1), REJECT_SHORT);
    CHECK_INT(reason_of(good, 0), REJECT_SHORT);
    memcpy(data, good, sizeof(good));
    CHECK_INT(reason_of(data, sizeof(data)), REJECT_LENGTH);
    for (size_t bit = 0; bit < 8 * sizeof(good); bit++) {
        memcpy(data, good, sizeof(good));
        data[bit / 8] ^= (uint8_t)(1u << bit % 8);
        CHECK(reason_of(data, sizeof(good)) != REJECT_NONE);
    }
    for (int i = 0; i < 4; i++) {
        static const struct swap_message wrong[] = {
            {.kind = 5, .channel = 1, .channels = 2},
            {.kind = SWAP_READY, .label = {2, 0}, .channel = 1, .channels = 2},
            {.kind = SWAP_READY, .channel = 0, .channels = 2},
            {.kind = SWAP_READY, .channel = 3, .channels = 2},
        };
        swap_message_encode(&wrong[i], data);
        CHECK_INT(reason_of(data, sizeof(good)), REJECT_FIELD);
    }
}

static void three_channels_show_each_frame_together(void)
{
    struct world *world = make_world();
    run(world, 10 * NSEC_PER_SEC);
    for (unsigned i = 1; i <= CHANNELS; i++) {
        CHECK(counts(world, i)->frames > 600);
        CHECK_INT(counts(world, i)->timeouts, 0);
        CHECK_INT(counts(world, i)->out_of_step, 0);
        CHECK_INT(counts(world, i)->present, 3);
        CHECK(counts(world, i)->skew_worst_ns <= 2 * STEP_NS);
    }
    CHECK(world->skew_most_ns <= 2 * STEP_NS);
}

static void a_dead_channel_costs_the_others_one_time_out_and_joins_when_it_is_back(void)
{
    struct world *world = make_world();
    run(world, NSEC_PER_SEC);
    world->channels[0].alive = false;
    run(world, NSEC_PER_SEC);
    for (unsigned i = 2; i <= CHANNELS; i++) {
        CHECK(counts(world, i)->timeouts <= 1); /* the other one may have told it */
        CHECK_INT(counts(world, i)->out_of_step, 0);
        CHECK_INT(counts(world, i)->present, 2);
        CHECK(world->channels[i - 1].wait_most_ns <= TIMEOUT_NS);
        CHECK(counts(world, i)->frames >= 120 - 4);
    }
    CHECK(counts(world, 2)->timeouts + counts(world, 3)->timeouts >= 1);
    start(world, 1);
    run(world, NSEC_PER_SEC);
    world->skew_most_ns = 0;
    run(world, NSEC_PER_SEC);
    for (unsigned i = 1; i <= CHANNELS; i++)
        CHECK_INT(counts(world, i)->present, 3);
    CHECK_INT(counts(world, 1)->timeouts, 0);
    CHECK(counts(world, 2)->timeouts <= 1);
    CHECK(world->skew_most_ns <= 2 * STEP_NS);
}

static void a_channel_that_leaves_costs_nothing(void)
{
    struct world *world = make_world();
    run(world, NSEC_PER_SEC);
    send_to_all(world, 3, SWAP_LEAVE);
    world->channels[2].alive = false;
    run(world, NSEC_PER_SEC);
    for (unsigned i = 1; i <= 2; i++) {
        CHECK_INT(counts(world, i)->timeouts, 0);
        CHECK_INT(counts(world, i)->present, 2);
    }
}

static void a_channel_alone_waits_once(void)
{
    struct world *world = make_world();
    world->channels[1].alive = world->channels[2].alive = false;
    run(world, NSEC_PER_SEC);
    CHECK_INT(counts(world, 1)->timeouts, 1);
    CHECK_INT(counts(world, 1)->present, 1);
    CHECK(counts(world, 1)->frames > 55);
    CHECK(swap_lock_speaks(&world->channels[0].lock));
}

static bool loses_ready_of_1_to_2(struct world *world, unsigned from, unsigned to,
                                  const struct swap_message *m)
{
    return from == 1 && to == 2 && m->kind == SWAP_READY;
}

static void a_lost_message_is_made_up_for_by_those_who_heard_it(void)
{
    struct world *world = make_world();
    world->loses = loses_ready_of_1_to_2;
    run(world, NSEC_PER_SEC);
    for (unsigned i = 1; i <= CHANNELS; i++) {
        CHECK_INT(counts(world, i)->timeouts, 0);
        CHECK(counts(world, i)->frames > 58);
        CHECK(counts(world, i)->skew_worst_ns <= 2 * STEP_NS);
    }
}

static bool loses_every_first_ready(struct world *world, unsigned from, unsigned to,
                                    const struct swap_message *m)
{
    return m->kind == SWAP_READY && world->channels[from - 1].lock.since_ns == world->now_ns &&
           from != to;
}

static void what_nobody_heard_is_said_again(void)
{
    struct world *world = make_world();
    world->loses = loses_every_first_ready;
    run(world, NSEC_PER_SEC);
    for (unsigned i = 1; i <= CHANNELS; i++)
        CHECK_INT(counts(world, i)->timeouts, 0);
}

static void a_channel_that_is_always_too_slow_does_not_slow_the_others(void)
{
    struct world *world = make_world();
    world->channels[1].draw_ns = 25 * PERIOD_NS / 2;
    run(world, 10 * NSEC_PER_SEC);
    CHECK(counts(world, 1)->frames > 600);
    CHECK(counts(world, 1)->timeouts <= 1);
    CHECK(counts(world, 3)->timeouts <= 1);
    CHECK_INT(counts(world, 1)->present, 2);
    world->channels[1].draw_ns = 5 * NSEC_PER_MSEC;
    run(world, NSEC_PER_SEC);
    for (unsigned i = 1; i <= CHANNELS; i++)
        CHECK_INT(counts(world, i)->present, 3);
}

static bool parts_1_from_the_others(struct world *world, unsigned from, unsigned to,
                                    const struct swap_message *m)
{
    return (from == 1) != (to == 1);
}

static void each_part_of_a_divided_network_goes_on_and_both_find_together(void)
{
    struct world *world = make_world();
    run(world, NSEC_PER_SEC);
    world->loses = parts_1_from_the_others;
    run(world, NSEC_PER_SEC);
    CHECK_INT(counts(world, 1)->present, 1);
    CHECK_INT(counts(world, 2)->present, 2);
    CHECK_INT(counts(world, 3)->present, 2);
    for (unsigned i = 1; i <= CHANNELS; i++)
        CHECK(counts(world, i)->frames >= 120 - 4);
    world->loses = NULL;
    run(world, NSEC_PER_SEC / 2);
    world->skew_most_ns = 0;
    run(world, NSEC_PER_SEC / 2);
    for (unsigned i = 1; i <= CHANNELS; i++)
        CHECK_INT(counts(world, i)->present, 3);
    CHECK(world->skew_most_ns <= 2 * STEP_NS);
}

static bool loses_a_fifth(struct world *world, unsigned from, unsigned to,
                          const struct swap_message *m)
{
    return next_random(world) % 5 == 0;
}

static void nobody_ever_waits_longer_than_the_time_out(void)
{
    struct world *world = make_world();
    world->loses = loses_a_fifth;
    for (int i = 0; i < 200; i++) {
        struct channel *channel = &world->channels[next_random(world) % CHANNELS];
        channel->draw_ns = (nsec_t)(next_random(world) % 40) * NSEC_PER_MSEC;
        world->delay_ns = (nsec_t)(next_random(world) % 30) * STEP_NS;
        run(world, 100 * NSEC_PER_MSEC);
    }
    for (unsigned i = 1; i <= CHANNELS; i++) {
        CHECK(world->channels[i - 1].wait_most_ns <= TIMEOUT_NS);
        CHECK(counts(world, i)->frames > 200);
        world->channels[i - 1].draw_ns = 5 * NSEC_PER_MSEC;
    }
    world->loses = NULL;
    world->delay_ns = STEP_NS;
    run(world, NSEC_PER_SEC);
    world->skew_most_ns = 0;
    run(world, NSEC_PER_SEC);
    CHECK(world->skew_most_ns <= 2 * STEP_NS);
    for (unsigned i = 1; i <= CHANNELS; i++)
        CHECK_INT(counts(world, i)->present, 3);
}

/* Each would wait for the one before it with a tick of its own, for ever. */
static void channels_that_begin_apart_find_one_tick(void)
{
    struct world *world = make_world();
    for (unsigned i = 0; i < CHANNELS; i++) {
        world->channels[i].draw_ns = 3 * PERIOD_NS / 4;
        world->channels[i].until_ns = (nsec_t)(i + 1) * PERIOD_NS;
    }
    run(world, 20 * PERIOD_NS);
    uint64_t shown = counts(world, 1)->frames, apart = counts(world, 1)->out_of_step;
    run(world, 50 * PERIOD_NS);
    CHECK(counts(world, 1)->frames >= shown + 40);
    CHECK_INT(counts(world, 1)->out_of_step, apart);
    CHECK_INT(counts(world, 2)->timeouts + counts(world, 3)->timeouts, 0);
    CHECK_INT(swap_lock_ahead(&world->channels[0].lock), 0);
}

static void frame_numbers_wrap(void)
{
    struct world *world = make_world();
    world->first_number = UINT32_MAX - 30;
    run(world, NSEC_PER_SEC);
    CHECK(world->channels[0].shown.number < 40);
    for (unsigned i = 1; i <= CHANNELS; i++) {
        CHECK_INT(counts(world, i)->timeouts, 0);
        CHECK_INT(counts(world, i)->out_of_step, 0);
    }
}

static void a_host_that_begins_anew_is_followed(void)
{
    struct world *world = make_world();
    world->base = SWAP_HOST;
    world->first_number = 100000;
    run(world, NSEC_PER_SEC);
    world->first_number = 0;
    run(world, NSEC_PER_SEC);
    for (unsigned i = 1; i <= CHANNELS; i++) {
        CHECK_INT(counts(world, i)->timeouts, 0);
        CHECK_INT(counts(world, i)->present, 3);
        CHECK(counts(world, i)->out_of_step <= 1);
    }
}

static void the_first_channel_in_step_speaks_to_the_host(void)
{
    struct world *world = make_world();
    world->base = SWAP_HOST;
    CHECK(!swap_lock_speaks(&world->channels[0].lock)); /* nothing is known yet */
    run(world, NSEC_PER_SEC);
    CHECK(swap_lock_speaks(&world->channels[0].lock));
    CHECK(!swap_lock_speaks(&world->channels[1].lock));
    CHECK(!swap_lock_speaks(&world->channels[2].lock));
    world->channels[0].alive = false;
    run(world, NSEC_PER_SEC);
    CHECK(swap_lock_speaks(&world->channels[1].lock));
    CHECK(!swap_lock_speaks(&world->channels[2].lock));
    start(world, 1); /* it does not hear the host: it is not in step */
    world->channels[0].blind = true;
    run(world, NSEC_PER_SEC);
    CHECK(!swap_lock_speaks(&world->channels[0].lock));
    CHECK(swap_lock_speaks(&world->channels[1].lock));
    CHECK_INT(counts(world, 2)->present, 2);
    CHECK_INT(counts(world, 2)->timeouts, 1);
    world->channels[0].blind = false;
    run(world, NSEC_PER_SEC);
    CHECK(swap_lock_speaks(&world->channels[0].lock));
    CHECK(!swap_lock_speaks(&world->channels[1].lock));
}

/* Two channels at the first frame after `shown`: 1 is ready with it, 2 has not got it. */
static void who_has_nothing_newer_is_not_waited_for(void)
{
    struct swap_lock one;
    const struct swap_params params = {
        .channel = 1, .channels = 2, .session = 1, .timeout_ns = TIMEOUT_NS};
    struct swap_message other = {
        .kind = SWAP_READY, .label = {SWAP_HOST, 7}, .channel = 2, .channels = 2, .session = 2};
    swap_lock_init(&one, &params);
    swap_lock_begin(&one, other.label, 0);
    CHECK(!swap_lock_may_show(&one, 0));
    swap_lock_take(&one, &other, 1);
    CHECK(swap_lock_may_show(&one, 1));
    swap_lock_show(&one, 1, 1);
    other.kind = SWAP_SHOW;
    swap_lock_take(&one, &other, 2);
    CHECK(swap_lock_was_shown(&one, other.label));
    swap_lock_begin(&one, (struct swap_label){SWAP_HOST, 8}, 10);
    CHECK(!swap_lock_may_show(&one, 10));
    other.kind = SWAP_PASS;
    swap_lock_take(&one, &other, 11);
    CHECK(swap_lock_may_show(&one, 11));
    swap_lock_show(&one, 11, 11);
    CHECK_INT(one.counts.timeouts, 0);
    CHECK_INT(one.counts.present, 2);
    CHECK_INT(one.counts.out_of_step, 0); /* both stood at 7 when 8 came */
    other.kind = SWAP_READY;
    other.label.number = 9;
    swap_lock_begin(&one, other.label, 20);
    CHECK(!swap_lock_may_show(&one, 20)); /* it passed that frame, not all */
    swap_lock_take(&one, &other, 21);
    CHECK(swap_lock_may_show(&one, 21));
    swap_lock_show(&one, 21, 21);
    CHECK_INT(one.counts.out_of_step, 1); /* the other one showed 7 until now, we 8 */
}

static void who_dies_while_there_is_nothing_to_show_is_given_up(void)
{
    struct swap_lock two;
    const struct swap_params params = {
        .channel = 2, .channels = 2, .session = 2, .timeout_ns = TIMEOUT_NS};
    const struct swap_message one = {
        .kind = SWAP_READY, .label = {SWAP_HOST, 7}, .channel = 1, .channels = 2, .session = 1};
    swap_lock_init(&two, &params);
    swap_lock_begin(&two, one.label, 0);
    swap_lock_take(&two, &one, 1);
    swap_lock_show(&two, 1, 1);
    CHECK(!swap_lock_speaks(&two));
    swap_lock_pass(&two, TIMEOUT_NS);
    CHECK(!swap_lock_speaks(&two)); /* it was heard less than the time-out ago */
    CHECK_INT(two.counts.present, 2);
    swap_lock_pass(&two, TIMEOUT_NS + 1);
    CHECK(swap_lock_speaks(&two)); /* the host is asked again */
    CHECK_INT(two.counts.present, 1);
}

static void strangers_and_namesakes_are_counted_and_not_followed(void)
{
    struct swap_lock lock;
    const struct swap_params params = {
        .channel = 1, .channels = 2, .session = 1, .timeout_ns = TIMEOUT_NS};
    struct swap_message message = {
        .kind = SWAP_SHOW, .label = {SWAP_HOST, 7}, .channel = 2, .channels = 3, .session = 2};
    swap_lock_init(&lock, &params);
    swap_lock_begin(&lock, message.label, 0);
    swap_lock_take(&lock, &message, 1);
    CHECK_INT(lock.counts.strangers, 1);
    message.channels = 2;
    message.channel = 1;
    swap_lock_take(&lock, &message, 1);
    CHECK_INT(lock.counts.namesakes, 1);
    message.session = 1; /* ourselves */
    swap_lock_take(&lock, &message, 1);
    CHECK_INT(lock.counts.namesakes, 1);
    CHECK(!swap_lock_may_show(&lock, 1));
}

static void skew_is_told_by_the_shared_clock(void)
{
    struct swap_lock lock;
    const struct swap_params params = {
        .channel = 1, .channels = 2, .session = 1, .timeout_ns = TIMEOUT_NS};
    struct swap_message message = {.kind = SWAP_SHOW,
                                   .label = {SWAP_HOST, 7},
                                   .channel = 2,
                                   .channels = 2,
                                   .session = 2,
                                   .realtime_ns = 1000};
    swap_lock_init(&lock, &params);
    swap_lock_begin(&lock, message.label, 0);
    swap_lock_take(&lock, &message, 1); /* shown there before it is here */
    swap_lock_show(&lock, 1, 1300);
    CHECK_INT(lock.counts.skew_worst_ns, 300);
    message.label.number = 8;
    swap_lock_begin(&lock, message.label, 2);
    message.kind = SWAP_READY;
    swap_lock_take(&lock, &message, 3);
    swap_lock_show(&lock, 3, 5000);
    message.kind = SWAP_SHOW; /* and after it */
    message.realtime_ns = 5500;
    swap_lock_take(&lock, &message, 4);
    CHECK_INT(lock.counts.skew_worst_ns, 500);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"the datagram is as documented", the_datagram_is_as_documented},
        {"what is no message is refused", what_is_no_message_is_refused},
        {"three channels show each frame together", three_channels_show_each_frame_together},
        {"a dead channel costs the others one time-out, and joins when it is back",
         a_dead_channel_costs_the_others_one_time_out_and_joins_when_it_is_back},
        {"a channel that leaves costs nothing", a_channel_that_leaves_costs_nothing},
        {"a channel alone waits once", a_channel_alone_waits_once},
        {"a lost message is made up for by those who heard it",
         a_lost_message_is_made_up_for_by_those_who_heard_it},
        {"what nobody heard is said again", what_nobody_heard_is_said_again},
        {"a channel that is always too slow does not slow the others",
         a_channel_that_is_always_too_slow_does_not_slow_the_others},
        {"each part of a divided network goes on, and both find together",
         each_part_of_a_divided_network_goes_on_and_both_find_together},
        {"nobody ever waits longer than the time-out", nobody_ever_waits_longer_than_the_time_out},
        {"channels that begin apart find one tick", channels_that_begin_apart_find_one_tick},
        {"frame numbers wrap", frame_numbers_wrap},
        {"a host that begins anew is followed", a_host_that_begins_anew_is_followed},
        {"the first channel in step speaks to the host",
         the_first_channel_in_step_speaks_to_the_host},
        {"who has nothing newer is not waited for", who_has_nothing_newer_is_not_waited_for},
        {"who dies while there is nothing to show is given up",
         who_dies_while_there_is_nothing_to_show_is_given_up},
        {"strangers and namesakes are counted and not followed",
         strangers_and_namesakes_are_counted_and_not_followed},
        {"skew is told by the shared clock", skew_is_told_by_the_shared_clock},
    };
    return CHECK_MAIN(tests);
}
