// A vertex of an entity's shape, from its number (render/entity_pass.c has the instances).
layout(location = 0) in vec4 in_place;   // enu from the eye; w: alpha
layout(location = 1) in vec4 in_forward; // as long as the entity is; w: the shape
layout(location = 2) in vec4 in_right;
layout(location = 3) in vec4 in_up;

out vec3 place;
flat out vec3 normal;
flat out vec4 paint; // albedo, alpha

// Forward, right, up, as shares of length, width and height. An arrow-head: nose, left, right, fin, belly.
const vec3 arrow[5] = vec3[](vec3(0.5, 0.0, 0.0), vec3(-0.5, -0.5, 0.0), vec3(-0.5, 0.5, 0.0),
                             vec3(-0.3, 0.0, 0.7), vec3(-0.3, 0.0, -0.3));
const int arrow_faces[18] = int[](0, 1, 3, 0, 3, 2, 0, 4, 1, 0, 2, 4, 1, 4, 3, 2, 3, 4);
// A box: a corner's bits are forward, right, up.
const int box_faces[36] = int[](0, 1, 3, 0, 3, 2, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4, 2, 3, 7, 2, 7, 6,
                                0, 2, 6, 0, 6, 4, 1, 3, 7, 1, 7, 5);

vec3 corner(bool box, int index)
{
    int number = box ? box_faces[index] : index < 18 ? arrow_faces[index] : 0;
    vec3 share = box ? vec3(number & 1, (number >> 1) & 1, number >> 2) - vec3(0.5, 0.5, 0.0)
                     : arrow[number];
    return share.x * in_forward.xyz + share.y * in_right.xyz + share.z * in_up.xyz;
}

void main()
{
    bool box = in_forward.w > 0.5;
    int first = gl_VertexID - gl_VertexID % 3;
    vec3 a = corner(box, first), b = corner(box, first + 1), c = corner(box, first + 2);
    // A face's normal is the one away from what is inside.
    vec3 inside = box ? 0.5 * in_up.xyz : -0.1 * in_forward.xyz + 0.1 * in_up.xyz;
    normal = cross(b - a, c - a);
    normal *= dot(normal, a - inside) < 0.0 ? -1.0 : 1.0;
    normal *= inversesqrt(max(dot(normal, normal), 1e-30));
    place = in_place.xyz + corner(box, gl_VertexID);
    paint = vec4(box ? vec3(0.20, 0.21, 0.13) : vec3(0.26, 0.27, 0.29), in_place.w);
    gl_Position = scene.clip_from_enu * vec4(place, 1.0);
}
