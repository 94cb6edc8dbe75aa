#version 460
#extension GL_EXT_ray_query : require
#extension GL_EXT_nonuniform_qualifier : require
#extension GL_EXT_samplerless_texture_functions : require

// Nothing is bound but the outputs, which say what null descriptors give.
layout(local_size_x = 1) in;
layout(set = 0, binding = 0) uniform accelerationStructureEXT structure;
layout(set = 0, binding = 1, std430) buffer Outputs { uint outputs[]; };
layout(set = 0, binding = 2, std430) buffer Words { uint words[]; };
layout(set = 0, binding = 3, std140) uniform Settings { uvec4 settings; };
layout(set = 0, binding = 4, rgba32f) uniform image2D picture;
layout(set = 0, binding = 5, r32ui) uniform uimage2D counts;
layout(set = 0, binding = 6) uniform sampler2D textures[];
layout(set = 0, binding = 7) uniform texture3D volume;
layout(set = 0, binding = 8) uniform sampler plain;
layout(set = 0, binding = 9) uniform samplerCubeShadow shadow;
layout(set = 0, binding = 10) uniform isamplerBuffer texels;
layout(set = 0, binding = 11, std430) buffer Unused { uint unused[]; };

void main() {
    words[5] = 9u;
    outputs[0] = words[5];
    outputs[1] = atomicAdd(words[2], 3u);
    outputs[2] = uint(words.length());
    outputs[3] = settings.z;
    imageStore(picture, ivec2(0, 0), vec4(1.0));
    imageStore(picture, ivec2(7, 9), vec4(1.0));
    outputs[4] = floatBitsToUint(imageLoad(picture, ivec2(0, 0)).x + imageLoad(picture, ivec2(7, 9)).w);
    outputs[5] = imageAtomicAdd(counts, ivec2(0, 0), 4u);
    outputs[6] = imageAtomicAdd(counts, ivec2(0, 0), 4u);
    vec4 color = textureLod(textures[nonuniformEXT(words[1] + 1000u)], vec2(0.5), 0.0);
    outputs[7] = floatBitsToUint(color.x + color.w);
    outputs[8] = floatBitsToUint(textureLod(sampler3D(volume, plain), vec3(0.25), 0.0).y);
    outputs[9] = uint(texelFetch(texels, 40).x);
    rayQueryEXT query;
    rayQueryInitializeEXT(query, structure, gl_RayFlagsNoneEXT, 0xFF, vec3(0.0), 0.0, vec3(0.0, 0.0, 1.0), 100.0);
    outputs[10] = uint(rayQueryProceedEXT(query)) + 7u;
    outputs[11] = floatBitsToUint(textureGrad(shadow, vec4(1.0, 0.0, 0.0, 0.5), vec3(0.0), vec3(0.0)));
    outputs[12] = uint(imageSize(picture).x);
}
