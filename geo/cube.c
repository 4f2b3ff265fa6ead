#include "geo/cube.h"

#include <math.h>

#define DEGREE     (M_PI / 180.0)
#define QUARTER    (M_PI / 4.0)
#define CORNER_RAD 0.9554 /* from the middle of a face to its corners, and a little */

/* In the frame that is turned by CUBE_TURN_DEG. Opposite axes belong to opposite faces. */
static const signed char axes[CUBE_FACES][3][3] = {
    {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}},  {{0, 1, 0}, {-1, 0, 0}, {0, 0, 1}},
    {{0, 0, 1}, {0, 1, 0}, {-1, 0, 0}}, {{-1, 0, 0}, {0, -1, 0}, {0, 0, 1}},
    {{0, -1, 0}, {1, 0, 0}, {0, 0, 1}}, {{0, 0, -1}, {0, 1, 0}, {1, 0, 0}},
};

/* From ECEF to the cube's frame (sign 1) and back (-1). */
static void turn(double sign, const double v[3], double ret[3])
{
    double c = cos(CUBE_TURN_DEG * DEGREE), s = sign * sin(CUBE_TURN_DEG * DEGREE);
    ret[0] = c * v[0] - s * v[1];
    ret[1] = s * v[0] + c * v[1];
    ret[2] = v[2];
}

void cube_axes(int face, double ret_axes[3][3])
{
    for (int i = 0; i < 3; i++) {
        const double axis[3] = {axes[face][i][0], axes[face][i][1], axes[face][i][2]};
        turn(-1.0, axis, ret_axes[i]);
    }
}

void cube_normal_from_geodetic(double lat_deg, double lon_deg, double ret_normal[3])
{
    double cosine = cos(lat_deg * DEGREE);
    ret_normal[0] = cosine * cos(lon_deg * DEGREE);
    ret_normal[1] = cosine * sin(lon_deg * DEGREE);
    ret_normal[2] = sin(lat_deg * DEGREE);
}

void cube_geodetic_from_normal(const double normal[3], double *ret_lat_deg, double *ret_lon_deg)
{
    *ret_lat_deg = atan2(normal[2], hypot(normal[0], normal[1])) / DEGREE;
    *ret_lon_deg =
        normal[0] == 0.0 && normal[1] == 0.0 ? 0.0 : atan2(normal[1], normal[0]) / DEGREE;
}

double cube_chord(const double a[3], const double b[3])
{
    double x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
    return sqrt(x * x + y * y + z * z);
}

static double along(const signed char axis[3], const double v[3])
{
    return axis[0] * v[0] + axis[1] * v[1] + axis[2] * v[2];
}

int cube_face_of(const double normal[3])
{
    double v[3];
    turn(1.0, normal, v);
    int best = 0;
    for (int face = 1; face < CUBE_FACES; face++)
        if (along(axes[face][0], v) > along(axes[best][0], v))
            best = face;
    return best;
}

void cube_angles(int face, const double normal[3], double *ret_xi, double *ret_eta)
{
    double v[3];
    turn(1.0, normal, v);
    double c = along(axes[face][0], v);
    *ret_xi = atan2(along(axes[face][1], v), c);
    *ret_eta = atan2(along(axes[face][2], v), c);
}

void cube_normal(int face, double xi, double eta, double ret_normal[3])
{
    double u = tan(xi), w = tan(eta), scale = 1.0 / sqrt(1.0 + u * u + w * w), v[3];
    for (int i = 0; i < 3; i++)
        v[i] = scale * (axes[face][0][i] + u * axes[face][1][i] + w * axes[face][2][i]);
    turn(-1.0, v, ret_normal);
}

