/* pcap, the classic format (libpcap's pcap-savefile(5)): either byte order, micro- or nanoseconds;
 * Ethernet (with 802.1Q tags), BSD loopback, Linux cooked v1 and v2, raw IP; UDP over IPv4 and IPv6
 * without extension headers. The time of a pose is the capture's stamp. */
#include <errno.h>
#include <math.h>
#include <string.h>

#include "base/bytes.h"
#include "io/flight_formats.h"
#include "io/flightgear.h"
#include "io/native.h"

#define LINK_NULL  0
#define LINK_ETHER 1
#define LINK_RAW   101
#define LINK_LOOP  108
#define LINK_SLL   113
#define LINK_IPV4  228
#define LINK_IPV6  229
#define LINK_SLL2  276
#define ETHER_VLAN 0x8100
#define ETHER_IPV4 0x0800
#define ETHER_IPV6 0x86dd
#define IP_UDP     17
#define RECORD_MAX (1u << 20)
#define CARRY_NS   (20 * NSEC_PER_MSEC) /* between the poses of what is dead-reckoned */
#define CARRY_MOST (12 * NSEC_PER_SEC)  /* IEEE 1278.1: the entity is gone then */
#define PCAPNG     0x0a0d0d0au

struct capture {
    const struct flight_input *input;
    bool big, nanoseconds;
    uint32_t link;
    size_t offset;
    uint64_t udp_packets;
    bool refused;    /* a packet; the sentence stands in diag */
    nsec_t heard_ns; /* when the entity that is dead-reckoned told its last state */
    struct intake intakes[POSE_PROTOCOLS]; /* those of CAN stay unused */
};

struct payload {
    const uint8_t *data;
    size_t size;
};

static bool magic_known(uint32_t magic, bool *ret_nanoseconds)
{
    *ret_nanoseconds = magic == 0xa1b23c4d;
    return magic == 0xa1b2c3d4 || magic == 0xa1b23c4d;
}

static bool pcap_recognises(const struct flight_input *input)
{
    struct byte_reader in = byte_reader_over(input->data, input->size);
    uint32_t magic = read_u32be(&in);
    bool nanoseconds;
    return !in.overrun && (magic_known(magic, &nanoseconds) ||
                           magic_known(__builtin_bswap32(magic), &nanoseconds) || magic == PCAPNG);
}

static uint32_t u32_at(const struct capture *c, size_t offset)
{
    struct byte_reader in = byte_reader_over(c->input->data, c->input->size);
    byte_reader_seek(&in, offset);
    return c->big ? read_u32be(&in) : read_u32le(&in);
}

static int read_header(struct capture *c, struct diag *diag)
{
    const struct flight_input *input = c->input;
    c->big = true;
    if (u32_at(c, 0) == PCAPNG)
        return diag_set(diag, -EBADMSG,
                        "%s: byte 0: pcapng; convert it with: editcap -F pcap IN OUT", input->name);
    c->big = magic_known(u32_at(c, 0), &c->nanoseconds);
    if (!c->big)
        magic_known(u32_at(c, 0), &c->nanoseconds);
    if (input->size < 24)
        return diag_set(diag, -EBADMSG, "%s: byte %zu: it ends within the pcap header", input->name,
                        input->size);
    c->link = u32_at(c, 20) & 0xffff;
    switch (c->link) {
    case LINK_NULL:
    case LINK_ETHER:
    case LINK_RAW:
    case LINK_LOOP:
    case LINK_SLL:
    case LINK_IPV4:
    case LINK_IPV6:
    case LINK_SLL2:
        c->offset = 24;
        return 0;
    default:
        return diag_set(diag, -EBADMSG, "%s: byte 20: link type %u is none that carries UDP here",
                        input->name, c->link);
    }
}

