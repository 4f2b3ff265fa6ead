// What every stage shares: the scene block (render/scene.h mirrors it), the sky, the haze.

const float EARTH_RADIUS = 6.371e6; // mean, m
const int MAX_LEVELS = 20;
const int PANES = 3; // of a level: on faces 0 or 3, 1 or 4, 2 or 5 of the cube (geo/cube.h)

struct Pane {
    vec4 along_xi, along_eta; // how the eye's normal changes with the face's coordinates, enu; w: the
                              // tangents u0, v0 of the eye's angles on the face
    mat3 axes;                // the face's c, a, b in enu
    vec4 base;                // xy: the base half-post from the eye (rad)
    ivec4 origin;             // xy: the eye's base half-post of level 0 (column, row) on this face;
                              // z: the face
};

// llvmpipe reads a uniform in a fragment stage lane by lane, with some 25 instructions a number, but what is
// flat across a triangle with one. So where CARRIED is defined the vertex stage hands on what shading needs
// of the scene, and the fragment stage has it by the same names.
#if defined(CARRIED) && FRAGMENT
#define SCENE_CARRIED 1
#define CARRIED_WAY in
#define CARRIED_NAME scene
#else
#define SCENE_CARRIED 0
#define CARRIED_WAY out
#define CARRIED_NAME carried
#endif

#ifdef CARRIED
CARRIED_WAY Carried {
    flat vec4 eye_trig, grid, eye_rest, accuracy, way_back, sun, haze, air, along, parallel, view_rays;
    flat mat3 enu_from_eye, axes[PANES];
    flat vec4 base[PANES]; // xy: the pane's; zw: its u0, v0
    flat ivec2 origin[PANES];
    flat ivec4 sizes;
} CARRIED_NAME;
#endif

#if !SCENE_CARRIED
struct Scene {
    mat4 clip_from_enu;   // of positions relative to the eye
    vec4 planes[4];       // the frustum's sides: inward normals, enu; how far inside of them the eye is, m
    vec4 eye_trig;        // sin and cos of the latitude; N0; height above the ellipsoid, m
    vec4 grid;            // x: half-posts of level 0 (rad); y: from the eye to the nearest ground, in
                          // Earth's radii; z: posts of level 0 a pixel covers at 1 m; w: what clip
                          // coordinates are divided by at the near plane: near, m; parallel rays: 1
    vec4 eye_rest;        // x: what the height lacks, for it is one float; y: 1 / where level 0 ends for
                          // shading; z: 1 / the share of a level that is blended; w: the eye's place
                          // along the poles' axis, m
    vec4 accuracy;        // x * error in m - w: the distance (chord) from which that is within the
                          // tolerance; y: the depth from which on nothing is seen, 0 without a limit;
                          // z: how far away the lowest land is seen, m
    vec4 way_back;        // for difference_from_enu: x: N0 + h0; y: 0.5 / x; z: N0 e2 / q^2; w: 1 / q, with
                          // q = (1 - e2) N0 + h0
    vec4 sun;             // enu direction; w: 1 above, 0 below the horizon (smooth)
    vec4 haze;            // x: extinction by haze near the ground, 1/m; y: column_below() the eye; z: the
                          // eye's altitude; w: time of day's ambient strength
    vec4 air;             // xyz: extinction by clear air at sea level, 1/m; w: column_below() the eye
    vec4 view_rays;       // tangents: left, bottom, right, top
    vec4 along;           // depth d is (x + y d) / (z + w d) m along the view; w: 1 where rays meet in the
                          // eye, 0 where they are parallel
    vec4 parallel;        // of parallel rays, else 0: xy: how much farther, and how much higher, than from
                          // the eye light has gone, m; z: a step of depth that is an edge; w: the
                          // distance at which their distances from the view direction are tangents, m
    mat4 enu_from_eye;
    ivec4 sizes;          // x: log2 of the half-posts of level 0 along the ground texture's largest tile;
                          // y: half-posts along a face at level 0; zw: finest and coarsest level held
};

