// What a ray saw, by words of its payload.
const uint WORDS = 72u;
const uint STAGE = 0u; // 1 miss, 2 closest-hit of a triangle, 3 of a box, 4 of a sphere, 5 of a linear swept sphere
const uint ANY_HITS = 1u;
const uint RECORD = 2u;
const uint FLAGS = 3u;
const uint PRIMITIVE = 4u;
const uint GEOMETRY = 5u;
const uint INSTANCE = 6u;
const uint CUSTOM = 7u;
const uint KIND = 8u;
const uint T_MIN = 9u;
const uint T_MAX = 10u;
const uint ATTRIBUTE = 11u; // 4
const uint WORLD_ORIGIN = 15u;
const uint WORLD_DIRECTION = 18u;
const uint OBJECT_ORIGIN = 21u;
const uint OBJECT_DIRECTION = 24u;
const uint OBJECT_TO_WORLD = 27u; // 12, column by column
const uint WORLD_TO_OBJECT = 39u; // 12
const uint VERTICES = 51u; // 9
const uint SEEN_FLAGS = 60u; // of the last any-hit
const uint SEEN_T = 61u;
const uint SEEN_KIND = 62u;
const uint SEEN_RECORD = 63u;
const uint NEVER = 64u; // written where nothing may run
const uint SEEN_ATTRIBUTE = 65u; // 2
const uint LAUNCH = 67u; // of the last hit or miss shader: id, then the product of the sizes
const uint CULL_MASK = 71u;

struct Probe {
    uint words[WORDS];
};

// Data behind a hit record's handle: what its shaders do.
struct Plan {
    uint id;
    uint any_hit; // 0 accepts, 1 ignores, 2 terminates, 3 ignores primitives of even number, 4 terminates in a
                  // function, 5 ignores beyond t = 1/2
    uint reports; // how many of the two
    float t[2];
    uint kind[2];
};
