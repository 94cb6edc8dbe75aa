//! What is said of a test that fails: who wrote the wrong number, or that nobody did, in launches,
//! dispatches and frames; the page about the right invocation; the lines that decided.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

fn scratch(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("explanations").join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a writable folder");
    folder
}

/// Writes files into a folder of the test's own and runs a command there; returns its exit code and
/// what it printed.
fn anyhit(name: &str, files: &[(&str, &str)], arguments: &[&str]) -> (Option<i32>, String) {
    let folder = scratch(name);
    for (file, text) in files {
        std::fs::write(folder.join(file), text).expect("a writable folder");
    }
    let mut command = Command::new(env!("CARGO_BIN_EXE_anyhit"));
    let output = command.args(arguments).current_dir(folder).stdin(Stdio::null()).output();
    let output = output.expect("the command starts");
    let text = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).expect("UTF-8")).concat();
    (output.status.code(), text)
}

/// What `anyhit test` prints of a scene that fails.
fn failure(name: &str, files: &[(&str, &str)]) -> String {
    let (code, text) = anyhit(name, files, &["test", "."]);
    // An expectation or a trap.
    assert!(matches!(code, Some(1 | 3)), "{code:?}: {text}");
    text
}

#[track_caller]
fn holds(text: &str, all: &[&str]) {
    for words in all {
        assert!(text.contains(words), "no `{words}` in\n{text}");
    }
}

/// A scene of one dispatch with a buffer `out`.
fn dispatch(out: &str, expected: &str) -> String {
    format!(
        "version = 1\n[shaders]\na = {{ source = 'a.wgsl', compiler_flags = ['-g'] }}\n[[dispatch]]\nshader = 'a'\n\
         [resources.out]\ntype = 'storage_buffer'\nbinding = 0\n{out}\n[[expect.buffer]]\nname = 'out'\n{expected}\n"
    )
}

#[test]
fn an_invocation_that_left_the_value_as_it_was_is_found() {
    let shader = "@group(0) @binding(0) var<storage, read_write> out: array<u32, 4>;\n\
        @compute @workgroup_size(4) fn main(@builtin(global_invocation_id) id: vec3u) {\n\
        \x20   out[id.x] = 7u * id.x;\n}\n";
    let scene = dispatch("data = { u32 = [9, 7, 2, 3] }", "u32 = [0, 8, 14, 21]");
    let text = failure("unchanged", &[("a.wgsl", shader), ("scene.toml", &scene)]);
    holds(
        &text,
        &[
            "last written, with an unchanged value, at a.wgsl:3: out[id.x] = 7u * id.x;",
            "the invocation, explained:",
            "invocation (1, 0, 0) of dispatch 0",
            "see also: anyhit trace-one-ray scene.toml --invocation 1,0,0\n",
        ],
    );
    let scene = dispatch("data = { u32 = [9, 8, 2, 3] }", "u32 = [0, 8, 14, 21]");
    let text = failure("changed", &[("a.wgsl", shader), ("scene.toml", &scene)]);
    holds(&text, &["last written at a.wgsl:3: out[id.x] = 7u * id.x;"]);
}

#[test]
fn a_value_that_nobody_wrote_is_told_with_the_lines_that_could_have() {
    let shader = "@group(0) @binding(0) var<storage, read_write> out: array<u32>;\n\
        @compute @workgroup_size(8) fn main(@builtin(global_invocation_id) id: vec3u) {\n\
        \x20   if (id.x < 5u) {\n        out[id.x] = 7u * id.x;\n    } else if (id.x == 99u) {\n\
        \x20       out[7] = 1u;\n    }\n}\n";
    let scene = dispatch("size = 32", "u32 = [0, 7, 14, 21, 28, 35, 'any', 49]");
    let text = failure("never", &[("a.wgsl", shader), ("scene.toml", &scene)]);
    holds(
        &text,
        &[
            "never written: no invocation stores to this byte; the lines that store:",
            // Five invocations of four bytes each.
            "= a.wgsl:4: out[id.x] = 7u * id.x; (ran 5 times, on bytes 0 to 19)",
            "= a.wgsl:6: out[7] = 1u; (never ran)",
            // The invocation of the element that is missing.
            "see also: anyhit trace-one-ray scene.toml --invocation 5,0,0\n",
        ],
    );
    // Each of the differences has its note.
    assert_eq!(text.matches("never written:").count(), 2, "{text}");
    let reader = "@group(0) @binding(0) var<storage, read_write> out: array<u32>;\n\
        @group(0) @binding(1) var<storage, read_write> other: array<u32>;\n\
        @compute @workgroup_size(1) fn main() { other[0] = out[0]; }\n";
    let other = "[resources.other]\ntype = 'storage_buffer'\nbinding = 1\nsize = 4\n";
    let scene = dispatch("size = 32", "u32 = [1]") + other;
    let text = failure("nowhere", &[("a.wgsl", reader), ("scene.toml", &scene)]);
    holds(&text, &["never written: no shader of the scene stores to it", "--invocation 0,0,0\n"]);
}

