//! Litmus tests of shaders that call each other: what a ray generation shader and the miss or
//! callable shader that it calls access.
//!
//! The verdicts are derived by hand from Vulkan's "Memory Model": accesses on both sides of a call
//! are ordered by a release on one side and an acquire on the other, whose scopes hold both
//! invocations, as `ShaderCallKHR` does, and `Subgroup` does not: lanes may be repacked.

use std::sync::Arc;

use anyhit_engine::module::Opcode;
use rspirv::spirv::Scope;

use crate::races::litmus::{
    ACQ, ACQ_VIS, Memory, Privacy, REL, REL_AV, Step, Writer, X, constants_of, decorate_buffer, races,
};
use crate::{Levels, ProgramPlan, Sanitizer};
use anyhit_engine::machine::{Buffer, Descriptor, Resources};
use anyhit_engine::module::assemble::Assembler;
use anyhit_engine::pipeline::{Launch, Pipeline};
use anyhit_engine::program::lower::lower;

use Privacy::{NonPrivate, Private, Within};
use Scope::{ShaderCallKHR, Subgroup};
use Step::{Fence, Load, Store};

/// How the ray generation shader calls the other one.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Call {
    /// A ray that misses.
    Trace,
    /// A callable shader.
    Callable,
}

/// What the caller does before the call, what the called shader does, and what the caller does
/// after it.
struct CallTest {
    name: &'static str,
    races: bool,
    before: &'static [Step],
    called: &'static [Step],
    after: &'static [Step],
}

static CALLS: &[CallTest] = &[
    CallTest {
        name: "a message to the called shader, without barriers",
        races: true,
        before: &[Store(X, NonPrivate)],
        called: &[Load(X, NonPrivate)],
        after: &[],
    },
    CallTest {
        name: "a message to the called shader",
        races: false,
        before: &[Store(X, NonPrivate), Fence(ShaderCallKHR, REL_AV)],
        called: &[Fence(ShaderCallKHR, ACQ_VIS), Load(X, NonPrivate)],
        after: &[],
    },
    CallTest {
        name: "a message to the called shader, made available by the accesses",
        races: false,
        before: &[Store(X, Within(ShaderCallKHR)), Fence(ShaderCallKHR, REL)],
        called: &[Fence(ShaderCallKHR, ACQ), Load(X, Within(ShaderCallKHR))],
        after: &[],
    },
    CallTest {
        name: "a message to the called shader, never made available",
        races: true,
        before: &[Store(X, NonPrivate), Fence(ShaderCallKHR, REL)],
        called: &[Fence(ShaderCallKHR, ACQ), Load(X, NonPrivate)],
        after: &[],
    },
    CallTest {
        name: "a message to the called shader, private",
        races: true,
        before: &[Store(X, Private), Fence(ShaderCallKHR, REL_AV)],
        called: &[Fence(ShaderCallKHR, ACQ_VIS), Load(X, Private)],
        after: &[],
    },
    CallTest {
        name: "a message to the called shader, within a subgroup",
        races: true,
        before: &[Store(X, NonPrivate), Fence(Subgroup, REL_AV)],
        called: &[Fence(Subgroup, ACQ_VIS), Load(X, NonPrivate)],
        after: &[],
    },
    CallTest {
        name: "a result",
        races: false,
        before: &[],
        called: &[Store(X, NonPrivate), Fence(ShaderCallKHR, REL_AV)],
        after: &[Fence(ShaderCallKHR, ACQ_VIS), Load(X, NonPrivate)],
    },
    CallTest {
        name: "a result that is not released",
        races: true,
        before: &[],
        called: &[Store(X, NonPrivate)],
        after: &[Fence(ShaderCallKHR, ACQ_VIS), Load(X, NonPrivate)],
    },
    CallTest {
        name: "both write",
        races: true,
        before: &[Store(X, NonPrivate)],
        called: &[Store(X, NonPrivate)],
        after: &[],
    },
    CallTest {
        name: "both read",
        races: false,
        before: &[Load(X, NonPrivate)],
        called: &[Load(X, NonPrivate)],
        after: &[],
    },
];

