//! `anyhit scene --init`: pointers lead to buffers, and records are those that rays ask for.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

fn scratch(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("scene-init").join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a writable folder");
    folder
}

/// Runs the command in a folder; returns its exit code and what it printed.
fn anyhit(folder: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_anyhit"));
    let output = command.args(arguments).current_dir(folder).stdin(Stdio::null()).output();
    let output = output.expect("the command starts");
    let text = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).expect("UTF-8")).concat();
    (output.status.code(), text)
}

/// Writes a scene of fixtures; returns it with what was printed.
fn written(folder: &Path, modules: &[&str]) -> (String, String) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("spirv-fixtures");
    let modules: Vec<String> = modules.iter().map(|name| root.join(name).display().to_string()).collect();
    let mut arguments = vec!["scene", "--init"];
    arguments.extend(modules.iter().map(String::as_str));
    let (code, text) = anyhit(folder, &arguments);
    assert_eq!(code, Some(0), "{text}");
    (std::fs::read_to_string(folder.join("scene.toml")).expect("the scene"), text)
}

#[track_caller]
fn holds(scene: &str, all: &[&str]) {
    for words in all {
        assert!(scene.contains(words), "no `{words}` in\n{scene}");
    }
}

#[test]
fn pointers_lead_to_buffers_and_circles_are_closed() {
    let folder = scratch("slang");
    let (scene, text) = written(&folder, &["pass/addresses/nested/nested.slang.spv"]);
    assert!(text.contains("run it: anyhit run scene.toml"), "{text}");
    holds(
        &scene,
        &[
            "# The push constants:\n#    0  pointer to",
            "push_constants = { shader = \"shaders\", value = { sceneInfo = { address_of = \"sceneInfo\" } }, \
             rest = \"zeros\" }",
            "record = { shader = \"shaders\", value = { material = { address_of = \"material\" } }, rest = \"zeros\" }",
            // A scene points to itself, and a material to the next one: circles of one.
            "value = { instances = { address_of = \"instances\" }, self = { address_of = \"sceneInfo\" } }",
            "value = { material = { address_of = \"material\" } }, rest = \"zeros\", repeat = 16 }",
            "value = { next = { address_of = \"material\" } }, rest = \"zeros\", repeat = 16 }",
            "[resources.material]\n#    0  vec3 colour\n#   12  float roughness",
            "# Rays are traced with SBT offset 0, SBT stride 0, miss index 0.",
        ],
    );
    assert_eq!(scene.matches("type = \"buffer\"").count(), 3, "{scene}");
    let (code, text) = anyhit(&folder, &["run", "scene.toml", "--dump", "material=hex"]);
    assert_eq!(code, Some(0), "{text}");
    // 16 materials of 32 bytes.
    assert!(text.contains("512 bytes"), "{text}");
}

#[cfg(feature = "wgsl")]
#[test]
fn compute_shaders_that_declare_other_types_at_a_binding_run() {
    let folder = scratch("other-types");
    let declared = |variable: &str, value: &str| {
        format!(
            "@group(0) @binding(0) var<storage, read_write> o: array<f32>;
            @group(0) @binding(1) var {variable};
            @compute @workgroup_size(1) fn main() {{ o[0] = {value}; }}"
        )
    };
    let files = [
        ("a.wgsl", declared("<storage, read> a: array<f32>", "a[0]")),
        ("b.wgsl", declared("b: texture_2d<f32>", "textureLoad(b, vec2(0), 0).x")),
        // A buffer that is larger than that of the first.
        ("c.wgsl", declared("<storage, read> c: array<vec4f, 5000>", "c[4999].x")),
        ("d.wgsl", declared("d: texture_3d<f32>", "textureLoad(d, vec3(0), 0).x")),
        ("e.wgsl", declared("<uniform> e: vec4f", "e.x")),
    ];
    for (name, text) in &files {
        std::fs::write(folder.join(name), text).expect("a file");
    }
    let (code, text) =
        anyhit(&folder, &["scene", "--init", "a.wgsl", "b.wgsl", "c.wgsl", "d.wgsl", "e.wgsl"]);
    assert!(code == Some(0) && !text.contains("does not run yet"), "{text}");
    let scene = std::fs::read_to_string(folder.join("scene.toml")).expect("the scene");
    // The images have one type; the others are told apart by theirs.
    holds(
        &scene,
        &["type = \"sampled_image\"", "dimension = \"3d\"", "passes = [3]", "type = \"uniform_buffer\""],
    );
    assert_eq!((scene.matches("passes = ").count(), scene.matches("binding = 1").count()), (1, 4), "{scene}");
    let (code, text) = anyhit(&folder, &["run", "scene.toml"]);
    assert_eq!(code, Some(0), "{text}");
}

#[test]
fn blocks_of_several_modules_share_their_buffers() {
    let folder = scratch("glsl");
    let modules = ["main.rgen", "main.rchit", "main.rmiss"];
    let modules = modules.map(|name| format!("pass/addresses/nested-glsl/{name}.spv"));
    let (scene, text) = written(&folder, &modules.each_ref().map(String::as_str));
    assert!(!text.contains("does not run yet"), "{text}\n{scene}");
    assert_eq!(scene.matches("type = \"buffer\"").count(), 3, "{scene}");
    // The block behind `instances` ends in an array of structs.
    holds(
        &scene,
        &["[resources.instances]", "value = { items = [{ material = { address_of = \"material\" } }, "],
    );
}

