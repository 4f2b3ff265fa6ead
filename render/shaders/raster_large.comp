// Draws the triangles that mesh.comp put aside, a tile at a time: a work group takes every so many.
layout(local_size_x = 64) in;

// Whether all of the tile is beyond an edge.
bool misses(Triangle triangle)
{
    for (int i = 0; i < 3; i++) {
        vec3 edge = triangle.edges[i];
        vec2 most = max(edge.xy, vec2(0.0)) * float(TILE - 1);
        if (most.x + most.y + edge.z < 0.0)
            return true;
    }
    return false;
}

void main()
{
    uint count = min(job_count, JOBS_MOST);
    int lane = int(gl_LocalInvocationIndex);
    ivec2 size = imageSize(picture);
    for (uint i = gl_WorkGroupID.x; i < count; i += gl_NumWorkGroups.x) {
        uvec2 job = jobs[i];
        ivec2 first = ivec2(job.y & 0xffffu, job.y >> 16);
        uint at = 3u * job.x;
        Triangle triangle;
        if (!set_up(large_corners[at], large_corners[at + 1u], large_corners[at + 2u], vec2(first),
                    triangle) ||
            misses(triangle))
            continue;
        for (int y = lane / TILE; y < TILE; y += 64 / TILE) {
            ivec2 place = ivec2(lane % TILE, y), pixel = first + place;
            if (all(lessThan(pixel, size)))
                draw_pixel(triangle, pixel, vec2(place));
        }
    }
}
