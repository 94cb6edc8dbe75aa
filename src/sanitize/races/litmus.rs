//! Litmus tests: a few invocations with a few accesses each, and whether they race by the Vulkan
//! memory model. The verdicts of [`MODEL`] are those of the Khronos Group's formal model (the
//! repository Vulkan-MemoryModel, `alloy/tests`, by the names given here), those of [`SHARED`] of
//! the tests of shared memory in the Vulkan validation layers.
//!
//! Invocations run in their order, so of each test the execution is met in which the later one sees
//! what the earlier one has written.

use std::sync::Arc;

use rspirv::spirv::{MemoryAccess, MemorySemantics as Semantics, Op, Scope};

use crate::machine::{Buffer, Descriptor, Resources};
use crate::module::assemble::Assembler;
use crate::pipeline::Compute;
use crate::program::lower::lower;
use crate::sanitize::rule::race;
use crate::sanitize::{Levels, ProgramPlan, Sanitizer};

use Scope::{Device, QueueFamily, Workgroup};
use Step::{Add, AtomicLoad, AtomicStore, Barrier, Fence, Load, Store};

/// The variables of a test, each a word of its own.
const X: u32 = 0;
const Y: u32 = 1;
const Z: u32 = 2;

/// How a plain access takes part in communication.
#[derive(Clone, Copy, PartialEq)]
enum Privacy {
    Private,
    NonPrivate,
    /// Made available or visible by the access itself, in a scope.
    Within(Scope),
}
use Privacy::{NonPrivate, Private, Within};

const NONE: Semantics = Semantics::empty();
const ACQUIRE: Semantics = Semantics::ACQUIRE;
const RELEASE: Semantics = Semantics::RELEASE;
const BOTH: Semantics = Semantics::ACQUIRE_RELEASE;
const AVAILABLE: Semantics = Semantics::MAKE_AVAILABLE;
const VISIBLE: Semantics = Semantics::MAKE_VISIBLE;

/// What an invocation does.
#[derive(Clone, Copy)]
enum Step {
    Load(u32, Privacy),
    Store(u32, Privacy),
    AtomicLoad(u32, Scope, Semantics),
    AtomicStore(u32, Scope, Semantics),
    Add(u32, Scope, Semantics),
    Fence(Scope, Semantics),
    /// All invocations of the workgroup wait. It stands in each of them.
    Barrier(Semantics),
}

/// The invocations of a test by workgroup.
struct Litmus {
    name: &'static str,
    races: bool,
    groups: &'static [&'static [&'static [Step]]],
}

const fn litmus(name: &'static str, races: bool, groups: &'static [&'static [&'static [Step]]]) -> Litmus {
    Litmus { name, races, groups }
}

/// With the storage class of buffers.
const BUFFER: Semantics = Semantics::UNIFORM_MEMORY;
const IMAGE: Semantics = Semantics::IMAGE_MEMORY;
const ACQ: Semantics = ACQUIRE.union(BUFFER);
const REL: Semantics = RELEASE.union(BUFFER);
const ACQ_VIS: Semantics = ACQ.union(VISIBLE);
const REL_AV: Semantics = REL.union(AVAILABLE);

