// What the stages of this case hand to each other.
struct Payload {
    vec3 normal;
    float t;
    uint hits;
};
