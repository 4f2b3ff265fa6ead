// A post of a node, or of a quarter of one, which near the end of its level's range slides onto the
// next coarser level's posts.
layout(location = 0) in ivec2 grid; // of the mesh
layout(location = 1) in ivec3 node; // first post, level

layout(location = 0) uniform vec2 morphs[LEVELS]; // x: from where on, m; y: how fast, 1/m

// To which post an odd one slides. Cells are cut towards the middle of their square of 2 x 2, so that
// where the coarse cell is cut from the south-east, that is where the middle goes.
ivec2 slide(ivec2 post, ivec2 odd, int level)
{
    ivec2 coarse = post >> (level + 1);
    bool falls = ((coarse.x ^ coarse.y) & 1) != 0;
    return ivec2(falls && odd == ivec2(1) ? 1 : -odd.x, -odd.y) * (1 << level);
}

void main()
{
    int level = node.z;
    ivec2 odd = grid & 1, post = node.xy + (grid << level);
    vec3 enu = field_enu(post, field_height(post));
    float share = clamp((length(enu) - morphs[level].x) * morphs[level].y, 0.0, 1.0);
    if (share > 0.0 && odd != ivec2(0)) {
        ivec2 move = slide(post, odd, level);
        if (share < 1.0) {
            vec2 from_eye = vec2(post - field_eye_post()) - field_eye_rest() + share * vec2(move);
            float height = field_height_filtered(vec2(post) + share * vec2(move));
            enu = field_enu_of_difference(field_difference(from_eye), height);
        } else {
            enu = field_enu(post + move, field_height(post + move));
        }
    }
    gl_Position = field_clip(enu);
}
