/* Dead reckoning of DIS entities: IEEE 1278.1, algorithms 1 to 9. Pure; any thread.
 *
 * An algorithm's name says whether the entity turns (F no, R yes), what of its path is constant (P
 * the velocity, V the acceleration) and in which axes velocity and acceleration are told (W those
 * of the world, ECEF; B those of the body, which turn with it). */
#pragma once

#include "geo/frames.h"

enum dis_algorithm {
    DIS_OTHER_ALGORITHM, /* treated as static */
    DIS_STATIC,
    DIS_FPW,
    DIS_RPW,
    DIS_RVW,
    DIS_FVW,
    DIS_FPB,
    DIS_RPB,
    DIS_RVB,
    DIS_FVB,
    DIS_ALGORITHMS
};

struct dis_motion {
    enum dis_algorithm algorithm;
    double position_ecef_m[3];
    struct quaternion orientation;                /* body (x forward, y right, z down) to ECEF */
    double velocity_mps[3], acceleration_mps2[3]; /* in the algorithm's axes */
    double rates_body_radps[3];
};

bool dis_algorithm_turns(enum dis_algorithm algorithm);       /* R */
bool dis_algorithm_accelerates(enum dis_algorithm algorithm); /* V */
bool dis_algorithm_in_body(enum dis_algorithm algorithm);     /* B */

/* The motion `dt_s` seconds later (earlier where negative). What the algorithm holds still stays,
 * whatever the other numbers say; where the body does not turn, its axes do not either. */
void dis_dead_reckon(const struct dis_motion *motion, double dt_s, struct dis_motion *ret_motion);
