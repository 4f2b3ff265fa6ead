// The vertices of a slice of a persistent grid, laid upon the ground (Houska 2019, sections 3.2.3 and
// 3.5).
layout(local_size_x = 8, local_size_y = 8) in;

layout(location = 0) uniform vec4 axes;          // east and north of right, and of forward
layout(location = 1) uniform vec2 normals_per_m; // of the ground plane, east and north
layout(location = 2) uniform ivec2 cells;        // columns and rows
layout(location = 3) uniform ivec2 slice;        // its first row, and rows of cells
layout(location = 4) uniform float jitter;       // by which columns within are moved, in columns
layout(location = 5) uniform float search_to_m;  // so far ahead are edges searched for
layout(std430, binding = 1) writeonly buffer Vertices { vec4 vertices[]; };

const int STEPS = 8, HALVINGS = 5;
const float NEXT = 0.1; // of a cell: to the second place of a slope

// On the ground plane, east and north.
vec2 place_of(int row, float across)
{
    GridRow at = grid_rows[row];
    return mix(at.left, at.right, across) * axes.xy + at.along * axes.zw;
}

vec3 difference_of(vec2 place)
{
    vec2 d = place * normals_per_m;
    float s = min(dot(d, d), 0.9);
    return vec3(d, -s / (1.0 + sqrt(1.0 - s)));
}

// In posts of the field, which ends at its edges.
vec2 posts_of(vec3 dn)
{
    return vec2(field_eye_post()) + (field_eye_rest() + field_posts_from_eye(dn));
}

float height_at(vec2 place)
{
    return field_height_between(clamp(posts_of(difference_of(place)), 0.0, float(FIELD_CELLS)));
}

// From one place to another on the same line, over an edge: where that is.
vec2 edge_between(vec2 from, vec2 to)
{
    float low = 0.0, high = 1.0, before = height_at(from);
    for (int i = 1; i <= STEPS; i++) {
        float share = float(i) / float(STEPS), height = height_at(mix(from, to, share));
        if (height < before) {
            low = max(share - 2.0 / float(STEPS), 0.0);
            high = share;
            break;
        }
        before = height;
    }
    for (int i = 0; i < HALVINGS; i++) {
        float middle = 0.5 * (low + high), aside = 0.02 * (high - low);
        if (height_at(mix(from, to, middle + aside)) > height_at(mix(from, to, middle - aside)))
            low = middle;
        else
            high = middle;
    }
    return mix(from, to, 0.5 * (low + high));
}

vec2 moved_to_edge(int row, float across)
{
    vec2 here = place_of(row, across);
    if (row == 0 || row == cells.y || grid_rows[row].along > search_to_m)
        return here;
    vec2 posts = posts_of(difference_of(here));
    // beyond the field there is nothing to search, and what is moved onto it would be no end of it
    if (posts != clamp(posts, 0.0, float(FIELD_CELLS)))
        return here;
    vec2 before = place_of(row - 1, across), after = place_of(row + 1, across);
    bool rises = height_at(mix(before, here, NEXT)) > height_at(before);
    bool falls = height_at(mix(here, after, NEXT)) < height_at(here);
    return rises && falls ? edge_between(before, here) : here;
}

void main()
{
    ivec2 at = ivec2(gl_GlobalInvocationID);
    if (any(greaterThan(at, ivec2(cells.x, slice.y))))
        return;
    bool within = at.x > 0 && at.x < cells.x;
    float across = (float(at.x) + (within ? jitter : 0.0)) / float(cells.x);
#if EDGES
    vec2 place = moved_to_edge(slice.x + at.y, across);
#else
    vec2 place = place_of(slice.x + at.y, across);
#endif
    vec3 dn = difference_of(place);
    vec2 posts = posts_of(dn), inside = clamp(posts, 0.0, float(FIELD_CELLS));
    if (posts != inside)
        dn = field_difference(inside - vec2(field_eye_post()) - field_eye_rest());
    vec3 enu = field_enu_of_difference(dn, field_height_between(inside));
    // on which of the field's edges it is
    vec4 edges = vec4(lessThanEqual(posts, vec2(0.0)), greaterThanEqual(posts, vec2(FIELD_CELLS)));
    vertices[at.y * (cells.x + 1) + at.x] = vec4(enu, dot(edges, vec4(1.0, 2.0, 4.0, 8.0)));
}