#[test]
fn of_large_dispatches_the_invocation_of_the_element_is_tried() {
    let shader = "@group(0) @binding(0) var<storage, read_write> out: array<u32>;\n\
        @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {\n\
        \x20   out[id.x] = id.x;\n}\n";
    let scene = dispatch("size = 409600", "offset = 400000\nu32 = [1]")
        .replace("shader = 'a'", "shader = 'a'\ngroups = [1600, 1, 1]");
    let text = failure("large", &[("a.wgsl", shader), ("scene.toml", &scene)]);
    // 400000 / 4
    holds(&text, &["last written at a.wgsl:3: out[id.x] = id.x;", "--invocation 100000,0,0\n"]);
    // Backwards no element is that of its invocation.
    let backwards = shader.replace("out[id.x] = id.x", "out[102399u - id.x] = id.x");
    let text = failure("large-backwards", &[("a.wgsl", &backwards), ("scene.toml", &scene)]);
    holds(&text, &["by one of its 102,400 invocations: too many to search (the limit is 65,536)"]);
}

const DRAW: &str = "@group(0) @binding(0) var picture: texture_storage_2d<rgba32float, write>;\n\
    @compute @workgroup_size(4, 4) fn main(@builtin(global_invocation_id) id: vec3u) {\n\
    \x20   textureStore(picture, id.xy, vec4f(vec2f(id.xy), 0.0, 1.0));\n}\n";

#[test]
fn images_that_dispatches_write_are_explained() {
    let scene = "version = 1\n[shaders]\na = { source = 'a.wgsl', compiler_flags = ['-g'] }\n\
        [[dispatch]]\nshader = 'a'\n\
        [resources.picture]\ntype = 'storage_image'\nformat = 'rgba32f'\nbinding = 0\nsize = [5, 4]\n\
        [[expect.image]]\nname = 'picture'\nat = [2, 3]\nf32 = [9, 3, 0, 1]\n\
        [[expect.image]]\nname = 'picture'\nat = [4, 1]\nf32 = [4, 'any', 'any', 'any']\n";
    let text = failure("image", &[("a.wgsl", DRAW), ("scene.toml", scene)]);
    holds(
        &text,
        &[
            "last written at a.wgsl:3: textureStore(picture, id.xy,",
            "invocation (2, 3, 0) of dispatch 0",
            "--invocation 2,3,0\n",
            // The workgroup covers 4 of the 5 columns.
            "never written: no invocation stores to this texel; the lines that store:",
            "(ran 16 times, on texels (0, 0) to (3, 3))",
        ],
    );
    assert!(!text.contains("--pixel"), "{text}");
}

