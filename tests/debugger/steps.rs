//! `anyhit trace-one-ray --interactive`: which lines there are to stop at, what parameters hold
//! there, and which writes are told. Facts are derived by hand from the sources in
//! `shaders/pass/debugger/`.

use anyhit::{ComputeTest, Module};

use crate::debugger::console::{run, tells, words};

const CALLS: &str = "shaders/pass/debugger/calls/scene.toml --invocation 0,0,0";
const WRITES: &str = "shaders/pass/debugger/writes/scene.toml --invocation 0,0,0";
const ONE_NAME: &str = "shaders/pass/debugger/one-name/scene.toml --pixel 0,0";

/// The transcript of commands, one a line, none of which fails.
#[track_caller]
fn session(arguments: &str, commands: &str) -> String {
    let (text, errors) = run(&words(arguments), commands);
    assert_eq!(errors, "", "{text}");
    text
}

/// `seven` adds 1 to the total on line 30, `bump` 10 on line 31.
#[test]
fn a_line_that_begins_with_a_call_is_stopped_at_before_the_call() {
    for variant in ["", " --variant lines"] {
        let arguments = format!("{CALLS}{variant}");
        tells(
            &session(&arguments, "break 30\nbreak 31\ncontinue\nprint total\nnext\nprint total\ncontinue\n"),
            &[
                "breakpoint 1: shaders/pass/debugger/calls/main.comp:30\n",
                "breakpoint 2: shaders/pass/debugger/calls/main.comp:31\n",
                "breakpoint 1\nmain at shaders/pass/debugger/calls/main.comp:30 ",
                "total = float 0\n",
                "breakpoint 2\nmain at shaders/pass/debugger/calls/main.comp:31 ",
                "total = float 1\n",
                "the end",
            ],
        );
        tells(
            &session(&arguments, "until 29\nstep\nstep\nfinish\nnext\nstep\nrfinish\nrnext\n"),
            &[
                "step\nmain at shaders/pass/debugger/calls/main.comp:30 ",
                "step\nseven at shaders/pass/debugger/calls/main.comp:16 ",
                "finish\nseven returned float 7\nmain at shaders/pass/debugger/calls/main.comp:30 ",
                "next\nmain at shaders/pass/debugger/calls/main.comp:31 ",
                "step\nbump at shaders/pass/debugger/calls/main.comp:21 ",
                "rfinish\nmain at shaders/pass/debugger/calls/main.comp:31 ",
                "rnext\nmain at shaders/pass/debugger/calls/main.comp:30 ",
            ],
        );
    }
}

#[test]
fn calls_and_barriers_are_instructions_to_stop_at() {
    tells(
        &session(CALLS, "break 32\ncontinue\nbegin\nbreak OpFunctionCall\ncontinue\nstepi\nrcontinue\n"),
        &[
            "breakpoint 1\nmain at shaders/pass/debugger/calls/main.comp:32 ",
            "memoryBarrierBuffer();",
            "breakpoint 2\nmain at shaders/pass/debugger/calls/main.comp:30 ",
            "stepi\nseven at shaders/pass/debugger/calls/main.comp:16 ",
            "rcontinue\nbreakpoint 2\nmain at shaders/pass/debugger/calls/main.comp:30 ",
        ],
    );
}

/// The function is called with (1, 2, 3), then with (4, 5, 6).
#[test]
fn a_function_begins_where_its_parameters_have_values() {
    for variant in ["", " --variant lines"] {
        let told = session(
            &format!("{CALLS}{variant}"),
            "log scaled {n} by {by}\nbreak scaled if n.x > 3\ncontinue\nlocals\n",
        );
        tells(
            &told,
            &[
                "printed: (1, 2, 3) by 0.5\n",
                "printed: (4, 5, 6) by 0.5\n",
                "breakpoint 2\nscaled at shaders/pass/debugger/calls/main.comp:25 ",
                "n = vec3(4, 5, 6)\n",
            ],
        );
        assert!(!told.contains("the condition of"), "{told}");
    }
}

/// The index is 1.
#[test]
fn writes_through_an_index_are_found() {
    let commands = "until 33\nwho array[1]\nuntil 33\nwho vector.y\nuntil 33\nwho vector\nuntil 33\nwho matrix[1][0]\n\
                    until 33\nwho vector.x\nuntil 24\nwatch array[1]\ncontinue\n";
    tells(
        &session(WRITES, commands),
        &[
            "the next step writes array[1] = float 5\nmain at shaders/pass/debugger/writes/main.comp:24 ",
            "the next step writes vector.y = float 6\nmain at shaders/pass/debugger/writes/main.comp:25 ",
            "writes vector = vec4(0, 6, 0, 0)\nmain at shaders/pass/debugger/writes/main.comp:25 ",
            "writes matrix[1][0] = float 7\nmain at shaders/pass/debugger/writes/main.comp:26 ",
            // Component 0 is not written by line 25.
            "writes vector.x = float 0\nmain at shaders/pass/debugger/writes/main.comp:21 ",
            "array[1] was written: float <not yet written> -> float 5\n",
            "main at shaders/pass/debugger/writes/main.comp:25 ",
        ],
    );
}

/// 5 is added to (1, 2, 3). Line 34 writes twice.
#[test]
fn a_write_of_several_components_is_one_write() {
    tells(
        &session(WRITES, "until 28\nwatch sum\nwatch outputs[1]\ncontinue\ncontinue\ncontinue\n"),
        &[
            "continue\nbreakpoint 1: sum was written: vec3 <not yet written> -> vec3(6, 7, 8)\n",
            "main at shaders/pass/debugger/writes/main.comp:30 ",
            "continue\nbreakpoint 2: outputs[1] was written: float 0 -> float 6\n",
            "main at shaders/pass/debugger/writes/main.comp:34 ",
            "continue\nthe end",
        ],
    );
}

