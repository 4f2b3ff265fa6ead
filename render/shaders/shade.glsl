// Shades every pixel once, from the depth that the terrain pass drew: sky where there is none, else
// land and water from slopes, altitude and noise fixed to the ground. The cost of a frame's shading
// is thus the same whatever the geometry, but for pixels on an edge where they have several samples:
// those are shaded one by one.

layout(binding = 1) uniform sampler2DArray surfaces; // slopes along and across, water, bend (all but
                                                     // water coded)
layout(binding = 2) uniform sampler2DArray ground;   // tiling: slope x, slope y, two noises; a layer with
                                                     // waves of all lengths, one with short ones
// Near / distance along the view axis; for parallel rays the way from far as a share.
#if SAMPLES > 1
layout(binding = 3) uniform sampler2DMS depths;
#else
layout(binding = 3) uniform sampler2D depths;
#endif

const vec3 SURFACE_MOST = vec3(4.0, 4.0, 1.0); // slopes, bend: terrain/loader.h
const float PHOTO_RELIEF = 0.4;  // how much of a slope is seen on a photograph
const float PHOTO_ALBEDO = 0.42; // of what is white there

// A place on the ground as its face of the cube has it.
struct Spot {
    int pane;
    ivec2 origin;    // the eye's base half-post of level 0 there
    vec2 halves;     // half-posts of level 0 from it
    vec3 normal;     // of the ellipsoid, enu at the eye
    vec3 along, across; // the directions of slopes: of growing xi, and to its left
};

// How a pane lies to the eye.
struct Lie {
    mat3 axes;
    vec2 base, eye;
    ivec2 origin;
};

Lie lie_of(int pane)
{
#if SCENE_CARRIED
    return Lie(scene.axes[pane], scene.base[pane].xy, scene.base[pane].zw, scene.origin[pane]);
#else
    Pane at = scene_block.panes[pane];
    return Lie(at.axes, at.base.xy, vec2(at.along_xi.w, at.along_eta.w), at.origin.xy);
#endif
}

// atan() to 1e-5 for |t| <= 1, an odd polynomial (Abramowitz and Stegun 4.4.49's kind).
vec2 quick_atan(vec2 t)
{
    vec2 t2 = t * t;
    return t * (0.99997726 + t2 * (-0.33262347 + t2 * (0.19354346 + t2 * (-0.11643287 +
               t2 * (0.05265332 - t2 * 0.01172120)))));
}

Spot spot_at(vec3 dn)
{
    Spot spot;
    spot.normal = vec3(dn.xy, 1.0 + dn.z);
    // Software rasterisers look up what has an index of its own value by value, so panes are chosen by
    // comparing.
    Lie at = lie_of(0);
    float most = 0.0;
    for (int p = 0; p < PANES; p++) {
        Lie other = lie_of(p);
        float toward = dot(other.axes[0], spot.normal);
        if (toward > most) {
            most = toward;
            spot.pane = p;
            at = other;
        }
    }
    spot.origin = at.origin;
    vec3 d = dn * at.axes; // in the face's axes
    vec2 change = (d.yz - at.eye * d.x) / most;
    vec2 angle = quick_atan(change / (1.0 + at.eye * (at.eye + change)));
    spot.halves = (angle - at.base) / scene.grid.x;
    spot.along = normalize(at.axes[1] - spot.normal * dot(at.axes[1], spot.normal));
    spot.across = cross(spot.normal, spot.along);
    return spot;
}

// 2^-n, which is exact and but a shift; exp2() is a polynomial by software.
float halved(int n)
{
    return intBitsToFloat((127 - n) << 23);
}

// Slopes and bend (as terrain/loader.h codes them), water. The storage is toroidal, so a half-post's texel
// follows from its address alone and no window has to be looked up.
vec4 surface_of_level(Spot spot, int level)
{
    const uint SIDE = 2u * uint(STORAGE), WHOLE = (1u << 30) / SIDE * SIDE; // origins may be below 0
    vec2 texel = vec2((uvec2(spot.origin >> level) + WHOLE) % SIDE) +
                 (vec2(spot.origin & ((1 << level) - 1)) + spot.halves) * halved(level) + 0.5;
    return textureLod(surfaces, vec3(texel * (1.0 / float(SIDE)), PANES * level + spot.pane), 0.0);
}

