// An entity, lit and hazed as the ground is. What lies behind the terrain, or beyond
// the far plane, is not seen.
#if SAMPLES > 1
layout(binding = 3) uniform sampler2DMS depths;
#else
layout(binding = 3) uniform sampler2D depths;
#endif

in vec3 place; // enu from the eye
flat in vec3 normal;
flat in vec4 paint;

layout(location = 0) out vec4 colour;

// The share of the pixel's samples before whose terrain this lies.
float share_seen()
{
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    float before = 0.0;
    for (int i = 0; i < SAMPLES; i++)
        before += gl_FragCoord.z >= texelFetch(depths, pixel, SAMPLES > 1 ? i : 0).r ? 1.0 : 0.0;
    return before / float(SAMPLES);
}

void main()
{
    float alpha = paint.a * share_seen();
    vec3 view = normalize(mix(-scene.enu_from_eye[2].xyz, place, scene.along.w));
    if (alpha <= 0.0 || gl_FragCoord.z <= scene.accuracy.y || dot(normal, view) >= 0.0)
        discard;
    vec4 there = difference_from_enu(place);
    vec3 up = vec3(there.xy, 1.0 + there.z);
    float lit = max(dot(normal, scene.sun.xyz), 0.0);
    vec3 radiance = paint.rgb * (sun_light() * lit + sky_light() * (0.55 + 0.45 * dot(normal, up)));
    vec3 air = sky_colour(vec3(view.xy, max(view.z, 0.0)));
    colour = vec4(displayed(mix(air, radiance, transmittance(dot(place, view), there.w))), alpha);
}
