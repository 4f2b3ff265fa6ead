// One triangle over the whole screen, as far away as what is not ground at all; the fragment stage gets
// the tangents of its pixel's ray.
out vec2 tangent;

void main()
{
    vec2 corner = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2);
    tangent = mix(scene.view_rays.xy, scene.view_rays.zw, corner);
    gl_Position = vec4(corner * 2.0 - 1.0, scene.accuracy.y, 1.0);
}