static MODEL: &[Litmus] = &[
    litmus("races", true, &[&[&[Store(X, Private), Store(X, Private)]], &[&[Store(X, Private)]]]),
    litmus(
        "mp",
        false,
        &[&[
            &[Store(X, Within(Device)), AtomicStore(Y, Workgroup, REL)],
            &[AtomicLoad(Y, Workgroup, ACQ), Load(X, Within(Device))],
        ]],
    ),
    litmus(
        "mp-no-avvis",
        true,
        &[&[
            &[Store(X, Private), AtomicStore(Y, Workgroup, REL)],
            &[AtomicLoad(Y, Workgroup, ACQ), Load(X, Private)],
        ]],
    ),
    litmus(
        "mp3",
        false,
        &[&[
            &[Store(X, Within(Device)), AtomicStore(Y, Workgroup, REL)],
            &[AtomicLoad(Y, Workgroup, ACQ), AtomicStore(Z, Workgroup, REL)],
            &[AtomicLoad(Z, Workgroup, ACQ), Load(X, Within(Device))],
        ]],
    ),
    litmus(
        "qfmp",
        false,
        &[
            &[&[Store(X, Within(QueueFamily)), AtomicStore(Y, QueueFamily, REL)]],
            &[&[AtomicLoad(Y, QueueFamily, ACQ), Load(X, Within(QueueFamily))]],
        ],
    ),
    litmus(
        "privmp",
        true,
        &[&[
            &[Store(X, Private), AtomicStore(Y, Workgroup, REL_AV)],
            &[AtomicLoad(Y, Workgroup, ACQ_VIS), Load(X, Private)],
        ]],
    ),
    litmus(
        "privwar",
        true,
        &[&[
            &[Load(X, Private), AtomicStore(Y, Workgroup, REL_AV)],
            &[AtomicLoad(Y, Workgroup, ACQ_VIS), Store(X, Private)],
        ]],
    ),
    litmus(
        "noncohwar",
        false,
        &[&[
            &[Load(X, NonPrivate), AtomicStore(Y, Workgroup, REL_AV)],
            &[AtomicLoad(Y, Workgroup, ACQ_VIS), Store(X, NonPrivate)],
        ]],
    ),
    litmus(
        "privpo",
        false,
        &[&[&[Load(X, Private), Store(X, Private), Load(X, Private), Store(X, NonPrivate)]]],
    ),
    litmus("noncohandatom", false, &[&[&[Store(Y, NonPrivate), Add(Y, Workgroup, NONE), Load(Y, Private)]]]),
    litmus(
        "noncohmpbar",
        false,
        &[
            &[&[Store(X, NonPrivate), Fence(Device, REL_AV), AtomicStore(Y, Device, NONE)]],
            &[&[AtomicLoad(Y, Device, NONE), Fence(Device, ACQ_VIS), Load(X, NonPrivate)]],
        ],
    ),
    litmus(
        "noncohmpfail",
        true,
        &[&[
            &[Store(X, NonPrivate), Store(Y, Within(Device)), AtomicStore(Z, Workgroup, REL)],
            &[AtomicLoad(Z, Workgroup, ACQ), Load(X, Within(Device))],
        ]],
    ),
    litmus(
        "noncohmpfail2",
        true,
        &[&[
            &[Store(X, NonPrivate), AtomicStore(Z, Workgroup, RELEASE.union(IMAGE).union(AVAILABLE))],
            &[AtomicLoad(Z, Workgroup, ACQ_VIS), Load(X, NonPrivate)],
        ]],
    ),
    litmus(
        "fencefence",
        false,
        &[&[
            &[Store(X, Within(Device)), Fence(Workgroup, REL), AtomicStore(Y, Workgroup, NONE)],
            &[AtomicLoad(Y, Workgroup, NONE), Fence(Workgroup, ACQ), Load(X, Within(Device))],
        ]],
    ),
    litmus(
        "fencefencebroken",
        true,
        &[
            &[&[Store(X, Within(Device)), Fence(Workgroup, REL), AtomicStore(Y, Device, NONE)]],
            &[&[AtomicLoad(Y, Device, NONE), Fence(Workgroup, ACQ), Load(X, Within(Device))]],
        ],
    ),
    litmus(
        "mpnotinscope1",
        false,
        &[
            &[&[AtomicStore(X, Workgroup, REL), AtomicStore(Y, Device, REL_AV)]],
            &[&[AtomicLoad(Y, Device, ACQ_VIS), AtomicLoad(X, Workgroup, ACQ)]],
        ],
    ),
    litmus(
        "mpnotinscope3",
        true,
        &[
            &[&[AtomicStore(X, Workgroup, REL_AV), AtomicStore(Y, Device, REL)]],
            &[&[AtomicLoad(Y, Device, ACQ), AtomicLoad(X, Workgroup, ACQ_VIS)]],
        ],
    ),
    litmus(
        "mpnotinscope5",
        true,
        &[
            &[&[Fence(Workgroup, REL_AV), AtomicStore(X, Workgroup, REL), AtomicStore(Y, Device, REL)]],
            &[&[AtomicLoad(Y, Device, ACQ), AtomicLoad(X, Workgroup, ACQ), Fence(Workgroup, ACQ_VIS)]],
        ],
    ),
    litmus(
        "sb2dv",
        true,
        &[
            &[&[AtomicStore(X, Workgroup, REL), AtomicLoad(Y, Device, ACQ)]],
            &[&[AtomicStore(Y, Workgroup, REL), AtomicLoad(X, Device, ACQ)]],
        ],
    ),
    litmus(
        "corr",
        false,
        &[
            &[&[AtomicStore(X, Device, NONE)]],
            &[&[AtomicStore(X, Device, NONE)]],
            &[&[AtomicLoad(X, Device, NONE), AtomicLoad(X, Device, NONE)]],
            &[&[AtomicLoad(X, Device, NONE), AtomicLoad(X, Device, NONE)]],
        ],
    ),
    litmus(
        "PC-bar-nonpriv",
        true,
        &[&[&[Load(X, NonPrivate), Barrier(NONE)], &[Barrier(NONE), Store(X, NonPrivate)]]],
    ),
    litmus(
        "PC-bar-acq-rel-priv",
        true,
        &[&[
            &[Load(X, Private), Barrier(BOTH.union(BUFFER))],
            &[Barrier(BOTH.union(BUFFER)), Store(X, Private)],
        ]],
    ),
    litmus(
        "PC-bar-acq-rel-nonpriv",
        false,
        &[&[
            &[Load(X, NonPrivate), Barrier(BOTH.union(BUFFER))],
            &[Barrier(BOTH.union(BUFFER)), Store(X, NonPrivate)],
        ]],
    ),
    litmus(
        "test5",
        false,
        &[
            &[
                &[Store(X, Within(Device)), AtomicStore(Y, Workgroup, REL)],
                &[AtomicLoad(Y, Workgroup, ACQ), AtomicStore(Z, Device, REL)],
            ],
            &[
                &[AtomicLoad(Z, Device, ACQ), AtomicStore(3, Workgroup, REL)],
                &[AtomicLoad(3, Workgroup, ACQ), Load(X, Within(Device))],
            ],
        ],
    ),
    litmus(
        "test12",
        false,
        &[&[
            &[Store(X, Within(Device)), Fence(Workgroup, REL), Barrier(NONE)],
            &[Barrier(NONE), Fence(Workgroup, ACQ), Load(X, Within(Device))],
        ]],
    ),
];

