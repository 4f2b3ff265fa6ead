// A vertex of a persistent grid that technique_persistent_grid_place.comp has laid upon the ground. A
// triangle of three on the same edge of the field, where the terrain ends, shows no ground: it stands upright.
layout(location = 0) in vec4 place; // from the eye; a bit for each edge of the field

out float gl_CullDistance[4];

void main()
{
    int edges = int(place.w);
    for (int i = 0; i < 4; i++)
        gl_CullDistance[i] = (edges >> i & 1) != 0 ? -1.0 : 1.0;
    gl_Position = field_clip(place.xyz);
}
