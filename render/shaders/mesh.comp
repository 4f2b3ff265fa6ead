// Makes the triangles of a block that select.comp lists, a work group each: post -> blended height ->
// position relative to the eye, once for every vertex, and the triangles that may be seen. They are
// listed for an indexed draw; with RASTER they are drawn, large ones but put aside for
// raster_large.comp.
//
// Vertices are addressed in half cells, so that the extra vertices of a doubled edge have integer
// addresses too. A vertex on an edge of the cube goes by the name that the lowest face has for it.
// So everything that two neighbours share is computed from the same integers by the same operations:
// shared edges meet to the bit.
layout(local_size_x = LANES) in;

const int POSTS = (BLOCK + 1) * (BLOCK + 1);
const int VERTICES = POSTS + 4 * BLOCK;    // a block's: its posts, then the middles of the cells on its
                                           // west, east, south and north edge
const int FANS = BLOCK * BLOCK * 2;        // triangles, before edges are doubled
const int INDICES = 3 * (FANS + 4 * BLOCK);
#if SQUARES
const int ITEMS = FANS / 8;                // of which an invocation takes one at a time: squares
#else
const int ITEMS = FANS;
#endif
const int ROUNDS = (ITEMS + LANES - 1) / LANES;

struct Draw {
    uint indices, instances, first, base_vertex, base_instance;
};
struct Block {
    ivec4 place; // first post (column, row); level + 32 * pane; doubled edges (bits: west, east, south,
                 // north)
    vec4 reaches; // how far the level reaches at the corners of the block's parent: south-west,
                  // south-east, north-west, north-east
};

layout(std430, binding = 1) buffer Draws {
    uint groups[3]; // blocks listed, 1, 1
    uint triangles;
    Draw draws[];
};
layout(std430, binding = 2) readonly buffer Blocks { Block blocks[]; };
#if !RASTER
layout(std430, binding = 4) writeonly buffer Vertices { float vertices[]; }; // enu, three each
layout(std430, binding = 5) writeonly buffer Indices { uint indices[]; };
#endif

layout(binding = 0) uniform sampler2DArray heights; // own and coarser, m above the ellipsoid

// What corner_from() gives; software reads and writes what is shared number by number, and does without z.
#if RASTER
shared vec4 corners[VERTICES];

vec4 corner_of(int vertex)
{
    return corners[vertex];
}

void keep_corner(int vertex, vec4 corner)
{
    corners[vertex] = corner;
}
#else
shared vec3 corners[VERTICES];

vec4 corner_of(int vertex)
{
    vec3 corner = corners[vertex];
    return vec4(corner.xy, 0.0, corner.z);
}

void keep_corner(int vertex, vec4 corner)
{
    corners[vertex] = corner.xyw;
}
#endif
shared uint kept, base;

struct Name {
    int pane;
    ivec2 halves;
};

// `end`: half-posts along a face. `sides`: 4, or 0 where it is on none; software leaves a loop, but no branch.
Name lowest_name(Name own, int end, int sides)
{
    Name lowest = own;
    int face = scene_block.panes[own.pane].origin.z;
    for (int side = 0; side < sides; side++) {
        ivec4 edge = scene_block.edges[4 * own.pane + side];
        ivec2 at = side < 2 ? own.halves : own.halves.yx; // across, along
        if (at.x != (side & 1) * end || edge.x < 0 || edge.w >= face)
            continue;
        ivec2 there = ivec2((edge.y & 1) * end, edge.z == 1 ? end - at.y : at.y);
        face = edge.w;
        lowest = Name(edge.x, edge.y < 2 ? there : there.yx);
    }
    return lowest;
}

float between(float a, float b, float t) // exactly a or b at the ends
{
    return a * (1.0 - t) + b * t;
}