/// Shared memory, in which `barrier()` orders and atomic instructions race with plain ones.
static SHARED: &[Litmus] = &[
    litmus("SingleScalar", true, &[&[&[Store(X, Private)], &[Store(X, Private)]]]),
    litmus(
        "TwoThreadsShareValuesThroughArray",
        true,
        &[&[&[Store(X, Private), Load(Y, Private)], &[Store(Y, Private), Load(X, Private)]]],
    ),
    litmus(
        "TwoThreadsShareValuesThroughArray, barrier",
        false,
        &[&[
            &[Store(X, Private), Barrier(SHARED_BARRIER), Load(Y, Private)],
            &[Store(Y, Private), Barrier(SHARED_BARRIER), Load(X, Private)],
        ]],
    ),
    litmus(
        "TwoVariables",
        true,
        &[&[&[Store(X, Private), Store(Y, Private)], &[Store(Y, Private), Store(X, Private)]]],
    ),
    litmus(
        "TwoVariablesBarrier",
        false,
        &[&[
            &[Store(X, Private), Barrier(SHARED_BARRIER), Store(Y, Private)],
            &[Store(Y, Private), Barrier(SHARED_BARRIER), Store(X, Private)],
        ]],
    ),
    litmus("AtomicStoreAndStore", true, &[&[&[AtomicStore(X, Workgroup, NONE)], &[Store(X, Private)]]]),
    litmus("AtomicAddAndLoad", true, &[&[&[Add(X, Device, NONE)], &[Store(X, Private)]]]),
    litmus(
        "SingleScalar, atomic",
        false,
        &[&[&[AtomicStore(X, Workgroup, NONE)], &[AtomicStore(X, Workgroup, NONE)]]],
    ),
    litmus("SingleElementAccess", false, &[&[&[Store(X, Private)], &[Store(Y, Private)]]]),
    litmus("MultiLoad", false, &[&[&[Load(X, Private), Load(Y, Private)], &[Load(X, Private)]]]),
    litmus(
        "FirstLoadThenSameInvocationStore",
        false,
        &[&[
            &[
                Store(X, Private),
                Barrier(SHARED_BARRIER),
                Load(X, Private),
                Store(X, Private),
                Load(X, Private),
            ],
            &[
                Store(Y, Private),
                Barrier(SHARED_BARRIER),
                Load(Y, Private),
                Store(Y, Private),
                Load(Y, Private),
            ],
        ]],
    ),
    litmus(
        "OffenderIsOpLoadFromMultipleLoaders",
        true,
        &[&[&[Load(X, Private)], &[Load(X, Private)], &[Store(X, Private)]]],
    ),
];
/// What GLSL's `barrier()` has.
const SHARED_BARRIER: Semantics = BOTH.union(Semantics::WORKGROUP_MEMORY);

