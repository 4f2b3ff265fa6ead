// The shading pass on a software rasteriser: one triangle over the whole screen.
in vec2 tangent;

layout(location = 0) out vec4 colour;

void main()
{
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    colour = stored(pixel_shown(pixel, tangent), pixel);
}
