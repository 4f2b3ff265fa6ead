// Imagery around the eye (terrain/image_clipmap.h): a window of texels a level, each finer level
// smaller. A place is looked up on the level whose texels are as large as its pixel, or on the finest
// one that holds it, and on the next coarser one, and is faded from one to the other.

#if COLOUR || WATER

const int IMAGE_LEVELS_MAX = 20;

// A plane that touches the Earth: offsets from the eye on it are (along, across) . dn / (1 + toward .
// dn) sides of level 0's storage, dn the difference of the normals.
struct ImagePlane {
    vec4 along, across, toward;
};

layout(std140, binding = 1) uniform Images {
    vec4 range;  // finest and coarsest level; texels of level 0 that a pixel covers at 1 m; 1 / width
                 // of the rim over which a level fades, in sides
    ivec4 split; // x: the finest level on the first plane
    ImagePlane planes[2];
    vec4 levels[IMAGE_LEVELS_MAX]; // xy: the eye in the storage; z: how far from the eye the level is
                                   // drawn, in sides; w: its layer
} images;

layout(binding = 4) uniform sampler2DArray image_colours; // sRGB-coded, times alpha; alpha
layout(binding = 5) uniform sampler2DArray image_waters;  // share of water; how far that is known

struct ImageSpot {
    vec3 own, coarser; // where to look up
    float weight;      // of own, the rest is coarser's
    float enlargement; // how much larger than the pixel the images' finest texels are, log2
};

// From the eye on both planes, of which mostly only one is in use.
struct ImageOffsets {
    vec2 first, second;
};

vec2 image_offset(int plane, vec3 dn)
{
    vec2 offset = vec2(dot(images.planes[plane].along.xyz, dn), dot(images.planes[plane].across.xyz, dn));
    return offset / (1.0 + dot(images.planes[plane].toward.xyz, dn));
}

ImageOffsets image_offsets(vec3 dn)
{
    ImageOffsets offsets = ImageOffsets(image_offset(0, dn), vec2(0.0));
    if (images.split.x > 0)
        offsets.second = image_offset(1, dn);
    return offsets;
}

// In sides of a level.
vec2 image_on_level(int level, ImageOffsets offsets)
{
    return (level < images.split.x ? offsets.second : offsets.first) * exp2(-float(level));
}

vec3 image_place(int level, ImageOffsets offsets)
{
    return vec3(images.levels[level].xy + image_on_level(level, offsets), images.levels[level].w);
}

// From the rim of a level inwards, in sides.
float image_inside(int level, ImageOffsets offsets)
{
    vec2 from_eye = abs(image_on_level(level, offsets));
    return images.levels[level].z - max(from_eye.x, from_eye.y);
}

// `slant`: the sine of the angle at which a place is seen. Pixels are taken to be as long as the
// foreshortening's root.
ImageSpot image_spot(vec3 dn, float distance_m, float slant)
{
    int last = int(images.range.y);
    ImageOffsets offsets = image_offsets(dn);
    float lod = log2(distance_m * images.range.z * inversesqrt(clamp(slant, 0.02, 1.0)));
    int level = int(clamp(floor(lod), images.range.x, images.range.y));
    float inside = image_inside(level, offsets);
    while (inside <= 0.0 && level < last) {
        level++;
        inside = image_inside(level, offsets);
    }
    ImageSpot spot;
    spot.weight = clamp(inside * images.range.w, 0.0, 1.0);
    if (level < last)
        spot.weight *= 1.0 - clamp(lod - float(level), 0.0, 1.0);
    spot.enlargement = max(1.0 - lod, 0.0); // level 0 is twice as dense as the images
    spot.own = image_place(level, offsets);
    spot.coarser = image_place(min(level + 1, last), offsets);
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
