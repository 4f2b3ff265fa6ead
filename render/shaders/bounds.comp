// Finds the least and greatest height of the blocks that an update has changed, and by how much the
// coarser level's surface differs most.
layout(local_size_x = 64) in;

layout(binding = 0) uniform sampler2DArray heights;
layout(binding = 0, rgba32f) writeonly uniform image2DArray bounds;

struct Rect {
    ivec4 part;  // first column and row in the torus, columns, blocks in all
    ivec4 place; // x: layer; w: its first work group
};
layout(std140, binding = 2) uniform Rects { Rect rects[360]; };

layout(location = 0) uniform ivec2 range; // first rectangle and end

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
    int i = (group - place.w) * 64 + int(gl_LocalInvocationID.x);
    if (i >= part.w)
        return;
    ivec2 block = wrapped(part.xy + ivec2(i % part.z, i / part.z), TABLE);
    vec2 range_m = vec2(1e30, -1e30);
    float error_m = 0.0;
    for (int row = 0; row <= BLOCK; row++)
        for (int col = 0; col <= BLOCK; col++) {
            ivec2 post = wrapped(block * BLOCK + ivec2(col, row), TABLE * BLOCK);
            vec2 pair = texelFetch(heights, ivec3(post, place.x), 0).rg;
            range_m = vec2(min(range_m.x, min(pair.x, pair.y)), max(range_m.y, max(pair.x, pair.y)));
            error_m = max(error_m, abs(pair.x - pair.y));
        }
    imageStore(bounds, ivec3(block, place.x), vec4(range_m, error_m, 0.0));
}