layout(std140, binding = 0) uniform SceneBlock {
    Scene scene;
    Pane panes[PANES];
    ivec4 edges[4 * PANES]; // across the sides west, east, south, north of a pane: the neighbour's pane
                            // (-1: not near), side, 1 where it runs backwards, its face
    vec4 levels[MAX_LEVELS]; // chords (terrain/clipmap.h): x: where the level ends, 0: it is not there;
                             // y: by where it is wholly blended into the next; w: no point of a block
                             // is farther from its middle. z: what its triangles miss of the Earth's
                             // curvature, m
    ivec4 candidates[PANES * MAX_LEVELS]; // blocks that may be drawn or split: first column, first row,
                                          // columns, rows
    ivec4 groups[MAX_LEVELS]; // select.comp's work groups: the first of each pane's candidates; the end
} scene_block;

// A compute stage of llvmpipe's reads uniforms as slowly in branches and loops, where not all lanes are sure
// to run. So where HELD is defined they are read at its beginning: main() calls hold_scene(). Not so arrays
// of the block, whose indices are no constants.
#ifdef HELD
Scene scene;

void hold_scene()
{
    scene = scene_block.scene;
}
#else
#define scene scene_block.scene

void hold_scene()
{
}
#endif
#endif

vec3 sky_colour(vec3 direction)
{
    float up = max(direction.z, 0.0);
    float toward_sun = max(dot(direction, scene.sun.xyz), 0.0);
    float low = 1.0 - up;
    low *= low * low;
    low *= low;
    float sunset = clamp(1.0 - abs(scene.sun.z) * 4.0, 0.0, 1.0);
    vec3 zenith = mix(vec3(0.06, 0.19, 0.58), vec3(0.10, 0.15, 0.34), sunset);
    vec3 horizon = mix(vec3(0.54, 0.71, 0.98), vec3(0.74, 0.53, 0.39), sunset * (0.3 + 0.7 * toward_sun));
    vec3 sky = mix(zenith, horizon, low);
    float glow = toward_sun * toward_sun;
    glow *= glow;
    glow *= glow;
    sky += vec3(0.22, 0.19, 0.13) * glow * (0.35 + 0.65 * low);
    return sky * scene.haze.w;
}

// A place on what is seen through a tangent is from + m along the view * along, relative to the eye.
struct Ray {
    vec3 from, along;
};

Ray ray_through(vec2 tangent)
{
    vec3 at = mat3(scene.enu_from_eye) * vec3(tangent, -1.0);
    vec3 along = mix(-scene.enu_from_eye[2].xyz, at, scene.along.w);
    return Ray(scene.parallel.w * (at - along), along);
}

float along_of(float depth)
{
    return (scene.along.x + scene.along.y * depth) / (scene.along.z + scene.along.w * depth);
}

// What falls on a surface that faces the sun, and on one from all of the sky.
vec3 sun_light()
{
    return mix(vec3(2.9, 1.5, 0.7), vec3(3.5, 3.25, 2.8), clamp(scene.sun.z * 3.0, 0.0, 1.0)) *
           scene.sun.w;
}

vec3 sky_light()
{
    return vec3(0.26, 0.36, 0.54) * scene.haze.w;
}

// As render/scene.c has them: haze is even up to HAZE_TOP and thins by e in HAZE_SCALE above it, clear
// air thins from sea level on; m.
const float HAZE_TOP = 1000.0, HAZE_SCALE = 1500.0, AIR_SCALE = 8000.0;

// Haze and air below an altitude, as metres of that near the ground.
vec2 column_below(float altitude_m)
{
    float above = max(altitude_m - HAZE_TOP, 0.0);
    vec2 thin = exp(-vec2(above, altitude_m) / vec2(HAZE_SCALE, AIR_SCALE));
    return vec2(HAZE_SCALE, AIR_SCALE) * (1.0 - thin) + vec2(altitude_m - above, 0.0);
}