/// The memory of the variables.
#[derive(Clone, Copy, PartialEq)]
enum Memory {
    /// A buffer, with the Vulkan memory model.
    Buffer,
    /// Shared variables, with that of GLSL.
    Shared,
}

/// The module of a test. A shader has the code of all invocations, each behind a test of its
/// number, between the barriers.
struct Writer {
    a: Assembler,
    next: u32,
    memory: Memory,
    constants: Vec<(u32, u32)>,
}

impl Writer {
    fn id(&mut self) -> u32 {
        self.next += 1;
        self.next
    }

    /// The id of a constant, which is declared before the function.
    fn constant(&self, value: u32) -> u32 {
        self.constants.iter().find(|(known, _)| *known == value).expect("a declared constant").1
    }

    fn variable(&mut self, number: u32) -> u32 {
        let (pointer, index) = (self.id(), self.constant(number));
        let operands = match self.memory {
            Memory::Buffer => vec![24, pointer, 30, self.constant(0), index],
            Memory::Shared => vec![24, pointer, 30, index],
        };
        self.a.op(Op::AccessChain, &operands);
        pointer
    }

    /// The memory operands of an access.
    fn operands(&self, privacy: Privacy, propagates: MemoryAccess) -> Vec<u32> {
        let non_private = MemoryAccess::NON_PRIVATE_POINTER;
        match privacy {
            _ if self.memory == Memory::Shared => Vec::new(),
            Private => Vec::new(),
            NonPrivate => vec![non_private.bits()],
            Within(scope) => vec![(non_private | propagates).bits(), self.constant(scope as u32)],
        }
    }

    /// Uses a value, so that its load is no dead code.
    fn consume(&mut self, value: u32) {
        let pointer = self.id();
        let ty = if self.memory == Memory::Buffer { 24 } else { 25 };
        let operands = [ty, pointer, 31, self.constant(0), 50];
        self.a.op(Op::AccessChain, &operands);
        self.a.op(Op::Store, &[pointer, value]);
    }