// How far the level reaches here. On an edge it follows from its two ends alone.
float reach_at(Block block, ivec2 halves, int level)
{
    const int side = 4 * BLOCK; // half-posts of the parent
    vec2 at = vec2(halves - (2 * block.place.xy & ~(side - 1))) / float(side);
    float reach = between(between(block.reaches.x, block.reaches.y, at.x),
                          between(block.reaches.z, block.reaches.w, at.x), at.y);
    return min(reach, scene_block.levels[level].y);
}

vec2 heights_at(int layer, ivec2 post)
{
    return texelFetch(heights, ivec3(uvec2(post) % uint(TABLE * BLOCK), layer), 0).rg;
}

// A vertex by the name that is its own in the world.
vec3 vertex_named(Block block, ivec2 halves, Name name, Pane pane)
{
    int level = block.place.z & 31, layer = PANES * level + name.pane;
    vec3 dn = normal_difference(pane, name.halves, level);
    vec2 pair = heights_at(layer, name.halves >> 1);
    float blend = blend_at(dn, reach_at(block, halves, level));
    if (((name.halves.x | name.halves.y) & 1) != 0) {
        // On an edge towards the finer level, whose vertices show this level's heights there.
        pair.x = 0.5 * (pair.x + heights_at(layer, (name.halves + 1) >> 1).x);
        blend = 0.0;
    }
    float height = pair.x * (1.0 - blend) + pair.y * blend;
    pair -= scene.eye_trig.w;
    float rise = pair.x * (1.0 - blend) + pair.y * blend - scene.eye_rest.x;
    return enu_from_difference(dn, height, rise);
}

// Half-posts along a face.
int end_of(Block block)
{
    return scene.sizes.y >> (block.place.z & 31);
}

bool on_an_edge(ivec2 halves, int end)
{
    return any(lessThanEqual(halves, ivec2(0))) || any(greaterThanEqual(halves, ivec2(end)));
}

vec3 vertex_at(Block block, ivec2 halves)
{
    int end = end_of(block);
    Name name = lowest_name(Name(block.place.z >> 5, halves), end, on_an_edge(halves, end) ? 4 : 0);
    return vertex_named(block, halves, name, scene_block.panes[name.pane]);
}

// The vertices that a block has, by number: its posts, then the middles along edges that are doubled.
int vertex_count(int doubled)
{
    return POSTS + BLOCK * bitCount(doubled);
}

int nth_vertex(int n, int doubled)
{
    if (n < POSTS)
        return n;
    int before = (n - POSTS) / BLOCK, sides = doubled; // doubled edges
    for (int i = 0; i < 3; i++)
        sides = i < before ? sides & (sides - 1) : sides;
    return n + BLOCK * (findLSB(sides) - before);
}

// Where a vertex lies in its block, in half cells.
ivec2 halves_of(int vertex)
{
    if (vertex < POSTS)
        return 2 * ivec2(vertex % (BLOCK + 1), vertex / (BLOCK + 1));
    int side = (vertex - POSTS) / BLOCK, along = 2 * ((vertex - POSTS) % BLOCK) + 1;
    int across = 2 * BLOCK * (side & 1);
    return side < 2 ? ivec2(across, along) : ivec2(along, across);
}

int vertex_of(ivec2 halves)
{
    if (((halves.x | halves.y) & 1) == 0)
        return (halves.y >> 1) * (BLOCK + 1) + (halves.x >> 1);
    return (halves.y & 1) == 1 ? POSTS + BLOCK * int(halves.x > 0) + (halves.y >> 1)
                               : POSTS + BLOCK * (2 + int(halves.y > 0)) + (halves.x >> 1);
}

#if RASTER

void draw_small(vec4 a, vec4 b, vec4 c, ivec2 first, ivec2 last)
{
    Triangle triangle;
    if (!set_up(a, b, c, vec2(first), triangle))
        return;
    for (int y = first.y; y <= last.y; y++)
        for (int x = first.x; x <= last.x; x++)
            draw_pixel(triangle, ivec2(x, y), vec2(x - first.x, y - first.y));
}

