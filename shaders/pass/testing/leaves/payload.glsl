struct Payload {
    vec3 colour;
    float t;
    uint seen;
};
