//! Litmus tests: a few invocations with a few accesses each, and whether they race by the Vulkan
//! memory model. Here is how they are written and run; the tests are in the files beside.
//!
//! Invocations run in their order, so of each test the execution is met in which the later one sees
//! what the earlier one has written.

use std::sync::Arc;

use anyhit_engine::module::Opcode;
use rspirv::spirv::{MemoryAccess, MemorySemantics as Semantics, Scope};

use crate::rule::race;
use crate::{Levels, ProgramPlan, Sanitizer};
use anyhit_engine::machine::invocation::DEFAULT_SUBGROUP_SIZE;
use anyhit_engine::machine::{Buffer, Descriptor, Resources};
use anyhit_engine::module::assemble::Assembler;
use anyhit_engine::pipeline::Compute;
use anyhit_engine::program::lower::lower;

use Step::{Add, AtomicLoad, AtomicStore, Barrier, Fence, Load, Store, SubgroupBarrier};

/// The variables of a test, each a word of its own.
pub(super) const X: u32 = 0;
/// See [`X`].
pub(super) const Y: u32 = 1;
/// See [`X`].
pub(super) const Z: u32 = 2;

/// How a plain access takes part in communication.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Privacy {
    /// In none.
    Private,
    /// Barriers and atomic instructions order it.
    NonPrivate,
    /// Made available or visible by the access itself, in a scope.
    Within(Scope),
    /// In none, and decorated `Volatile`.
    Volatile,
}
use Privacy::{NonPrivate, Private, Volatile, Within};

pub(super) const NONE: Semantics = Semantics::empty();
pub(super) const ACQUIRE: Semantics = Semantics::ACQUIRE;
pub(super) const RELEASE: Semantics = Semantics::RELEASE;
pub(super) const BOTH: Semantics = Semantics::ACQUIRE_RELEASE;
pub(super) const AVAILABLE: Semantics = Semantics::MAKE_AVAILABLE;
pub(super) const VISIBLE: Semantics = Semantics::MAKE_VISIBLE;

/// What an invocation does.
#[derive(Clone, Copy, Debug)]
pub(super) enum Step {
    Load(u32, Privacy),
    Store(u32, Privacy),
    AtomicLoad(u32, Scope, Semantics),
    AtomicStore(u32, Scope, Semantics),
    Add(u32, Scope, Semantics),
    Fence(Scope, Semantics),
    /// All invocations of the workgroup wait. It stands in each of them.
    Barrier(Semantics),
    /// Those of a subgroup wait. It stands in each of them.
    SubgroupBarrier(Semantics),
}

/// The invocations of a test by workgroup.
pub(super) struct Litmus {
    name: &'static str,
    races: bool,
    groups: &'static [&'static [&'static [Step]]],
}

pub(super) const fn litmus(
    name: &'static str,
    races: bool,
    groups: &'static [&'static [&'static [Step]]],
) -> Litmus {
    Litmus { name, races, groups }
}

/// With the storage class of buffers.
pub(super) const BUFFER: Semantics = Semantics::UNIFORM_MEMORY;
pub(super) const IMAGE: Semantics = Semantics::IMAGE_MEMORY;
pub(super) const ACQ: Semantics = ACQUIRE.union(BUFFER);
pub(super) const REL: Semantics = RELEASE.union(BUFFER);
pub(super) const ACQ_VIS: Semantics = ACQ.union(VISIBLE);
pub(super) const REL_AV: Semantics = REL.union(AVAILABLE);

/// The memory of the variables.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Memory {
    /// A buffer, with the Vulkan memory model.
    Buffer,
    /// Shared variables, with that of GLSL.
    Shared,
}

/// Decorates a buffer of words, given its array, block and variable.
pub(super) fn decorate_buffer(a: &mut Assembler, [array, block, variable]: [u32; 3], binding: u32) {
    a.op(Opcode::Decorate, &[array, 6, 4]);
    a.op(Opcode::Decorate, &[block, 2]);
    a.op(Opcode::MemberDecorate, &[block, 0, 35, 0]);
    a.op(Opcode::Decorate, &[variable, 34, 0]);
    a.op(Opcode::Decorate, &[variable, 33, binding]);
}

/// The module of a test. A shader has the code of all invocations, each behind a test of its
/// number, between the barriers.
pub(super) struct Writer {
    /// What is written so far.
    pub a: Assembler,
    /// The last id that was given out.
    pub next: u32,
    /// Where the variables are.
    pub memory: Memory,
    /// Constants, with their ids.
    pub constants: Vec<(u32, u32)>,
    /// The id of a value that no other invocation has.
    pub own: u32,
}

impl Writer {
    /// A new id.
    pub(super) fn id(&mut self) -> u32 {
        self.next += 1;
        self.next
    }