/* Passes the link's header; leaves `in` at the IP header. */
static bool skip_link(uint32_t link, struct byte_reader *in)
{
    uint16_t type = 0;
    switch (link) {
    case LINK_NULL:
    case LINK_LOOP:
        byte_reader_seek(in, 4);
        return !in->overrun;
    case LINK_ETHER:
        byte_reader_seek(in, 12);
        type = read_u16be(in);
        for (int tags = 0; type == ETHER_VLAN && tags < 2; tags++) {
            read_u16be(in);
            type = read_u16be(in);
        }
        break;
    case LINK_SLL:
        byte_reader_seek(in, 14);
        type = read_u16be(in);
        break;
    case LINK_SLL2:
        type = read_u16be(in);
        byte_reader_seek(in, 20);
        break;
    default: /* raw IP */
        return true;
    }
    return !in->overrun && (type == ETHER_IPV4 || type == ETHER_IPV6);
}

/* Passes the IP header; returns true where a whole UDP datagram follows. */
static bool skip_ip(struct byte_reader *in)
{
    size_t start = in->offset;
    unsigned first = read_u8(in);
    if (first >> 4 == 4) {
        byte_reader_seek(in, start + 6);
        uint16_t fragment = read_u16be(in) & 0x3fff;
        read_u8(in);
        bool udp = read_u8(in) == IP_UDP;
        byte_reader_seek(in, start + 4 * (size_t)(first & 15));
        return udp && fragment == 0 && (first & 15) >= 5 && !in->overrun;
    }
    byte_reader_seek(in, start + 6);
    bool udp = read_u8(in) == IP_UDP;
    byte_reader_seek(in, start + 40);
    return first >> 4 == 6 && udp && !in->overrun;
}

static bool udp_payload(uint32_t link, const uint8_t *data, size_t size,
                        struct payload *ret_payload)
{
    struct byte_reader in = byte_reader_over(data, size);
    if (!skip_link(link, &in) || !skip_ip(&in))
        return false;
    read_u32be(&in); /* ports */
    size_t length = read_u16be(&in);
    read_u16be(&in); /* checksum: often left to the card, so worth nothing in a capture */
    if (in.overrun || length < 8)
        return false;
    length -= 8;
    size_t rest = in.size - in.offset;
    *ret_payload =
        (struct payload){.data = in.data + in.offset, .size = length < rest ? length : rest};
    return true;
}

/* Which protocol's packet this is; NULL for something else's traffic. */
static struct intake *intake_for(struct capture *c, const struct flight_params *params,
                                 const struct payload *payload)
{
    if (params->force_protocol)
        return &c->intakes[params->protocol];
    if (native_recognises(payload->data, payload->size))
        return &c->intakes[POSE_PROTOCOL_NATIVE];
    if (flightgear_recognises(payload->data, payload->size))
        return &c->intakes[POSE_PROTOCOL_FLIGHTGEAR];
    if (xplane_recognises(payload->data, payload->size))
        return &c->intakes[POSE_PROTOCOL_XPLANE];
    if (dis_recognises(payload->data, payload->size))
        return &c->intakes[POSE_PROTOCOL_DIS];
    return NULL;
}

/* What dead reckoning says since the last state, as a live source gives it out. */
static int carry_forward(const struct capture *c, const struct dis_tracker *dis, nsec_t until_ns,
                         struct flight *flight)
{
    struct pose pose;
    if (until_ns - c->heard_ns > CARRY_MOST)
        until_ns = c->heard_ns + CARRY_MOST;
    for (nsec_t at_ns = c->heard_ns + CARRY_NS; at_ns < until_ns; at_ns += CARRY_NS) {
        if (!dis_tracker_pose(dis, at_ns, &pose))
            return 0;
        int r = flight_append(flight, &pose, NAN);
        if (r < 0)
            return r;
    }
    return 0;
}