#[test]
fn records_are_those_that_rays_ask_for() {
    // The shadow ray has miss index 1 and no hit group of its own.
    let (scene, _) = written(&scratch("shadow"), &["demo/swept-spheres/swept_spheres.slang.spv"]);
    holds(&scene, &["SBT offset 0, SBT stride 0, miss index 0 and 1."]);
    // Rays with offset 1 and miss index 1 alone come to the second record of each table.
    let modules = ["slang/main.slang", "payload.rchit", "payload.rmiss"]
        .map(|name| format!("pass/hit-object/{name}.spv"));
    let modules = modules.each_ref().map(String::as_str);
    let (scene, _) = written(&scratch("offset"), &modules);
    holds(
        &scene,
        &[
            "# Rays are traced with SBT offset 1, SBT stride 1, miss index 1.",
            "miss = [{}, { shader = \"miss\", record = { zeros = 4 } }]",
            "hit = [\n    {},\n    { closest_hit = \"closest_hit\", record = { zeros = 4 } },\n]",
        ],
    );
    // What a buffer or a push constant says is not known.
    let modules = ["main.rgen", "main.rchit", "main.rmiss"];
    let modules = modules.map(|name| format!("pass/resources/record-and-push-constants/{name}.spv"));
    let (scene, _) = written(&scratch("unknown"), &modules.each_ref().map(String::as_str));
    holds(&scene, &["SBT offset and miss index of rays in `raygen` are not constants", "SBT stride 1"]);
}

#[cfg(unix)]
#[test]
fn a_printed_command_runs_in_a_shell() {
    let folder = scratch("it's a \"folder\", $HOME");
    let module =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("spirv-fixtures/pass/addresses/nested/nested.slang.spv");
    let path = folder.join("a scene.toml").display().to_string();
    let (code, text) = anyhit(&folder, &["scene", "--init", &module.display().to_string(), "-o", &path]);
    assert_eq!(code, Some(0), "{text}");
    let line = text.split_once("run it: ").expect("a command").1;
    let program = Path::new(env!("CARGO_BIN_EXE_anyhit")).parent().expect("a folder");
    let output = Command::new("/bin/sh").args(["-c", line]).env("PATH", program).current_dir("/").output();
    let output = output.expect("a shell");
    assert!(output.status.success(), "{line}{}", String::from_utf8_lossy(&output.stderr));
}

/// A function that traces, as glslang and Slang hand operands to it: the offset in a variable of
/// the caller, the miss index as a value.
const CALLS: &str = r#"
    OpCapability RayTracingKHR
    OpExtension "SPV_KHR_ray_tracing"
    OpMemoryModel Logical GLSL450
    OpEntryPoint RayGenerationKHR %main "main" %scene %payload
    OpName %scene "scene"
    OpDecorate %scene DescriptorSet 0
    OpDecorate %scene Binding 0
    OpDecorate %miss1 SpecId 0
    %void = OpTypeVoid
    %uint = OpTypeInt 32 0
    %float = OpTypeFloat 32
    %v3 = OpTypeVector %float 3
    %structure = OpTypeAccelerationStructureKHR
    %scenePointer = OpTypePointer UniformConstant %structure
    %scene = OpVariable %scenePointer UniformConstant
    %v4 = OpTypeVector %float 4
    %payloadPointer = OpTypePointer RayPayloadKHR %v4
    %payload = OpVariable %payloadPointer RayPayloadKHR
    %local = OpTypePointer Function %uint
    %zero = OpConstant %uint 0
    %two = OpConstant %uint 2
    %mask = OpConstant %uint 255
    %miss1 = OpSpecConstant %uint 1
    %f0 = OpConstant %float 0
    %f1 = OpConstant %float 1
    %origin = OpConstantComposite %v3 %f0 %f0 %f0
    %direction = OpConstantComposite %v3 %f0 %f0 %f1
    %start = OpTypeFunction %void
    %traces = OpTypeFunction %void %local %uint
    %main = OpFunction %void None %start
    %begin = OpLabel
    %first = OpVariable %local Function
    %second = OpVariable %local Function
    OpStore %first %zero
    %a = OpFunctionCall %void %trace %first %zero
    OpStore %second %two
    %b = OpFunctionCall %void %trace %second %miss1
    OpReturn
    OpFunctionEnd
    %trace = OpFunction %void None %traces
    %offset = OpFunctionParameter %local
    %miss = OpFunctionParameter %uint
    %body = OpLabel
    %tlas = OpLoad %structure %scene
    %value = OpLoad %uint %offset
    OpTraceRayKHR %tlas %zero %mask %value %two %miss %origin %f0 %direction %f1 %payload
    OpReturn
    OpFunctionEnd
"#;

