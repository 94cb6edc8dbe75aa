@group(0) @binding(0) var picture: texture_storage_2d<rgba32float, write>;

@compute @workgroup_size(8, 4)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if (any(id.xy >= vec2<u32>(13u, 6u))) {
        return;
    }
    // Floats from 2^24 on are the even numbers.
    let red = (16777216.0 + f32(id.x)) - 16777216.0;
    var green = 0.0;
    if (id.x < 4u) {
        green = 0.25 * f32(id.y);
    }
    textureStore(picture, vec2<i32>(id.xy), vec4<f32>(red, green, 0.0, 1.0));
}