static int take_payload(struct capture *c, const struct flight_params *params,
                        const struct payload *payload, nsec_t time_ns, struct flight *flight,
                        struct diag *diag)
{
    c->udp_packets++;
    struct intake *intake = intake_for(c, params, payload);
    if (!intake)
        return 0;
    struct pose pose;
    struct rejection rejection;
    const struct dis_tracker before = intake->dis;
    int r = intake_packet(intake, payload->data, payload->size, time_ns, &pose, &rejection);
    if (r == 0)
        return 0;
    if (r < 0) {
        diag_set(diag, 0, "%s: byte %zu: %s", c->input->name, c->offset, rejection.text);
        c->refused = true;
        if (!flight->note.text[0])
            flight->note = *diag;
        return 0;
    }
    r = carry_forward(c, &before, time_ns, flight);
    if (r < 0)
        return r;
    c->heard_ns = time_ns;
    pose.time_ns = time_ns;
    return flight_append(flight, &pose, intake->agl_m);
}

static void add_counters(struct intake_counters *sum, const struct intake_counters *more)
{
    sum->received += more->received;
    sum->accepted += more->accepted;
    sum->others += more->others;
    sum->lost += more->lost;
    sum->reordered += more->reordered;
    sum->duplicates += more->duplicates;
    for (int i = 0; i < REJECT_REASONS; i++)
        sum->rejected[i] += more->rejected[i];
}

static int read_records(struct capture *c, const struct flight_params *params,
                        struct flight *flight, struct diag *diag)
{
    while (c->offset < c->input->size) {
        /* A capture that was cut off is good up to there. */
        size_t rest = c->input->size - c->offset;
        if (rest < 16 ||
            (u32_at(c, c->offset + 8) <= RECORD_MAX && u32_at(c, c->offset + 8) > rest - 16)) {
            diag_set(&flight->note, 0, "%s: byte %zu: it ends within a packet", c->input->name,
                     c->offset);
            return 0;
        }
        nsec_t time_ns = (nsec_t)u32_at(c, c->offset) * NSEC_PER_SEC +
                         (nsec_t)u32_at(c, c->offset + 4) * (c->nanoseconds ? 1 : NSEC_PER_USEC);
        size_t length = u32_at(c, c->offset + 8);
        if (length > RECORD_MAX)
            return diag_set(diag, -EBADMSG, "%s: byte %zu: a packet of %zu bytes", c->input->name,
                            c->offset, length);
        struct payload payload;
        if (udp_payload(c->link, c->input->data + c->offset + 16, length, &payload)) {
            int r = take_payload(c, params, &payload, time_ns, flight, diag);
            if (r < 0)
                return r;
        }
        c->offset += 16 + length;
    }
    return 0;
}

static int pcap_read(const struct flight_input *input, const struct flight_params *params,
                     struct flight *flight, struct diag *diag)
{
    if (params->force_protocol &&
        (pose_protocol_is_can(params->protocol) || params->protocol == POSE_PROTOCOL_CIGI))
        return diag_set(diag, -EBADMSG, "%s: no poses of %s are read from a pcap", input->name,
                        pose_protocol_name(params->protocol));
    struct capture c = {.input = input};
    int r = read_header(&c, diag);
    if (r < 0)
        return r;
    for (int i = 0; i < POSE_PROTOCOLS; i++)
        intake_init(&c.intakes[i], &(struct intake_params){.protocol = (enum pose_protocol)i,
                                                           .geoid = params->geoid,
                                                           .dis = params->dis});
    r = read_records(&c, params, flight, diag);
    for (int i = 0; i < POSE_PROTOCOLS; i++)
        add_counters(&flight->counters, &c.intakes[i].counters);
    if (r == 0 && flight->count == 0 && flight->counters.received == 0)
        return diag_set(diag, -EBADMSG,
                        "%s: none of its %llu UDP packets is a pose that this program knows",
                        input->name, (unsigned long long)c.udp_packets);
    if (r == 0 && flight->count == 0 && !c.refused)
        return diag_set(diag, -EBADMSG, "%s: what it holds is sound, but not about own-ship",
                        input->name);
    if (r == 0 && flight->count == 0)
        return -EBADMSG; /* the last refusal stands in diag */
    return r;
}

const struct flight_format flight_format_pcap = {"pcap", pcap_recognises, pcap_read};
