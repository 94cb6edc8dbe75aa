#version 460
#extension GL_NV_compute_shader_derivatives : require
#extension GL_ARB_sparse_texture2 : require
#extension GL_ARB_sparse_texture_clamp : require

// Every way to sample with an implicit level of detail, and the sparse forms, over one quad.
layout(local_size_x = 2, local_size_y = 2) in;
layout(derivative_group_quadsNV) in;
layout(set = 0, binding = 1, std430) buffer Outputs { vec4 outputs[4][6]; };
layout(set = 0, binding = 2) uniform sampler2D levels;
layout(set = 0, binding = 3) uniform sampler2DShadow depths;
layout(set = 0, binding = 4, r32f) uniform readonly image2D picture;

void main() {
    uvec2 at = gl_LocalInvocationID.xy;
    uint i = gl_LocalInvocationIndex;
    vec2 place = (vec2(at) + 0.5) * 0.125;
    float q = float(1 + at.x);
    outputs[i][0] = vec4(texture(levels, place, 1.0).r, texture(levels, place * 2, 1.0).r,
                         textureProj(levels, vec3(place * 2 * q, q)).r,
                         textureProj(levels, vec3(place * 2 * q, q), 1.0).r);
    outputs[i][1] = vec4(textureQueryLod(levels, place * 4), textureQueryLod(levels, place * 16));
    outputs[i][2] = vec4(texture(depths, vec3(place, 0.4)), textureProj(depths, vec4(place * q, 0.5 * q, q)),
                         textureProj(depths, vec4(place * q, 0.75 * q, q)), texture(depths, vec3(place, 0.75), 1.0));
    vec4 texel;
    int code = sparseTextureARB(levels, place * 2, texel);
    outputs[i][3].xy = vec2(texel.r, sparseTexelsResidentARB(code));
    sparseTextureClampARB(levels, place, 2.0, texel);
    outputs[i][3].zw = vec2(texel.r, textureClampARB(levels, place, 1.0).r);
    sparseTextureLodARB(levels, place, 3.0, texel);
    outputs[i][4].x = texel.r;
    sparseTexelFetchARB(levels, ivec2(0), 1, texel);
    outputs[i][4].y = texel.r;
    sparseTextureGatherARB(levels, place, texel);
    outputs[i][4].z = texel.w;
    sparseTextureARB(depths, vec3(place, 0.4), outputs[i][4].w);
    sparseImageLoadARB(picture, ivec2(at), texel);
    outputs[i][5].x = texel.r;
    sparseTextureGatherARB(depths, place, 0.75, texel);
    outputs[i][5].y = texel.x;
    sparseTextureGradARB(levels, place, vec2(0.5, 0), vec2(0), texel);
    outputs[i][5].z = texel.r;
    sparseTextureLodARB(depths, vec3(place, 0.25), 0.0, outputs[i][5].w);
}