#[test]
fn a_frame_is_searched_pass_by_pass() {
    let sum = "@group(0) @binding(0) var picture: texture_storage_2d<rgba32float, read>;\n\
        @group(0) @binding(1) var<storage, read_write> total: array<vec4f>;\n\
        @compute @workgroup_size(1) fn main() {\n    var sum = vec4f();\n\
        \x20   for (var x = 0u; x < 4u; x++) { sum += textureLoad(picture, vec2u(x, 1u)); }\n\
        \x20   total[0] = sum;\n}\n";
    let scene = |expected: &str| {
        format!(
            "version = 1\n[shaders]\nfirst = {{ source = 'a.wgsl', compiler_flags = ['-g'] }}\n\
             second = {{ source = 'b.wgsl', compiler_flags = ['-g'] }}\n\
             [[pass]]\nname = 'draw'\nshader = 'first'\n[[pass]]\nname = 'sum up'\nshader = 'second'\n\
             [resources.picture]\ntype = 'storage_image'\nformat = 'rgba32f'\nbinding = 0\nsize = [4, 4]\n\
             [resources.total]\ntype = 'storage_buffer'\nbinding = 1\nsize = 16\n{expected}"
        )
    };
    // 0 + 1 + 2 + 3 = 6, and four times 1.
    let of_buffer = scene("[[expect.buffer]]\nname = 'total'\nf32 = [6, 5, 0, 4]\n");
    let text = failure("frame-buffer", &[("a.wgsl", DRAW), ("b.wgsl", sum), ("scene.toml", &of_buffer)]);
    holds(
        &text,
        &[
            "last written at b.wgsl:6: total[0] = sum;",
            "--invocation 0,0,0 --pass \"sum up\"\n",
            "pass sum up",
        ],
    );
    let of_image = scene("[[expect.image]]\nname = 'picture'\nat = [1, 2]\nf32 = [1, 3, 0, 1]\n");
    let text = failure("frame-image", &[("a.wgsl", DRAW), ("b.wgsl", sum), ("scene.toml", &of_image)]);
    holds(&text, &["last written at a.wgsl:3: textureStore(", "--invocation 1,2,0 --pass draw\n"]);
    // The command is one that works.
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("explanations/frame-buffer");
    let mut command = Command::new(env!("CARGO_BIN_EXE_anyhit"));
    command.args(["trace-one-ray", "scene.toml", "--invocation", "0,0,0", "--pass", "sum up"]);
    let output = command.current_dir(folder).output().expect("the command starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn a_trap_of_a_dispatch_is_explained_by_its_invocation() {
    let shader = "@group(0) @binding(0) var<storage, read_write> out: array<u32>;\n\
        @compute @workgroup_size(4) fn main(@builtin(global_invocation_id) id: vec3u) {\n\
        \x20   out[id.x] = 1u;\n}\n";
    let scene = dispatch("size = 8", "u32 = [1]");
    let text = failure("trap", &[("a.wgsl", shader), ("scene.toml", &scene)]);
    holds(&text, &["a shader trapped", "the invocation, explained:", "--invocation 2,0,0\n"]);
}

/// The shaders of a leaf with holes: where u + v is above 0.6.
const HEAD: &str = "#version 460\n#extension GL_EXT_ray_tracing : require\n\
    struct Payload { vec3 colour; float t; };\n\
    layout(location = 0) rayPayloadInEXT Payload payload;\n";
const CUT: &str = "hitAttributeEXT vec2 at;\nvoid main() {\n    float sum = at.x;\n    sum += at.y;\n\
    \x20   if (sum > 0.6)\n        ignoreIntersectionEXT;\n    payload.colour.y = sum;\n}\n";
const PAINT: &str = "void main() {\n    payload.t = gl_HitTEXT;\n    payload.colour.z = 0.0;\n}\n";
const SKY: &str = "void main() { payload.t = -1.0; }\n";

/// The scene with the leaf, and a ray that must find something.
fn leaf(name: &str, ray: &str, arguments: &[&str]) -> String {
    let scene = format!(
        "version = 1\n[shaders]\nany = 'leaf.rahit'\npaint = 'leaf.rchit'\nsky = 'sky.rmiss'\n\
         [pipeline]\nmiss = ['sky']\nhit = [{{ closest_hit = 'paint', any_hit = 'any' }}]\n\
         [geometry.t]\ntype = 'triangles'\nvertices = [[-1, -1, 0], [1, -1, 0], [0, 1, 0]]\n\
         [[instance]]\ngeometry = 't'\n[[ray]]\nname = 'a'\ndirection = [0, 0, -1]\n{ray}\n"
    );
    let shaders = [CUT, PAINT, SKY].map(|text| [HEAD, text].concat());
    let files = [
        ("leaf.rahit", shaders[0].as_str()),
        ("leaf.rchit", &shaders[1]),
        ("sky.rmiss", &shaders[2]),
        ("a.test.toml", &scene),
    ];
    let (code, text) = anyhit(name, &files, &[&["test", "."], arguments].concat());
    assert_eq!(code, Some(1), "{text}");
    text
}

#[test]
#[cfg_attr(not(feature = "glsl"), ignore = "needs the feature `glsl`")]
fn the_any_hit_shader_that_decided_shows_its_lines_and_the_hints_stand_above() {
    // In the middle of the triangle's height u + v is 3/4.
    let text = leaf("ignored", "origin = [0, 0, 3]\nexpect = { t = 3 }", &[]);
    holds(
        &text,
        &[
            "hint     ray at depth 1: it misses because any-hit shaders ignored its 1 candidate",
            "7  float sum = at.x;",
            "8  sum += at.y;",
            "sum = float 0.75",
            "9  if (sum > 0.6)",
            "10  ignoreIntersectionEXT;",
        ],
    );
    let text = leaf("two-lines", "origin = [0, 0, 3]\nexpect = { t = 3 }", &["--explain-lines", "2"]);
    holds(
        &text,
        &["executed lines\n", "2 lines before these", "9  if (sum > 0.6)", "10  ignoreIntersectionEXT;"],
    );
    assert!(!text.contains("7  float sum"), "{text}");
    let text = leaf("no-lines", "origin = [0, 0, 3]\nexpect = { t = 3 }", &["--explain-lines", "0"]);
    assert!(!text.contains("executed lines") && text.contains("hint     ray at depth 1"), "{text}");
    let text = leaf("unexplained", "origin = [0, 0, 3]\nexpect = { t = 3 }", &["--no-explanation"]);
    assert!(!text.contains("hint") && text.contains("see also: anyhit trace-one-ray"), "{text}");
    // Where it is accepted, the lines that led there.
    let text = leaf("kept", "origin = [-0.6, -0.9, 3]\nexpect = { miss = true }", &[]);
    holds(&text, &["9  if (sum > 0.6)", "11  payload.colour.y = sum;"]);
    // As JSON, the hints are told apart.
    let text = leaf("json", "origin = [0, 0, 3]\nexpect = { t = 3 }", &["--format", "json"]);
    let json: serde_json::Value =
        serde_json::from_str(text.rsplit_once("\nerror:").expect("the verdict").0).expect("JSON");
    assert_eq!(json["tests"][0]["hints"][0]["kind"], "all_ignored", "{text}");
}

#[test]
#[cfg_attr(not(feature = "glsl"), ignore = "needs the feature `glsl`")]
fn words_of_a_payload_are_told_whether_they_changed_or_not() {
    // Begins as 0, and is set to 0.
    let ray = "origin = [-0.6, -0.9, 3]\nexpect = { payload = { colour = [1, 'any', 2] } }";
    let text = leaf("payload", ray, &[]);
    holds(
        &text,
        &[
            "never written: it still has the initial value of the ray's payload",
            "last written, with an unchanged value, at leaf.rchit:7: payload.colour.z = 0.0;",
        ],
    );
}

const RAYGEN: &str = "#version 460\n#extension GL_EXT_ray_tracing : require\n\
    struct Payload { vec3 colour; float t; };\n\
    layout(set = 0, binding = 0) uniform accelerationStructureEXT world;\n\
    layout(set = 0, binding = 1, rgba8) uniform image2D picture;\n\
    layout(location = 0) rayPayloadEXT Payload payload;\n\
    void main() {\n    payload.colour = vec3(0.25);\n    payload.t = 0.0;\n\
    \x20   traceRayEXT(world, 0, 0xFF, 0, 0, 0, vec3(0, 0, 3), 0.0, vec3(0, 0, -1), 9.0, 0);\n\
    \x20   imageStore(picture, ivec2(gl_LaunchIDEXT.xy), vec4(payload.colour, 1.0));\n}\n";

#[test]
#[cfg_attr(not(feature = "glsl"), ignore = "needs the feature `glsl`")]
fn what_ray_generation_set_before_it_traced_is_its_own() {
    let scene = "version = 1\nlaunch = [2, 1]\n[shaders]\ngen = 'main.rgen'\nsky = 'sky.rmiss'\n\
        [pipeline]\nraygen = 'gen'\nmiss = ['sky']\n\
        [geometry.t]\ntype = 'triangles'\nvertices = [[5, 5, 0], [6, 5, 0], [5, 6, 0]]\n[[instance]]\ngeometry = 't'\n\
        [resources.world]\ntype = 'acceleration_structure'\nbinding = 0\n\
        [resources.picture]\ntype = 'storage_image'\nformat = 'rgba8'\nbinding = 1\noutput = true\n\
        [[ray]]\nname = 'first'\npixel = [1, 0]\nexpect = { payload = { colour = [1, 1, 1] } }\n\
        [[expect.image]]\nname = 'picture'\nfile = 'white.png'\nbecause = 'all is white'\n";
    let sky = [HEAD, SKY].concat();
    let folder = scratch("raygen");
    let white = anyhit_scene::image::Rgba8 { extent: [2, 1], pixels: vec![255; 8] };
    std::fs::write(folder.join("white.png"), white.encode_png().expect("a picture"))
        .expect("a writable folder");
    for (file, text) in [("main.rgen", RAYGEN), ("sky.rmiss", &sky), ("scene.toml", scene)] {
        std::fs::write(folder.join(file), text).expect("a writable folder");
    }
    let mut command = Command::new(env!("CARGO_BIN_EXE_anyhit"));
    command.args(["test", ".", "--pictures", "pictures"]).current_dir(&folder).stdin(Stdio::null());
    let output = command.output().expect("the command starts");
    let text = String::from_utf8(output.stdout).expect("UTF-8");
    holds(
        &text,
        &[
            "last written at main.rgen:8: payload.colour = vec3(0.25);",
            // The whole picture, by its worst texel.
            "2 of 2 texels differ",
            "last written at main.rgen:11: imageStore(picture,",
            "--pixel 0,0\n",
        ],
    );
}

#[test]
#[cfg_attr(not(feature = "glsl"), ignore = "needs the feature `glsl`")]
fn of_two_shaders_each_builtin_is_compared_with_its_namesake() {
    // One shader more reads a builtin, which stands before the others.
    let plain = PAINT.replace("payload.colour.z = 0.0;", "payload.colour.z = gl_WorldRayOriginEXT.z;");
    let other =
        plain.replace("payload.t =", "if (gl_HitKindEXT == 0x7u) payload.colour.x = 9.0;\n    payload.t =");
    let scene = |file: &str| {
        format!(
            "version = 1\n[shaders]\npaint = {{ source = '{file}', compiler_flags = ['-g'] }}\n\
             [pipeline]\nhit = [{{ closest_hit = 'paint' }}]\n\
             [geometry.t]\ntype = 'triangles'\nvertices = [[-1, -1, 0], [1, -1, 0], [0, 1, 0]]\n\
             [[instance]]\ngeometry = 't'\n[[ray]]\nname = 'a'\norigin = [0, 0, 3]\ndirection = [0, 0, -1]\n"
        )
    };
    let shaders = [plain, other].map(|text| [HEAD, &text].concat());
    let scenes = ["a.rchit", "b.rchit"].map(scene);
    let files = [
        ("a.rchit", shaders[0].as_str()),
        ("b.rchit", &shaders[1]),
        ("a.toml", &scenes[0]),
        ("b.toml", &scenes[1]),
    ];
    for scenes in [["a.toml", "b.toml"], ["b.toml", "a.toml"]] {
        let arguments = ["trace-one-ray", scenes[0], "--compare", scenes[1]];
        let (code, text) = anyhit("compared", &files, &arguments);
        assert_eq!(code, Some(0), "{text}");
        assert!(!text.contains("HitKindKHR") && !text.contains("uint 254"), "{text}");
    }
}

#[test]
fn the_trap_names_the_sampler_that_a_shared_binding_lacks() {
    let shader = "@group(0) @binding(0) var picture: texture_2d<f32>;\n\
        @group(0) @binding(2) var filtering: sampler;\n\
        @group(0) @binding(1) var<storage, read_write> result: vec4f;\n\
        @compute @workgroup_size(1) fn main() { result = textureSampleLevel(picture, filtering, vec2f(0.5), 0.0); }\n";
    let scene = |extra: &str| {
        format!(
            "version = 1\n[shaders]\na = 'a.wgsl'\n[[dispatch]]\nshader = 'a'\n\
             [resources.picture]\ntype = 'sampled_image'\nbinding = 0\nsize = [1, 1]\nformat = 'rgba32f'\nfill = [1, 2, 3, 4]\n\
             [resources.result]\ntype = 'storage_buffer'\nbinding = 1\nsize = 16\n{extra}"
        )
    };
    let files = [("a.wgsl", shader), ("scene.toml", &scene(""))];
    let (code, text) = anyhit("sampler", &files, &["run", "scene.toml"]);
    assert_eq!(code, Some(3), "{text}");
    holds(
        &text,
        &[
            "no descriptor of this kind is bound here",
            "`filtering` (set 0, binding 2, element 0), a sampler",
            "not bound: `filtering` (set 0, binding 2, sampler)",
        ],
    );
}

#[test]
#[cfg_attr(not(feature = "glsl"), ignore = "needs the feature `glsl`")]
fn of_a_shared_binding_the_variable_is_named_whose_kind_is_missing() {
    let scene = |kind: &str| {
        format!(
            "version = 1\n[shaders]\na = 'a.comp'\n[[dispatch]]\nshader = 'a'\n\
             [resources.given]\nbinding = 0\n{kind}\n\
             [resources.result]\ntype = 'storage_buffer'\nbinding = 1\nsize = 16\n"
        )
    };
    const IMAGE: &str = "type = 'sampled_image'\nsize = [1, 1]\nformat = 'rgba32f'\nfill = [1, 2, 3, 4]";
    const SAMPLER: &str = "type = 'sampler'\nsampler = { filter = 'nearest' }";
    const BUFFER: &str = "type = 'storage_buffer'\nsize = 16";
    let head = |declared: &str, body: &str| {
        format!(
            "#version 460\n#extension GL_EXT_ray_query : require\n#extension GL_EXT_nonuniform_qualifier : require\n\
             #extension GL_EXT_samplerless_texture_functions : require\n\
             layout(local_size_x = 1) in;\n{declared}\n\
             layout(set = 0, binding = 1) buffer Result {{ vec4 result; }};\nvoid main() {{ {body} }}\n"
        )
    };
    let separate = head(
        "layout(set = 0, binding = 0) uniform texture2D picture;\nlayout(set = 0, binding = 0) uniform sampler filtering;",
        "result = textureLod(sampler2D(picture, filtering), vec2(0.5), 0.0);",
    );
    let buffer = head(
        "layout(set = 0, binding = 0) uniform texture2D picture;\nlayout(set = 0, binding = 0) buffer Given { vec4 given; };",
        "result = texelFetch(picture, ivec2(0), 0) + given;",
    );
    let structure = head(
        "layout(set = 0, binding = 0) uniform accelerationStructureEXT world;\nlayout(set = 0, binding = 0) buffer Given { vec4 given; };",
        "rayQueryEXT q; rayQueryInitializeEXT(q, world, 0, 255, vec3(0), 0.0, vec3(1), 1.0); result = given;",
    );
    let array = head(
        "layout(set = 0, binding = 0) uniform texture2D pictures[];\nlayout(set = 0, binding = 0) uniform sampler filtering[];",
        "result = textureLod(sampler2D(pictures[0], filtering[0]), vec2(0.5), 0.0);",
    );
    let cases = [
        ("image-alone", &separate, IMAGE, "`filtering`", "sampler"),
        ("sampler-alone", &separate, SAMPLER, "`picture`", "sampled_image"),
        ("buffer-alone", &buffer, BUFFER, "`picture`", "sampled_image"),
        ("structure-missing", &structure, BUFFER, "`world`", "acceleration_structure"),
        ("array", &array, IMAGE, "`filtering`", "sampler"),
    ];
    for (name, shader, kind, variable, ty) in cases {
        let scene = scene(kind);
        let files = [("a.comp", shader.as_str()), ("scene.toml", &scene)];
        let (code, text) = anyhit(name, &files, &["run", "scene.toml"]);
        assert_eq!(code, Some(3), "{name}: {text}");
        let missing = format!("{variable} (set 0, binding 0, {ty})");
        holds(
            &text,
            &[
                &format!("the scene binds nothing to {missing}"),
                &format!("not bound: {missing}"),
                &format!("= {variable} (set 0, binding 0, element 0)"),
            ],
        );
        // What is asked for is found where nothing need be bound.
        let zeros = scene.replace("[resources.given]", "[pipeline]\nunbound = 'zeros'\n[resources.given]");
        let files = [("a.comp", shader.as_str()), ("scene.toml", &zeros)];
        let (code, text) = anyhit(name, &files, &["run", "scene.toml"]);
        assert_eq!(code, Some(0), "{name}: {text}");
    }
}

#[test]
fn assertions_of_rust_show_the_lines_that_decided() -> anyhit::Result<()> {
    use anyhit::{Explain, LoadedScene, Ray};
    let loaded = LoadedScene::open("shaders/pass/testing/leaves/scene.toml")?;
    let (pipeline, scene) = loaded.pipeline()?;
    // Primitive 0 is a hole, at z = 1; behind it is a leaf.
    let text = pipeline.trace(&scene, Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -1.0]))?.explain();
    holds(
        &text,
        &[
            "executed lines",
            "shaders/pass/testing/leaves/hole.rahit",
            "if (gl_PrimitiveID == 0) {",
            "ignoreIntersectionEXT;",
        ],
    );
    // Up to the hole alone, at t 3.
    let ray = Ray { t_max: 3.5, ..Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -1.0]) };
    let text = pipeline.trace(&scene, ray)?.explain();
    holds(&text, &["hint  ray at depth 1: it misses because any-hit shaders ignored its 1 candidate"]);
    Ok(())
}