    /// The id of a constant, which is declared before the function.
    pub(super) fn constant(&self, value: u32) -> u32 {
        self.constants.iter().find(|(known, _)| *known == value).expect("a declared constant").1
    }

    fn variable(&mut self, number: u32) -> u32 {
        let (pointer, index) = (self.id(), self.constant(number));
        let operands = match self.memory {
            Memory::Buffer => vec![24, pointer, 30, self.constant(0), index],
            Memory::Shared => vec![24, pointer, 30, index],
        };
        self.a.op(Opcode::AccessChain, &operands);
        pointer
    }

    /// The memory operands of an access.
    fn operands(&self, privacy: Privacy, propagates: MemoryAccess) -> Vec<u32> {
        let non_private = MemoryAccess::NON_PRIVATE_POINTER;
        match privacy {
            _ if self.memory == Memory::Shared => Vec::new(),
            Private => Vec::new(),
            NonPrivate => vec![non_private.bits()],
            Volatile => vec![MemoryAccess::VOLATILE.bits()],
            Within(scope) => vec![(non_private | propagates).bits(), self.constant(scope as u32)],
        }
    }

    /// Uses a value, so that its load is no dead code.
    fn consume(&mut self, value: u32) {
        let pointer = self.id();
        let ty = if self.memory == Memory::Buffer { 24 } else { 25 };
        let operands = [ty, pointer, 31, self.constant(0), self.own];
        self.a.op(Opcode::AccessChain, &operands);
        self.a.op(Opcode::Store, &[pointer, value]);
    }

    /// Writes a step.
    pub(super) fn step(&mut self, step: Step) {
        let one = self.constant(1);
        match step {
            Load(variable, privacy) => {
                let (pointer, value) = (self.variable(variable), self.id());
                let operands = self.operands(privacy, MemoryAccess::MAKE_POINTER_VISIBLE);
                self.a.op(Opcode::Load, &[&[5, value, pointer][..], &operands].concat());
                self.consume(value);
            }
            Store(variable, privacy) => {
                let pointer = self.variable(variable);
                let operands = self.operands(privacy, MemoryAccess::MAKE_POINTER_AVAILABLE);
                // Each invocation its own value: one value would be another rule.
                self.a.op(Opcode::Store, &[&[pointer, self.own][..], &operands].concat());
            }
            AtomicLoad(variable, scope, semantics) => {
                let (pointer, value) = (self.variable(variable), self.id());
                let [scope, semantics] = [scope as u32, semantics.bits()].map(|one| self.constant(one));
                self.a.op(Opcode::AtomicLoad, &[5, value, pointer, scope, semantics]);
                self.consume(value);
            }
            AtomicStore(variable, scope, semantics) => {
                let pointer = self.variable(variable);
                let [scope, semantics] = [scope as u32, semantics.bits()].map(|one| self.constant(one));
                self.a.op(Opcode::AtomicStore, &[pointer, scope, semantics, one]);
            }
            Add(variable, scope, semantics) => {
                let (pointer, value) = (self.variable(variable), self.id());
                let [scope, semantics] = [scope as u32, semantics.bits()].map(|one| self.constant(one));
                self.a.op(Opcode::AtomicIAdd, &[5, value, pointer, scope, semantics, one]);
            }
            Fence(scope, semantics) => {
                let operands = [scope as u32, semantics.bits()].map(|one| self.constant(one));
                self.a.op(Opcode::MemoryBarrier, &operands);
            }
            Barrier(_) | SubgroupBarrier(_) => unreachable!("barriers stand between the invocations' code"),
        }
    }

