//! Synthetic inputs of smoke tests: what of memory, images and hits differs, and how far it
//! reaches.

use std::process::Command;

use serde_json::Value;

/// The report of a module, and the exit code.
fn smoke(text: &str) -> (Option<i32>, Value) {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("main.wgsl");
    std::fs::write(&file, text).expect("a file");
    let output = Command::new(env!("CARGO_BIN_EXE_anyhit")).args(["smoke", "--json"]).arg(&file).output();
    let output = output.expect("the command starts");
    let json = serde_json::from_slice(&output.stdout);
    (output.status.code(), json.unwrap_or_else(|_| panic!("{}", String::from_utf8_lossy(&output.stderr))))
}

#[track_caller]
fn is_entered(text: &str) {
    let (code, report) = smoke(text);
    let entry = &report["entry_points"][0];
    let coverage = &entry["coverage"];
    assert_eq!((code, &entry["result"]), (Some(0), &Value::from("ok")), "{text}\n{report:#}");
    assert_eq!(coverage["blocks_entered"], coverage["blocks"], "{text}\n{report:#}");
}

#[test]
fn what_lies_behind_a_large_array_has_values() {
    // The count lies behind 256 KiB, and behind two arrays of which the second has structs.
    for behind in ["", "structs: array<Two, 30000>,"] {
        is_entered(&format!(
            "struct Two {{ a: u32, b: vec2f }}
            struct Cache {{ cells: array<u32, 65536>, {behind} count: u32 }}
            @group(0) @binding(0) var<storage, read_write> cache: Cache;
            @group(0) @binding(1) var<storage, read_write> o: array<u32>;
            @compute @workgroup_size(1)
            fn main(@builtin(global_invocation_id) id: vec3u) {{
                if (id.x < cache.count) {{ o[id.x] = cache.cells[id.x]; }}
            }}"
        ));
    }
    // The last elements themselves, of arrays with and without a length.
    is_entered(
        "@group(0) @binding(0) var<storage, read_write> cells: array<vec4u, 50000>;
        @group(0) @binding(1) var<storage, read_write> floats: array<f32>;
        @group(0) @binding(2) var<storage, read_write> o: array<u32, 2>;
        @compute @workgroup_size(64)
        fn main(@builtin(global_invocation_id) id: vec3u) {
            if (any(cells[49999u - id.x] != vec4u(0))) { o[0] = 1u; }
            if (floats[arrayLength(&floats) - 1u - id.x] > 0.0) { o[1] = 1u; }
        }",
    );
}

#[test]
fn images_grow_in_layers_samples_and_sides() {
    let stored = |ty: &str, place: &str| {
        format!(
            "@group(0) @binding(0) var image: {ty};
            @group(0) @binding(1) var<storage, read_write> o: array<vec4f>;
            @compute @workgroup_size(1)
            fn main(@builtin(workgroup_id) id: vec3u) {{ o[id.x] += textureLoad(image, {place}); }}"
        )
    };
    for (ty, place) in [
        ("texture_2d_array<f32>", "vec2(0u), 9u + id.x, 0"),
        ("texture_2d_array<f32>", "vec2(0u), 40u, 0"),
        ("texture_1d<f32>", "700u, 0"),
        ("texture_3d<f32>", "vec3(0u, 0u, 50u), 0"),
        ("texture_2d<f32>", "vec2(60u, 1u), 0"),
        ("texture_2d<f32>", "vec2(0u), 5"),
        ("texture_multisampled_2d<f32>", "vec2(0u), 9"),
        ("texture_storage_2d_array<rgba32float, read>", "vec2(0u), 30u"),
    ] {
        is_entered(&stored(ty, place));
    }
    // Layer 5 of the faces of a cube, and a texel whose side and layer are both too great.
    is_entered(
        "@group(0) @binding(0) var faces: texture_storage_2d_array<r32float, read_write>;
        @compute @workgroup_size(1)
        fn main(@builtin(workgroup_id) id: vec3u) {
            for (var face = 0u; face < 6u; face++) {
                textureStore(faces, id.xy, face, textureLoad(faces, id.xy, face) + 1.0);
            }
            textureStore(faces, vec2(50u, 0u), 20u, textureLoad(faces, vec2(50u, 0u), 20u));
        }",
    );
}

#[test]
fn hits_differ_in_all_their_numbers() {
    let hit = |stage: &str, builtin: &str, condition: &str| {
        format!(
            "enable wgpu_ray_tracing_pipeline;
            enable primitive_index;
            struct Payload {{ t: f32 }}
            var<incoming_ray_payload> incoming: Payload;
            @{stage} @incoming_payload(incoming)
            fn main(@builtin({builtin}) x: u32) {{
                if ({condition}) {{ incoming.t = 1.0; }} else {{ incoming.t = 2.0; }}
            }}"
        )
    };
    for stage in ["closest_hit", "any_hit"] {
        for builtin in ["primitive_index", "instance_custom_data", "geometry_index"] {
            is_entered(&hit(stage, builtin, "x == 0u"));
            is_entered(&hit(stage, builtin, "x == 2u"));
        }
        is_entered(&hit(stage, "primitive_index", "x > 100u"));
        is_entered(&hit(stage, "instance_custom_data", "x > 100u"));
    }
    let of_launch = |stage: &str| hit(stage, "ray_invocation_id", "x.x == 2u").replace("x: u32", "x: vec3u");
    ["closest_hit", "any_hit", "miss"].map(of_launch).iter().for_each(|text| is_entered(text));
}
