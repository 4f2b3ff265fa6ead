// A post of a patch of 16 x 16 cells that is morphed into the next coarser level, while its edges
// follow the coarser of the two patches that share each.
layout(location = 0) in ivec3 own;    // first post, factor: 4096 to the level, and how far it is morphed
layout(location = 1) in ivec4 beside; // factors of the edges in the west, east, south, north

const int CELLS = 16, FACTOR = 4096;

float share_of(int factor)
{
    return float(factor % FACTOR) / float(FACTOR);
}

struct Edge {
    ivec2 start, along;
    int factor;
};

Edge edge_at(ivec2 at)
{
    if (at.x == 0 || at.x == CELLS)
        return Edge(own.xy + ivec2(at.x, 0), ivec2(0, 1), at.x == 0 ? beside.x : beside.y);
    return Edge(own.xy + ivec2(0, at.y), ivec2(1, 0), at.y == 0 ? beside.z : beside.w);
}

bool is_on_edge(ivec2 at)
{
    return any(equal(at % CELLS, ivec2(0)));
}

// Of a post that the edge's level has: every second one morphs.
float edge_post_height(Edge edge, int at)
{
    int spacing = 1 << (edge.factor / FACTOR);
    ivec2 post = edge.start + at * edge.along, away = spacing * edge.along;
    float height = field_height(post);
    if ((at & spacing) == 0)
        return height;
    return mix(height, 0.5 * (field_height(post - away) + field_height(post + away)),
               share_of(edge.factor));
}

// Of any place of the edge.
float edge_height(Edge edge, int at)
{
    int spacing = 1 << (edge.factor / FACTOR), before = at & ~(spacing - 1);
    float height = edge_post_height(edge, before);
    return at == before ? height
                        : mix(height, edge_post_height(edge, before + spacing),
                              float(at - before) / float(spacing));
}

// Of a post that the next coarser level has: it is still, but on an edge.
float coarse_height(ivec2 at)
{
    if (!is_on_edge(at))
        return field_height(own.xy + at);
    Edge edge = edge_at(at);
    return edge_height(edge, edge.along.x != 0 ? at.x : at.y);
}

// Every second post moves towards the middle of the two that stay, wherever an edge takes these.
float inner_height(ivec2 at)
{
    int level = own.z / FACTOR;
    ivec2 odd = at >> level & 1, coarse = (own.xy + at) >> (level + 1);
    float height = field_height(own.xy + at), share = share_of(own.z);
    if (odd == ivec2(0) || share == 0.0)
        return height;
    bool falls = odd == ivec2(1) && ((coarse.x ^ coarse.y) & 1) != 0;
    ivec2 away = ivec2(odd.x, falls ? -odd.y : odd.y) * (1 << level);
    return mix(height, 0.5 * (coarse_height(at - away) + coarse_height(at + away)), share);
}

void main()
{
    ivec2 at = ivec2(gl_VertexID % (CELLS + 1), gl_VertexID / (CELLS + 1));
    if (!is_on_edge(at)) {
        gl_Position = field_clip(field_enu(own.xy + at, inner_height(at)));
        return;
    }
    // What the edge's level leaves out falls onto the nearest post that it has.
    Edge edge = edge_at(at);
    int spacing = 1 << (edge.factor / FACTOR), place = edge.along.x != 0 ? at.x : at.y;
    place = (place + (spacing >> 1)) & ~(spacing - 1);
    gl_Position =
        field_clip(field_enu(edge.start + place * edge.along, edge_post_height(edge, place)));
}
