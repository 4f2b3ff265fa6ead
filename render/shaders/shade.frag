// The shading pass on a software rasteriser: one triangle over the whole screen.
in vec2 tangent;

layout(location = 0) out vec4 colour;

void main()
{
    colour = vec4(pixel_shown(ivec2(gl_FragCoord.xy), tangent), 1.0);
}
