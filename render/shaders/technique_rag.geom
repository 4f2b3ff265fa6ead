// One pass of the refinement (Schmiade 2008): a triangle that cannot be seen is left out, any other
// is cut by its edges. Its first vertex is the one opposite the hypotenuse. What two triangles share
// they have to decide and to place alike, so an edge is looked at from one end, always the same.
layout(triangles) in;
layout(triangle_strip, max_vertices = 12) out;

layout(location = 0) in vec3 place_in[];
layout(location = 1) in vec3 enu_in[];

layout(xfb_buffer = 0, xfb_stride = 24) out;
layout(location = 0, xfb_offset = 0) out vec3 place;
layout(location = 1, xfb_offset = 12) out vec3 enu;

layout(location = 0) uniform int pass;
layout(location = 1) uniform float tolerance; // rad
layout(location = 2) uniform vec3 eye;        // in the field's frame, and the frustum's sides
layout(location = 3) uniform vec3 sides[4];
layout(location = 7) uniform int level_count;
layout(location = 8) uniform ivec2 levels[12]; // of the boxes: the first, how many along

layout(std430, binding = 1) readonly buffer Boxes { // least and most, in the field's frame
    float boxes[];
};

struct Corner {
    vec3 place; // column and row of the field, height
    vec3 enu;
};

Corner corners[6]; // then the middles of the edges 01, 12, 20

// The box of the least square of a box's size or twice, four times ... which has the triangle; -1: none.
int box_around(out ivec2 level)
{
    vec2 a = corners[0].place.xy, b = corners[1].place.xy, c = corners[2].place.xy;
    ivec2 low = ivec2(floor(min(a, min(b, c))));
    ivec2 high = max(ivec2(ceil(max(a, max(b, c)))) - 1, low), differ = low ^ high;
    int log_cells = max(findMSB(differ.x | differ.y) + 1, BOX_LOG);
    if (log_cells - BOX_LOG >= level_count)
        return -1;
    level = levels[log_cells - BOX_LOG];
    ivec2 box = low >> log_cells;
    return level.x + box.y * level.y + box.x;
}

// The ground under the triangle, which is what it can be refined to, or the triangle itself may be in
// the picture.
bool may_be_seen()
{
    ivec2 level;
    int box = -1;
    for (int s = 0; s < 4; s++) {
        vec3 n = scene.planes[s].xyz;
        if (dot(n, corners[0].enu) >= 0.0 || dot(n, corners[1].enu) >= 0.0 ||
            dot(n, corners[2].enu) >= 0.0)
            continue;
        if (box < 0)
            box = box_around(level);
        if (box < 0)
            return true;
        vec3 least = vec3(boxes[6 * box], boxes[6 * box + 1], boxes[6 * box + 2]);
        vec3 most = vec3(boxes[6 * box + 3], boxes[6 * box + 4], boxes[6 * box + 5]);
        vec3 inmost = max(sides[s] * (least - eye), sides[s] * (most - eye));
        if (inmost.x + inmost.y + inmost.z < 0.0)
            return false;
    }
    return true;
}

Corner on_ground(vec2 at)
{
    precise vec3 ground;
    float height = field_height_between(at);
    vec2 posts = (at - vec2(field_eye_post())) - field_eye_rest();
    ground = field_enu_of_difference(field_difference(posts), height);
    return Corner(vec3(at, height), ground);
}

bool goes_before(Corner a, Corner b)
{
    return a.place.x < b.place.x || a.place.x == b.place.x && a.place.y < b.place.y;
}

// No longer than a cell: there is nothing more to be had from the heights (equation 3).
bool is_a_cell(Corner a, Corner b)
{
    vec2 way = abs(a.place.xy - b.place.xy);
    return max(way.x, way.y) <= 1.0;
}

