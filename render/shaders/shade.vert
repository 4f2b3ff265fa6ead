// One triangle over the whole screen; the fragment stage gets the ray through its pixel.
out vec3 ray_eye; // (x, y, -1): scaled by the distance along the view axis it gives the position

void main()
{
    vec2 corner = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2);
    ray_eye = vec3(mix(scene.view_rays[0].xy, scene.view_rays[0].zw, corner), -1.0);
    gl_Position = vec4(corner * 2.0 - 1.0, 0.0, 1.0);
}