/// The module of a test: its entry points are the ray generation shader and the other one.
fn module(test: &CallTest, call: Call) -> Assembler {
    const LOCATIONS: [u32; 2] = [60, 61];
    let (stage, classes) = match call {
        Call::Trace => (5317, [5338, 5342]),
        Call::Callable => (5318, [5328, 5329]),
    };
    let mut a = Assembler::bare(4000);
    for capability in [1, 11, 4479, 5345, 5346] {
        a.op(Opcode::Capability, &[capability]);
    }
    a.op(Opcode::MemoryModel, &[0, 3]);
    a.with_string(Opcode::EntryPoint, &[5313, 40], "main", &[30, 31, LOCATIONS[0]]);
    a.with_string(Opcode::EntryPoint, &[stage, 70], "called", &[30, 31, LOCATIONS[1]]);
    for (array, block, variable, binding) in [(20, 21, 30, 0), (26, 27, 31, 1)] {
        decorate_buffer(&mut a, [array, block, variable], binding);
    }
    a.types();
    let mut writer = Writer { a, next: 100, memory: Memory::Buffer, constants: Vec::new(), own: 0 };
    for value in constants_of([test.before, test.called, test.after].into_iter().flatten()) {
        let id = writer.id();
        writer.a.op(Opcode::Constant, &[5, id, value]);
        writer.constants.push((value, id));
    }
    for (array, block, pointer, variable) in [(20, 21, 22, 30), (26, 27, 28, 31)] {
        writer.a.op(Opcode::TypeRuntimeArray, &[array, 5]);
        writer.a.op(Opcode::TypeStruct, &[block, array]);
        writer.a.op(Opcode::TypePointer, &[pointer, 12, block]);
        writer.a.op(Opcode::Variable, &[pointer, variable, 12]);
    }
    writer.a.op(Opcode::TypePointer, &[24, 12, 5]);
    for (at, (class, variable)) in (0..).zip(classes.into_iter().zip(LOCATIONS)) {
        writer.a.op(Opcode::TypePointer, &[62 + at, class, 5]);
        writer.a.op(Opcode::Variable, &[62 + at, variable, class]);
    }
    // A null structure, which every ray misses.
    writer.a.op(Opcode::TypeInt, &[80, 64, 0]);
    writer.a.op(Opcode::TypeAccelerationStructureKHR, &[81]);
    writer.a.op(Opcode::ConstantNull, &[80, 82]);
    writer.a.op(Opcode::Constant, &[6, 83, 0]);
    writer.a.op(Opcode::Constant, &[6, 84, 1.0f32.to_bits()]);
    writer.a.op(Opcode::ConstantComposite, &[7, 85, 84, 84, 84]);
    let zero = writer.constant(0);
    writer.own = writer.constant(6);
    writer.a.op(Opcode::Function, &[1, 40, 0, 2]);
    writer.a.op(Opcode::Label, &[41]);
    test.before.iter().for_each(|&step| writer.step(step));
    match call {
        Call::Trace => {
            writer.a.op(Opcode::ConvertUToAccelerationStructureKHR, &[81, 86, 82]);
            let operands = [86, zero, zero, zero, zero, zero, 85, 83, 85, 84, LOCATIONS[0]];
            writer.a.op(Opcode::TraceRayKHR, &operands);
        }
        Call::Callable => _ = writer.a.op(Opcode::ExecuteCallableKHR, &[zero, LOCATIONS[0]]),
    }
    test.after.iter().for_each(|&step| writer.step(step));
    writer.a.op(Opcode::Return, &[]);
    writer.a.op(Opcode::FunctionEnd, &[]);
    writer.own = writer.constant(7);
    writer.a.op(Opcode::Function, &[1, 70, 0, 2]);
    writer.a.op(Opcode::Label, &[71]);
    test.called.iter().for_each(|&step| writer.step(step));
    writer.a.op(Opcode::Return, &[]);
    writer.a.op(Opcode::FunctionEnd, &[]);
    writer.a
}

/// The rules about races that a test breaks.
fn broken(test: &CallTest, call: Call) -> Vec<&'static str> {
    let module = Arc::new(module(test, call).loaded());
    let [main, called] = [0, 1].map(|at| lower(&module, &module.entry_points[at]).unwrap());
    let builder = Pipeline::builder().ray_generation(main).unwrap();
    let builder = match call {
        Call::Trace => builder.miss(called),
        Call::Callable => builder.callable(called),
    };
    let pipeline = builder.unwrap().build().unwrap().unoptimized().unwrap();
    let resources = (0..2).fold(Resources::default(), |resources, binding| {
        resources.bind(0, binding, Descriptor::Buffer(Buffer::zeroed(64)))
    });
    let plans: Vec<ProgramPlan> = pipeline.programs.iter().map(ProgramPlan::new).collect();
    let levels = Levels::default();
    let mut sanitizer = Sanitizer::new(&plans, &levels).with_resources(&resources).of_pipeline(&pipeline);
    let launch = Launch { pipeline: &pipeline, resources: &resources };
    launch.run_observed([1; 3], &mut |_| (), &mut sanitizer).unwrap();
    races(sanitizer)
}

#[test]
fn caller_and_called_shader_race_but_for_a_release_and_an_acquire() {
    let mut wrong = Vec::new();
    for call in [Call::Trace, Call::Callable] {
        for test in CALLS {
            let found = broken(test, call);
            if found.is_empty() == test.races {
                wrong.push(format!("{call:?}, {}: {found:?}", test.name));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}
