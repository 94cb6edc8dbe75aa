#version 460
#extension GL_EXT_descriptor_heap : require
#extension GL_EXT_structured_descriptor_heap : require
#extension GL_EXT_nonuniform_qualifier : require
#extension GL_EXT_scalar_block_layout : require

layout(local_size_x = 4) in;

layout(buffer_type, scalar) buffer Words {
    uint words[];
};

struct Material {
    vec4 factor;
    Words words;
};

layout(constant_id = 0) const uint materials_offset = 256;

layout(push_constant) uniform Constants {
    uint outputs_offset;
    uint first_material;
} constants;

layout(heap_offset = materials_offset) resourceheap Materials {
    uint count;
    Words chosen;
    Material materials[4];
} materials;

layout(heap_offset = constants.outputs_offset) resourceheap Outputs {
    Words outputs;
    layout(r32ui) uimage2D images[2];
} results;

void main() {
    uint id = gl_GlobalInvocationID.x;
    uint material = constants.first_material + id % materials.count;
    vec4 factor = materials.materials[material].factor;
    results.outputs.words[id] = uint(factor.y) * materials.materials[nonuniformEXT(material)].words.words[id];
    materials.chosen.words[id] = material;
    imageStore(results.images[0], ivec2(id, 0), uvec4(id + 7));
}