// The share of light that the air lets through from a point that is `distance_m` from the eye (along the
// view, if rays are parallel), and `rise_m` higher; both are homogeneous in layers.
vec3 transmittance(float distance_m, float rise_m)
{
    distance_m = max(distance_m + scene.parallel.x, 0.0);
    rise_m -= scene.parallel.y;
    float rise = rise_m < 0.0 ? min(rise_m, -4.0) : max(rise_m, 4.0); // columns are floats
    float eye = scene.haze.z + scene.parallel.y;
    vec2 mean = (column_below(eye + rise) - vec2(scene.haze.y, scene.air.w)) / rise;
    return exp(-distance_m * (scene.haze.x * mean.x + scene.air.xyz * mean.y));
}

// The sky as it is seen from the eye: the less of it the less air the ray goes through, compared with one
// from sea level, and blue the least so. The air is counted by its depth straight up, of which a level ray
// has 36: the square root of half the Earth's circumference over AIR_SCALE.
vec3 sky_seen(vec3 direction)
{
    const float LEVEL = 36.0;
    const vec3 SCATTERED = vec3(0.2, 0.45, 1.1);
    float up = abs(direction.z), altitude = max(scene.haze.z, 0.0), radius = EARTH_RADIUS + altitude;
    float on_high = exp(-altitude / AIR_SCALE) / (up + 1.0 / LEVEL);
    float lowest = max(radius * sqrt(1.0 - up * up) - EARTH_RADIUS, 0.0);
    float through = 2.0 * LEVEL * exp(-lowest / AIR_SCALE) - on_high;
    float air = direction.z < 0.0 ? through : on_high;
    float from_sea = 1.0 / (max(direction.z, 0.0) + 1.0 / LEVEL);
    return sky_colour(direction) * (1.0 - exp(-SCATTERED * air)) / (1.0 - exp(-SCATTERED * from_sea));
}

// Radiance to what is stored: a shoulder up to snow in the full sun (3.3), then gamma 2.
vec3 displayed(vec3 radiance)
{
    return sqrt(min(radiance * 1.45 / (1.0 + 1.15 * radiance), 1.0));
}

// What is stored of a pixel: with less than half a step of 1/255 added or taken, so that the sky has no
// bands, by a pattern that is even at every scale (the fractional part of a plane).
vec4 stored(vec3 shown, ivec2 pixel)
{
    float pattern = fract(dot(vec2(pixel & 1023), vec2(0.75487767, 0.56984029)));
    return vec4(shown + (pattern - 0.5) * (1.0 / 256.0), 1.0);
}
// Positions relative to the eye on WGS84 by differences that do not cancel: decision 0013. A place is
// the difference dn of its unit normal from the eye's, and a height.

const float WGS84_A = 6378137.0;
const float WGS84_E2 = 6.69437999014e-3;

// tan(x) to a few units in the last place for |x| <= 1.2: the hardware's own is only good to about
// 2^-21 in absolute terms, which is nothing where x is small.
vec2 exact_tan(vec2 x)
{
    vec2 h = 0.5 * x, h2 = h * h;
    vec2 s = h * (1.0 + h2 * (-1.0 / 6.0 + h2 * (1.0 / 120.0 + h2 * (-1.0 / 5040.0 + h2 / 362880.0))));
    vec2 c = 1.0 + h2 * (-0.5 + h2 * (1.0 / 24.0 + h2 * (-1.0 / 720.0 + h2 * (1.0 / 40320.0 -
             h2 / 3628800.0))));
    return 2.0 * s * c / (1.0 - 2.0 * s * s);
}

#if !SCENE_CARRIED
// From angles (xi, eta) away from those of the eye on a pane's face.
vec3 normal_difference_of_angle(Pane at, vec2 angle)
{
    vec2 t = exact_tan(angle);
    vec2 g = t / (1.0 - vec2(at.along_xi.w, at.along_eta.w) * t);
    vec3 m = g.x * at.along_xi.xyz + g.y * at.along_eta.xyz;
    float scale = 1.0 / sqrt((1.0 + m.z) * (1.0 + m.z) + dot(m.xy, m.xy));
    vec3 dn = vec3(m.xy * scale, 0.0);
    dn.z = -dot(dn, dn) / (1.0 + (1.0 + m.z) * scale);
    return dn;
}