#[test]
#[cfg_attr(not(feature = "glsl"), ignore = "needs the feature `glsl`")]
fn a_record_is_shown_as_the_shader_declares_it() {
    // std430: elements of 8 bytes follow each other. Given are elements of 16, as std140 has them.
    let shader = [
        HEAD,
        "layout(shaderRecordEXT, std430) buffer Record { vec2 values[2]; };\n\
         void main() { payload.colour.xy = values[1]; }\n",
    ]
    .concat();
    let scene = "version = 1\n[shaders]\npaint = 'a.rchit'\n\
        [pipeline]\nhit = [{ closest_hit = 'paint', record = { f32 = [1, 2, 0, 0, 3, 4, 0, 0] } }]\n\
        [geometry.t]\ntype = 'triangles'\nvertices = [[-1, -1, 0], [1, -1, 0], [0, 1, 0]]\n\
        [[instance]]\ngeometry = 't'\n[[ray]]\nname = 'a'\norigin = [0, 0, 3]\ndirection = [0, 0, -1]\n\
        expect = { payload = { colour = [3, 4, 0] } }\n";
    let text = failure("record", &[("a.rchit", &shader), ("a.test.toml", scene)]);
    for row in [
        ["record values[0], byte 0", "vec2(1, 2)"],
        ["record values[1], byte 8", "vec2(0, 0)"],
        ["record from byte 16 on", "not declared; as floats 3, 4, 0, 0"],
    ] {
        let line = text.lines().find(|line| line.contains(row[0]));
        assert!(line.is_some_and(|line| line.ends_with(row[1])), "{row:?} in\n{text}");
    }
}

#[test]
fn the_command_names_the_variant() {
    let shader = |value: u32| {
        format!(
            "@group(0) @binding(0) var<storage, read_write> out: array<u32>;\n\
             @compute @workgroup_size(1) fn main() {{ out[0] = {value}u; }}\n"
        )
    };
    let scene =
        dispatch("size = 4", "u32 = [1]") + "[[variant]]\nname = 'far away'\nshaders = { a = 'b.wgsl' }\n";
    let (one, two) = (shader(1), shader(2));
    let text = failure("variant", &[("a.wgsl", &one), ("b.wgsl", &two), ("scene.toml", &scene)]);
    // The scene itself passes.
    holds(&text, &["--invocation 0,0,0 --variant \"far away\"\n", "1 passed, 1 failed"]);
}
