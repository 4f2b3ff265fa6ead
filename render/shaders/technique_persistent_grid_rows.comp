// Where the rows of a persistent grid are (Houska 2019, sections 3.2.3, 3.3 and 3.4): one work group.
// A row's cells are all as long, and as wide, so that the importance image's columns are equal; there
// is one.
layout(local_size_x = 256) in;
const int SLOTS = 256; // of the importance

layout(location = 0) uniform vec4 camera; // sine and cosine of its angle below the horizon; height, m;
                                          // widest line of the cover
layout(location = 1) uniform ivec4 sizes; // columns and rows of cells; corners of the sides
layout(location = 2) uniform float jitter; // by which rows within are moved, in rows
layout(location = 3) uniform vec2 left_side[CORNERS];
layout(location = 40) uniform vec2 right_side[CORNERS];

shared float sums[SLOTS];

float left_at(float y)
{
    int i = 1;
    while (i < sizes.z - 1 && y > left_side[i].y)
        i++;
    vec2 from = left_side[i - 1], to = left_side[i];
    return mix(from.x, to.x, clamp((y - from.y) / max(to.y - from.y, 1e-12), 0.0, 1.0));
}

float right_at(float y)
{
    int i = sizes.w - 1;
    while (i > 1 && y < right_side[i - 1].y)
        i--;
    vec2 from = right_side[i - 1], to = right_side[i];
    return mix(from.x, to.x, 1.0 - clamp((to.y - y) / max(to.y - from.y, 1e-12), 0.0, 1.0));
}

float lowest()
{
    return left_side[0].y;
}

float y_of(float v)
{
    return mix(lowest(), left_side[sizes.z - 1].y, v);
}

// From the camera along the ray of y: how far ahead per m along the picture's axis, and how long.
vec2 ray(float y)
{
    float t = camera.z / max(camera.x - y * camera.y, 1e-6);
    return vec2(t * (camera.y + y * camera.x), t);
}

// (3.5): how long a cell is over how wide.
float importance(float v)
{
    float y = y_of(v), step = (y_of(1.0) - lowest()) / float(sizes.y);
    vec2 here = ray(y);
    float length = step * here.y * here.y / camera.z; // the derivative of how far ahead, by y
    float width = max(right_at(y) - left_at(y), 0.05 * camera.w) / float(sizes.x) * here.y;
    return length / width;
}

// The integral of the importance up to v, all of it being 1.
float integral(int slot)
{
    return slot == 0 ? 0.0 : sums[slot - 1] / sums[SLOTS - 1];
}

float inverse_integral(float share)
{
    int low = 0, high = SLOTS;
    while (high - low > 1) {
        int middle = (low + high) / 2;
        if (integral(middle) <= share)
            low = middle;
        else
            high = middle;
    }
    float from = integral(low), to = integral(high);
    return (float(low) + clamp((share - from) / max(to - from, 1e-12), 0.0, 1.0)) / float(SLOTS);
}

// Of a row, or of a place between rows.
float y_of_row(float row)
{
    float v = clamp(row / float(sizes.y), 0.0, 1.0);
#if WARP
    v = inverse_integral(v);
#endif
    return y_of(v);
}

// The row that is nearest to a corner of the outline goes through it: or the corner would be cut off.
float y_at_corner(int row)
{
    if (row == 0 || row == sizes.y)
        return y_of_row(float(row));
    float at = float(row) + jitter;
    float low = y_of_row(at - 0.5), high = y_of_row(at + 0.5), kept = y_of_row(at);
    for (int i = 1; i < sizes.z - 1; i++)
        if (left_side[i].y > low && left_side[i].y <= high)
            kept = left_side[i].y;
    for (int i = 1; i < sizes.w - 1; i++)
        if (right_side[i].y > low && right_side[i].y <= high)
            kept = right_side[i].y;
    return kept;
}

void main()
{
    int i = int(gl_LocalInvocationIndex);
#if WARP
    sums[i] = importance((float(i) + 0.5) / float(SLOTS));
    barrier();
    for (int reach = 1; reach < SLOTS; reach *= 2) {
        float before = i >= reach ? sums[i - reach] : 0.0;
        barrier();
        sums[i] += before;
        barrier();
    }
#endif
    for (int row = i; row <= sizes.y; row += SLOTS) {
        float y = y_at_corner(row);
        vec2 at = ray(y);
        grid_rows[row] = GridRow(at.x, at.y * left_at(y), at.y * right_at(y), 0.0);
    }
}
