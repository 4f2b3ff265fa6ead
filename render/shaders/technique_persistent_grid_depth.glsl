// Pictures of depth (near over distance along the view) that a persistent grid keeps.
const float SAME = 0.05; // what differs by no more than this share is of one surface

bool same_surface(float a, float b)
{
    return abs(a - b) <= SAME * max(a, b);
}

// Between pixels, which is exact on planes; beside an edge that of the nearest pixel.
float depth_at(sampler2D picture, vec2 at)
{
    vec4 around = textureGather(picture, at);
    float least = min(min(around.x, around.y), min(around.z, around.w));
    float most = max(max(around.x, around.y), max(around.z, around.w));
    ivec2 size = textureSize(picture, 0);
    if (same_surface(least, most))
        return textureLod(picture, at, 0.0).r;
    return texelFetch(picture, clamp(ivec2(at * vec2(size)), ivec2(0), size - 1), 0).r;
}

bool inside(vec2 at)
{
    return all(greaterThanEqual(at, vec2(0.0))) && all(lessThan(at, vec2(1.0)));
}

// Where a place on one picture (0 to 1, and depth) is on another; w: its distance there over that here.
vec4 place_on(mat4 way, vec2 at, float depth)
{
    vec4 clip = way * vec4(2.0 * at - 1.0, depth, 1.0);
    return vec4(0.5 * clip.xy / clip.w + 0.5, clip.z / clip.w, clip.w);
}
