// Values of every scalar type, as scalars, vectors, matrices, arrays and structs, that are live over a
// shader call. Each is made from the inputs before and compared after with what the inputs then say.

struct Mixed {
    float16_t half_float;
    int64_t wide;
    bool flag;
    vec3 point;
};

struct Live {
    int8_t i8;
    uint8_t u8;
    int16_t i16;
    uint16_t u16;
    int i32;
    uint u32;
    int64_t i64;
    uint64_t u64;
    float16_t f16;
    float f32;
    double f64;
    i8vec4 i8v;
    u16vec3 u16v;
    ivec4 i32v;
    i64vec2 i64v;
    f16vec3 f16v;
    vec4 f32v;
    dvec3 f64v;
    mat3x2 matrix;
    bool flag;
    uint array[5];
    double wide_array[3];
    Mixed mixed;
};

Live make(int n) {
    Live live;
    live.i8 = int8_t(-n);
    live.u8 = uint8_t(n + 200);
    live.i16 = int16_t(-300 * n);
    live.u16 = uint16_t(60000 + n);
    live.i32 = -70000 * n;
    live.u32 = 4000000000u + uint(n);
    live.i64 = int64_t(n) * -5000000000l;
    live.u64 = uint64_t(n) * 10000000000000ul;
    live.f16 = float16_t(n) / float16_t(4);
    live.f32 = float(n) / 3.0;
    live.f64 = double(n) / 3.0lf;
    live.i8v = i8vec4(n, -n, n + 1, 7);
    live.u16v = u16vec3(n, 2 * n, 65535);
    live.i32v = ivec4(n, -n, n * n, 1 << n);
    live.i64v = i64vec2(live.i64, -live.i64);
    live.f16v = f16vec3(live.f16, -live.f16, 1.0hf);
    live.f32v = vec4(live.f32, -live.f32, 0.5, float(n));
    live.f64v = dvec3(live.f64, -live.f64, 0.25lf);
    live.matrix = mat3x2(n, 1, 2, n, 3, 4);
    live.flag = n > 2;
    for (int at = 0; at < 5; ++at) {
        live.array[at] = uint(n * at);
    }
    for (int at = 0; at < 3; ++at) {
        live.wide_array[at] = double(n) / double(at + 3);
    }
    live.mixed = Mixed(live.f16, live.i64, !live.flag, live.f32v.xyz);
    return live;
}

uint equal_members(Live a, Live b) {
    uint count = 0u;
    count += uint(a.i8 == b.i8) + uint(a.u8 == b.u8) + uint(a.i16 == b.i16) + uint(a.u16 == b.u16);
    count += uint(a.i32 == b.i32) + uint(a.u32 == b.u32) + uint(a.i64 == b.i64) + uint(a.u64 == b.u64);
    count += uint(a.f16 == b.f16) + uint(a.f32 == b.f32) + uint(a.f64 == b.f64);
    count += uint(a.i8v == b.i8v) + uint(a.u16v == b.u16v) + uint(a.i32v == b.i32v) + uint(a.i64v == b.i64v);
    count += uint(a.f16v == b.f16v) + uint(a.f32v == b.f32v) + uint(a.f64v == b.f64v);
    count += uint(a.matrix == b.matrix) + uint(a.flag == b.flag) + uint(a.array == b.array);
    count += uint(a.wide_array == b.wide_array) + uint(a.mixed == b.mixed);
    return count;
}
