// What every stage shares: the scene block (render/scene.h mirrors it), the sky, the haze.

const int MAX_LEVELS = 20;

struct Level {
    ivec4 origin; // xy: column and row of the window's first post in finest posts from the eye's
                  //     base post; zw: the same post's place in the toroidal storage
    vec4 blend;   // xy: the eye in posts from the window's first post; z: where the blend starts,
                  // in posts from there; w: 1 / its width
    vec4 fade;    // x: least blend of the whole level; y: metres by which a block bulges over its
                  // corners' plane; z: the last post's index (n - 1); w: the level's shift
};

layout(std140, binding = 0) uniform Scene {
    mat4 clip_from_enu;   // of positions relative to the eye
    vec4 planes[4];       // the frustum's sides through the eye, inward normals, enu
    vec4 eye_trig;        // sin and cos of the latitude; N0; height above the ellipsoid, m
    vec4 grid;            // column and row spacing (rad); the base post from the eye (rad), xy
    vec4 eye_texture;     // xy: the base post modulo 2^20; z: storage side; w: 1 / that
    vec4 sun;             // enu direction; w: 1 above, 0 below the horizon (smooth)
    vec4 haze;            // x: extinction at the eye, 1/m; y: 1 / scale height; z: eye's altitude;
                          // w: time of day's ambient strength
    vec4 view_rays[2];    // tangents: left, bottom, right, top; least blend of the finest level drawn,
                          // unused, finest posts a pixel covers at 1 m, near distance (m)
    mat4 enu_from_eye;
    ivec4 base;           // the eye's base post (column, row); storage side - 1; finest and coarsest
                          // level drawn, 8 bits each
    vec4 blend;           // for shading: xy: the centre of blending in finest posts from the base
                          // post; z: 1 / posts from there to a level's end; w: z's inverse over width
    Level levels[MAX_LEVELS];
} scene;

vec3 sky_colour(vec3 direction)
{
    float up = max(direction.z, 0.0);
    float toward_sun = max(dot(direction, scene.sun.xyz), 0.0);
    float low = 1.0 - up;
    low *= low;
    low *= low;
    float sunset = clamp(1.0 - abs(scene.sun.z) * 4.0, 0.0, 1.0);
    vec3 zenith = mix(vec3(0.10, 0.24, 0.56), vec3(0.10, 0.15, 0.34), sunset);
    vec3 horizon = mix(vec3(0.56, 0.67, 0.80), vec3(0.74, 0.53, 0.39), sunset * (0.3 + 0.7 * toward_sun));
    vec3 sky = mix(zenith, horizon, low);
    float glow = toward_sun * toward_sun;
    glow *= glow;
    glow *= glow;
    sky += vec3(0.22, 0.19, 0.13) * glow * (0.35 + 0.65 * low);
    return sky * scene.haze.w;
}

// The share of light that the air lets through over `distance_m`, towards a point whose height
// differs by `rise_m`: homogeneous in layers, thinning exponentially with height.
float transmittance(float distance_m, float rise_m)
{
    float t = rise_m * scene.haze.y;
    float mean = abs(t) < 1e-3 ? 1.0 - 0.5 * t : (1.0 - exp(-t)) / t;
    return exp(-scene.haze.x * distance_m * mean);
}

// Radiance to what is stored: a soft shoulder, then gamma 2.
vec3 displayed(vec3 radiance)
{
    radiance = radiance * (1.0 + radiance * 0.12) / (1.0 + radiance * 0.55);
    return sqrt(clamp(radiance * 1.12, 0.0, 1.0));
}
// Positions relative to the eye on WGS84 by differences that do not cancel.

const float WGS84_A = 6378137.0;
const float WGS84_E2 = 6.69437999014e-3;

// sin(x) to a few units in the last place for |x| <= 1.6: the hardware's own is only good to
// about 2^-21 in absolute terms, which is nothing where x is small.
float small_sin(float x)
{
    float x2 = x * x;
    return x * (1.0 + x2 * (-1.0 / 6.0 + x2 * (1.0 / 120.0 + x2 * (-1.0 / 5040.0 +
           x2 * (1.0 / 362880.0 - x2 / 39916800.0)))));
}

// East, north, up from the eye of a point d_lat and d_lon (rad) away, height_m above the ellipsoid.
vec3 enu_from_difference(float d_lat, float d_lon, float height_m)
{
    float sin0 = scene.eye_trig.x, cos0 = scene.eye_trig.y, n0 = scene.eye_trig.z;
    float rise = height_m - scene.eye_trig.w;
    float s = small_sin(0.5 * d_lat);
    float c = sqrt(1.0 - s * s);
    float sin_d = 2.0 * s * c, one_minus_cos_d = 2.0 * s * s;
    float ds = cos0 * sin_d - sin0 * one_minus_cos_d;
    float dc = -sin0 * sin_d - cos0 * one_minus_cos_d;
    float w0 = 1.0 - WGS84_E2 * sin0 * sin0;
    float dw = -WGS84_E2 * ds * (2.0 * sin0 + ds);
    float root0 = sqrt(w0), root1 = sqrt(w0 + dw);
    float dn = -WGS84_A * dw / (root0 * root1 * (root0 + root1));
    float radius = n0 + dn + height_m;
    float d_rho = (dn + rise) * cos0 + radius * dc;
    float dz = ((1.0 - WGS84_E2) * dn + rise) * sin0 +
               ((1.0 - WGS84_E2) * (n0 + dn) + height_m) * ds;
    float half_lon = small_sin(0.5 * d_lon);
    float cos_half = sqrt(1.0 - half_lon * half_lon);
    float ring = radius * (cos0 + dc);
    float dx = d_rho - ring * 2.0 * half_lon * half_lon;
    float east = ring * 2.0 * half_lon * cos_half;
    return vec3(east, cos0 * dz - sin0 * dx, cos0 * dx + sin0 * dz);
}

// The inverse for shading: longitude and latitude (rad) from the eye of a point given from the eye. By
// the centre of curvature of the eye's meridian: the error grows as e^2 times the square of the angle, a
// metre at 25 km and far below a post or texel wherever a level of that spacing is drawn.
vec2 angle_from_enu(vec3 enu)
{
    float sin0 = scene.eye_trig.x, cos0 = scene.eye_trig.y, n0 = scene.eye_trig.z;
    float h0 = scene.eye_trig.w;
    float dx = cos0 * enu.z - sin0 * enu.y, dz = sin0 * enu.z + cos0 * enu.y;
    float x = (n0 + h0) * cos0 + dx;
    float d_lon = atan(enu.x / x);
    float d_rho = dx + enu.x * enu.x / (sqrt(x * x + enu.x * enu.x) + x);
    float north = cos0 * dz - sin0 * d_rho, up = cos0 * d_rho + sin0 * dz;
    float meridian_radius = n0 * (1.0 - WGS84_E2) / (1.0 - WGS84_E2 * sin0 * sin0);
    float d_lat = atan(north / (meridian_radius + h0 + up));
    return vec2(d_lon, d_lat);
}

const float RIM = 4.0; // posts over which the blend is forced to 1 whatever the eye does

// How far a place in a level's window is blended into the coarser level.
float blend_at(vec2 local, Level level)
{
    vec2 from_eye = abs(local - level.blend.xy);
    vec2 from_rim = min(local, level.fade.z - local);
    float by_eye = clamp((max(from_eye.x, from_eye.y) - level.blend.z) * level.blend.w, 0.0, 1.0);
    float by_rim = clamp(1.0 - min(from_rim.x, from_rim.y) / RIM, 0.0, 1.0);
    return max(max(by_eye, by_rim), level.fade.x);
}
