#version 460
#extension GL_GOOGLE_include_directive : require
#include "scene.glsl"

layout(location = 0) rayPayloadInEXT Payload payload;

void main() {
    payload.frame = pushConst.sceneInfo.frame + 1;
}
