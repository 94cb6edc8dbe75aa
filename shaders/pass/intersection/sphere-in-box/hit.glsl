// What the intersection shader hands to the hit shaders, and what the ray brings back.
struct Attributes {
    vec3 normal;
    uint root; // 0: near, 1: far
};

struct Payload {
    vec3 normal;
    float t;
    uint kind;
    uint any_hits;
    int primitive;
    uint root;
};
