// One triangle over the whole screen, as far away as what is not ground at all; the fragment stage gets
// the tangents of its pixel's ray, and what it needs of the scene.
out vec2 tangent;

void main()
{
    vec2 corner = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2);
    tangent = mix(scene.view_rays.xy, scene.view_rays.zw, corner);
    carried.eye_trig = scene.eye_trig;
    carried.grid = scene.grid;
    carried.eye_rest = scene.eye_rest;
    carried.accuracy = scene.accuracy;
    carried.way_back = scene.way_back;
    carried.sun = scene.sun;
    carried.haze = scene.haze;
    carried.air = scene.air;
    carried.along = scene.along;
    carried.parallel = scene.parallel;
    carried.view_rays = scene.view_rays;
    carried.enu_from_eye = mat3(scene.enu_from_eye);
    carried.sizes = scene.sizes;
    for (int p = 0; p < PANES; p++) {
        Pane pane = scene_block.panes[p];
        carried.axes[p] = pane.axes;
        carried.base[p] = vec4(pane.base.xy, pane.along_xi.w, pane.along_eta.w);
        carried.origin[p] = pane.origin.xy;
    }
    gl_Position = vec4(corner * 2.0 - 1.0, scene.accuracy.y, 1.0);
}
