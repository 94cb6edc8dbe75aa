// What the closest-hit shader found, all zero on a miss.
struct Result {
    vec3 exact;      // unit normals in object space
    float u;
    vec3 projected;
    float t;
    float angle;     // between the two, in radians
    float expected;  // asin(|r0 - r1| / |p1 - p0|): holds between the caps, 0 < u < 1
    float off_sphere; // |hit - centre| - radius of the generating sphere at u
    float hits;
};