// From the level that covers the place, blended into the next as the geometry is: levels end at
// distances that double. Slopes, water, bend.
vec4 surface_at(Spot spot, vec3 dn)
{
    float away = distance_of(dn) * scene.eye_rest.y;
    int first = scene.sizes.z, last = scene.sizes.w;
    int level = clamp((floatBitsToInt(away) + 0x7fffff >> 23) - 127, first, last); // log2, rounded up
    vec4 own = surface_of_level(spot, level);
    float blend = clamp((away * halved(level) - 1.0) * scene.eye_rest.z + 1.0, 0.0, 1.0);
    if (blend > 0.0 && level < last)
        own = mix(own, surface_of_level(spot, level + 1), blend);
    vec3 code = own.xyw * (255.0 / 127.0) - 128.0 / 127.0, ground_shape = SURFACE_MOST * code * abs(code);
    return vec4(ground_shape.xy, own.z, ground_shape.z);
}

// The noise of a tile that is 2^power half-posts of level 0 wide, whatever these are, and of which a pixel
// covers 2^lod texels.
vec4 ground_noise(Spot spot, int power, float layer, float lod)
{
    ivec2 whole = spot.origin & ((1 << max(power, 0)) - 1);
    return textureLod(ground, vec3((vec2(whole) + spot.halves) * halved(power), layer), lod);
}

// What grows or lies there. `soft` is what thresholds have to be wider by where the noise that would cut
// across them is too fine to be seen. `wide` varies over kilometres, `near` over metres; both are fixed
// to the ground. Tree and snow lines follow the latitude, of which `sin2` is the sine's square, as they
// do on Earth, and so do deserts. Hollows are moist and keep snow; ridges are bare.
vec3 land_colour(float altitude_km, float steepness, float hollow, float sin2, vec4 wide, vec4 near,
                 float soft)
{
    float tropic = (sin2 - 0.17) * 12.0;
    float dry = 1.0 / (1.0 + tropic * tropic);
    float tree_line = 3.9 - (2.6 + 2.0 * sin2) * sin2;
    float snow_line = 5.3 - (2.6 + 3.2 * sin2) * sin2;
    float patches = wide.z * 0.55 + near.z * 0.45;
    float ragged = (patches - 0.5) * 1.1;
    float moisture = smoothstep(0.38, 0.62, wide.w * 0.7 + near.w * 0.3 + 0.1 - 0.3 * dry + 0.4 * hollow);

    vec3 straw = mix(vec3(0.155, 0.135, 0.060), vec3(0.300, 0.235, 0.150), dry);
    vec3 meadow = mix(straw, vec3(0.070, 0.105, 0.028), moisture);
    vec3 forest = vec3(0.020, 0.036, 0.014) * (0.2 + 1.7 * near.z);
    vec3 alpine = mix(vec3(0.155, 0.135, 0.085), vec3(0.105, 0.110, 0.055), moisture);
    vec3 rock = mix(vec3(0.115, 0.105, 0.098), vec3(0.215, 0.200, 0.185), patches);
    vec3 snow = vec3(0.80, 0.84, 0.90);

    float above_trees = smoothstep(-0.25, 0.15, altitude_km + 0.4 * ragged - tree_line);
    vec3 land = mix(meadow, alpine, above_trees);
    float growth = wide.w * 0.45 + near.w * 0.35 + near.z * 0.2 - 0.2 * dry + 0.2 * hollow;
    float trees = smoothstep(0.49 - soft, 0.53 + soft, growth) *
                  (1.0 - above_trees) * (1.0 - smoothstep(0.7, 1.1, steepness));
    land = mix(land * (0.65 + 0.7 * near.z), forest, trees);
    float bare = smoothstep(0.62, 0.78, steepness + 0.7 * ragged + 0.2 * above_trees - 0.5 * hollow);
    land = mix(land, rock * (0.25 + 1.5 * near.z), bare);
    float snowy = smoothstep(-0.04, 0.10, altitude_km + 0.9 * ragged - snow_line) *
                  (1.0 - smoothstep(0.75, 0.95, steepness + 0.5 * ragged - 0.6 * hollow));
    land = mix(land, snow, snowy);
    return mix(vec3(0.21, 0.18, 0.125), land, smoothstep(0.0005, 0.006, altitude_km));
}

// Power 32 by squaring.
float power32(float x)
{
    x *= x;
    x *= x;
    x *= x;
    x *= x;
    return x * x;
}

