// The refined mesh, at last.
layout(location = 1) in vec3 from_eye;

void main()
{
    gl_Position = field_clip(from_eye);
}