    /// Code that one invocation executes.
    fn guarded(&mut self, invocation: u32, steps: &[Step]) {
        let [is_it, body, after] = [(); 3].map(|()| self.id());
        self.a.op(Opcode::IEqual, &[3, is_it, self.own, self.constant(invocation)]);
        self.a.op(Opcode::SelectionMerge, &[after, 0]);
        self.a.op(Opcode::BranchConditional, &[is_it, body, after]);
        self.a.op(Opcode::Label, &[body]);
        steps.iter().for_each(|&step| self.step(step));
        self.a.op(Opcode::Branch, &[after]);
        self.a.op(Opcode::Label, &[after]);
    }
}

/// The constants of some steps, and the numbers of invocations.
pub(super) fn constants_of<'a>(steps: impl Iterator<Item = &'a Step>) -> Vec<u32> {
    let mut all: Vec<u32> = (0..64).collect();
    for step in steps {
        match *step {
            AtomicLoad(_, scope, semantics) | AtomicStore(_, scope, semantics) | Add(_, scope, semantics) => {
                all.extend([scope as u32, semantics.bits()]);
            }
            Fence(scope, semantics) => all.extend([scope as u32, semantics.bits()]),
            Barrier(semantics) | SubgroupBarrier(semantics) => all.push(semantics.bits()),
            Load(_, Within(scope)) | Store(_, Within(scope)) => all.push(scope as u32),
            Load(..) | Store(..) => {}
        }
    }
    all.sort_unstable();
    all.dedup();
    all
}

/// The rules about races that a test breaks.
fn broken(litmus: &Litmus, memory: Memory) -> Vec<&'static str> {
    broken_by(litmus.groups, memory, DEFAULT_SUBGROUP_SIZE)
}