    fn step(&mut self, step: Step) {
        let one = self.constant(1);
        match step {
            Load(variable, privacy) => {
                let (pointer, value) = (self.variable(variable), self.id());
                let operands = self.operands(privacy, MemoryAccess::MAKE_POINTER_VISIBLE);
                self.a.op(Op::Load, &[&[5, value, pointer][..], &operands].concat());
                self.consume(value);
            }
            Store(variable, privacy) => {
                let pointer = self.variable(variable);
                let operands = self.operands(privacy, MemoryAccess::MAKE_POINTER_AVAILABLE);
                // Each invocation its own value: one value would be another rule.
                self.a.op(Op::Store, &[&[pointer, 50][..], &operands].concat());
            }
            AtomicLoad(variable, scope, semantics) => {
                let (pointer, value) = (self.variable(variable), self.id());
                let [scope, semantics] = [scope as u32, semantics.bits()].map(|one| self.constant(one));
                self.a.op(Op::AtomicLoad, &[5, value, pointer, scope, semantics]);
                self.consume(value);
            }
            AtomicStore(variable, scope, semantics) => {
                let pointer = self.variable(variable);
                let [scope, semantics] = [scope as u32, semantics.bits()].map(|one| self.constant(one));
                self.a.op(Op::AtomicStore, &[pointer, scope, semantics, one]);
            }
            Add(variable, scope, semantics) => {
                let (pointer, value) = (self.variable(variable), self.id());
                let [scope, semantics] = [scope as u32, semantics.bits()].map(|one| self.constant(one));
                self.a.op(Op::AtomicIAdd, &[5, value, pointer, scope, semantics, one]);
            }
            Fence(scope, semantics) => {
                let operands = [scope as u32, semantics.bits()].map(|one| self.constant(one));
                self.a.op(Op::MemoryBarrier, &operands);
            }
            Barrier(_) => unreachable!("barriers stand between the invocations' code"),
        }
    }

    /// Code that one invocation executes.
    fn guarded(&mut self, invocation: u32, steps: &[Step]) {
        let [is_it, body, after] = [(); 3].map(|()| self.id());
        self.a.op(Op::IEqual, &[3, is_it, 50, self.constant(invocation)]);
        self.a.op(Op::SelectionMerge, &[after, 0]);
        self.a.op(Op::BranchConditional, &[is_it, body, after]);
        self.a.op(Op::Label, &[body]);
        steps.iter().for_each(|&step| self.step(step));
        self.a.op(Op::Branch, &[after]);
        self.a.op(Op::Label, &[after]);
    }
}

/// The constants of a test: indices, scopes and semantics.
fn constants(litmus: &Litmus) -> Vec<u32> {
    let mut all: Vec<u32> = (0..8).collect();
    for step in litmus.groups.iter().copied().flatten().copied().flatten() {
        match *step {
            AtomicLoad(_, scope, semantics) | AtomicStore(_, scope, semantics) | Add(_, scope, semantics) => {
                all.extend([scope as u32, semantics.bits()]);
            }
            Fence(scope, semantics) => all.extend([scope as u32, semantics.bits()]),
            Barrier(semantics) => all.push(semantics.bits()),
            Load(..) | Store(..) => {}
        }
    }
    all.sort_unstable();
    all.dedup();
    all
}

