// A vertex that mesh.comp has placed.
layout(location = 0) in vec4 in_enu;

void main()
{
    gl_Position = scene.clip_from_enu * vec4(in_enu.xyz, 1.0);
}
