// A post of a tile of the reference: its own height, no blending.
layout(location = 0) in float in_height; // m above the ellipsoid

layout(location = 0) uniform ivec4 tile; // first column and row; level; pane

void main()
{
    ivec2 post = tile.xy + ivec2(gl_VertexID % (BLOCK + 1), gl_VertexID / (BLOCK + 1));
    vec3 dn = normal_difference(tile.w, 2 * post, tile.z);
    gl_Position =
        scene.clip_from_enu * vec4(enu_from_difference(dn, in_height, rise_of(in_height)), 1.0);
}