#[test]
fn operands_are_followed_through_calls() {
    let folder = scratch("calls");
    std::fs::write(folder.join("calls.spv"), crate::support::assembly::assemble(CALLS)).expect("a module");
    let module = folder.join("calls.spv").display().to_string();
    let (scene, text) = written(&folder, &[&module, "pass/hit-object/payload.rmiss.spv"]);
    holds(&scene, &["# Rays are traced with SBT offset 0 and 2, SBT stride 2, miss index 0 and 1."]);
    // Two miss records for one shader, of which the second one is null.
    holds(&scene, &["miss = [{ shader = \"miss\", record = { zeros = 4 } }, {}]"]);
    assert!(!text.contains("does not run yet"), "{text}\n{scene}");
}

/// What `--init` says of GLSL sources, by their names.
#[cfg(feature = "glsl")]
fn of_sources(name: &str, sources: &[(&str, &str)], command: &[&str]) -> (Option<i32>, String) {
    let folder = scratch(name);
    for (file, text) in sources {
        let text = format!("#version 460\n#extension GL_EXT_ray_tracing : require\n{text}");
        std::fs::write(folder.join(file), text).expect("a writable folder");
    }
    let mut arguments: Vec<&str> = command.to_vec();
    arguments.extend(sources.iter().map(|(file, _)| *file));
    if command[0] == "test" {
        arguments.push("case");
    }
    let (code, mut text) = anyhit(&folder, &arguments);
    text += &std::fs::read_to_string(folder.join("scene.toml")).unwrap_or_default();
    (code, text)
}

#[cfg(feature = "glsl")]
#[test]
fn shaders_that_do_not_fit_are_refused_with_both_types() {
    const CHIT: &str = "struct Payload { vec3 colour; float t; };\nlayout(location = 0) rayPayloadInEXT Payload payload;\n\
        hitAttributeEXT vec2 at;\nvoid main() { payload.colour = vec3(at, 0); }\n";
    const SHADOW: &str = "struct Shadow { uint light; };\nlayout(location = 0) rayPayloadInEXT Shadow shadow;\n\
        void main() { shadow.light = 1u; }\n";
    const WIDE: &str = "struct Payload { vec3 colour; float t; };\nlayout(location = 0) rayPayloadInEXT Payload payload;\n\
        hitAttributeEXT vec3 at;\nvoid main() { payload.colour = at; }\n";
    const RINT: &str =
        "hitAttributeEXT uvec2 cell;\nvoid main() { cell = uvec2(1); reportIntersectionEXT(1.0, 0u); }\n";
    const RGEN: &str = "struct Payload { vec3 colour; float t; };\nlayout(location = 0) rayPayloadEXT Payload payload;\n\
        layout(set = 0, binding = 0) uniform accelerationStructureEXT world;\n\
        struct Data { vec4 all; };\nlayout(location = 0) callableDataEXT Data data;\n\
        void main() { traceRayEXT(world, 0, 255, 0, 0, 0, vec3(0), 0.0, vec3(1), 9.0, 0); executeCallableEXT(0, 0); }\n";
    const CALL: &str = "struct Other { int n; };\nlayout(location = 0) callableDataInEXT Other data;\nvoid main() { data.n = 1; }\n";
    for command in [&["scene", "--init"][..], &["test", "--init"]] {
        let refused = |name: &str, sources: &[(&str, &str)], words: &[&str]| {
            let (code, text) = of_sources(&format!("{name}-{}", command[0]), sources, command);
            assert_eq!(code, Some(2), "{text}");
            holds(&text, words);
        };
        let payloads = ["Payload { vec3 colour, float t }", "Shadow { uint light }", "payload differ"];
        refused("any-hit", &[("a.rchit", CHIT), ("b.rahit", SHADOW)], &payloads);
        refused(
            "attributes",
            &[("a.rchit", CHIT), ("b.rint", RINT)],
            &["hit attributes differ", ": vec2", ": uvec2"],
        );
        refused("wide", &[("a.rchit", WIDE)], &["reports its hit attributes", ": vec3"]);
        refused("miss", &[("a.rgen", RGEN), ("b.rmiss", SHADOW)], &payloads);
        refused(
            "callable",
            &[("a.rgen", RGEN), ("b.rcall", CALL)],
            &["callable data differ", "Other { int n }", "Data { vec4 all }"],
        );
    }
    // Any-hit shaders go to the hit group that they fit, whatever the order, and those of rays of
    // another kind have groups of their own.
    let any = CHIT.replace("hitAttributeEXT vec2 at;", "").replace("vec3(at, 0)", "vec3(1)");
    let plain = CHIT.replace("vec3(at, 0)", "vec3(at, 1)");
    let sources = [("a.rahit", SHADOW), ("b.rahit", any.as_str()), ("a.rchit", &plain), ("a.rmiss", SHADOW)];
    let (code, text) = of_sources("pairs", &sources, &["scene", "--init"]);
    assert_eq!(code, Some(0), "{text}");
    holds(
        &text,
        &["{ closest_hit = \"closest_hit\", any_hit = \"any_hit_2\" }", "{ any_hit = \"any_hit\" }"],
    );
}
