// Imagery around the eye (terrain/image_clipmap.h): a window of texels a level, each finer level
// smaller. A place is looked up on the level whose texels are as large as its pixel is wide, or on the
// finest one that holds it, and on the next coarser one, and is faded from one to the other. There are
// IMAGE_TAPS looks at most on each, along the ground that a pixel covers.

#if COLOUR || WATER

const int IMAGE_LEVELS_MAX = 20;
const float CLOSENESS = 0.8; // looks are as far apart as 1 / that of the footprint's width
const float RIM = 16.0;      // a level fades over a sixteenth of its side
// Levels fade into each other over 1 / that of an octave. Where each look is dear, mostly one is seen.
const float LEVELS_MEET = IMAGE_TAPS > 4 ? 1.0 : 3.0;

// A plane that touches the Earth: offsets from the eye on it are (along, across) . dn / (1 + toward .
// dn) sides of level 0's storage, dn the difference of the normals.
struct ImagePlane {
    vec4 along, across, toward;
};

layout(std140, binding = 1) uniform Images {
    vec4 range;  // finest and coarsest level; how much a normal changes over the pixel's angle at
                 // 1 m; texels a side
    ivec4 split; // x: the finest level on the first plane
    ImagePlane planes[2];
    vec4 levels[IMAGE_LEVELS_MAX]; // xy: the eye in the storage; z: how far from the eye the level is
                                   // drawn, in sides; w: its layer
} images;

layout(binding = 4) uniform sampler2DArray image_colours; // sRGB-coded, times alpha; alpha
layout(binding = 5) uniform sampler2DArray image_waters;  // share of water; how far that is known

// Where a pixel looks: along the longer axis of its footprint, on two levels.
struct ImageSpot {
    vec3 own, coarser;           // the footprint's middle
    vec2 own_length, coarser_length;
    int own_taps, coarser_taps;
    float weight;                // of own, the rest is coarser's
    float enlargement;           // how much larger than the pixel the images' finest texels are, log2
};

// From the eye on both planes, of which mostly only one is in use; and how long the footprint is there.
struct ImageOffsets {
    vec2 first, second, first_length, second_length;
};

vec2 image_along(int plane, vec3 way)
{
    return vec2(dot(images.planes[plane].along.xyz, way), dot(images.planes[plane].across.xyz, way));
}

// How the offset changes with dn, along a way.
vec2 image_change(int plane, vec3 dn, vec2 offset, vec3 way)
{
    vec3 toward = images.planes[plane].toward.xyz;
    return (image_along(plane, way) - offset * dot(toward, way)) / (1.0 + dot(toward, dn));
}

vec2 image_offset(int plane, vec3 dn)
{
    return image_along(plane, dn) / (1.0 + dot(images.planes[plane].toward.xyz, dn));
}

ImageOffsets image_offsets(vec3 dn, vec3 footprint)
{
    ImageOffsets offsets = ImageOffsets(image_offset(0, dn), vec2(0.0), vec2(0.0), vec2(0.0));
    offsets.first_length = image_change(0, dn, offsets.first, footprint);
    if (images.split.x > 0) {
        offsets.second = image_offset(1, dn);
        offsets.second_length = image_change(1, dn, offsets.second, footprint);
    }
    return offsets;
}

// In sides of a level.
vec2 image_on_level(int level, ImageOffsets offsets)
{
    return (level < images.split.x ? offsets.second : offsets.first) * exp2(-float(level));
}

vec2 image_length(int level, ImageOffsets offsets)
{
    return (level < images.split.x ? offsets.second_length : offsets.first_length) * exp2(-float(level));
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

// How many looks a footprint of so many texels of level 0 takes on a level: no closer to each other
// than the footprint is wide, or than the texels are.
int image_taps(int level, float major, float minor)
{
    float taps = CLOSENESS * major / max(minor, exp2(float(level)));
    return int(clamp(ceil(taps), 1.0, float(IMAGE_TAPS)));
}

// Of ground with the ellipsoid's `normal`, `facing` the sine of the angle at which it is seen: a pixel's
// footprint is as wide as its angle and longer by the foreshortening. The level goes by its width, or
// by its length over the most looks there may be; the loop takes the length (Heckbert 1989; the
// hardware's own way of it is not specified).
ImageSpot image_spot(vec3 dn, vec3 normal, vec3 view, float distance_m, float facing)
{
    int last = int(images.range.y);
    float width = distance_m * images.range.z;
    vec3 ahead = normalize(view + facing * normal + vec3(1e-4, 0.0, 0.0)); // straight down: any way
    vec3 footprint = ahead * (width / clamp(facing, 0.02, 1.0));
    ImageOffsets offsets = image_offsets(dn, footprint);
    float major = images.range.w * length(offsets.first_length);
    float minor = images.range.w *
                  length(image_change(0, dn, offsets.first, width * cross(normal, ahead)));
    float lod = log2(max(minor, CLOSENESS * major / float(IMAGE_TAPS)));
    int level = int(clamp(floor(lod), images.range.x, images.range.y));
    float inside = image_inside(level, offsets);
    while (inside <= 0.0 && level < last) {
        level++;
        inside = image_inside(level, offsets);
    }
    int coarser = min(level + 1, last);
    ImageSpot spot;
    spot.weight = clamp(inside * RIM, 0.0, 1.0);
    if (level < last)
        spot.weight *= clamp((0.5 - (lod - float(level))) * LEVELS_MEET + 0.5, 0.0, 1.0);
    spot.enlargement = max(1.0 - log2(minor), 0.0); // level 0 is twice as dense as the images
    spot.own = image_place(level, offsets);
    spot.own_length = image_length(level, offsets);
    spot.own_taps = image_taps(level, major, minor);
    spot.coarser = image_place(coarser, offsets);
    spot.coarser_length = image_length(coarser, offsets);
    spot.coarser_taps = image_taps(coarser, major, minor);
    // Beyond the coarsest level there is nothing.
    if (level == last)
        spot.coarser_taps = 0;
    return spot;
}

// Linear light, times alpha; IEC 61966-2-1 to 0.2 %.
vec4 image_light(vec4 texel)
{
    vec3 coded = texel.rgb / max(texel.a, 1.0 / 255.0);
    return vec4(texel.a * coded * (coded * (coded * 0.305306011 + 0.682171111) + 0.012522878), texel.a);
}

vec4 image_mean(sampler2DArray image, bool light, vec3 middle, vec2 length, int taps)
{
    vec2 step = length / float(max(taps, 1));
    vec3 at = vec3(middle.xy - 0.5 * float(taps - 1) * step, middle.z);
    vec4 sum = vec4(0.0);
    for (int i = 0; i < taps; i++) {
        vec4 texel = textureLod(image, at, 0.0);
        sum += light ? image_light(texel) : texel;
        at.xy += step;
    }
    return sum / float(max(taps, 1));
}

vec4 image_lookup(sampler2DArray image, bool light, ImageSpot spot)
{
    vec4 found = vec4(0.0);
    if (spot.weight < 1.0)
        found = (1.0 - spot.weight) *
                image_mean(image, light, spot.coarser, spot.coarser_length, spot.coarser_taps);
    if (spot.weight > 0.0)
        found += spot.weight * image_mean(image, light, spot.own, spot.own_length, spot.own_taps);
    return found;
}

// Linear light, alpha.
vec4 image_colour(ImageSpot spot)
{
    vec4 found = image_lookup(image_colours, true, spot);
    return vec4(found.rgb / max(found.a, 1.0 / 255.0), found.a);
}

#endif
