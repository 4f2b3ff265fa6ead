/* From where, in which direction and through what air a frame is seen. */
#pragma once

#include <stdbool.h>

#include "base/diag.h"
#include "geo/pose.h"

struct view {
    struct geodetic eye;
    double enu_from_eye[3][3]; /* columns: right, up, back (x, y, z of the GL eye frame) in ENU */
    /* Tangents of the frustum's half-angles from the view direction, at the edges of the picture;
     * off-axis allowed, and left greater than right (or bottom than top) in a mirror. */
    double tan_left, tan_right, tan_bottom, tan_top;
    /* Rays are parallel to the view direction, and the picture's edges are everywhere where those
     * of the tangents are at this distance; 0: rays meet in the eye. */
    double parallel_m;
    double near_m;       /* along the view; of parallel rays any, negative ones included */
    double far_m;        /* likewise; what is farther is not seen; 0: all is */
    double air_m;        /* light has gone so much farther than from the eye: parallel rays */
    double air_rise_m;   /* and so much higher has it come to */
    double visibility_m; /* meteorological: where contrast falls to 2 % (Koschmieder); INFINITY: no
                            haze */
    double sun_enu[3];   /* unit vector to the sun at the eye */
    double undulation_m; /* of the geoid below the eye */
};

/* The channel's place and direction in the aircraft (product configuration: channel). */
struct channel_geometry {
    double offset_m[3];                  /* eyepoint in body axes: forward, right, down */
    double yaw_deg, pitch_deg, roll_deg; /* of the view direction against the body axes */
    double left_deg, right_deg, bottom_deg, top_deg;
    bool parallel;                           /* projection, between edges in metres: */
    double left_m, right_m, bottom_m, top_m; /* from the view direction, not between rays */
    bool mirror_x, mirror_y; /* left and right, bottom and top change places in the picture */
    double near_m; /* what is nearer need not be seen; 0, or more than the channel's own: that */
    double far_m;  /* likewise farther; 0, or infinite: there is no such limit */
};

/* A frustum whose edges are farther from the view direction than this, or nearer to each other, is
 * none: at 90 degrees a picture would be infinite. */
#define VIEW_EDGE_MOST_DEG 85.0
#define VIEW_NARROWEST_DEG 0.1

/* Likewise of a picture by parallel rays. */
#define VIEW_EDGE_MOST_M 1e6
#define VIEW_NARROWEST_M 1.0

/* Heights above the ellipsoid beyond which no eye is taken: below all ground, and above what the
 * clipmap holds of the Earth. */
#define VIEW_LOWEST_M  -12e3
#define VIEW_HIGHEST_M 600e3

/* -EINVAL with a sentence where one of its numbers is not finite, or the frustum is none. */
int channel_geometry_check(const struct channel_geometry *geometry, struct diag *diag);

/* The view from an aircraft at `pose`: eyepoint, axes, frustum and far; near, air, sun and
 * undulation are left to the caller. An eye beyond VIEW_LOWEST_M or VIEW_HIGHEST_M is brought
 * there. That of parallel rays is in the middle of the picture, whose edges may be off the axis. */
void view_from_pose(const struct pose *pose, const struct channel_geometry *geometry,
                    struct view *ret_view);

/* Where a place (ENU at the eye) is on a picture of that size, in pixels from the lower left
 * corner, and how far along the view; false where it is before the near plane. */
bool view_project(const struct view *view, int width, int height, const double enu_m[3],
                  double ret_px[2], double *ret_along_m);

/* The place that is seen there, `depth` being above 0: near over distance along the view; of
 * parallel rays the share of the way from far to near. */
void view_unproject(const struct view *view, int width, int height, const double px[2],
                    double depth, double ret_enu_m[3]);

/* Whether there is anything to be seen from there: all that view_from_pose() sets is finite, and
 * the eye has a place on the Earth. */
bool view_is_sane(const struct view *view);

/* Lifts an eye that is so near the ground below it, or so deep in it, that the near plane cuts into
 * level ground: from beneath, land is a hole. Of parallel rays it is left where it is. */
void view_lift(struct view *view, double ground_m);

/* Of parallel rays, which see the same from anywhere along them: takes the eye to where a
 * perspective would be as detailed, parallel_m before the ground (at a height above the ellipsoid)
 * in the middle of the picture, and sets far to beyond all ground. After near is set; once. Others
 * stay as they are. */
void view_slide(struct view *view, double ground_m);

/* How far from the eye the lowest land may be that is seen (m): to where a ray touches it. */
double view_horizon_m(const struct view *view);

/* How far from the eye any land may be that is seen (m): a summit beyond the horizon. */
double view_farthest_m(const struct view *view);
