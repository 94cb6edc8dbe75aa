//! `anyhit trace-one-ray --interactive`: scripts of commands and what they are answered.
//!
//! `tests/debugger/scripts/*.stdin` hold the commands; `*.stdout` the transcripts, which
//! `BLESS=1 cargo test` writes anew: they guard the form. The facts in them are derived by hand
//! from the scenes and stand in the tests here.

use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};

use anyhit::{ComputeTest, Hit, Module, Ray, ShaderTest};
use pretty_assertions::assert_eq;

/// The transcript of a script, compared with the one that is kept.
pub(crate) fn transcript(name: &str) -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let script = root.join(format!("tests/debugger/scripts/{name}.stdin"));
    let script = std::fs::read_to_string(script).expect("the script is there");
    let (arguments, commands) = script.split_once('\n').expect("a line of arguments");
    let arguments = arguments.strip_prefix("# trace-one-ray ").expect("the arguments");
    let (text, errors) = run(&words(arguments), commands);
    assert_eq!(errors, "", "{name}");
    let kept = root.join(format!("tests/debugger/scripts/{name}.stdout"));
    if std::env::var_os("BLESS").is_some() {
        std::fs::write(&kept, &text).expect("the folder is there");
    }
    let expected = std::fs::read_to_string(&kept).unwrap_or_default();
    assert_eq!(text, expected, "{name}: `BLESS=1 cargo test` if the new form is meant");
    text
}

/// What the program answers to commands, and its errors.
pub(crate) fn run(arguments: &[String], commands: &str) -> (String, String) {
    let mut child = Command::new(env!("CARGO_BIN_EXE_anyhit"))
        .arg("trace-one-ray")
        .arg("--interactive")
        .args(arguments)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the binary of this crate starts");
    // A session that has ended reads no more.
    let _ = child.stdin.take().expect("a pipe").write_all(commands.as_bytes());
    let output = child.wait_with_output().expect("the program ends");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("UTF-8");
    (text(output.stdout), text(output.stderr))
}

/// The words of a command line, of which some are quoted.
pub(crate) fn words(text: &str) -> Vec<String> {
    let parts = text.split('"').enumerate();
    let words = parts.flat_map(|(number, part)| match number % 2 {
        1 => vec![part.to_owned()],
        _ => part.split_whitespace().map(str::to_owned).collect(),
    });
    words.collect()
}

/// Checks that texts stand in a transcript, in this order.
#[track_caller]
pub(crate) fn tells(transcript: &str, facts: &[&str]) {
    let mut rest = transcript;
    for fact in facts {
        let at =
            rest.find(fact).unwrap_or_else(|| panic!("`{fact}` is not told after the facts before:\n{rest}"));
        rest = &rest[at + fact.len()..];
    }
}

/// The ray meets the first hair at t = 5 - 2 - 1/2, which is cut, and the second at 5 - 1/2, a
/// quarter of the way from (-1, 0, 0) to (3, 0, 0): its axis is at the origin there, and the normal
/// is (0, 0, 1). The colour is half of that, shifted by a half.
#[test]
fn from_ray_generation_into_any_hit_and_closest_hit_and_back_to_who_wrote() {
    tells(
        &transcript("hair"),
        &[
            "main at shaders/pass/debugger/hair/cut.rahit:9  AnyHitKHR `main`",
            "1 main at shaders/pass/debugger/hair/main.rgen:19  RayGenerationKHR `main`",
            "cut.rahit:11",
            "hair = int 0",
            "shade.rchit:22",
            "gl_HitLSSPositionsNV = vec3[2]((-1, 0, 0), (3, 0, 0))",
            "centre = vec3 <not yet written>\n",
            "centre = vec3(0, 0, 0)\n",
            "normal_at returned vec3(0, 0, 1)\n",
            "normal = vec3(0, 0, 1)",
            "dot(normal, gl_WorldRayDirectionEXT) = float -1",
            "payload = Payload { colour: vec3(0.5, 0.5, 1), t: float 4.5 }",
            // The third component of the colour is written by the closest-hit shader.
            "who payload.colour.b\n",
            "payload.colour.b = float 1\n",
            "shade.rchit:23",
            "who hit\n",
            // The argument of the call on line 22.
            "hit = vec3(0, 0, 0.5)\n",
            "shade.rchit:22",
            "rfinish\n",
            "main.rgen:19",
            "rnext\n",
            "main.rgen:18",
            // Before the trace it is ray generation's own zero.
            "who payload.colour\n",
            "payload.colour = vec3(0, 0, 0)\n",
            "main.rgen:17",
            "the start of the run",
        ],
    );
}