// Where there is no room left it is drawn here and now, which is slow.
void draw_large(vec4 a, vec4 b, vec4 c, ivec2 first, ivec2 last)
{
    ivec2 tiles = (last - first) / TILE + 1;
    uint count = uint(tiles.x * tiles.y);
    uint triangle = atomicAdd(large_count, 1u);
    uint job = triangle < LARGE_MOST ? atomicAdd(job_count, count) : JOBS_MOST;
    if (job + count > JOBS_MOST)
        draw_small(a, b, c, first, last);
    if (triangle < LARGE_MOST) {
        large_corners[3u * triangle] = a;
        large_corners[3u * triangle + 1u] = b;
        large_corners[3u * triangle + 2u] = c;
    }
    for (uint i = 0u; i < count && job + i < JOBS_MOST; i++) {
        ivec2 at = first + TILE * ivec2(int(i) % tiles.x, int(i) / tiles.x);
        jobs[job + i] = uvec2(triangle, uint(at.x) | uint(at.y) << 16);
    }
}

#endif

// Whether a triangle is to be counted; with RASTER it is drawn.
bool is_kept(vec4 a, vec4 b, vec4 c)
{
    vec2 first, last;
    if (!bounds_of(a, b, c, first, last))
        return false;
#if RASTER
    vec2 across = scene.view_rays.zw - scene.view_rays.xy, size = last - first + 1.0;
    if (across.x * across.y < 0.0) { // a mirror turns triangles round
        vec4 d = b;
        b = c;
        c = d;
    }
    if (size.x * size.y <= SMALL)
        draw_small(a, b, c, ivec2(first), ivec2(last));
    else
        draw_large(a, b, c, ivec2(first), ivec2(last));
#endif
    return true;
}

const ivec2 ring[8] = ivec2[](ivec2(0, 0), ivec2(1, 0), ivec2(2, 0), ivec2(2, 1), ivec2(2, 2),
                              ivec2(1, 2), ivec2(0, 2), ivec2(0, 1));

// A side of a cell, seen from the middle of its square of 2 x 2 cells: one triangle or two. There is
// one way to cut such a square only, and it makes the triangles of every level lie within those of
// the next.
struct Fan {
    int middle, from, between, to; // vertices
    bool two;
};

Fan fan_at(int index, int doubled)
{
    int square = index >> 3, part = index & 7, squares = BLOCK / 2;
    ivec2 at = ivec2(square % squares, square / squares);
    ivec2 from = 4 * at + 2 * ring[part], to = 4 * at + 2 * ring[(part + 1) & 7];
    int outer = part < 2 ? (at.y == 0 ? 4 : 0) : part < 4 ? (at.x == squares - 1 ? 2 : 0)
              : part < 6 ? (at.y == squares - 1 ? 8 : 0) : (at.x == 0 ? 1 : 0);
    Fan fan;
    fan.middle = vertex_of(4 * at + 2);
    fan.from = vertex_of(from);
    fan.to = vertex_of(to);
    fan.two = (doubled & outer) != 0;
    fan.between = fan.two ? vertex_of((from + to) / 2) : fan.to;
    return fan;
}

// Bits: which of the two triangles to keep.
int kept_of(Fan fan)
{
    vec4 middle = corner_of(fan.middle), between = corner_of(fan.between);
    int first = is_kept(middle, corner_of(fan.from), between) ? 1 : 0;
    if (!fan.two)
        return first;
    return first | (is_kept(middle, between, corner_of(fan.to)) ? 2 : 0);
}

#if !RASTER

// Writes a triangle, and says where the next one goes.
uint put(uint at, uint first, int a, int b, int c)
{
    indices[at] = first + uint(a);
    indices[at + 1u] = first + uint(b);
    indices[at + 2u] = first + uint(c);
    return at + 3u;
}

uint put_fan(uint at, uint first, Fan fan, int keep)
{
    if ((keep & 1) != 0)
        at = put(at, first, fan.middle, fan.from, fan.between);
    if ((keep & 2) != 0)
        at = put(at, first, fan.middle, fan.between, fan.to);
    return at;
}

