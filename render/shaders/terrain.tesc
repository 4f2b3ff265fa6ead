// Sets the tessellation levels of a square of 2 x 2 cells (Song et al. 2016, equations 2 to 6).
layout(vertices = 1) out;

in ivec4 block_out[];
in vec4 reaches_out[];

patch out ivec4 patch_block;
patch out vec4 patch_reaches;

void main()
{
    int doubled = block_out[0].w;
    patch_block = block_out[0];
    patch_reaches = reaches_out[0];
    gl_out[gl_InvocationID].gl_Position = vec4(0.0);
    gl_TessLevelInner[0] = gl_TessLevelInner[1] = 2.0;
    gl_TessLevelOuter[0] = float(2 << (doubled & 1));
    gl_TessLevelOuter[1] = float(2 << (doubled >> 2 & 1));
    gl_TessLevelOuter[2] = float(2 << (doubled >> 1 & 1));
    gl_TessLevelOuter[3] = float(2 << (doubled >> 3 & 1));
}
