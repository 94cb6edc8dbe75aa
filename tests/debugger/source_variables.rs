//! The debugger reads variables by their names and evaluates expressions of them, in modules of
//! real compilers. Values are derived from the sources, `shaders/debug/variables/`.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use anyhit::{Module, Program};
use anyhit_debugger::debugger::expression::{assign, evaluate};
use anyhit_debugger::debugger::{
    LaneState, SourceFrame, Variable, VariableKind, global_variables, source_frames, variables_in_frame,
};
use anyhit_engine::interp;
use anyhit_engine::machine::invocation::Invocation;
use anyhit_engine::machine::workgroup::Workgroup;
use anyhit_engine::machine::{
    Batch, Bindings, Buffer, Descriptor, Lanes, Mask, Observer, OpIndex, Reg, Resources, Stop,
};
use anyhit_engine::ops::builtin::Builtin;

const FOLDER: &str = "spirv-fixtures/debug/variables";

/// A batch of one invocation, stopped somewhere.
#[derive(Debug)]
pub(crate) struct Stopped {
    program: Program,
    batch: Batch<1>,
    bindings: Bindings,
}

impl LaneState for Stopped {
    fn register(&self, register: Reg) -> u32 {
        self.batch.registers[register].0[0]
    }

    fn set_register(&mut self, register: Reg, word: u32) {
        self.batch.registers[register].0[0] = word;
    }

    fn bindings(&self) -> &Bindings {
        &self.bindings
    }

    fn shader_record(&self) -> Option<(&Buffer, u64, u64)> {
        self.batch.invocations.record(0).map(|record| (&*record.data, record.offset, record.size))
    }

    fn workgroup_memory(&self) -> Option<&Buffer> {
        self.batch.invocations.workgroup(0).map(|group| &*group.memory)
    }

    fn builtin(&self, builtin: &'static Builtin) -> Option<Vec<u32>> {
        let mut words = vec![Lanes::<1>::splat(0); builtin.shape.words() as usize];
        builtin.read.read(&self.batch.invocations, Mask::lane(0), &mut words);
        Some(words.into_iter().map(|word| word.0[0]).collect())
    }
}

/// Pauses the first time that an operation of a line comes.
struct PauseAt<'p> {
    program: &'p Program,
    line: u32,
}

impl Observer<1> for PauseAt<'_> {
    fn before(&mut self, _: &mut Batch<1>, op: OpIndex) -> bool {
        let offset = self.program.origins[op.index()].offset;
        let line = self.program.module.debug_info.line_at(offset);
        line.is_some_and(|line| line.line == self.line)
    }
}

/// The line of a source that ends with a comment.
fn line_of(source: &str, mark: &str) -> u32 {
    let path = Path::new("shaders/debug/variables").join(source);
    let text = fs::read_to_string(path).expect("the source");
    let at = text.lines().position(|line| line.ends_with(&format!("// {mark}")));
    at.expect("the mark") as u32 + 1
}

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

impl Stopped {
    /// A program of a fixture with memory for it, not yet run.
    pub(crate) fn new(fixture: &str) -> Self {
        let module = Module::open(Path::new(FOLDER).join(fixture)).expect("a module");
        let program = Program::of(&module, "main").expect("a program").unoptimized().expect("the same");
        let mut resources = Resources::default();
        // Two nodes: { vec4(0, 1, 2, 3), &second } and { vec4(4, 5, 6, 7), null }.
        let second = Buffer::new(&[floats(&[4.0, 5.0, 6.0, 7.0]), vec![0; 16]].concat());
        let address = resources.memory.add_buffer(&second);
        let first = [floats(&[0.0, 1.0, 2.0, 3.0]), address.to_le_bytes().to_vec(), vec![0; 8]].concat();
        let first = resources.memory.add_buffer(&Buffer::new(&first));
        let constants = [first.to_le_bytes().to_vec(), 9_u32.to_le_bytes().to_vec(), vec![0; 4]].concat();
        resources.push_constants = Some(Buffer::new(&constants));
        let items = match fixture.contains("slang") {
            true => floats(&[0.0, 1.0, 4.0, 0.0]),
            false => {
                // The second material at 64: colour, rough; two columns of stride 16; ids.
                let mut bytes = vec![0; 64];
                bytes.extend(floats(&[0.25, 0.5, 0.75, 8.0]));
                bytes.extend(floats(&[1.0, 2.0, 3.0, 0.0, 4.0, 5.0, 6.0, 0.0]));
                bytes.extend([7_u32, 8, 9, 0].iter().flat_map(|id| id.to_le_bytes()));
                bytes.extend(floats(&[10.0, 11.0, 12.0, 13.0]));
                bytes
            }
        };
        let resources = resources.bind(0, 0, Descriptor::Buffer(Buffer::new(&items)));
        let bindings = resources.bindings(program.bindings());
        let mut batch = program.batch::<1>();
        let size = program.workgroup.as_ref().expect("a compute shader").memory;
        let group =
            Workgroup { id: [0; 3], count: [1; 3], size: [1; 3], memory: Buffer::zeroed(size as usize) };
        let workgroup = Some(Arc::new(group));
        batch.invocations.set(0, Invocation { launch_size: [1; 3], workgroup, ..Invocation::default() });
        program.begin(&mut batch, Mask::lane(0), 1_000_000);
        Self { program, batch, bindings }
    }

