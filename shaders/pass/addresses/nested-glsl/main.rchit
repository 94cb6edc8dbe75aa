#version 460
#extension GL_GOOGLE_include_directive : require
#include "scene.glsl"

layout(location = 0) rayPayloadInEXT Payload payload;
layout(shaderRecordEXT, std430) buffer Record { Material material; } record;

void main() {
    Instance instance = pushConst.sceneInfo.instances.items[gl_InstanceID];
    payload.colour = instance.material.colour * instance.scale;
    payload.roughness = instance.material.next.next.roughness;
    payload.other = record.material.roughness;
    payload.frame = pushConst.sceneInfo.self.self.frame;
    payload.material = instance.material;
    pushConst.sceneInfo.instances.items[gl_InstanceID].t = gl_HitTEXT;
}