/// The ray of pixel 1,1 meets sphere 0 alone; the callable is asked to double its t of 3.875.
#[test]
fn slang_is_debugged_by_its_own_names() {
    tells(
        &transcript("slang"),
        &[
            "every_second at shaders/pass/slang/hit/hit.slang:83  AnyHitKHR `every_second`",
            "print payload.any_hits\npayload.any_hits = uint 1\n",
            "round at shaders/pass/slang/hit/hit.slang:58  ClosestHitKHR `round`",
            // The centre (-0.25, -0.25, 0), and 1/8 above it.
            "hit = vec3(-0.25, -0.25, 0.125)",
            // The any-hit shader counted, in the payload that it was given before.
            "who payload.any_hits\n",
            "every_second at shaders/pass/slang/hit/hit.slang:83",
            "twice at shaders/pass/slang/hit/hit.slang:117  CallableKHR `twice`",
            "question = Question { value: float 3.875, answer: float 0 }",
            // Slang keeps what it passes in variables of its own, and notes no value of the
            // source's.
            "up\n",
            "payload = <optimized out: the compiler records no value for it here>\n",
        ],
    );
}

/// Two boxes stand in the way of invocation 1's ray, which they are entered by at t = 5 - 3 and
/// 5 - 1; the loop over candidates is followed.
#[test]
fn a_ray_query_of_a_compute_shader_is_stepped_through() {
    tells(
        &transcript("query"),
        &[
            "GLCompute `main`",
            "ray query: begins: origin (1, 0, 5)",
            "primitive 0: candidate at t 2",
            "primitive 1: candidate at t 4",
            "entry = float 2",
            "box = int 0",
            "t = float 100",
            "entry = float 4",
            "box = int 1",
            "t = float 4",
        ],
    );
}

/// Without debug information the lines are instructions.
#[test]
fn a_module_without_debug_information_is_stepped_by_instruction() {
    tells(
        &transcript("bare"),
        &[
            "RayGenerationKHR `main`",
            "OpStore",
            "OpTraceRayKHR",
            "ClosestHitKHR `main`",
            "rcontinue\nbreakpoint 1\n",
            "OpTraceRayKHR",
        ],
    );
}

/// An index of 4, which is the launch index, into an array of 4 traps.
#[test]
fn a_trap_is_stopped_at_and_its_cause_found_backwards() {
    tells(
        &transcript("trap"),
        &[
            "trapped: ",
            "weighted at shaders/fail/memory/full-debug-info/main.rgen:14",
            "1 main at shaders/fail/memory/full-debug-info/main.rgen:20",
            "weight.index = int 4",
            "who weight.index\n",
            "main at shaders/fail/memory/full-debug-info/main.rgen:20",
            "gl_LaunchIDEXT.x = uint 4",
        ],
    );
}

/// With the hair's number set to 1 the any-hit shader keeps the first hair, at t = 2.5.
#[test]
fn a_variable_is_set_and_the_invocation_goes_another_way() {
    tells(
        &transcript("changed"),
        &[
            "payload.t was written: float <not yet written> -> float -1",
            "hair = int 1",
            "breakpoint 2: shaders/pass/debugger/hair/shade.rchit:24 if gl_HitTEXT == 2.5",
            "printed: the normal is (0, 0, 1), t 2.5",
            "breakpoint 2\n",
            "payload.t was written: float -1 -> float 2.5",
            "payload = Payload { colour: vec3(0.5, 0.5, 1), t: float 2.5 }",
            // Backwards, in the other order.
            "breakpoint 2\n",
            "payload.t was written: float <not yet written> -> float -1",
        ],
    );
}

/// The traversal of the ray, event by event.
#[test]
fn a_traversal_is_stepped_through() {
    tells(
        &transcript("traversal"),
        &[
            "1 of 5: ray at depth 1: origin (0, 0, 5), direction (0, 0, -1), t from 0 to 100",
            "primitive 0: candidate at t 2.5",
            "primitive 1: candidate at t 4.5",
            "instance 0: entered",
        ],
    );
}

