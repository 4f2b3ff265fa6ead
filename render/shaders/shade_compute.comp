// The shading pass on a GPU: full-screen work needs no rasteriser.
layout(local_size_x = 8, local_size_y = 8) in;

layout(binding = 0, rgba8) writeonly uniform image2D picture;

void main()
{
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy), size = imageSize(picture);
    if (pixel.x >= size.x || pixel.y >= size.y)
        return;
    vec2 place = (vec2(pixel) + 0.5) / vec2(size);
    vec2 tangent = mix(scene.view_rays.xy, scene.view_rays.zw, place);
    imageStore(picture, pixel, stored(pixel_shown(pixel, tangent), pixel));
}
