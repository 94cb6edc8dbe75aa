// A payload with all that one may hold: nested structs, arrays, a matrix, integers of both signs.
struct Bounce {
    vec3 at;
    int primitive;
};

struct Payload {
    uint depth;
    Bounce bounces[3];
    mat2 turned;
    ivec2 counts; // hits, misses
    float path[4];
};
