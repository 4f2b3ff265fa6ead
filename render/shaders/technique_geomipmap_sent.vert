// A post at the height that the CPU has morphed it to.
layout(location = 0) in ivec2 post;
layout(location = 1) in float height;

void main()
{
    gl_Position = field_clip(field_enu(post, height));
}