/// The rules about races that invocations break, by workgroup.
pub(super) fn broken_by(groups: &[&[&[Step]]], memory: Memory, subgroup_size: u32) -> Vec<&'static str> {
    const GLOBAL_INVOCATION_ID: u32 = 28;
    let size = groups.iter().map(|group| group.len()).max().unwrap_or(1) as u32;
    let mut a = Assembler::bare(4000);
    a.op(Opcode::Capability, &[1]);
    if memory == Memory::Buffer {
        a.op(Opcode::Capability, &[5345]);
        a.op(Opcode::Capability, &[5346]);
    }
    a.op(Opcode::MemoryModel, &[0, if memory == Memory::Buffer { 3 } else { 1 }]);
    a.with_string(Opcode::EntryPoint, &[5, 40], "main", &[30, 31, 32]);
    a.op(Opcode::ExecutionMode, &[40, 17, size, 1, 1]);
    a.op(Opcode::Decorate, &[32, 11, GLOBAL_INVOCATION_ID]);
    for (array, block, variable, binding) in [(20, 21, 30, 0), (26, 27, 31, 1)] {
        if memory == Memory::Shared && variable == 30 {
            continue;
        }
        decorate_buffer(&mut a, [array, block, variable], binding);
    }
    a.types();
    let mut writer = Writer { a, next: 100, memory, constants: Vec::new(), own: 50 };
    for value in constants_of(groups.iter().copied().flatten().copied().flatten()) {
        let id = writer.id();
        writer.a.op(Opcode::Constant, &[5, id, value]);
        writer.constants.push((value, id));
    }
    let class = if memory == Memory::Buffer { 12 } else { 4 };
    let four = writer.constant(4);
    let a = &mut writer.a;
    if memory == Memory::Buffer {
        a.op(Opcode::TypeRuntimeArray, &[20, 5]);
        a.op(Opcode::TypeStruct, &[21, 20]);
        a.op(Opcode::TypePointer, &[22, class, 21]);
    } else {
        a.op(Opcode::TypeArray, &[20, 5, four]);
        a.op(Opcode::TypePointer, &[22, class, 20]);
    }
    a.op(Opcode::TypePointer, &[24, class, 5]);
    a.op(Opcode::Variable, &[22, 30, class]);
    a.op(Opcode::TypeRuntimeArray, &[26, 5]);
    a.op(Opcode::TypeStruct, &[27, 26]);
    a.op(Opcode::TypePointer, &[28, 12, 27]);
    if memory == Memory::Shared {
        a.op(Opcode::TypePointer, &[25, 12, 5]);
    }
    a.op(Opcode::Variable, &[28, 31, 12]);
    a.op(Opcode::TypeVector, &[33, 5, 3]);
    a.op(Opcode::TypePointer, &[34, 1, 33]);
    a.op(Opcode::Variable, &[34, 32, 1]);
    a.op(Opcode::Function, &[1, 40, 0, 2]);
    a.op(Opcode::Label, &[41]);
    a.op(Opcode::Load, &[33, 51, 32]);
    a.op(Opcode::CompositeExtract, &[5, 50, 51, 0]);
    // The parts of the invocations between the barriers.
    let mut parts: Vec<(u32, std::slice::Split<'_, Step, _>)> = Vec::new();
    let is_barrier = |step: &Step| matches!(step, Barrier(_) | SubgroupBarrier(_));
    for (group, invocations) in (0..).zip(groups) {
        for (at, steps) in (0..).zip(*invocations) {
            parts.push((group * size + at, steps.split(is_barrier)));
        }
    }
    let all = groups.iter().copied().flatten();
    let waits = all.max_by_key(|steps| steps.iter().filter(|step| is_barrier(step)).count());
    let mut barriers = waits.copied().unwrap_or_default().iter().filter(|step| is_barrier(step));
    loop {
        for (invocation, rest) in &mut parts {
            if let Some(steps) = rest.next() {
                writer.guarded(*invocation, steps);
            }
        }
        let (scope, semantics) = match barriers.next() {
            Some(Barrier(semantics)) => (Scope::Workgroup, semantics),
            Some(SubgroupBarrier(semantics)) => (Scope::Subgroup, semantics),
            _ => break,
        };
        let operands = [scope as u32, scope as u32, semantics.bits()].map(|one| writer.constant(one));
        writer.a.op(Opcode::ControlBarrier, &operands);
    }
    writer.a.op(Opcode::Return, &[]);
    writer.a.op(Opcode::FunctionEnd, &[]);
    run(&writer.a, groups.len() as u32, subgroup_size)
}

fn run(module: &Assembler, groups: u32, subgroup_size: u32) -> Vec<&'static str> {
    let module = Arc::new(module.loaded());
    let program = Arc::new(lower(&module, &module.entry_points[0]).unwrap().unoptimized().unwrap());
    let plans = [ProgramPlan::new(&program)];
    let levels = Levels::default();
    let resources = Resources::default();
    let resources = (0..2).fold(resources, |resources, binding| {
        resources.bind(0, binding, Descriptor::Buffer(Buffer::zeroed(256)))
    });
    let mut sanitizer = Sanitizer::new(&plans, &levels).with_resources(&resources);
    let compute = Compute::new(program.clone()).unwrap().subgroup_size(subgroup_size).unwrap();
    compute.run_observed(&resources, [groups, 1, 1], &mut |_| (), &mut sanitizer).unwrap();
    races(sanitizer)
}

/// The rules about races that a sanitizer has seen broken.
pub(super) fn races(sanitizer: Sanitizer<'_>) -> Vec<&'static str> {
    let findings = sanitizer.into_findings();
    findings
        .iter()
        .map(|finding| finding.rule.id)
        .filter(|id| race::RULES.iter().any(|rule| rule.id == *id))
        .collect()
}

/// Runs tests, and compares what is told with their verdicts.
pub(super) fn check(tests: &[Litmus], memory: Memory) {
    let wrong = tests.iter().filter_map(|litmus| {
        let found = broken(litmus, memory);
        (found.is_empty() == litmus.races).then(|| format!("{}: {found:?}", litmus.name))
    });
    let wrong: Vec<String> = wrong.collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}
