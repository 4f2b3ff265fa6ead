// A vertex of the mesh between two passes; the coarse mesh knows its place alone.
layout(location = 0) in vec3 at; // column and row of the field, height
layout(location = 1) in vec3 from_eye;

layout(location = 0) out vec3 place;
layout(location = 1) out vec3 enu;

layout(location = 0) uniform int pass;

void main()
{
    place = at;
    enu = pass == 0 ? field_enu(ivec2(at.xy), at.z) : from_eye;
}
