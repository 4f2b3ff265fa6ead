// A post of a tile of GRID_CELLS x GRID_CELLS cells, an instance of which is drawn.
layout(location = 0) in ivec2 first_post;

void main()
{
    ivec2 post = first_post + ivec2(gl_VertexID % (GRID_CELLS + 1), gl_VertexID / (GRID_CELLS + 1));
    gl_Position = field_clip(field_enu(post, field_height(post)));
}
