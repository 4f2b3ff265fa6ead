// Finds the least and greatest height of the blocks that an update has changed, and by how much the
// coarser level's surface differs most. Several invocations share a block: one alone takes a tenth of
// a millisecond, for it waits for every post.
layout(local_size_x = LANES, local_size_y = 64 / LANES) in;

layout(binding = 0) uniform sampler2DArray heights;
layout(binding = 0, rgba32f) writeonly uniform image2DArray bounds;

struct Rect {
    ivec4 part;  // first column and row in the torus, columns, blocks in all
    ivec4 place; // x: layer; w: its first work group
};
layout(std140, binding = 2) uniform Rects { Rect rects[360]; };

layout(location = 0) uniform ivec2 range; // first rectangle and end

shared vec3 found[64]; // least, greatest, error; by each invocation

// What lies less than a side beyond the end.
ivec2 wrapped(ivec2 at, int side)
{
    return at - side * ivec2(greaterThanEqual(at, ivec2(side)));
}

void main()
{
    int group = int(gl_WorkGroupID.x), first = range.x, end = range.y; // the rectangle is among these
    while (end - first > 1) {
        int middle = (first + end) / 2;
        if (rects[middle].place.w <= group)
            first = middle;
        else
            end = middle;
    }
    ivec4 part = rects[first].part, place = rects[first].place;
    int lane = int(gl_LocalInvocationID.x), row = int(gl_LocalInvocationID.y);
    int i = (group - place.w) * (64 / LANES) + row;
    ivec2 block = wrapped(part.xy + ivec2(i % part.z, i / part.z), TABLE);
    vec3 own = vec3(1e30, -1e30, 0.0);
    for (int p = lane; p < (BLOCK + 1) * (BLOCK + 1) && i < part.w; p += LANES) {
        ivec2 post = wrapped(block * BLOCK + ivec2(p % (BLOCK + 1), p / (BLOCK + 1)), TABLE * BLOCK);
        vec2 pair = texelFetch(heights, ivec3(post, place.x), 0).rg;
        own = vec3(min(own.x, min(pair.x, pair.y)), max(own.y, max(pair.x, pair.y)),
                   max(own.z, abs(pair.x - pair.y)));
    }
    found[row * LANES + lane] = own;
    barrier();
    if (lane > 0 || i >= part.w)
        return;
    for (int k = 1; k < LANES; k++) {
        vec3 other = found[row * LANES + k];
        own = vec3(min(own.x, other.x), max(own.y, other.y), max(own.z, other.z));
    }
    imageStore(bounds, ivec3(block, place.x), vec4(own, 0.0));
}
