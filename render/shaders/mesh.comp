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
const int ROUNDS = (FANS + LANES - 1) / LANES;

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
layout(std430, binding = 4) writeonly buffer Vertices { vec4 vertices[]; }; // enu
layout(std430, binding = 5) writeonly buffer Indices { uint indices[]; };
#endif

layout(binding = 0) uniform sampler2DArray heights; // own and coarser, m above the ellipsoid

// The lattice in which samples of the picture lie: half of its columns and rows, and where the first of
// each is. No columns: all triangles are kept.
layout(location = 0) uniform vec3 lattice;

shared vec4 corners[VERTICES]; // corner_from()
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

vec3 vertex_at(Block block, ivec2 halves)
{
    int level = block.place.z & 31;
    Name name = Name(block.place.z >> 5, halves);
    int end = scene.sizes.y >> level;
    bool inside = all(greaterThan(name.halves, ivec2(0))) && all(lessThan(name.halves, ivec2(end)));
    name = lowest_name(name, end, inside ? 0 : 4);
    int layer = PANES * level + name.pane;
    vec3 dn = normal_difference(name.pane, name.halves, level);
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

// Where what is before the near plane of a triangle that it cuts lies on the screen: x / w and y / w, a
// little more where its corners are far aside, for rounding.
void cut_range(vec4 corners[3], out vec2 least, out vec2 most)
{
    float near = scene.grid.w, margin = 0.0;
    least = vec2(1e30);
    most = vec2(-1e30);
    for (int i = 0; i < 3; i++) {
        vec4 from = corners[i], to = corners[(i + 1) % 3];
        bool ahead = from.w >= near;
        if (ahead) {
            least = min(least, from.xy);
            most = max(most, from.xy);
        }
        if (ahead == (to.w >= near))
            continue;
        vec2 clip = from.xy * from.w, way = to.xy * to.w - clip;
        vec2 at = (clip + way * ((near - from.w) / (to.w - from.w))) / near;
        least = min(least, at);
        most = max(most, at);
        margin = max(margin, exp2(-20.0) / near * max(abs(clip.x) + abs(way.x), abs(clip.y) + abs(way.y)));
    }
    least -= margin;
    most += margin;
}

#else

// What is but listed is kept: software runs both sides of a branch, and such triangles are few.
void cut_range(vec4 corners[3], out vec2 least, out vec2 most)
{
    least = vec2(-1.0);
    most = vec2(1.0);
}

#endif

// The columns and rows of the lattice in which a triangle may have samples. False where there are
// none, for it is behind, beside, turned away, or lies between samples.
bool bounds_of(vec4 a, vec4 b, vec4 c, out vec2 first, out vec2 last)
{
    const float MARGIN = 1.0 / 64.0; // of a pixel; a rasteriser moves vertices by less
    first = vec2(0.0);
    last = 2.0 * lattice.xy - 1.0;
    if (lattice.x == 0.0)
        return true;
    vec2 least = min(a.xy, min(b.xy, c.xy)), most = max(a.xy, max(b.xy, c.xy));
    bool cut = min(a.w, min(b.w, c.w)) < scene.grid.w;
    if (cut)
        cut_range(vec4[3](a, b, c), least, most);
    least = max(least, vec2(-1.0));
    most = min(most, vec2(1.0));
    first = ceil((least + 1.0) * lattice.xy - (lattice.z + MARGIN));
    last = floor((most + 1.0) * lattice.xy - (lattice.z - MARGIN));
    if (any(greaterThan(first, last)))
        return false;
    if (cut)
        return true;
    vec2 u = (b.xy - a.xy) * lattice.xy, v = (c.xy - a.xy) * lattice.xy;
    return u.x * v.y - u.y * v.x >= -MARGIN * (abs(u.x) + abs(u.y) + abs(v.x) + abs(v.y) + MARGIN);
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
    vec2 across = scene.view_rays.zw - scene.view_rays.xy, first, last;
    if (across.x * across.y < 0.0) { // a mirror turns triangles round
        vec4 d = b;
        b = c;
        c = d;
    }
    if (!bounds_of(a, b, c, first, last))
        return false;
#if RASTER
    vec2 size = last - first + 1.0;
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
    vec4 middle = corners[fan.middle], between = corners[fan.between];
    int first = is_kept(middle, corners[fan.from], between) ? 1 : 0;
    if (!fan.two)
        return first;
    return first | (is_kept(middle, between, corners[fan.to]) ? 2 : 0);
}

#if !RASTER

void put(uint at, uint first, int a, int b, int c)
{
    indices[at] = first + uint(a);
    indices[at + 1u] = first + uint(b);
    indices[at + 2u] = first + uint(c);
}

// Writes what an invocation keeps, from `at` on.
void list_kept(int keep[ROUNDS], uint at, uint first, int doubled)
{
    for (int i = 0; i < ROUNDS; i++) {
        if (keep[i] == 0)
            continue;
        Fan fan = fan_at(LANES * i + int(gl_LocalInvocationIndex), doubled);
        if ((keep[i] & 1) != 0) {
            put(at, first, fan.middle, fan.from, fan.between);
            at += 3u;
        }
        if ((keep[i] & 2) != 0) {
            put(at, first, fan.middle, fan.between, fan.to);
            at += 3u;
        }
    }
}

#endif

void place_vertices(Block block, uint first)
{
    for (int i = int(gl_LocalInvocationIndex); i < VERTICES; i += LANES) {
        if (i >= POSTS && (block.place.w >> ((i - POSTS) / BLOCK) & 1) == 0)
            continue;
        vec3 enu = vertex_at(block, 2 * block.place.xy + halves_of(i));
        corners[i] = corner_from(scene.clip_from_enu * vec4(enu, 1.0));
#if !RASTER
        vertices[first + uint(i)] = vec4(enu, 1.0);
#endif
    }
}

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
    int keep[ROUNDS];
    uint count = 0u;
    for (int i = 0; i < ROUNDS; i++) {
        int at = LANES * i + lane;
        keep[i] = at < FANS ? kept_of(fan_at(at, block.place.w)) : 0;
        count += uint((keep[i] & 1) + (keep[i] >> 1));
    }
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