static int dot(const signed char a[3], const signed char b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

struct cube_edge cube_edge(int face, enum cube_side side)
{
    const signed char(*own)[3] = axes[face];
    int across = side == CUBE_WEST || side == CUBE_EAST ? 1 : 2, way = side & 1 ? 1 : -1;
    struct cube_edge edge = {0};
    while (dot(axes[edge.face][0], own[across]) != way)
        edge.face++;
    const signed char(*other)[3] = axes[edge.face];
    int back = dot(other[1], own[0]) != 0 ? 1 : 2; /* the neighbour's axis towards this face */
    bool at_end = dot(other[back], own[0]) > 0;
    edge.side = back == 1 ? (at_end ? CUBE_EAST : CUBE_WEST) : (at_end ? CUBE_NORTH : CUBE_SOUTH);
    edge.backwards = dot(other[3 - back], own[3 - across]) < 0;
    return edge;
}

static bool is_on(const struct cube_post *post, enum cube_side side, int64_t cells)
{
    int64_t at = side == CUBE_WEST || side == CUBE_EAST ? post->col : post->row;
    return at == (side & 1 ? cells : 0);
}

struct cube_post cube_post_lowest(struct cube_post post, int64_t cells)
{
    struct cube_post lowest = post;
    for (int side = 0; side < CUBE_SIDES; side++) {
        struct cube_edge edge = cube_edge(post.face, side);
        if (edge.face >= lowest.face || !is_on(&post, side, cells))
            continue;
        int64_t way = side == CUBE_WEST || side == CUBE_EAST ? post.row : post.col;
        int64_t end = edge.side & 1 ? cells : 0;
        if (edge.backwards)
            way = cells - way;
        lowest = edge.side == CUBE_WEST || edge.side == CUBE_EAST
                     ? (struct cube_post){edge.face, end, way}
                     : (struct cube_post){edge.face, way, end};
    }
    return lowest;
}

struct cap {
    double normal[3]; /* in the face's axes */
    double radius_rad;
    double *xi, *eta; /* the range so far */
};

/* The range of xi (axis 1) or eta (axis 2) of all of the cap. False where it is not all on this
 * side of the face's ends. */
static bool range_within(const struct cap *cap, int axis, double ret_range[2])
{
    const double *n = cap->normal;
    double ratio = sin(cap->radius_rad) / hypot(n[0], n[axis]);
    if (n[0] <= 0.0 || ratio >= 1.0)
        return false;
    double middle = atan2(n[axis], n[0]), half = asin(ratio);
    ret_range[0] = middle - half;
    ret_range[1] = middle + half;
    return ret_range[0] >= -QUARTER && ret_range[1] <= QUARTER;
}

/* Takes in a direction in the face's axes that may be of the cap, where it lies on the face. */
static void take(const struct cap *cap, const double v[3])
{
    const double slack = 1e-9;
    double xi = atan2(v[1], v[0]), eta = atan2(v[2], v[0]);
    if (v[0] <= 0.0 || fabs(xi) > QUARTER + slack || fabs(eta) > QUARTER + slack)
        return;
    cap->xi[0] = fmin(cap->xi[0], fmax(xi, -QUARTER));
    cap->xi[1] = fmax(cap->xi[1], fmin(xi, QUARTER));
    cap->eta[0] = fmin(cap->eta[0], fmax(eta, -QUARTER));
    cap->eta[1] = fmax(cap->eta[1], fmin(eta, QUARTER));
}

/* Where the cap's rim touches a line of equal xi (axis 2) or eta (axis 1). */
static void take_extremes(const struct cap *cap, int axis)
{
    const double *n = cap->normal;
    int other = 3 - axis;
    double across = hypot(n[0], n[other]), ratio = sin(cap->radius_rad) / across;
    for (int way = -1; ratio < 1.0 && way <= 1; way += 2) {
        double turned = atan2(n[other], n[0]) + way * asin(ratio), v[3];
        /* The rim's point on that great circle: the foot of the middle on its plane. */
        double along = n[0] * cos(turned) + n[other] * sin(turned);
        v[0] = along * cos(turned);
        v[other] = along * sin(turned);
        v[axis] = n[axis];
        take(cap, v);
    }
}

/* Where the rim crosses the great circle of a side of the face. */
static void take_crossings(const struct cap *cap, int axis, double way)
{
    double plane[3] = {way * M_SQRT1_2, 0.0, 0.0}, foot[3], side[3], length = 0.0;
    plane[axis] = -M_SQRT1_2;
    double off = cap->normal[0] * plane[0] + cap->normal[axis] * plane[axis];
    for (int i = 0; i < 3; i++) {
        foot[i] = cap->normal[i] - off * plane[i];
        length += foot[i] * foot[i];
    }
    length = sqrt(length);
    double cosine = cos(cap->radius_rad) / length;
    if (!(cosine < 1.0))
        return;
    for (int i = 0; i < 3; i++)
        foot[i] /= length;
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        side[i] = plane[j] * foot[k] - plane[k] * foot[j];
    }
    double sine = sqrt(1.0 - cosine * cosine);
    for (int sign = -1; sign <= 1; sign += 2) {
        double v[3];
        for (int i = 0; i < 3; i++)
            v[i] = cosine * foot[i] + sign * sine * side[i];
        take(cap, v);
    }
}

bool cube_cap_range(int face, const double normal[3], double radius_rad, double ret_xi[2],
                    double ret_eta[2])
{
    double v[3];
    struct cap cap = {.radius_rad = radius_rad, .xi = ret_xi, .eta = ret_eta};
    turn(1.0, normal, v);
    for (int i = 0; i < 3; i++)
        cap.normal[i] = along(axes[face][i], v);
    if (cap.normal[0] < cos(radius_rad + CORNER_RAD))
        return false;
    if (range_within(&cap, 1, ret_xi) && range_within(&cap, 2, ret_eta))
        return true;
    ret_xi[0] = ret_eta[0] = INFINITY;
    ret_xi[1] = ret_eta[1] = -INFINITY;
    take(&cap, cap.normal);
    for (int axis = 1; axis <= 2; axis++) {
        take_extremes(&cap, axis);
        take_crossings(&cap, axis, 1.0);
        take_crossings(&cap, axis, -1.0);
    }
    for (int corner = 0; corner < 4; corner++) {
        const double at[3] = {1.0, corner & 1 ? 1.0 : -1.0, corner & 2 ? 1.0 : -1.0};
        double cosine =
            (at[0] * cap.normal[0] + at[1] * cap.normal[1] + at[2] * cap.normal[2]) / sqrt(3.0);
        if (cosine >= cos(radius_rad))
            take(&cap, at);
    }
    return ret_xi[0] <= ret_xi[1];
}

double cube_scale(const double normal[3])
{
    double xi, eta;
    cube_angles(cube_face_of(normal), normal, &xi, &eta);
    double u = tan(xi), w = tan(eta), r2 = 1.0 + u * u + w * w;
    return sqrt((1.0 + u * u) * (1.0 + w * w) / (r2 * sqrt(r2)));
}
