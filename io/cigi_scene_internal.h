/* What the parts of io/cigi_scene share. Private to it. */
#pragma once

#include "io/cigi_scene.h"

/* Bits of `use` in View Control and Articulated Part Control: offsets, then these. */
enum { CIGI_USE_ROLL = 1 << 3, CIGI_USE_PITCH = 1 << 4, CIGI_USE_YAW = 1 << 5 };

/* Entities, their places, rates and parts; and views. As cigi_scene_take(). */
int cigi_entities_take(struct cigi_scene *scene, const struct cigi_packet *packet, bool placed,
                       nsec_t receive_ns, struct rejection *ret_rejection);
int cigi_views_take(struct cigi_scene *scene, const struct cigi_packet *packet,
                    struct rejection *ret_rejection);

uint64_t cigi_part_number(uint16_t entity, uint8_t part);

/* Any finite angles, brought into what they are read as. */
struct attitude cigi_attitude_from_angles(double roll_deg, double pitch_deg, double yaw_deg);

/* Takes those of six numbers that `use` names. */
void cigi_take_offset(uint8_t use, const float offset_m[3], const float angles_deg[3],
                      double offset[3], struct attitude *attitude);

/* Refusals. */
int cigi_table_full(const char *what, const struct cigi_table *table,
                    struct rejection *ret_rejection);
int cigi_bad_place(const char *what, const double place[3], struct rejection *ret_rejection);
