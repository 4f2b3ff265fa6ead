#include "geo/cube.h"
#include "geo/geographic.h"
#include "tests/check.h"

#define QUARTER (M_PI / 4.0)

static uint32_t random_state = 7;

static double random_between(double low, double high)
{
    random_state = random_state * 1664525u + 1013904223u;
    return low + (high - low) * (random_state >> 8) / 16777216.0;
}

static void random_normal(double ret[3])
{
    double z = random_between(-1, 1), lon = random_between(-M_PI, M_PI), r = sqrt(1.0 - z * z);
    ret[0] = r * cos(lon);
    ret[1] = r * sin(lon);
    ret[2] = z;
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void every_direction_lies_on_one_face(void)
{
    double worst = 0.0;
    int beyond = 0;
    for (int i = 0; i < 20000; i++) {
        double n[3], again[3], xi, eta;
        random_normal(n);
        int face = cube_face_of(n);
        cube_angles(face, n, &xi, &eta);
        beyond += fabs(xi) > QUARTER + 1e-12 || fabs(eta) > QUARTER + 1e-12;
        cube_normal(face, xi, eta, again);
        worst = fmax(worst, cube_chord(n, again));
    }
    CHECK_INT(beyond, 0);
    CHECK(worst < 1e-15);
    double north[3], lat, lon;
    cube_normal_from_geodetic(90.0, 12.0, north);
    CHECK_INT(cube_face_of(north), 2);
    cube_geodetic_from_normal((const double[3]){0.0, 0.0, -1.0}, &lat, &lon);
    CHECK(lat == -90.0 && lon == 0.0);
}

static void axes_are_right_handed(void)
{
    for (int face = 0; face < CUBE_FACES; face++) {
        double a[3][3];
        cube_axes(face, a);
        double cross[3] = {a[0][1] * a[1][2] - a[0][2] * a[1][1],
                           a[0][2] * a[1][0] - a[0][0] * a[1][2],
                           a[0][0] * a[1][1] - a[0][1] * a[1][0]};
        CHECK(cube_chord(cross, a[2]) < 1e-15);
        double opposite[3][3];
        cube_axes((face + 3) % CUBE_FACES, opposite);
        CHECK_NEAR(dot(a[0], opposite[0]), -1.0, 1e-15);
    }
}

/* The formula that the shaders take apart, against GeographicLib. */
static void a_normal_and_a_height_are_a_place(void)
{
    const double e2 = 6.69437999014131699614e-3;
    double worst_m = 0.0;
    for (int i = 0; i < 5000; i++) {
        struct geodetic place = {random_between(-90, 90), random_between(-180, 180),
                                 random_between(-500, 400e3)};
        double n[3], ecef[3], mine[3];
        cube_normal_from_geodetic(place.lat_deg, place.lon_deg, n);
        geocentric_from_geodetic(&place, ecef);
        double across = 6378137.0 / sqrt(1.0 - e2 * n[2] * n[2]);
        for (int k = 0; k < 3; k++)
            mine[k] = (across * (k == 2 ? 1.0 - e2 : 1.0) + place.height_m) * n[k];
        worst_m = fmax(worst_m, cube_chord(ecef, mine));
    }
    CHECK(worst_m < 1e-8);
}

static const int64_t cells = 64;

static void normal_of(const struct cube_post *post, double ret[3])
{
    double step = 2.0 * QUARTER / (double)cells;
    cube_normal(post->face, (double)post->col * step - QUARTER, (double)post->row * step - QUARTER,
                ret);
}

static struct cube_post on_side(int face, enum cube_side side, int64_t way)
{
    int64_t end = side & 1 ? cells : 0;
    return side == CUBE_WEST || side == CUBE_EAST ? (struct cube_post){face, end, way}
                                                  : (struct cube_post){face, way, end};
}

static void faces_share_the_posts_of_their_edges(void)
{
    double worst = 0.0;
    int one_sided = 0;
    for (int face = 0; face < CUBE_FACES; face++)
        for (int side = 0; side < CUBE_SIDES; side++) {
            struct cube_edge there = cube_edge(face, side),
                             back = cube_edge(there.face, there.side);
            one_sided +=
                back.face != face || (int)back.side != side || back.backwards != there.backwards;
            for (int64_t way = 0; way <= cells; way++) {
                struct cube_post own = on_side(face, side, way);
                struct cube_post other =
                    on_side(there.face, there.side, there.backwards ? cells - way : way);
                double a[3], b[3];
                normal_of(&own, a);
                normal_of(&other, b);
                worst = fmax(worst, cube_chord(a, b));
            }
        }
    CHECK_INT(one_sided, 0);
    CHECK(worst < 1e-15);
}

/* Every post that is the same place has the same lowest name. */
static void a_post_has_one_lowest_name(void)
{
    int wrong = 0, corners = 0, edges = 0;
    for (int face = 0; face < CUBE_FACES; face++)
        for (int64_t row = 0; row <= cells; row += row == 0 || row == cells - 1 ? 1 : 7)
            for (int64_t col = 0; col <= cells; col += col == 0 || col == cells - 1 ? 1 : 7) {
                struct cube_post post = {face, col, row};
                struct cube_post lowest = cube_post_lowest(post, cells);
                struct cube_post again = cube_post_lowest(lowest, cells);
                double a[3], b[3];
                normal_of(&post, a);
                normal_of(&lowest, b);
                wrong += cube_chord(a, b) > 1e-15;
                wrong += lowest.face > face || again.face != lowest.face ||
                         again.col != lowest.col || again.row != lowest.row;
                bool at_col = col == 0 || col == cells, at_row = row == 0 || row == cells;
                if (!at_col && !at_row)
                    wrong += lowest.face != face;
                corners += at_col && at_row && lowest.face < 2;
                edges += at_col != at_row;
                /* No face with the same place is lower. */
                for (int other = 0; other < lowest.face; other++) {
                    double xi, eta, axes[3][3];
                    cube_axes(other, axes);
                    cube_angles(other, a, &xi, &eta);
                    wrong += dot(axes[0], a) > 0.0 && fabs(xi) <= QUARTER + 1e-12 &&
                             fabs(eta) <= QUARTER + 1e-12;
                }
            }
    CHECK_INT(wrong, 0);
    CHECK_INT(corners, 6 * 3); /* faces 0 and 1 have six of the eight corners */
    CHECK(edges > 100);
}

static void a_cap_lies_in_its_range(void)
{
    int outside = 0, wide = 0, met = 0;
    for (int i = 0; i < 20000; i++) {
        double centre[3], n[3], radius = random_between(1e-4, 0.6);
        random_normal(centre);
        /* A place within the cap. */
        double away[3];
        random_normal(away);
        double reach = radius * random_between(0.0, 1.0), off = dot(away, centre), length = 0.0;
        for (int k = 0; k < 3; k++) {
            away[k] -= off * centre[k];
            length += away[k] * away[k];
        }
        for (int k = 0; k < 3; k++)
            n[k] = cos(reach) * centre[k] + sin(reach) * away[k] / sqrt(length);
        int face = cube_face_of(n);
        double xi[2], eta[2], at_xi, at_eta;
        cube_angles(face, n, &at_xi, &at_eta);
        if (!cube_cap_range(face, centre, radius, xi, eta)) {
            outside++;
            continue;
        }
        met++;
        const double slack = 1e-12;
        outside += at_xi < xi[0] - slack || at_xi > xi[1] + slack || at_eta < eta[0] - slack ||
                   at_eta > eta[1] + slack;
        /* Not wider than the cap's diameter over the least width of a cell, on its own face. */
        if (radius < 0.05 && face == cube_face_of(centre))
            wide += xi[1] - xi[0] > 2.0 * radius / 0.66 || eta[1] - eta[0] > 2.0 * radius / 0.66;
    }
    CHECK_INT(outside, 0);
    CHECK_INT(wide, 0);
    CHECK_INT(met, 20000);
}

/* The coarsest level of a clipmap holds a cap of 0.5 rad in windows narrower than a face. */
static void a_cap_of_half_a_radian_does_not_fill_a_face(void)
{
    double widest = 0.0;
    for (int i = 0; i < 100000; i++) {
        double centre[3], xi[2], eta[2];
        random_normal(centre);
        for (int face = 0; face < CUBE_FACES; face++)
            if (cube_cap_range(face, centre, 0.5, xi, eta))
                widest = fmax(widest, fmax(xi[1] - xi[0], eta[1] - eta[0]));
    }
    printf("     %.2f degrees\n", widest * 180.0 / M_PI);
    CHECK(widest < 86.0 * M_PI / 180.0);
}

/* The area of a small cell, by its diagonals. */
static void the_scale_is_that_of_the_cells(void)
{
    double least = 1.0, most = 0.0, worst = 0.0;
    for (int i = 0; i < 5000; i++) {
        double n[3], xi, eta, corner[4][3], step = 1e-4;
        random_normal(n);
        int face = cube_face_of(n);
        cube_angles(face, n, &xi, &eta);
        for (int k = 0; k < 4; k++)
            cube_normal(face, xi + step * ((k & 1) - 0.5), eta + step * ((k >> 1) - 0.5),
                        corner[k]);
        double p[3], q[3];
        for (int k = 0; k < 3; k++) {
            p[k] = corner[3][k] - corner[0][k];
            q[k] = corner[2][k] - corner[1][k];
        }
        double cross = dot(p, p) * dot(q, q) - dot(p, q) * dot(p, q);
        double scale = cube_scale(n);
        worst = fmax(worst, fabs(sqrt(0.5 * sqrt(cross)) / step - scale));
        least = fmin(least, scale);
        most = fmax(most, scale);
    }
    CHECK(worst < 1e-6);
    CHECK(least > 0.8408 && least < 0.85);
    CHECK(most <= 1.0 && most > 0.99);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"every direction lies on one face", every_direction_lies_on_one_face},
        {"axes are right-handed", axes_are_right_handed},
        {"a normal and a height are a place", a_normal_and_a_height_are_a_place},
        {"faces share the posts of their edges", faces_share_the_posts_of_their_edges},
        {"a post has one lowest name", a_post_has_one_lowest_name},
        {"a cap lies in its range", a_cap_lies_in_its_range},
        {"a cap of half a radian does not fill a face",
         a_cap_of_half_a_radian_does_not_fill_a_face},
        {"the scale is that of the cells", the_scale_is_that_of_the_cells},
    };
    return CHECK_MAIN(tests);
}