#endif

#if SQUARES

// By software an invocation takes a whole square, so that it reads each corner once. Sides on doubled
// edges, which are few, come after all squares.

// The middle of a square, and the vertices around it, of which the last is the first.
int middle_of(int square)
{
    const int SIDE = BLOCK / 2;
    return (2 * (square / SIDE) + 1) * (BLOCK + 1) + 2 * (square % SIDE) + 1;
}

int around(int middle, int part)
{
    ivec2 off = ring[part & 7] - 1;
    return middle + off.y * (BLOCK + 1) + off.x;
}

// Bits: which sides lie on doubled edges.
int doubled_parts(int square, int doubled)
{
    const int SIDE = BLOCK / 2;
    ivec2 at = ivec2(square % SIDE, square / SIDE);
    return (at.y == 0 && (doubled & 4) != 0 ? 0x03 : 0) | (at.x == SIDE - 1 && (doubled & 2) != 0 ? 0x0c : 0) |
           (at.y == SIDE - 1 && (doubled & 8) != 0 ? 0x30 : 0) | (at.x == 0 && (doubled & 1) != 0 ? 0xc0 : 0);
}

// Bits: which of the triangles around its middle to keep.
int kept_of_square(int square, int doubled)
{
    int at = middle_of(square), keep = 0;
    vec4 middle = corner_of(at), first = corner_of(around(at, 0)), from = first;
    for (int part = 0; part < 8; part++) {
        vec4 to = first;
        if (part < 7)
            to = corner_of(around(at, part + 1));
        keep |= is_kept(middle, from, to) ? 1 << part : 0;
        from = to;
    }
    return keep & ~doubled_parts(square, doubled);
}

// The side of the nth cell along doubled edges.
Fan nth_doubled(int n, int doubled)
{
    int between = nth_vertex(POSTS + n, doubled), along = (between - POSTS) % BLOCK;
    int side = (between - POSTS) / BLOCK; // west, east, south, north
    int across = side & 1; // seen from the middle sides go round leftwards
    bool back = side == 0 || side == 3;
    ivec2 near = ivec2(across * BLOCK, along), far = ivec2(across * BLOCK, along + 1);
    ivec2 middle = ivec2(across * (BLOCK - 2) + 1, along | 1);
    near = side < 2 ? near : near.yx;
    far = side < 2 ? far : far.yx;
    middle = side < 2 ? middle : middle.yx;
    ivec2 from = back ? far : near, to = back ? near : far;
    return Fan(middle.y * (BLOCK + 1) + middle.x, from.y * (BLOCK + 1) + from.x, between,
               to.y * (BLOCK + 1) + to.x, true);
}

#endif

#if SQUARES

struct Kept {
    int squares[ROUNDS]; // bits of each round
    int doubled;         // two of each round
};

Kept find_kept(int doubled, out uint count)
{
    int lane = int(gl_LocalInvocationIndex), end = BLOCK * bitCount(doubled);
    Kept keep;
    keep.doubled = 0;
    count = 0u;
    for (int i = 0; i < ROUNDS; i++) {
        int square = LANES * i + lane;
        keep.squares[i] = square < ITEMS ? kept_of_square(square, doubled) : 0;
        count += uint(bitCount(keep.squares[i]));
    }
    int n = lane, shift = 0;
    do {
        if (n < end)
            keep.doubled |= kept_of(nth_doubled(n, doubled)) << shift;
        n += LANES;
        shift += 2;
    } while (n < end);
    count += uint(bitCount(keep.doubled));
    return keep;
}

#else

struct Kept {
    int fans[ROUNDS];
};

Kept find_kept(int doubled, out uint count)
{
    Kept keep;
    count = 0u;
    for (int i = 0; i < ROUNDS; i++) {
        int at = LANES * i + int(gl_LocalInvocationIndex);
        keep.fans[i] = at < FANS ? kept_of(fan_at(at, doubled)) : 0;
        count += uint((keep.fans[i] & 1) + (keep.fans[i] >> 1));
    }
    return keep;
}