#if OBLIQUE
// The angle at which the distance between an edge and the ground is seen, at LOOKS places of it, the
// middle among them (equation 4).
float error_of(Corner a, Corner b, Corner middle)
{
    precise float worst = 0.0;
    for (int i = 1; i <= LOOKS; i++) {
        float t = float(i) / float(LOOKS + 1);
        Corner ground = middle;
        if (2 * i != LOOKS + 1)
            ground = on_ground(a.place.xy + t * (b.place.xy - a.place.xy));
        precise vec3 off = ground.enu - (a.enu + t * (b.enu - a.enu));
        worst = max(worst, length(cross(off, ground.enu)) / dot(ground.enu, ground.enu));
    }
    return worst;
}
#else
// The angle at which the difference between the heights of its ends is seen from the nearest point of
// an edge. Half an edge has half the difference and is no nearer, so that what is not cut has no half
// that would be ("strictly monotonic", section 4.2.1).
float error_of(Corner a, Corner b)
{
    vec3 way = b.enu - a.enu;
    float t = clamp(-dot(a.enu, way) / dot(way, way), 0.0, 1.0);
    precise float error = abs(a.place.z - b.place.z) / length(a.enu + t * way);
    return error;
}
#endif

// Whether an edge is cut; its middle then is on the ground.
bool is_cut(int from, int to, int middle)
{
    Corner a = corners[from], b = corners[to];
    if (is_a_cell(a, b))
        return false;
    if (goes_before(b, a)) {
        Corner first = b;
        b = a;
        a = first;
    }
#if OBLIQUE
    corners[middle] = on_ground(0.5 * (a.place.xy + b.place.xy));
    return error_of(a, b, corners[middle]) > tolerance;
#else
    if (!(error_of(a, b) > tolerance))
        return false;
    corners[middle] = on_ground(0.5 * (a.place.xy + b.place.xy));
    return true;
#endif
}

void emit(int a, int b, int c)
{
    const int order[3] = int[3](a, b, c);
    for (int i = 0; i < 3; i++) {
        place = corners[order[i]].place;
        enu = corners[order[i]].enu;
        EmitVertex();
    }
    EndPrimitive();
}

// The half of the triangle that has the leg from a to b, whose middle is cut, too, or not.
void emit_half(int a, int b, int middle, bool cut)
{
    if (!cut) {
        emit(4, a, b);
        return;
    }
    emit(middle, 4, a);
    emit(middle, b, 4);
}

void emit_right_angled(bool leg01, bool leg20)
{
    emit_half(0, 1, 3, leg01);
    emit_half(2, 0, 5, leg20);
}

// The hypotenuse is not cut, a leg is (figure 13, right).
void emit_oblique(bool leg01, bool leg20)
{
    if (!leg20) {
        emit(0, 3, 2);
        emit(3, 1, 2);
        return;
    }
    if (!leg01) {
        emit(0, 1, 5);
        emit(5, 1, 2);
        return;
    }
    emit(0, 3, 5);
    emit(5, 3, 2);
    emit(3, 1, 2);
}

void main()
{
    for (int i = 0; i < 3; i++)
        corners[i] = Corner(place_in[i], enu_in[i]);
    if (!may_be_seen())
        return;
    if (pass == 0) {
        emit(0, 1, 2);
        return;
    }
    bool leg01 = is_cut(0, 1, 3), hypotenuse = is_cut(1, 2, 4), leg20 = is_cut(2, 0, 5);
    if (!leg01 && !hypotenuse && !leg20) {
        emit(0, 1, 2);
        return;
    }
    control.has_split = 1;
    if (hypotenuse) {
        emit_right_angled(leg01, leg20);
        return;
    }
#if OBLIQUE
    emit_oblique(leg01, leg20);
#else
    // A T-vertex that is not seen, for it lies on the edge.
    corners[4] = Corner(0.5 * (corners[1].place + corners[2].place),
                        0.5 * (corners[1].enu + corners[2].enu));
    emit_right_angled(leg01, leg20);
#endif
}
