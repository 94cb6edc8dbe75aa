//! What the sanitizer counts as output, as one finding, and as independent of synthetic inputs.

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use crate::support::assembly::assemble;

/// Runs the program; returns the exit code and both outputs.
fn run(arguments: &[&str]) -> (Option<i32>, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_anyhit"));
    command.args(arguments).current_dir(env!("CARGO_MANIFEST_DIR"));
    let output = command.output().expect("the program");
    let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
    (output.status.code(), text(output.stdout) + &text(output.stderr))
}

/// An empty folder for a test.
fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder");
    folder
}

/// A closest-hit shader that writes the normal of its payload, and behind it more.
fn closest_hit(more: &str) -> String {
    format!(
        "OpCapability RayTracingKHR
         OpExtension \"SPV_KHR_ray_tracing\"
         OpMemoryModel Logical GLSL450
         OpEntryPoint ClosestHitKHR %main \"main\" %p
         OpName %p \"p\"
         OpName %k \"k\"
         OpName %payload \"Payload\"
         OpMemberName %payload 0 \"normal\"
         OpMemberName %payload 1 \"t\"
         %void = OpTypeVoid
         %main_type = OpTypeFunction %void
         %float = OpTypeFloat 32
         %int = OpTypeInt 32 1
         %vec3 = OpTypeVector %float 3
         %payload = OpTypeStruct %vec3 %float
         %ptr_payload = OpTypePointer IncomingRayPayloadKHR %payload
         %ptr_vec3 = OpTypePointer IncomingRayPayloadKHR %vec3
         %ptr_float = OpTypePointer IncomingRayPayloadKHR %float
         %ptr_local = OpTypePointer Function %float
         %p = OpVariable %ptr_payload IncomingRayPayloadKHR
         %i0 = OpConstant %int 0
         %i1 = OpConstant %int 1
         %zero = OpConstant %float 0.0
         %one = OpConstant %float 1.0
         %up = OpConstantComposite %vec3 %zero %one %zero
         %main = OpFunction %void None %main_type
         %entry = OpLabel
         %k = OpVariable %ptr_local Function
         %normal = OpAccessChain %ptr_vec3 %p %i0
         OpStore %normal %up
         %t = OpAccessChain %ptr_float %p %i1
         {more}
         OpReturn
         OpFunctionEnd"
    )
}

const RAY: &str = "version = 1
[shaders]
surface = \"surface.spv\"
[pipeline]
hit = [{ closest_hit = \"surface\" }]
[geometry.triangle]
type = \"triangles\"
vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
[[instance]]
geometry = \"triangle\"
[[ray]]
name = \"down\"
origin = [0.25, 0.5, 4]
direction = [0, 0, -1]
expect = { t = 4, payload = { normal = [0, 1, 0] } }
";

/// What a `[[ray]]` leaves in its payload is read by the test: an undefined member is denied, as it
/// is where a ray generation shader writes it to a buffer, though the test expects nothing of it.
#[test]
fn an_undefined_member_of_a_rays_payload_is_denied() {
    let folder = folder("sanitized-payload");
    let scene = folder.join("scene.toml");
    std::fs::write(&scene, RAY).expect("written");
    let test = |more: &str| {
        std::fs::write(folder.join("surface.spv"), assemble(&closest_hit(more))).expect("written");
        run(&["test", scene.to_str().expect("UTF-8"), "--sanitize"])
    };
    let (code, text) = test(
        "%undefined = OpLoad %float %k
         OpStore %t %undefined",
    );
    assert_eq!(code, Some(6), "{text}");
    assert!(
        text.contains("error[uninit-function]: `k` was never written, and is left in the payload"),
        "{text}"
    );
    // A NaN is a lint wherever it ends up.
    let (code, text) = test(
        "%ratio = OpFDiv %float %zero %zero
         OpStore %t %ratio",
    );
    assert!(text.contains("a NaN, made by 0.0 / 0.0, is left in the payload of the ray"), "{code:?} {text}");
    let fixed = [
        "OpStore %t %one",
        // What is undefined and then written is defined.
        "%undefined = OpLoad %float %k
         OpStore %t %undefined
         OpStore %t %one",
        // The test gives the payload its values: what nobody else writes is defined.
        "",
    ];
    for more in fixed {
        let (code, text) = test(more);
        assert_eq!((code, text.contains("error[")), (Some(0), false), "{text}");
    }
}

/// A module that two shaders of a scene are is one place.
#[test]
fn a_shader_that_a_scene_names_twice_has_each_finding_once() {
    const MODULE: &str = "spirv-fixtures/sanitize/int-div-zero/broken.slang.spv";
    let folder = folder("sanitized-twice");
    let module = Path::new(env!("CARGO_MANIFEST_DIR")).join(MODULE);
    std::fs::copy(module, folder.join("one.spv")).expect("copied");
    std::fs::copy(folder.join("one.spv"), folder.join("same.spv")).expect("copied");
    let findings = |shaders: &[&str]| {
        let dispatches =
            shaders.iter().map(|name| format!("[[dispatch]]\nshader = \"{name}:mean_colors\"\n"));
        let text = format!(
            "version = 1\n[shaders]\none = \"one.spv\"\nsame = \"same.spv\"\n{}\
             [resources.palette]\ntype = \"storage_buffer\"\nbinding = 1\nsize = 16\n\
             [resources.clusters]\ntype = \"storage_buffer\"\nbinding = 2\n\
             data = {{ u32 = [[800, 400, 0, 8], [0, 0, 0, 0], [255, 255, 255, 1], [90, 60, 30, 3]] }}\n",
            dispatches.collect::<String>()
        );
        let scene = folder.join("scene.toml");
        std::fs::write(&scene, text).expect("written");
        let (_, text) = run(&["run", scene.to_str().expect("UTF-8"), "--sanitize", "--findings", "json"]);
        // The list stands first; what is printed for people follows.
        let list = &text[text.find('[').unwrap_or(0)..];
        let findings = serde_json::Deserializer::from_str(list).into_iter::<Value>().next();
        let findings = findings.and_then(Result::ok).unwrap_or_else(|| panic!("no JSON: {text}"));
        findings.as_array().expect("a list").iter().map(|one| one["count"].as_u64()).collect::<Vec<_>>()
    };
    let once = findings(&["one"]);
    let twice = findings(&["one", "same"]);
    assert!(!once.is_empty());
    assert_eq!(twice, once.iter().map(|count| count.map(|count| 2 * count)).collect::<Vec<_>>());
}

/// What is found on all sets of values depends on none of them. The division by zero depends on
/// what the buffer holds.
#[test]
fn smoke_denies_what_depends_on_no_synthetic_input() {
    let smoke = |rule: &str, file: &str| {
        run(&["smoke", &format!("spirv-fixtures/sanitize/{rule}/{file}"), "--sanitize"])
    };
    let (code, text) = smoke("race-workgroup", "broken.comp.spv");
    assert!(code == Some(6) && text.contains("error[race-workgroup]: "), "{code:?} {text}");
    let (code, text) = smoke("race-workgroup", "mended.comp.spv");
    assert!(code == Some(0) && !text.contains("race-"), "{code:?} {text}");
    let (code, text) = smoke("int-div-zero", "broken.slang.spv");
    assert!(code != Some(6) && text.contains("warning[int-div-zero]: "), "{code:?} {text}");
    assert!(text.contains("on synthetic inputs"), "{text}");
}
