// Shades every pixel once, from the depth that the terrain pass drew: sky where there is none, else
// land and water from slopes, altitude and noise fixed to the ground. The cost of a frame's shading
// is thus the same whatever the geometry.

layout(binding = 1) uniform sampler2DArray surfaces; // slope east, slope north (coded), water
layout(binding = 2) uniform sampler2D ground;        // tiling: slope x, slope y, two noises
layout(binding = 3) uniform sampler2D depths;        // near / distance along the view axis

const float SURFACE_STEEPEST = 4.0;
const float PHOTO_RELIEF = 0.4;  // how much of a slope is seen on a photograph
const float PHOTO_ALBEDO = 0.42; // of what is white there

// Slopes (as terrain/loader.h codes them) and water at a place on the finest grid. The storage is
// toroidal, so a post's texel follows from its address alone and no window has to be looked up.
vec3 surface_of_level(vec2 grid, int level)
{
    float spacing = exp2(float(-level));
    ivec2 base = scene.base.xy << 1; // in half-posts
    vec2 texel = vec2((base >> level) & (2 * scene.base.z + 1)) +
                 (vec2(base & ((1 << level) - 1)) + 2.0 * grid) * spacing + 0.5;
    return textureLod(surfaces, vec3(texel * (0.5 * scene.eye_texture.w), level), 0.0).xyz;
}

// From the level that covers the place, blended into the next as the geometry is.
vec3 surface_at(vec2 grid)
{
    vec2 from_eye = abs(grid - scene.blend.xy);
    float posts = max(max(from_eye.x, from_eye.y), 1.0);
    int first = scene.base.w & 255, last = scene.base.w >> 8;
    int level = clamp(int(ceil(log2(posts * scene.blend.z))), first, last);
    float blend = clamp((posts * exp2(float(-level)) * scene.blend.z - 1.0) * scene.blend.w + 1.0,
                        0.0, 1.0);
    if (level == first)
        blend = max(blend, scene.view_rays[1].x);
    vec3 own = surface_of_level(grid, level);
    if (blend > 0.0 && level < last)
        own = mix(own, surface_of_level(grid, level + 1), blend);
    vec2 code = own.xy * (255.0 / 127.0) - 128.0 / 127.0;
    return vec3(SURFACE_STEEPEST * code * abs(code), own.z);
}