/// A case's ray from z = 4 over x = 0 meets the hole at z = 1, t = 3, then the leaf at z = 0, t =
/// 4: the any-hit shader counts to 2, first at the hole.
#[test]
fn a_ray_of_a_test_file_is_debugged() {
    tells(
        &transcript("test-case"),
        &[
            "leaf.rchit:12  ClosestHitKHR `main`",
            "payload = Payload { colour: vec3(0, 0, 0), t: float 0, seen: uint 2 }\n",
            "who payload.seen\n",
            "payload.seen = uint 2\n",
            "hole.rahit:12  AnyHitKHR `main`",
            "gl_HitTEXT = float 4\n",
            "payload.seen = uint 1\n",
            "hole.rahit:12  AnyHitKHR `main`",
            "gl_HitTEXT = float 3\n",
        ],
    );
}

/// The ray's payload begins with a count of 5, to which the hole and the leaf add one each.
#[test]
fn a_test_begins_with_the_payload_that_it_gives() {
    let told = transcript("test-payload");
    tells(&told, &["AnyHitKHR", "payload.seen = uint 5\n", "ClosestHitKHR", "payload.seen = uint 7\n"]);
}

/// The ray down at the sphere of radius 1/2 meets it at t = 4 - 1/2, where the normal is (0, 0, 1).
/// Answers of traces are asked again on the way back.
#[test]
fn a_shader_test_is_debugged() -> anyhit::Result<()> {
    let sphere = Module::open("spirv-fixtures/pass/sphere/closest-hit/main.rchit.spv")?;
    let hit = Hit::sphere([0.0; 3], 0.5).ray(Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -1.0]));
    let test = ShaderTest::new(&sphere, "main")?.hit(hit.clone());
    let told = test.debug("print gl_HitTEXT\nbreak OpReturn\ncontinue\nprint payload\ncontinue")?;
    tells(
        &told,
        &[
            "ClosestHitKHR `main`",
            "gl_HitTEXT = float 3.5\n",
            "normal: vec3(0, 0, 1)",
            "t: float 3.5",
            "the end of the run\n",
        ],
    );
    let error = test.debug("print 1\nfrob").unwrap_err();
    let expected = "line 2 of the script failed: `frob`: unknown command `frob`; `help` lists all commands";
    assert_eq!(error.message(), expected);
    Ok(())
}

/// Invocation 5 of the second workgroup's sum: its index within the workgroup is 5 - 4.
#[test]
fn an_invocation_of_a_compute_test_is_debugged() -> anyhit::Result<()> {
    let source = "
        @group(0) @binding(0) var<storage, read_write> sums: array<u32>;
        @compute @workgroup_size(4)
        fn sum(@builtin(local_invocation_index) local: u32, @builtin(global_invocation_id) id: vec3u) {
            sums[id.x] = 10 * id.x + local;
        }";
    let module = Module::from_source("sum.wgsl", source)?;
    let test = ComputeTest::new(&module, "sum")?.buffer(0, 0, &[0u32; 8]).workgroups([2, 1, 1]);
    let told = test.debug([5, 0, 0], "watch sums[5]\ncontinue")?;
    tells(&told, &["GLCompute `sum`", "sums[5] was written: uint 0 -> uint 51\n"]);
    assert!(test.debug([8, 0, 0], "where").is_err());
    Ok(())
}

/// Of a vector one component is written, and a variable only by what a function returns: half of
/// 10. Then 4 + 7 comes to the sum, as the user says, in place of 4 + 5.
#[test]
fn values_are_told_apart_from_what_nobody_wrote() {
    tells(
        &transcript("scopes"),
        &[
            "not declared yet: ",
            "until 31\n",
            "late = float <not yet written>\n",
            "x (of line 30) = float 10\n",
            "parts = vec3(<not yet written>, 3, <not yet written>)\n",
            "x (of line 25) = float 1\n",
            "parts = vec3(<not yet written>, 3, <not yet written>)\n",
            "parts.y + x = float 13\n",
            "halved at shaders/pass/debugger/scopes/main.rgen:20",
            "value = float 10\n",
            "finish\nhalved returned float 5\nmain at shaders/pass/debugger/scopes/main.rgen:31",
            "light was written: Light { colour: vec3(0, 0, 0), size: vec2(0, 0) } -> \
             Light { colour: vec3(1, 3, 5), size: vec2(0, 0) }\n",
            " -> Light { colour: vec3(1, 3, 5), size: vec2(4, 8) }\n",
            "who light\n",
            "the next step writes light = Light { colour: vec3(1, 3, 5), size: vec2(4, 8) }\n",
            "main.rgen:34",
            "set late = 7\nlate = float 7\n",
            "sum = float 11\n",
            "the next step writes sum = float 11\n",
            "main.rgen:35",
            "who late\nlate was set by you at step ",
            "main.rgen:35",
        ],
    );
}

