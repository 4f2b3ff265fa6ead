// A picture of depth as it is.
layout(binding = 0) uniform sampler2D picture;

void main()
{
    gl_FragDepth = texelFetch(picture, ivec2(gl_FragCoord.xy), 0).r;
}
