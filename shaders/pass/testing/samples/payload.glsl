struct Payload {
    float light;
    uint bounces;
};
