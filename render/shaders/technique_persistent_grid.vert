// A vertex of a persistent grid that technique_persistent_grid_place.comp has laid upon the ground.
layout(location = 0) in vec3 enu;

void main()
{
    gl_Position = field_clip(enu);
}