    /// Runs on until an operation of the marked line comes.
    fn run_to(mut self, source: &str, mark: &str) -> Self {
        let mut pause = PauseAt { program: &self.program, line: line_of(source, mark) };
        let stop = interp::run_lane(&mut self.batch, &self.program, &self.bindings, Some(&mut pause));
        assert!(matches!(stop, Stop::Paused), "{stop:?}");
        self
    }

    fn frames(&self) -> Vec<SourceFrame> {
        source_frames(&self.program, self.program.origins[self.batch.op.index()])
    }

    /// The names of the functions, the innermost first.
    fn functions(&self) -> Vec<String> {
        self.frames().iter().map(|frame| frame.function.to_string()).collect()
    }

    /// The value of an expression in a frame, or what is wrong with it.
    fn eval_in(&self, frame: usize, text: &str) -> String {
        let found = evaluate(&self.program, &self.frames()[frame], self, text);
        let found = found.map_err(|error| error.to_string());
        match found.and_then(|found| found.value(self)) {
            Ok(value) => value.to_string(),
            Err(message) => message,
        }
    }

    pub(crate) fn eval(&self, text: &str) -> String {
        self.eval_in(0, text)
    }

    pub(crate) fn assert_all(&self, expected: &[(&str, &str)]) {
        let found: Vec<_> = expected.iter().map(|(text, _)| (*text, self.eval(text))).collect();
        let found: Vec<_> = found.iter().map(|(text, value)| (*text, value.as_str())).collect();
        pretty_assertions::assert_eq!(found, expected);
    }

    fn set(&mut self, target: &str, value: &str) -> Result<(), String> {
        let frame = self.frames().remove(0);
        // The state is borrowed apart from the program.
        let program = self.program.clone();
        assign(&program, &frame, self, target, value).map(drop).map_err(|error| error.to_string())
    }

    fn locals(&self, frame: usize) -> Vec<Variable> {
        variables_in_frame(&self.program, &self.frames()[frame], self)
    }
}

/// Names with whether they are declared.
fn names(variables: &[Variable]) -> Vec<(&str, bool)> {
    variables.iter().map(|variable| (variable.name.as_str(), variable.is_declared)).collect()
}

#[test]
fn inner_variables_of_glsl_hide_outer_ones() {
    let stopped = Stopped::new("locals.comp.gVS.spv").run_to("locals.comp", "A");
    assert_eq!(stopped.functions(), ["helper", "main"]);
    let locals = stopped.locals(0);
    assert_eq!(names(&locals), [("local", true), ("local", true), ("v", true), ("a", true)]);
    let kinds: Vec<_> = locals.iter().map(|local| local.kind).collect();
    use VariableKind::{Local, Parameter};
    assert_eq!(kinds, [Local, Local, Parameter, Parameter]);
    // The inner `local` is v.x + 4, the outer one a * 2.
    stopped.assert_all(&[("local", "float 5"), ("a", "float 1"), ("v", "vec3(1, 2, 3)")]);
    assert_eq!(stopped.eval_in(1, "normal"), "vec3(1, 2, 3)");
    // Debug information declares a variable before its initializer, in which the call stands.
    assert_eq!(stopped.eval_in(1, "result"), "float 0");
    let later = format!(
        "at character 1 of the expression: `second` is not declared before line {}",
        line_of("locals.comp", "D") - 2
    );
    assert_eq!(stopped.eval_in(1, "second"), later);

    let stopped = Stopped::new("locals.comp.gVS.spv").run_to("locals.comp", "B");
    // This version of glslang tells no blocks: the later variable of a name hides the earlier one
    // to the end of the function.
    stopped.assert_all(&[("v", "vec3(1, 7, 3)"), ("a", "float 1")]);
}

#[test]
fn loops_of_glsl_are_followed() {
    let stopped = Stopped::new("locals.comp.gVS.spv").run_to("locals.comp", "C");
    stopped.assert_all(&[
        ("i", "int 0"),
        ("twice", "uint 0"),
        ("material.rough", "float 4"),
        ("material.ids", "uint[3](7, 8, 9)"),
        ("material.ids[i + 1]", "uint 8"),
    ]);
}

