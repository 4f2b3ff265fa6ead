// Empties the picture and the list of large triangles.
layout(local_size_x = 8, local_size_y = 8) in;

void main()
{
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (all(lessThan(pixel, imageSize(picture))))
        imageStore(picture, pixel, uvec4(0u));
    if (gl_GlobalInvocationID.xy == uvec2(0u))
        large_count = job_count = 0u;
}
