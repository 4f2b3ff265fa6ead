// A rasteriser of depth in compute shaders: decision 0018. A triangle covers the samples (the middles
// of pixels) that lie in it, or outside of it by less than what may be rounded (about 1/500 pixel), so
// that no sample between two triangles with a common edge is missed.

const int TILE = 32;         // pixels across of what a work group of raster_large.comp does at a time
const float SMALL = 256.0;   // pixels of a triangle's bounds that one invocation goes through
const uint LARGE_MOST = 65536u, JOBS_MOST = 262144u; // as in render/raster.c

layout(binding = 3, r32ui) uniform uimage2D picture; // depth, its bits
layout(std430, binding = 6) buffer Large {
    uint large_count, job_count, unused0, unused1;
    vec4 large_corners[]; // three a triangle
};
layout(std430, binding = 7) buffer Jobs { uvec2 jobs[]; }; // triangle; first column + 65536 * row

// Linear functions of a place, in pixels from the middle of one: x, y, constant.
struct Triangle {
    mat3 edges; // not negative inside
    vec3 depth;
    float least, most; // depth of its corners
    bool cut;          // by the near plane; parallel rays' are not
};

// A corner of a triangle: clip coordinates over w, and w.
vec4 corner_from(vec4 clip)
{
    float w = abs(clip.w) < 1e-6 ? 1e-6 : clip.w; // a micrometre from the plane of the eye
    return vec4(clip.xyz / w, w);
}

// In pixels from the middle of the one at `origin`.
vec2 place_of(vec4 corner, vec2 origin)
{
    return (corner.xy + 1.0) * (0.5 * vec2(imageSize(picture))) - (origin + 0.5);
}

vec3 widened(vec3 edge, float pixels)
{
    return edge + vec3(0.0, 0.0, (abs(edge.x) + abs(edge.y)) * pixels);
}

vec3 edge_through(vec2 from, vec2 to, float margin)
{
    vec2 way = to - from;
    return widened(vec3(-way.y, way.x, way.y * from.x - way.x * from.y), margin);
}

float greatest(vec2 v)
{
    return max(abs(v.x), abs(v.y));
}

// All corners before the near plane: depth is taken by its differences from a corner's, which keeps
// it right where a triangle is seen as a line nearly.
bool set_up_whole(vec4 a, vec4 b, vec4 c, vec2 origin, inout Triangle triangle)
{
    vec2 p = place_of(a, origin), q = place_of(b, origin), r = place_of(c, origin);
    vec2 u = q - p, v = r - p;
    float area = u.x * v.y - u.y * v.x;
    if (!(area > 0.0))
        return false;
    vec3 depths = vec3(a.z, b.z, c.z);
    vec2 rise = depths.yz - depths.x;
    vec2 slope = vec2(v.y * rise.x - u.y * rise.y, u.x * rise.y - v.x * rise.x) / area;
    float margin = exp2(-20.0) * max(greatest(vec2(imageSize(picture))),
                                     max(greatest(p), max(greatest(q), greatest(r))));
    triangle.edges = mat3(edge_through(q, r, margin), edge_through(r, p, margin),
                          edge_through(p, q, margin));
    triangle.depth = vec3(slope, depths.x - dot(slope, p));
    triangle.least = min(depths.x, min(depths.y, depths.z));
    triangle.most = max(depths.x, max(depths.y, depths.z));
    return true;
}

vec3 homogeneous(vec4 corner, vec2 origin)
{
    return vec3(place_of(corner, origin) * corner.w, corner.w);
}

// Edge functions from cross products (Olano and Greer 1997): no corner need be before the eye.
bool set_up_cut(vec4 a, vec4 b, vec4 c, vec2 origin, inout Triangle triangle)
{
    vec3 p = homogeneous(a, origin), q = homogeneous(b, origin), r = homogeneous(c, origin);
    vec3 from_p = cross(q, r), from_q = cross(r, p), from_r = cross(p, q);
    float volume = dot(p, from_p);
    if (!(volume > 0.0))
        return false;
    const float MARGIN = 1.0 / 256.0;
    triangle.edges = mat3(widened(from_p, MARGIN), widened(from_q, MARGIN), widened(from_r, MARGIN));
    triangle.depth = (from_p + from_q + from_r) * (scene.grid.w / volume);
    return true;
}

// False for a triangle that faces away.
bool set_up(vec4 a, vec4 b, vec4 c, vec2 origin, out Triangle triangle)
{
    triangle.cut = min(a.w, min(b.w, c.w)) < scene.grid.w;
    return triangle.cut ? set_up_cut(a, b, c, origin, triangle)
                        : set_up_whole(a, b, c, origin, triangle);
}

void draw_pixel(Triangle triangle, ivec2 pixel, vec2 place)
{
    vec3 at = vec3(place, 1.0);
    if (any(lessThan(at * triangle.edges, vec3(0.0))))
        return;
    float depth = dot(triangle.depth, at);
    if (!triangle.cut)
        depth = clamp(depth, triangle.least, triangle.most);
    if (depth <= 0.0 || depth > 1.0)
        return;
    imageAtomicMax(picture, pixel, floatBitsToUint(depth));
}