/// The expressions that all forms of `locals.comp` know at line D.
const AT_D: &[(&str, &str)] = &[
    ("result", "float 5"),
    ("normal", "vec3(1, 7, 3)"),
    ("normal.zx", "vec2(3, 1)"),
    ("small * 2", "float16_t 1"),
    ("large", "int64_t -5000000000"),
    ("large / 1000l", "int64_t -5000000"),
    ("wide", "double 0.25"),
    ("wide + 1", "double 1.25"),
    ("material.frame", "mat2x3((1, 2, 3), (4, 5, 6))"),
    ("material.frame[1].y", "float 5"),
    ("material.frame * vec2(1, 10)", "vec3(41, 52, 63)"),
    ("material.ids", "uint[3](0, 2, 4)"),
    // Members of a block without a name.
    ("materials[1].colour", "vec3(0.25, 0.5, 0.75)"),
    ("materials[1].frame[1]", "vec3(4, 5, 6)"),
    ("items.length()", "int 4"),
    ("items[2] + items[3]", "float 25"),
    ("items[4]", "at character 6 of the expression: 4 is outside the 4 elements of float[]"),
    ("constants.count", "uint 9"),
    ("constants.head.value", "vec4(0, 1, 2, 3)"),
    ("constants.head->next->value.w", "float 7"),
    ("(*second).value.x", "float 4"),
    ("second.next == 0", "bool true"),
    ("second.next.value", "at character 13 of the expression: the pointer is null"),
    ("kept[1]", "vec2(5, 7)"),
    ("samples", "int 5"),
    ("gl_WorkGroupSize", "uvec3(1, 1, 1)"),
    ("GlobalInvocationId.x", "uint 0"),
    ("norml", "at character 1 of the expression: no variable `norml` here; did you mean `normal`?"),
    ("material.ruff", "at character 10 of the expression: no member of Material `ruff`"),
    ("gl_HitTEXT", "at character 1 of the expression: a GLCompute shader has no `gl_HitTEXT`"),
];

#[test]
fn glsl_variables_are_read_with_every_form_of_debug_information() {
    for fixture in ["locals.comp.gVS.spv", "locals.comp.g.spv"] {
        let stopped = Stopped::new(fixture).run_to("locals.comp", "D");
        assert_eq!(stopped.functions(), ["main"], "{fixture}");
        stopped.assert_all(AT_D);
    }
}

#[test]
fn glsl_names_are_read_without_lines() {
    // Without lines there is none to stop at: the shader stops where the other form does.
    let lines = Stopped::new("locals.comp.g.spv").run_to("locals.comp", "D");
    let mut stopped = Stopped::new("locals.comp.spv");
    struct PauseAtOp(OpIndex);
    impl Observer<1> for PauseAtOp {
        fn before(&mut self, _: &mut Batch<1>, op: OpIndex) -> bool {
            op == self.0
        }
    }
    let mut pause = PauseAtOp(lines.batch.op);
    interp::run_lane(&mut stopped.batch, &stopped.program, &stopped.bindings, Some(&mut pause));
    stopped.assert_all(AT_D);
}

#[test]
fn variables_and_memory_are_set() {
    let mut stopped = Stopped::new("locals.comp.gVS.spv").run_to("locals.comp", "D");
    assert_eq!(stopped.set("result", "normal.x + 2"), Ok(()));
    assert_eq!(stopped.set("normal.xz", "vec2(8, 9)"), Ok(()));
    assert_eq!(stopped.set("material.frame[1].z", "0.5"), Ok(()));
    assert_eq!(stopped.set("materials[0]", "materials[1]"), Ok(()));
    assert_eq!(stopped.set("items[3]", "-1"), Ok(()));
    assert_eq!(stopped.set("second.value.y", "100"), Ok(()));
    assert_eq!(stopped.set("large", "7"), Ok(()));
    assert_eq!(stopped.set("kept[0]", "vec2(1, 2)"), Ok(()));
    stopped.assert_all(&[
        ("result", "float 3"),
        ("normal", "vec3(8, 7, 9)"),
        ("material.frame", "mat2x3((1, 2, 3), (4, 5, 0.5))"),
        ("materials[0].ids", "uint[3](7, 8, 9)"),
        ("materials[0].frame[0]", "vec3(1, 2, 3)"),
        ("items[3]", "float -1"),
        ("second.value.y", "float 100"),
        ("large", "int64_t 7"),
        ("kept", "vec2[2]((1, 2), (5, 7))"),
    ]);
    let refused = [
        ("result + 1", "1", "at character 8 of the expression: only variables and their parts can be set"),
        ("index", "1.5", "at character 1 of the expression: cannot convert float to uint: write uint(...)"),
        ("normal", "vec2(1)", "at character 1 of the expression: cannot convert vec2 to vec3"),
        (
            "samples",
            "1",
            "at character 1 of the expression: it is a value, not a variable: the compiler may have used it already",
        ),
        (
            "gl_LocalInvocationIndex",
            "1",
            "at character 1 of the expression: `gl_LocalInvocationIndex` is an input of the shader",
        ),
        ("items[9]", "1", "at character 6 of the expression: 9 is outside the 4 elements of float[]"),
    ];
    for (target, value, message) in refused {
        assert_eq!(stopped.set(target, value), Err(message.to_owned()), "{target} = {value}");
    }
    // The shader goes on with what was set: 3 + 100 + 1/2 + 7 + 1/4 + 5.
    let stopped = stopped.run_to("locals.comp", "E");
    stopped.assert_all(&[("items[0]", "float 115.75"), ("late", "float 11")]);
}