/// The rules about races that a test breaks.
fn broken(litmus: &Litmus, memory: Memory) -> Vec<&'static str> {
    const GLOBAL_INVOCATION_ID: u32 = 28;
    let size = litmus.groups.iter().map(|group| group.len()).max().unwrap_or(1) as u32;
    let mut a = Assembler::bare(1000);
    a.op(Op::Capability, &[1]);
    if memory == Memory::Buffer {
        a.op(Op::Capability, &[5345]);
        a.op(Op::Capability, &[5346]);
    }
    a.op(Op::MemoryModel, &[0, if memory == Memory::Buffer { 3 } else { 1 }]);
    a.with_string(Op::EntryPoint, &[5, 40], "main", &[30, 31, 32]);
    a.op(Op::ExecutionMode, &[40, 17, size, 1, 1]);
    a.op(Op::Decorate, &[32, 11, GLOBAL_INVOCATION_ID]);
    for (array, block, variable, binding) in [(20, 21, 30, 0), (26, 27, 31, 1)] {
        if memory == Memory::Shared && variable == 30 {
            continue;
        }
        a.op(Op::Decorate, &[array, 6, 4]);
        a.op(Op::Decorate, &[block, 2]);
        a.op(Op::MemberDecorate, &[block, 0, 35, 0]);
        a.op(Op::Decorate, &[variable, 34, 0]);
        a.op(Op::Decorate, &[variable, 33, binding]);
    }
    a.types();
    let mut writer = Writer { a, next: 100, memory, constants: Vec::new() };
    for value in constants(litmus) {
        let id = writer.id();
        writer.a.op(Op::Constant, &[5, id, value]);
        writer.constants.push((value, id));
    }
    let class = if memory == Memory::Buffer { 12 } else { 4 };
    let four = writer.constant(4);
    let a = &mut writer.a;
    if memory == Memory::Buffer {
        a.op(Op::TypeRuntimeArray, &[20, 5]);
        a.op(Op::TypeStruct, &[21, 20]);
        a.op(Op::TypePointer, &[22, class, 21]);
    } else {
        a.op(Op::TypeArray, &[20, 5, four]);
        a.op(Op::TypePointer, &[22, class, 20]);
    }
    a.op(Op::TypePointer, &[24, class, 5]);
    a.op(Op::Variable, &[22, 30, class]);
    a.op(Op::TypeRuntimeArray, &[26, 5]);
    a.op(Op::TypeStruct, &[27, 26]);
    a.op(Op::TypePointer, &[28, 12, 27]);
    if memory == Memory::Shared {
        a.op(Op::TypePointer, &[25, 12, 5]);
    }
    a.op(Op::Variable, &[28, 31, 12]);
    a.op(Op::TypeVector, &[33, 5, 3]);
    a.op(Op::TypePointer, &[34, 1, 33]);
    a.op(Op::Variable, &[34, 32, 1]);
    a.op(Op::Function, &[1, 40, 0, 2]);
    a.op(Op::Label, &[41]);
    a.op(Op::Load, &[33, 51, 32]);
    a.op(Op::CompositeExtract, &[5, 50, 51, 0]);
    // The parts of the invocations between the barriers.
    let mut parts: Vec<(u32, std::slice::Split<'_, Step, _>)> = Vec::new();
    let is_barrier = |step: &Step| matches!(step, Barrier(_));
    for (group, invocations) in (0..).zip(litmus.groups) {
        for (at, steps) in (0..).zip(*invocations) {
            parts.push((group * size + at, steps.split(is_barrier)));
        }
    }
    let all = litmus.groups.iter().copied().flatten();
    let waits = all.max_by_key(|steps| steps.iter().filter(|step| is_barrier(step)).count());
    let mut barriers = waits.copied().unwrap_or_default().iter().filter(|step| is_barrier(step));
    loop {
        for (invocation, rest) in &mut parts {
            if let Some(steps) = rest.next() {
                writer.guarded(*invocation, steps);
            }
        }
        let Some(Barrier(semantics)) = barriers.next() else { break };
        let operands = [2, 2, semantics.bits()].map(|one| writer.constant(one));
        writer.a.op(Op::ControlBarrier, &operands);
    }
    writer.a.op(Op::Return, &[]);
    writer.a.op(Op::FunctionEnd, &[]);
    run(&writer.a, litmus.groups.len() as u32)
}

fn run(module: &Assembler, groups: u32) -> Vec<&'static str> {
    let module = Arc::new(module.loaded());
    let program = Arc::new(lower(&module, &module.entry_points[0]).unwrap().unoptimized().unwrap());
    let plans = [ProgramPlan::new(&program)];
    let levels = Levels::default();
    let resources = Resources::default();
    let resources = (0..2).fold(resources, |resources, binding| {
        resources.bind(0, binding, Descriptor::Buffer(Buffer::zeroed(64)))
    });
    let mut sanitizer = Sanitizer::new(&plans, &levels).with_resources(&resources);
    let compute = Compute::new(program.clone()).unwrap();
    compute.run_observed(&resources, [groups, 1, 1], &mut |_| (), &mut sanitizer).unwrap();
    let findings = sanitizer.into_findings();
    findings
        .iter()
        .map(|finding| finding.rule.id)
        .filter(|id| race::RULES.iter().any(|rule| rule.id == *id))
        .collect()
}

fn check(tests: &[Litmus], memory: Memory) {
    let wrong = tests.iter().filter_map(|litmus| {
        let found = broken(litmus, memory);
        (found.is_empty() == litmus.races).then(|| format!("{}: {found:?}", litmus.name))
    });
    let wrong: Vec<String> = wrong.collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn verdicts_are_those_of_the_formal_model() {
    check(MODEL, Memory::Buffer);
}

#[test]
fn verdicts_on_shared_memory_are_those_of_the_validation_layers() {
    check(SHARED, Memory::Shared);
}