// What grows or lies there. `wide` varies over kilometres, `near` over metres; both are fixed to the
// ground. Tree and snow lines follow the latitude as they do on Earth.
vec3 land_colour(float altitude_km, float steepness, vec4 wide, vec4 near)
{
    float sin2 = scene.eye_trig.x * scene.eye_trig.x;
    float tree_line = 3.9 - (2.6 + 2.0 * sin2) * sin2;
    float snow_line = 5.3 - (2.6 + 3.2 * sin2) * sin2;
    float patches = wide.z * 0.55 + near.z * 0.45;
    float ragged = (patches - 0.5) * 1.1;
    float moisture = smoothstep(0.38, 0.62, wide.w * 0.7 + near.w * 0.3);

    vec3 meadow = mix(vec3(0.155, 0.135, 0.060), vec3(0.070, 0.105, 0.028), moisture);
    vec3 forest = vec3(0.020, 0.036, 0.014) * (0.2 + 1.7 * near.z);
    vec3 alpine = mix(vec3(0.155, 0.135, 0.085), vec3(0.105, 0.110, 0.055), moisture);
    vec3 rock = mix(vec3(0.115, 0.105, 0.098), vec3(0.215, 0.200, 0.185), patches);
    vec3 snow = vec3(0.80, 0.84, 0.90);

    float above_trees = smoothstep(-0.25, 0.15, altitude_km + 0.4 * ragged - tree_line);
    vec3 land = mix(meadow, alpine, above_trees);
    float trees = smoothstep(0.49, 0.53, wide.w * 0.45 + near.w * 0.35 + near.z * 0.2) *
                  (1.0 - above_trees) * (1.0 - smoothstep(0.7, 1.1, steepness));
    land = mix(land * (0.65 + 0.7 * near.z), forest, trees);
    float bare = smoothstep(0.62, 0.78, steepness + 0.7 * ragged + 0.2 * above_trees);
    land = mix(land, rock * (0.25 + 1.5 * near.z), bare);
    float snowy = smoothstep(-0.04, 0.10, altitude_km + 0.9 * ragged - snow_line) *
                  (1.0 - smoothstep(0.75, 0.95, steepness + 0.5 * ragged));
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

vec3 water_radiance(vec3 view, vec3 normal, vec3 sun_colour, vec3 ambient, vec3 body)
{
    vec3 mirrored = reflect(view, normal);
    mirrored.z = abs(mirrored.z);
    float facing = 1.0 - max(dot(-view, normal), 0.0);
    float facing2 = facing * facing;
    float fresnel = 0.02 + 0.98 * facing2 * facing2 * facing;
    float glint = power32(max(dot(mirrored, scene.sun.xyz), 0.0));
    return mix(body * (sun_colour * 0.6 + ambient), sky_colour(mirrored),
               fresnel) + sun_colour * glint * 0.8;
}

#if COLOUR
// A photograph has light and shade of its own, so slopes count for less than they do elsewhere. Where
// its texels are larger than pixels neither slopes nor what grows there is in it: then slopes count in
// full, and noise gives it a texture (`mottle`, about 0).
vec3 photo_radiance(vec3 photo, float mottle, vec2 slope, vec2 rough_slope, float enlargement,
                    vec3 sun_colour, vec3 ambient)
{
    float lacking = clamp(0.25 * enlargement, 0.0, 1.0);
    vec3 normal = normalize(vec3(-mix(PHOTO_RELIEF * slope, rough_slope, lacking), 1.0));
    float lit = max(dot(normal, scene.sun.xyz), 0.0);
    vec3 albedo = PHOTO_ALBEDO * photo * (1.0 + mottle * lacking);
    return albedo * (sun_colour * lit + ambient * (0.55 + 0.45 * normal.z));
}
#endif

vec3 ground_radiance(vec3 enu, vec3 view, float distance_m, float altitude_km)
{
    vec2 angle = angle_from_enu(enu);
    vec2 grid = (angle - scene.grid.zw) / scene.grid.xy;
    vec3 surface = surface_at(grid);
    vec2 place = grid + scene.eye_texture.xy;
    // Finest posts that a pixel covers, lengthened by half of the foreshortening.
    float posts = distance_m * scene.view_rays[1].z * inversesqrt(clamp(-view.z, 0.02, 1.0));
    float lod = log2(posts) - 0.6;
    vec4 wide = textureLod(ground, place * (1.0 / 16384.0), lod - 6.0);
    vec4 middle = textureLod(ground, place * (1.0 / 2048.0), lod - 3.0);
    vec4 near = textureLod(ground, place * (1.0 / 256.0), lod);

    float steepness = length(surface.xy);
    float water = surface.z;
#if COLOUR || WATER
    ImageSpot spot = image_spot(angle, distance_m, -view.z);
#endif
#if WATER
    vec2 mask = image_lookup(image_waters, spot).xy;
    water = water * (1.0 - mask.y) + mask.x;
#endif
    water = smoothstep(0.45, 0.55, water);
    vec2 bumps = (wide.xy - 0.5) * 0.7 + (middle.xy - 0.5) * 1.3 + (near.xy - 0.5) * 1.4;
    vec2 slope = surface.xy + bumps * (0.12 + 0.88 * min(steepness, 1.0)) * (1.0 - water);
    slope += (near.xy - 0.5) * 0.05 * water;
    vec3 normal = normalize(vec3(-slope, 1.0));

    vec3 sun_colour = mix(vec3(2.9, 1.5, 0.7), vec3(3.5, 3.25, 2.8),
                          clamp(scene.sun.z * 3.0, 0.0, 1.0)) * scene.sun.w;
    vec3 ambient = vec3(0.26, 0.36, 0.54) * scene.haze.w;
    vec3 body = vec3(0.012, 0.045, 0.075);
#if COLOUR
    vec4 photo = image_colour(spot);
    body = mix(body, photo.rgb, photo.a);
#endif
    if (water >= 1.0)
        return water_radiance(view, normal, sun_colour, ambient, body);
    float lit = max(dot(normal, scene.sun.xyz), 0.0);
    vec3 albedo =
        land_colour(altitude_km, steepness, mix(wide, middle, 0.35), mix(middle, near, 0.5));
    vec3 radiance = albedo * (sun_colour * lit + ambient * (0.55 + 0.45 * normal.z));
#if COLOUR
    // A noise that is far away enough for its tiles to stand in rows is left out.
    vec3 strength = clamp(vec3(3.0, 2.0, 1.0) - 0.25 * lod, 0.0, 1.0);
    float mottle = dot((vec3(wide.z, middle.z, near.z) - 0.5) * strength, vec3(0.6, 0.6, 0.8));
    vec3 lit_photo = photo_radiance(photo.rgb, mottle, surface.xy, slope,
                                    spot.enlargement, sun_colour, ambient);
    radiance = mix(radiance, lit_photo, photo.a);
#endif
    if (water > 0.0)
        radiance = mix(radiance, water_radiance(view, normal, sun_colour, ambient, body),
                       water);
    return radiance;
}

// What a pixel shows whose ray goes through `tangent` of the view. `depth` is near over distance.
vec3 shaded(vec2 tangent, float depth)
{
    vec3 ray = mat3(scene.enu_from_eye) * vec3(tangent, -1.0);
    float ray_length = length(ray);
    vec3 view = ray / ray_length;
    vec3 radiance;
    if (depth <= 0.0) {
        radiance = sky_colour(view);
        float disc = smoothstep(0.99996, 0.99999, dot(view, scene.sun.xyz));
        radiance += vec3(12.0, 10.5, 8.0) * disc * scene.sun.w;
    } else {
        vec3 enu = ray * (scene.view_rays[1].w / depth);
        float distance_m = ray_length * (scene.view_rays[1].w / depth);
        // The height difference along the line of sight, the Earth's curvature included.
        float rise_m = enu.z + dot(enu.xy, enu.xy) * (0.5 / 6.371e6);
        vec3 land = ground_radiance(enu, view, distance_m, (scene.haze.z + rise_m) * 1e-3);
        float clear = transmittance(distance_m, rise_m);
        radiance = mix(sky_colour(vec3(view.xy, 0.0)), land, clear);
    }
    return displayed(radiance);
}