#[test]
fn globals_are_told_by_kind() {
    let stopped = Stopped::new("locals.comp.gVS.spv").run_to("locals.comp", "D");
    let globals = global_variables(&stopped.program, &stopped);
    let found: Vec<_> = globals.iter().map(|one| (one.name.as_str(), one.kind, one.is_anonymous)).collect();
    use VariableKind::{Buffer, Builtin, PushConstant, Workgroup};
    let expected = [
        ("constants", PushConstant, false),
        ("kept", Workgroup, false),
        ("Block", Buffer, true),
        ("gl_LocalInvocationIndex", Builtin, false),
    ];
    assert_eq!(found, expected);
    // A buffer's array is read in pages.
    let block = &globals[2].place;
    let items = block.member("items").expect("a member");
    let page: Vec<_> = items
        .children(1..3, &stopped)
        .into_iter()
        .map(|(name, place)| (name, place.value(&stopped).expect("a value").to_string()))
        .collect();
    assert_eq!(page, [("[1]".to_owned(), "float 11".to_owned()), ("[2]".to_owned(), "float 12".to_owned())]);
    // A pointer has the parts of what it points to.
    let head = globals[0].place.member("head").expect("a member");
    let parts: Vec<String> = head.children(0..9, &stopped).into_iter().map(|(name, _)| name).collect();
    assert_eq!(parts, ["value", "next"]);
}

#[test]
fn functions_that_slang_has_inlined_are_frames() {
    let stopped = Stopped::new("locals.slang.g2.spv").run_to("locals.slang", "A");
    assert_eq!(stopped.functions(), ["helper", "main"]);
    let lines: Vec<_> = stopped.frames().iter().map(|frame| frame.line.map(|line| line.line)).collect();
    let call = line_of("locals.slang", "D") - 2;
    assert_eq!(lines, [Some(line_of("locals.slang", "A")), Some(call)]);
    stopped.assert_all(&[("local", "float 5"), ("a", "float 1"), ("v", "vec3(1, 2, 3)")]);
    assert_eq!(stopped.eval_in(1, "normal"), "vec3(1, 2, 3)");

    let stopped = Stopped::new("locals.slang.g2.spv").run_to("locals.slang", "F");
    assert_eq!(stopped.functions(), ["Material.luma", "main"]);
    // The colour is the normal before `helper` changes it: 1 + 2 + 3.
    stopped.assert_all(&[("sum", "float 6"), ("scale", "float 5"), ("this.colour", "vec3(1, 2, 3)")]);
    assert_eq!(stopped.eval_in(1, "normal"), "vec3(1, 7, 3)");
}

#[test]
fn variables_of_slang_are_read_from_values_and_parts() {
    let stopped = Stopped::new("locals.slang.g2.spv").run_to("locals.slang", "C");
    stopped.assert_all(&[("i", "int 0"), ("twice", "uint 0"), ("material.rough", "float 4")]);

    let stopped = Stopped::new("locals.slang.g2.spv").run_to("locals.slang", "D");
    stopped.assert_all(&[
        ("normal", "vec3(1, 7, 3)"),
        ("result", "float 5"),
        ("material.ids", "uint[3](0, 2, 4)"),
        ("material.ids[2]", "uint 4"),
        ("material.colour", "vec3(1, 2, 3)"),
        ("material", "Material { colour: vec3(1, 2, 3), rough: float 4, ids: uint[3](0, 2, 4) }"),
        ("second.value", "vec4(4, 5, 6, 7)"),
        ("second->value.y", "float 5"),
        ("constants.head->value.z", "float 2"),
        ("items[2]", "float 4"),
        ("DispatchThreadID", "at character 1 of the expression: no variable `DispatchThreadID` here"),
        ("gl_GlobalInvocationID", "uvec3(0, 0, 0)"),
    ]);
}
