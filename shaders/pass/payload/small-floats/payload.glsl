// What the stages of this case hand to each other.
struct Payload {
    bfloat16_t weight;
    floate4m3_t tint[2];
    fe5m2vec3 parts;
    float t;
};