vec3 water_radiance(vec3 view, vec3 normal, vec3 up, vec3 sun_colour, vec3 ambient, vec3 body)
{
    vec3 mirrored = reflect(view, normal);
    float above = dot(mirrored, up);
    mirrored += (abs(above) - above) * up;
    float facing = 1.0 - max(dot(-view, normal), 0.0);
    float facing2 = facing * facing;
    float fresnel = 0.02 + 0.98 * facing2 * facing2 * facing;
    float glint = power32(max(dot(mirrored, scene.sun.xyz), 0.0));
    return mix(body * (sun_colour * 0.6 + ambient), sky_colour(mirrored),
               fresnel) + sun_colour * glint * 0.8;
}

// The normal of ground with such slopes.
vec3 tilted(Spot spot, vec2 slope)
{
    return normalize(spot.normal - slope.x * spot.along - slope.y * spot.across);
}

#if COLOUR
// A photograph has light and shade of its own, so slopes count for less than they do elsewhere. Where
// its texels are larger than pixels neither slopes nor what grows there is in it: then slopes count in
// full, and noise gives it a texture (`mottle`, about 0).
vec3 photo_radiance(vec3 photo, float mottle, Spot spot, vec2 slope, vec2 rough_slope,
                    float enlargement, vec3 sun_colour, vec3 ambient)
{
    float lacking = clamp(0.25 * enlargement, 0.0, 1.0);
    vec3 normal = tilted(spot, mix(PHOTO_RELIEF * slope, rough_slope, lacking));
    float lit = max(dot(normal, scene.sun.xyz), 0.0);
    vec3 albedo = PHOTO_ALBEDO * photo * (1.0 + mottle * lacking);
    return albedo * (sun_colour * lit + ambient * (0.55 + 0.45 * dot(normal, spot.normal)));
}
#endif

// `distance_m`: at which a pixel is as large there.
vec3 ground_radiance(vec3 dn, vec3 view, float distance_m, float altitude_km)
{
    Spot spot = spot_at(dn);
    vec4 surface = surface_at(spot, dn);
    // Half-posts of level 0 that a pixel covers, lengthened by half of the foreshortening.
    float facing = -dot(view, spot.normal);
    float covered = distance_m * scene.grid.z * 2.0 * inversesqrt(clamp(facing, 0.02, 1.0));
    // Tiles of 1024 km, 64 km, 4 km, 256 m and 16 m, of 2^8 texels.
    int power = scene.sizes.x;
    float lod = log2(covered) - float(power - 8) - 0.6;
    // From where its tiles would be seen to stand in rows there is no noise.
    vec4 seen = clamp(vec4(-1.0, 0.0, -2.0, -4.0) - 0.5 * lod, 0.0, 1.0);
    vec4 wide = mix(vec4(0.5), ground_noise(spot, power, 0.0, lod), seen.x);
    vec4 middle = mix(vec4(0.5), ground_noise(spot, power - 4, 1.0, lod + 4.0), seen.y);
    vec4 near = mix(vec4(0.5), ground_noise(spot, power - 8, 1.0, lod + 8.0), seen.z);
#if GRAIN
    wide += 0.6 * clamp(1.0 - 0.5 * lod, 0.0, 1.0) * (ground_noise(spot, power + 4, 0.0, lod - 4.0) - 0.5);
    vec4 grain = mix(vec4(0.5), ground_noise(spot, power - 12, 1.0, lod + 12.0), seen.w);
#else
    vec4 grain = vec4(0.5); // each is a twentieth of a frame by software
#endif

    float steepness = length(surface.xy), hollow = surface.w, water = surface.z;
#if COLOUR || WATER
    ImageSpot image = image_spot(dn, spot.normal, view, distance_m, facing);
#endif
#if WATER
    vec2 mask = image_lookup(image_waters, false, image).xy;
    water = water * (1.0 - mask.y) + mask.x;
#endif
    water = smoothstep(0.45, 0.55, water);
    vec2 bumps = (wide.xy - 0.5) * 0.7 + (middle.xy - 0.5) * 1.3 + (near.xy - 0.5) * 1.4 +
                 (grain.xy - 0.5) * 0.7;
    vec2 slope = surface.xy + bumps * (0.12 + 0.88 * min(steepness, 1.0)) * (1.0 - water);
    slope += (near.xy - 0.5) * 0.05 * water;
    vec3 normal = tilted(spot, slope);

    vec3 sun_colour = sun_light(), ambient = sky_light();
    vec3 body = vec3(0.012, 0.045, 0.075);
#if COLOUR
    vec4 photo = image_colour(image);
    body = mix(body, photo.rgb, photo.a);
#endif
    vec3 radiance = vec3(0.0);
    if (water < 1.0) {
        float lit = max(dot(normal, scene.sun.xyz), 0.0);
        float sine = dot(spot.normal.yz, scene.eye_trig.yx);
        vec3 albedo = land_colour(altitude_km, steepness, hollow, sine * sine, mix(wide, middle, 0.35),
                                  mix(middle, near, 0.5), 0.05 * (2.0 - seen.y - seen.z));
        albedo *= 0.6 + 0.8 * grain.z;
        float open = 0.55 + 0.45 * dot(normal, spot.normal) - 0.5 * hollow; // to the sky
        radiance = albedo * (sun_colour * lit + ambient * max(open, 0.2));
#if COLOUR
        float mottle = dot(vec3(wide.z, middle.z, near.z) - 0.5, vec3(0.6, 0.6, 0.8));
        vec3 lit_photo = photo_radiance(photo.rgb, mottle, spot, surface.xy, slope,
                                        image.enlargement, sun_colour, ambient);
        radiance = mix(radiance, lit_photo, photo.a);
#endif
    }
    if (water > 0.0)
        radiance = mix(radiance, water_radiance(view, normal, spot.normal, sun_colour, ambient, body),
                       water);
    return radiance;
}

