/* A known flight, sent as a host sends it and shown as a channel shows it, against what it was: how
 * far off the picture is, and how smooth. Everything between runs as it does live (sender, decoder,
 * intake, motion), in virtual time, so that the same seed gives the same figures on any machine. */
#pragma once

#include "base/diag.h"
#include "base/stats.h"
#include "io/sender.h"

struct motion_trial_params {
    enum pose_protocol protocol;
    double rate_hz;          /* of poses, 10 to 1000 */
    unsigned position_every; /* of a bus: the position with every n-th; 0 = 1 */
    double jitter_ms, loss, reorder;
    uint64_t seed;
    nsec_t delay_ns, extrapolate_ns;
    double duration_s; /* of which the first MOTION_TRIAL_SKIP_S are not judged */
};

#define MOTION_TRIAL_SKIP_S   5.0
#define MOTION_TRIAL_FRAME_HZ 60.0

struct motion_trial_result {
    size_t frames;
    struct distribution position_m;   /* distance of what is shown from where it was then */
    struct distribution attitude_deg; /* likewise, the angle of the turn between them */
    /* |p(i+1) - 2 p(i) + p(i-1)| of consecutive frames: of what is shown, and of the truth. */
    struct distribution bend_m, true_bend_m;
    uint64_t packets, left_out, refused;
};

/* The flight: a figure of eight, 80 to 130 m/s, that climbs and sinks by 150 m. Velocity, attitude
 * (coordinated) and rates belong to it. */
void motion_trial_truth(double time_s, struct pose *ret_pose);

/* Returns 0, or -errno with a sentence. */
int motion_trial_run(const struct motion_trial_params *params,
                     struct motion_trial_result *ret_result, struct diag *diag);