#endif

#if !RASTER

// Writes what an invocation keeps, from `at` on.
void list_kept(Kept keep, uint at, uint first, int doubled)
{
    int lane = int(gl_LocalInvocationIndex);
#if SQUARES
    for (int i = 0; i < ROUNDS; i++) {
        int middle = middle_of(LANES * i + lane);
        for (int part = 0; part < 8; part++)
            if ((keep.squares[i] >> part & 1) != 0)
                at = put(at, first, middle, around(middle, part), around(middle, part + 1));
    }
    int n = lane;
    do {
        at = put_fan(at, first, nth_doubled(n, doubled), keep.doubled & 3);
        keep.doubled >>= 2;
        n += LANES;
    } while (keep.doubled != 0);
#else
    for (int i = 0; i < ROUNDS; i++)
        at = put_fan(at, first, fan_at(LANES * i + lane, doubled), keep.fans[i]);
#endif
}

#endif

void keep_vertex(int vertex, vec3 enu, uint first)
{
    keep_corner(vertex, corner_from(scene.clip_from_enu * vec4(enu, 1.0)));
#if !RASTER
    uint at = 3u * (first + uint(vertex));
    vertices[at] = enu.x;
    vertices[at + 1u] = enu.y;
    vertices[at + 2u] = enu.z;
#endif
}

#if SQUARES

// Software goes through a loop whose test comes first once more than that is true, and through one whose
// test comes last once at least. What depends on the pane it looks up value by value, so first all vertices
// have the block's own; where the block lies on an edge of the cube those on that edge are placed anew.
void place_vertices(Block block, uint first)
{
    int lane = int(gl_LocalInvocationIndex), n = lane, count = vertex_count(block.place.w);
    int own = block.place.z >> 5, end = end_of(block);
    Pane pane = scene_block.panes[own];
    do {
        if (n < count) {
            int i = nth_vertex(n, block.place.w);
            ivec2 halves = 2 * block.place.xy + halves_of(i);
            keep_vertex(i, vertex_named(block, halves, Name(own, halves), pane), first);
        }
        n += LANES;
    } while (n < count);
    ivec2 low = 2 * block.place.xy, high = low + 2 * BLOCK;
    int anew = on_an_edge(low, end) || on_an_edge(high, end) ? count : 0;
    n = lane;
    do {
        int i = nth_vertex(n, block.place.w);
        ivec2 halves = 2 * block.place.xy + halves_of(i);
        if (n < anew && on_an_edge(halves, end))
            keep_vertex(i, vertex_at(block, halves), first);
        n += LANES;
    } while (n < anew);
}

#else

void place_vertices(Block block, uint first)
{
    for (int n = int(gl_LocalInvocationIndex); n < vertex_count(block.place.w); n += LANES) {
        int i = nth_vertex(n, block.place.w);
        keep_vertex(i, vertex_at(block, 2 * block.place.xy + halves_of(i)), first);
    }
}

#endif

void main()
{
    hold_scene();
    uint index = gl_WorkGroupID.x, first = index * uint(VERTICES);
    int lane = int(gl_LocalInvocationIndex);
    if (index >= uint(DRAWS * BLOCKS_A_DRAW))
        return;
    Block block = blocks[index];
    place_vertices(block, first);
    if (lane == 0)
        kept = 0u;
    barrier();
    uint count;
    Kept keep = find_kept(block.place.w, count);
    uint place = count > 0u ? atomicAdd(kept, count) : 0u;
    barrier();
    if (lane == 0 && kept > 0u) {
        atomicAdd(triangles, kept);
#if !RASTER
        uint draw = index / uint(BLOCKS_A_DRAW);
        base = draw * uint(BLOCKS_A_DRAW * INDICES) + atomicAdd(draws[draw].indices, 3u * kept);
#endif
    }
#if !RASTER
    barrier();
    list_kept(keep, base + 3u * place, first, block.place.w);
#endif
}
