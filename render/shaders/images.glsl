// Imagery around the eye (terrain/image_clipmap.h): a window of texels a level, each finer level
// smaller. A place is looked up on the level whose texels are as large as its pixel, or on the finest
// one that holds it, and on the next coarser one, and is faded from one to the other.

#if COLOUR || WATER

const int IMAGE_LEVELS_MAX = 20;

struct ImageLevel {
    vec4 place;  // xy: the eye in the storage; zw: what a radian is there; in sides of the storage
    vec4 extent; // x: how far from the eye the level is drawn, in sides; y: its layer
};

layout(std140, binding = 1) uniform Images {
    vec4 range; // finest and coarsest level; texels of level 0 that a pixel covers at 1 m; 1 / width of
                // the rim over which a level fades, in sides
    ImageLevel levels[IMAGE_LEVELS_MAX];
} images;

layout(binding = 4) uniform sampler2DArray image_colours; // sRGB-coded, times alpha; alpha
layout(binding = 5) uniform sampler2DArray image_waters;  // share of water; how far that is known

struct ImageSpot {
    vec3 own, coarser; // where to look up
    float weight;      // of own, the rest is coarser's
    float enlargement; // how much larger than the pixel the images' finest texels are, log2
};

vec3 image_place(int level, vec2 angle)
{
    return vec3(images.levels[level].place.xy + angle * images.levels[level].place.zw,
                images.levels[level].extent.y);
}

// From the rim of a level inwards, in sides.
float image_inside(int level, vec2 angle)
{
    vec2 from_eye = abs(angle * images.levels[level].place.zw);
    return images.levels[level].extent.x - max(from_eye.x, from_eye.y);
}

// `angle`: from the eye to the place (rad, east and north); `slant`: the sine of the angle at which it
// is seen. Pixels are taken to be as long as the foreshortening's root.
ImageSpot image_spot(vec2 angle, float distance_m, float slant)
{
    int last = int(images.range.y);
    float lod = log2(distance_m * images.range.z * inversesqrt(clamp(slant, 0.02, 1.0)));
    int level = int(clamp(floor(lod), images.range.x, images.range.y));
    float inside = image_inside(level, angle);
    while (inside <= 0.0 && level < last) {
        level++;
        inside = image_inside(level, angle);
    }
    ImageSpot spot;
    spot.weight = clamp(inside * images.range.w, 0.0, 1.0);
    if (level < last)
        spot.weight *= 1.0 - clamp(lod - float(level), 0.0, 1.0);
    spot.enlargement = max(1.0 - lod, 0.0); // level 0 is twice as dense as the images
    spot.own = image_place(level, angle);
    spot.coarser = image_place(min(level + 1, last), angle);
    // Beyond the coarsest level there is nothing.
    if (level == last)
        spot.coarser.z = -1.0;
    return spot;
}

vec4 image_lookup(sampler2DArray image, ImageSpot spot)
{
    vec4 coarser = spot.coarser.z < 0.0 ? vec4(0.0) : textureLod(image, spot.coarser, 0.0);
    return mix(coarser, textureLod(image, spot.own, 0.0), spot.weight);
}

// Linear light, alpha.
vec4 image_colour(ImageSpot spot)
{
    vec4 texel = image_lookup(image_colours, spot);
    vec3 coded = texel.rgb / max(texel.a, 1.0 / 255.0);
    // IEC 61966-2-1 to 0.2 %.
    return vec4(coded * (coded * (coded * 0.305306011 + 0.682171111) + 0.012522878), texel.a);
}

#endif
