// The ground that the compared techniques draw (terrain/field.h): heights of posts, and where they
// are. Positions are relative to the eye; what two triangles share has to be computed from the same
// post or place by the same function.
layout(binding = 8) uniform sampler2DArray field_heights; // m above the ellipsoid

// Which piece of the field has a cell: one has all, where the GPU's textures are large enough. Pieces
// beside each other both have the posts of the edge between them.
ivec2 field_piece(ivec2 cell)
{
#if FIELD_PIECE < FIELD_CELLS
    return min(cell / FIELD_PIECE, ivec2(FIELD_CELLS / FIELD_PIECE - 1));
#else
    return ivec2(0);
#endif
}

int field_layer(ivec2 piece)
{
    return piece.y * (FIELD_CELLS / FIELD_PIECE) + piece.x;
}

// Of a post; beyond the edges that of the edge.
float field_height(ivec2 post)
{
    ivec2 at = clamp(post, ivec2(0), ivec2(FIELD_CELLS)), piece = field_piece(at);
    return texelFetch(field_heights, ivec3(at - piece * FIELD_PIECE, field_layer(piece)), 0).r;
}

// Of a place between posts, bilinear, by the GPU's filter: its weights may have 8 bits.
float field_height_filtered(vec2 at)
{
    ivec2 piece = field_piece(ivec2(max(at, vec2(0.0))));
    vec2 within = at - vec2(piece * FIELD_PIECE);
    return textureLod(field_heights,
                      vec3((within + 0.5) / float(FIELD_PIECE + 1), float(field_layer(piece))), 0.0)
        .r;
}

// Of a place between posts, on the triangles that the ground is made of.
float field_height_between(vec2 at)
{
    ivec2 cell = clamp(ivec2(floor(at)), ivec2(0), ivec2(FIELD_CELLS - 1));
    vec2 t = at - vec2(cell);
    bool falls = ((cell.x ^ cell.y) & 1) != 0;
    float sw = field_height(cell), se = field_height(cell + ivec2(1, 0));
    float nw = field_height(cell + ivec2(0, 1)), ne = field_height(cell + 1);
    if (falls)
        return t.x + t.y < 1.0 ? sw + t.x * (se - sw) + t.y * (nw - sw)
                               : ne + (1.0 - t.x) * (nw - ne) + (1.0 - t.y) * (se - ne);
    return t.y < t.x ? sw + t.x * (se - sw) + t.y * (ne - se)
                     : sw + t.y * (nw - sw) + t.x * (ne - nw);
}

vec3 field_enu_of_difference(vec3 dn, float height)
{
    return enu_from_difference(dn, height, rise_of(height));
}

// East, north, up from the eye of a post at a height.
vec3 field_enu(ivec2 post, float height)
{
    ivec2 halves = 2 * (post + ivec2(FIELD_COL, FIELD_ROW));
    return field_enu_of_difference(normal_difference(FIELD_PANE, halves, 0), height);
}

// Where the eye is, in whole posts, and what is left of it (at most half a post).
ivec2 field_eye_post()
{
    return (scene_block.panes[FIELD_PANE].origin.xy >> 1) - ivec2(FIELD_COL, FIELD_ROW);
}

vec2 field_eye_rest()
{
    Pane pane = scene_block.panes[FIELD_PANE];
    return 0.5 * vec2(pane.origin.xy & 1) - 0.5 * pane.base.xy / scene.grid.x;
}

// Of a place that is so many posts from the eye, on the ellipsoid: to be given to
// field_enu_of_difference().
vec3 field_difference(vec2 posts_from_eye)
{
    return normal_difference_of_angle(scene_block.panes[FIELD_PANE], 2.0 * scene.grid.x * posts_from_eye);
}

// And back: posts from the eye, to within 1e-6 of them; the place is on the field's side of the
// Earth.
vec2 field_posts_from_eye(vec3 dn)
{
    Pane at = scene_block.panes[FIELD_PANE];
    vec2 eye = vec2(at.along_xi.w, at.along_eta.w);
    vec3 d = dn * at.axes; // in the face's axes
    vec2 change = (d.yz - eye * d.x) / dot(at.axes[0], vec3(dn.xy, 1.0 + dn.z));
    return 0.5 * atan(change / (1.0 + eye * (eye + change))) / scene.grid.x;
}

vec4 field_clip(vec3 enu)
{
    return scene.clip_from_enu * vec4(enu, 1.0);
}