// What is seen through `tangent` of the view. Parallel rays show one place of the sky, and no sun there,
// which would be all of it.
vec3 shaded(vec2 tangent, float depth)
{
    Ray ray = ray_through(tangent);
    float ray_length = length(ray.along);
    vec3 view = ray.along / ray_length;
    bool ground_seen = GROUND == 1 && (SKY == 0 || depth > scene.accuracy.y);
    vec3 radiance = ground_seen ? sky_colour(vec3(view.xy, 0.0)) : sky_seen(view);
    if (ground_seen) {
        float along_m = along_of(depth), distance_m = ray_length * along_m;
        vec4 place = difference_from_enu(ray.from + ray.along * along_m);
        vec3 land = ground_radiance(place.xyz, view, distance_m * scene.along.w + scene.parallel.w,
                                    (scene.haze.z + place.w) * 1e-3);
        radiance = mix(radiance, land, transmittance(distance_m, place.w));
    } else {
        float disc = smoothstep(0.99996, 0.99999, dot(view, scene.sun.xyz));
        radiance += vec3(12.0, 10.5, 8.0) * disc * (scene.sun.w * scene.along.w);
    }
    return displayed(radiance);
}

#if SAMPLES > 1

// Samples whose depths differ by more than this share are of two surfaces, or of one that is seen so
// flatly that no harm is done.
const float EDGE = 0.05;

const vec2 sample_places[SAMPLES] = vec2[](SAMPLE_PLACES);

// What a pixel shows, the view's tangent at its middle. Depth is linear across a surface, and the
// samples lie evenly around the middle.
vec3 pixel_shown(ivec2 pixel, vec2 tangent)
{
    float depth[SAMPLES], least = 1e30, most = 0.0, sum = 0.0;
    for (int i = 0; i < SAMPLES; i++) {
        depth[i] = texelFetch(depths, pixel, i).r;
        least = min(least, depth[i]);
        most = max(most, depth[i]);
        sum += depth[i];
    }
    bool edge = most - least > EDGE * most * scene.along.w + scene.parallel.z;
    vec2 pixel_size = (scene.view_rays.zw - scene.view_rays.xy) / vec2(textureSize(depths));
    vec3 light = vec3(0.0); // which adds up; what is stored is its root
    int count = edge ? SAMPLES : 1;
    for (int i = 0; i < count; i++) {
        vec2 off = edge ? (sample_places[i] - 0.5) * pixel_size : vec2(0.0);
        vec3 own = shaded(tangent + off, edge ? depth[i] : sum / float(SAMPLES));
        light += own * own;
    }
    return sqrt(light / float(count));
}

#else

vec3 pixel_shown(ivec2 pixel, vec2 tangent)
{
    return shaded(tangent, texelFetch(depths, pixel, 0).r);
}

#endif
