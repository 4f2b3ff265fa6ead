// Which triangles of mesh.comp may be seen: those that may have a sample of the picture.

// The lattice in which samples of the picture lie: half of its columns and rows, and where the first of
// each is. No columns: all triangles are kept.
layout(location = 0) uniform vec3 lattice;

#if RASTER

// Where what is before the near plane of a triangle that it cuts lies on the screen: x / w and y / w, a
// little more where its corners are far aside, for rounding.
void cut_range(vec4 corners[3], out vec2 least, out vec2 most)
{
    float near = scene.grid.w, margin = 0.0;
    least = vec2(1e30);
    most = vec2(-1e30);
    for (int i = 0; i < 3; i++) {
        vec4 from = corners[i], to = corners[(i + 1) % 3];
        bool ahead = from.w >= near;
        if (ahead) {
            least = min(least, from.xy);
            most = max(most, from.xy);
        }
        if (ahead == (to.w >= near))
            continue;
        vec2 clip = from.xy * from.w, way = to.xy * to.w - clip;
        vec2 at = (clip + way * ((near - from.w) / (to.w - from.w))) / near;
        least = min(least, at);
        most = max(most, at);
        margin = max(margin, exp2(-20.0) / near * max(abs(clip.x) + abs(way.x), abs(clip.y) + abs(way.y)));
    }
    least -= margin;
    most += margin;
}

#else

// What is but listed is kept: software runs both sides of a branch, and such triangles are few.
void cut_range(vec4 corners[3], out vec2 least, out vec2 most)
{
    least = vec2(-1.0);
    most = vec2(1.0);
}

#endif

// The columns and rows of the lattice in which a triangle may have samples. False where there are
// none, for it is behind, beside, turned away, or lies between samples.
bool bounds_of(vec4 a, vec4 b, vec4 c, out vec2 first, out vec2 last)
{
    const float MARGIN = 1.0 / 64.0; // of a pixel; a rasteriser moves vertices by less
    first = vec2(0.0);
    last = 2.0 * lattice.xy - 1.0;
    if (lattice.x == 0.0)
        return true;
    vec2 least = min(a.xy, min(b.xy, c.xy)), most = max(a.xy, max(b.xy, c.xy));
    bool cut = min(a.w, min(b.w, c.w)) < scene.grid.w;
    if (cut)
        cut_range(vec4[3](a, b, c), least, most);
    least = max(least, vec2(-1.0));
    most = min(most, vec2(1.0));
    first = ceil((least + 1.0) * lattice.xy - (lattice.z + MARGIN));
    last = floor((most + 1.0) * lattice.xy - (lattice.z - MARGIN));
    if (any(greaterThan(first, last)))
        return false;
    if (cut)
        return true;
    vec2 across = scene.view_rays.zw - scene.view_rays.xy;
    float turned = across.x * across.y < 0.0 ? -1.0 : 1.0; // by a mirror
    vec2 u = turned * lattice.xy * (b.xy - a.xy), v = lattice.xy * (c.xy - a.xy);
    return u.x * v.y - u.y * v.x >= -MARGIN * (abs(u.x) + abs(u.y) + abs(v.x) + abs(v.y) + MARGIN);
}