/// Nobody writes the weight.
#[test]
fn a_copy_of_what_nobody_wrote_is_not_written() {
    tells(
        &session(
            WRITES,
            "until 30\nwatch half_written\ncontinue\ndelete\nuntil 33\nprint copy\nprint copy.depth\n",
        ),
        &[
            "half_written was written: Sample <not yet written> -> Sample { colour: vec3(6, 7, 8), \
             weight: float <not yet written>, depth: float <not yet written> }\n",
            "copy = Sample { colour: vec3(6, 7, 8), weight: float <not yet written>, depth: float 4 }\n",
            "copy.depth = float 4\n",
        ],
    );
}

/// What is passed on has the name of what is given. The wall's colour is (1, 2, 3) * 2.
#[test]
fn the_payload_of_an_entry_point_is_the_one_that_it_is_given() {
    let commands = "log shade {normal} by {scale}\nbreak 34\ncontinue\nprint p.depth\nnext\nprint p.colour\nwho p.colour\n\
                    next\nset p.depth = 1\nset p.colour.x = 9\nuntil 28\nprint p.colour\n";
    tells(
        &session(ONE_NAME, commands),
        &[
            "breakpoint 2\nrchit at shaders/pass/debugger/one-name/all.slang:34 ",
            "p.depth = uint 0\n",
            "printed: (1, 2, 3) by 2\n",
            "rchit at shaders/pass/debugger/one-name/all.slang:35 ",
            "p.colour = vec3(2, 4, 6)\n",
            "the next step writes p.colour = vec3(2, 4, 6)\n",
            "rchit at shaders/pass/debugger/one-name/all.slang:34 ",
            "p.depth = uint 1\n",
            // No second ray: the sky is not seen.
            "until 28\nrgen at shaders/pass/debugger/one-name/all.slang:28 ",
            "p.colour = vec3(9, 4, 6)\n",
        ],
    );
    let told = session(ONE_NAME, "break rchit if p.depth > 0\ncontinue\n");
    tells(&told, &["the end"]);
    assert!(!told.contains("the condition of"), "{told}");
}

/// Both hairs are candidates of the only hit record.
#[test]
fn a_candidate_that_an_any_hit_shader_decides_on_has_its_record() {
    let hair = "shaders/pass/debugger/hair/scene.toml --pixel 0,0";
    let told =
        session(hair, "break verdict=candidate any-hit if record == 0\ncontinue\ncontinue\ncontinue\n");
    let decides = "hit record 0: an any-hit shader decides";
    tells(&told, &["continue\nbreakpoint 1\n", decides, "continue\nbreakpoint 1\n", decides, "the end"]);
    let told = session(hair, "break verdict=candidate any-hit if record == 1\ncontinue\n");
    tells(&told, &["continue\nthe end"]);
    assert!(!told.contains("the condition of"), "{told}");
}

/// A parameter of WGSL is a value, whose parts only are used; the first line of the entry point is
/// a call.
#[test]
fn a_parameter_that_is_a_value_is_told() -> anyhit::Result<()> {
    let source = "
        struct Line { start: vec2f, end: vec2f }
        @group(0) @binding(0) var<storage, read_write> sums: array<f32>;
        fn slope(line: Line) -> f32 {
            let along = line.end - line.start;
            return along.y / along.x;
        }
        @compute @workgroup_size(1)
        fn main() {
            let rise = slope(Line(vec2f(1.0, 2.0), vec2f(3.0, 8.0)));
            sums[0] = rise;
        }";
    let module = Module::from_source("slope.wgsl", source)?;
    let test = ComputeTest::new(&module, "main")?.buffer(0, 0, &[0f32; 1]);
    let told = test.debug([0, 0, 0], "break slope\ncontinue\nprint line\nfinish\n")?;
    tells(
        &told,
        &[
            "slope.wgsl:10 ",
            "slope.wgsl:5 ",
            "line = Line { start: vec2(1, 2), end: vec2(3, 8) }\n",
            "slope returned float 3\n",
        ],
    );
    Ok(())
}

/// A loop of six turns, numbered from 0: the fourth hit is turn 3, in either direction.
#[test]
fn hits_are_counted_from_the_start_in_either_direction() {
    let script = "break main.comp:13 from 4\ncontinue\nprint turn\nrcontinue\nbreakpoints\ncontinue\n\
                  print turn\ncontinue\nprint turn\nbreakpoints\nrcontinue\nprint turn\nbreakpoints\nrcontinue\n\
                  delete\nbreak main.comp:13 if turn % 2 == 1 from 2\ncontinue\nprint turn\nrcontinue\n";
    let (text, errors) = run(&words("tests/debugger/scripts/turns.toml --invocation 0,0,0"), script);
    assert_eq!(errors, "");
    tells(
        &text,
        &[
            "turn = uint 3\n",
            "rcontinue\nthe start of the run\n",
            "breakpoints\nbreakpoint 1: ",
            "main.comp:13 from 4\n",
            "turn = uint 3\n",
            "turn = uint 4\n",
            "main.comp:13 from 4, hit 5 times\n",
            "rcontinue\nbreakpoint 1\n",
            "turn = uint 3\n",
            "main.comp:13 from 4, hit 4 times\n",
            "rcontinue\nthe start of the run\n",
            "turn = uint 3\n",
            "rcontinue\nthe start of the run\n",
        ],
    );
}