// From a half-post of a level on a pane's face.
vec3 normal_difference(Pane at, ivec2 halves, int level)
{
    vec2 angle = vec2((halves << level) - at.origin.xy) * scene.grid.x + at.base.xy;
    return normal_difference_of_angle(at, angle);
}

vec3 normal_difference(int pane, ivec2 halves, int level)
{
    return normal_difference(scene_block.panes[pane], halves, level);
}
#endif

// How much longer the radius of curvature in the prime vertical is where the normal's polar part is
// `ds` greater.
// The series of a / sqrt(1 - e2 sin^2), to 4 mm.
float radius_change(float ds)
{
    float from = scene.eye_trig.x * scene.eye_trig.x, change = ds * (2.0 * scene.eye_trig.x + ds);
    float to = from + change;
    return WGS84_A * WGS84_E2 * change *
           (0.5 + WGS84_E2 * (0.375 * (from + to) +
                              WGS84_E2 * 0.3125 * (to * to + to * from + from * from)));
}

// East, north, up from the eye of a place that is `height_m` above the ellipsoid, `rise_m` higher than
// the eye.
vec3 enu_from_difference(vec3 dn, float height_m, float rise_m)
{
    float sin0 = scene.eye_trig.x, cos0 = scene.eye_trig.y, n0 = scene.eye_trig.z;
    float ds = cos0 * dn.y + sin0 * dn.z;
    float d_radius = radius_change(ds), radius = n0 + d_radius;
    return (radius + height_m) * dn + vec3(0.0, 0.0, d_radius + rise_m) -
           WGS84_E2 * (radius * ds + d_radius * sin0) * vec3(0.0, cos0, sin0);
}

// How much higher than the eye a height is.
float rise_of(float height_m)
{
    return (height_m - scene.eye_trig.w) - scene.eye_rest.x;
}

// The inverse: dn, and in w how much higher than the eye the place is (m). The normal is parallel to the
// position with its polar part stretched, by (N + h) / ((1 - e2) N + h); what does not change from pixel
// to pixel comes with the scene, and roots are series where that will do.
vec4 difference_from_enu(vec3 enu)
{
    vec3 pole = vec3(0.0, scene.eye_trig.y, scene.eye_trig.x);
    float length0 = scene.way_back.x, polar = scene.eye_rest.w;
    float over = (2.0 * length0 * enu.z + dot(enu, enu)) * scene.way_back.y;
    float rise = over - over * over * scene.way_back.y;
    rise = over - rise * rise * scene.way_back.y;
    float thinner = rise * scene.way_back.w;
    float d_stretch = -rise * scene.way_back.z * (1.0 - thinner * (1.0 - thinner * (1.0 - thinner)));
    float dz = dot(enu, pole), stretch0 = length0 * scene.way_back.w;
    vec3 d = enu + ((stretch0 - 1.0) * dz + d_stretch * (polar + dz)) * pole;
    float d_length2 = 2.0 * length0 * d.z + dot(d, d);
    float length2 = length0 * length0 + d_length2, inverse = inversesqrt(length2);
    vec2 across = d.xy * inverse;
    float s = dot(across, across);
    float down = 0.5 * s * (1.0 + s * (0.25 + s * (0.125 + s * (0.078125 + s * 0.0546875))));
    float ds = dot(vec3(across, -down), pole);
    return vec4(across, -down, d_length2 / (length2 * inverse + length0) - radius_change(ds));
}

// How far a place is from the eye, as levels count it.
float distance_of(vec3 dn)
{
    return sqrt(dot(dn, dn) + scene.grid.y * scene.grid.y);
}

// How far a level is blended into the coarser one, where it reaches so far: from 3/4 of that on
// (CLIPMAP_BLEND), and wholly a little before the end, whatever is rounded.
float blend_at(vec3 dn, float reach)
{
    return clamp((distance_of(dn) / reach - 0.75) * (1.0 / 0.249), 0.0, 1.0);
}
