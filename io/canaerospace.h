/* CANaerospace 1.7 (Stock Flight Systems, interface specification, default identifier
 * distribution): frames to a pose and back. Pure: the caller says when a frame came. One thread at
 * a time. */
#pragma once

#include <linux/can.h>

#include "io/can_assembly.h"

/* The redundancy channels that 29-bit identifiers have room for; 0 is the first source. */
#define CANAEROSPACE_REDUNDANCY_MAX 8190

/* The CAN identifier that carries a quantity: of channel 0 that of 11 bits, of others with
 * CAN_EFF_FLAG (section 4 of the specification: 65536 more for each). */
uint32_t canaerospace_id(enum can_quantity quantity, unsigned redundancy);

struct canaerospace_half {
    bool present;
    uint8_t code;
    uint32_t word;
    nsec_t time_ns;
};

/* What is known of an identifier's sender. */
struct canaerospace_channel {
    bool counted; /* `code` is that of a former frame */
    uint8_t code;
    bool halves_share_code; /* this sender gives both halves one code */
    struct canaerospace_half low, high;
};

struct canaerospace {
    unsigned redundancy; /* the channel that is listened to */
    struct canaerospace_channel channels[CAN_QUANTITIES];
    struct can_assembly assembly;
    uint64_t frames; /* that carried a quantity of ours, accepted or not */
    uint64_t lost;   /* by gaps in the message codes */
};

void canaerospace_init(struct canaerospace *state, unsigned redundancy);

/* Takes one frame. Returns 1 with a new pose (can_assembly_take()), 0 where there is none yet or
 * the frame is no quantity of ours, or -EBADMSG. */
int canaerospace_take(struct canaerospace *state, const struct can_frame *frame, nsec_t now_ns,
                      struct pose_sample *ret_sample, struct rejection *ret_rejection);

/* An identification service request (id 128, section 5 of the specification) to `node` or to all:
 * fills the answer (id 129) and returns true. */
bool canaerospace_identify(const struct can_frame *frame, uint8_t node,
                           struct can_frame *ret_answer);

/* Makes the frames of a host. Position goes out with every `position_every`-th pose, as doubles in
 * two halves; everything else with each, as floats. */
struct canaerospace_encoder {
    uint8_t node;
    unsigned redundancy;
    unsigned position_every; /* 0 = 1 */
    unsigned count;
    uint8_t codes[CAN_QUANTITIES];
};

#define CANAEROSPACE_FRAMES_MAX 16

/* `pose` has its height above the ellipsoid. Returns how many frames it wrote. */
size_t canaerospace_encode(struct canaerospace_encoder *encoder, const struct pose *pose,
                           struct can_frame ret_frames[CANAEROSPACE_FRAMES_MAX]);