/// Without scopes in its debug information a variable has the line where it is first used.
#[test]
fn variables_of_one_name_have_their_lines() {
    tells(&transcript("scopes-lines"), &["x (of line 30) = float 10\n", "x (of line 25) = float 1\n"]);
}

/// The ray meets the hairs at t = 5 - 2 - 1/2 and 5 - 1/2. A condition sees the event, not the
/// shader that comes after it.
#[test]
fn conditions_of_a_traversal_are_about_its_events() {
    tells(
        &transcript("traversal-condition"),
        &[
            "continue\n",
            "printed: hair 0 at t 2.5\n",
            "breakpoint 1\n",
            "> instance 0, geometry 0, primitive 1: candidate at t 4.5\n",
            "continue\n",
            "printed: the condition of breakpoint 3: at character 1 of the expression: the event has no `hair`; it has \
             instance, geometry, primitive, t, u, v, kind\n",
            "> instance 0, geometry 0, primitive 0: candidate at t 2.5\n",
        ],
    );
}

#[test]
fn an_input_cannot_be_set() {
    let scene = ["shaders/pass/debugger/hair/scene.toml".to_owned()];
    for (command, answer) in [
        ("set gl_HitTEXT = 1", "`gl_HitTEXT` is gl_RayTmaxEXT, an input of the shader"),
        ("set gl_WorldRayOriginEXT.x = 1", "`gl_WorldRayOriginEXT` is an input of the shader"),
    ] {
        let (text, _) = run(&scene, &format!("until closest-hit\n{command}\n"));
        assert!(text.contains(answer), "`{command}` is answered:\n{text}");
    }
}

/// A command that makes no sense says why, and a script ends there.
#[test]
fn mistakes_are_explained() {
    let scene = ["shaders/pass/debugger/hair/scene.toml".to_owned()];
    for (command, answer) in [
        ("jump", "unknown command `jump`"),
        ("break 1000", "`shaders/pass/debugger/hair/main.rgen` has no code at or after line 1000"),
        ("break nothing", "no function is named `nothing`"),
        ("break OpFrob", "`OpFrob` is not a SPIR-V opcode"),
        ("break other.rgen:3", "no shader was compiled from `other.rgen`; the sources are "),
        ("break", "a place is missing"),
        ("break primitive=x", "`x` is not an index"),
        ("break verdict=gone", "`gone` is not a verdict; the verdicts are entered, "),
        ("print nomral", "no variable `nomral` here"),
        ("print 1 +", "at character 4 of the expression"),
        ("set origin", "`set NAME = EXPRESSION` sets a variable"),
        ("set 1 = 2", "can be set"),
        ("frame 9", "the stack has 1 frames, numbered from 0"),
        ("up", "this is the outermost frame"),
        ("goto soon", "`soon` is not a step number"),
        ("delete 4", "breakpoint 4 does not exist"),
        ("watch 1 + 1", "has no location"),
        ("locals now", "`locals` takes no argument: `now`"),
        ("finish 2", "`finish` takes no argument: `2`"),
        ("step many", "`many` is not a count"),
    ] {
        let (text, errors) = run(&scene, &format!("{command}\nwhere\n"));
        assert!(text.contains(answer), "`{command}` is answered:\n{text}");
        assert!(errors.contains("line 1 of the script failed"), "{errors}");
        assert!(errors.contains(answer), "`{command}` ends with:\n{errors}");
        assert!(!text.contains("(anyhit) where"), "a script goes on after a mistake:\n{text}");
    }
}
