//! Smoke tests: every entry point of a module, run once on made-up inputs.
//!
//! What a shader would find bound is made up from what it declares, from one seed: integers are 0 to
//! 3, floats lie in [0, 1), matrices are the identity; runtime arrays have 1024 elements, arrays of
//! descriptors 16, images 16 texels a side and all their levels. Pointers lead to memory of what
//! they point to. A 64-bit integer or a pair of 32-bit ones becomes an address where the shader is
//! seen to go to memory through it: the run is repeated until every address leads somewhere.
//!
//! A ray generation shader is launched over 8 x 4 invocations, a compute shader dispatched in 2 x 2
//! workgroups. Closest-hit and any-hit shaders see a
//! hit of each kind of geometry that they may be called for, intersection shaders a box, miss
//! shaders a ray. Where a shader traces, the ray really is traced through a scene with all kinds of
//! primitives; in the place of the shaders that are not there, the payload is filled like all else,
//! one time in four as by a miss (floats -1, integers 0). So are callable data.
//!
//! Where these values make a shader trap, it is given others: another seed, then a launch of one
//! invocation, at last also all integers 0 or all 1. If one of these runs to its end, the result is
//! ok with a note.

mod fill;
mod hits;
mod report;
mod resources;

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use crate::accel::{RayFlags, TraceRay};
use crate::error::{Error, ErrorKind, Result};
use crate::geometry::Ray;
use crate::harness::smoke::fill::{Content, Integers, Numbers, Wide, region_of};
use crate::harness::smoke::hits::Kind;
use crate::harness::smoke::resources::{Given, Values};
use crate::machine::{Invocation, TrapCode};
use crate::module::interface::{EntryPoint, InterfaceVariable, Stage};
use crate::module::ty::{Type, TypeId};
use crate::module::{Definition, Id, Module};
use crate::ops::pointer::storage;
use crate::pipeline::group::{Group, HitGroup};
use crate::pipeline::{
    Caller, Compute, Event, Launch, Pipeline, RayOperands, Record, Shader, Trapped, Witness,
};
use crate::program::{self, Program, obstacles};

pub use report::{EntryReport, Report, Run, TrapReport, Verdict};

/// Invocations of a ray generation shader.
const LAUNCH: [u32; 3] = [8, 4, 1];
/// Workgroups of a compute shader.
const GROUPS: [u32; 3] = [2, 2, 1];
/// Invocations of a workgroup that is dispatched once only.
const LARGE: u64 = 1024;
/// Lanes of a batch.
const LANES: usize = 64;
/// Null records of each shader binding table.
const RECORDS: usize = 1024;
/// Addresses that one shader may be taught.
const MOST_ADDRESSES: usize = 256;

/// How to run a smoke test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// The seed of all values.
    pub seed: u64,
    /// Operations that an invocation may spend at back edges and calls.
    pub budget: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self { seed: 1, budget: 1 << 18 }
    }
}

/// Runs every entry point of a module once.
///
/// ```
/// use anyhit::Module;
/// use anyhit::harness::smoke::{self, Options};
///
/// # fn main() -> anyhit::Result<()> {
/// let module = Module::open("spirv-fixtures/pass/sphere/closest-hit/main.rchit.spv")?;
/// let report = smoke::run(&module, Options::default());
/// assert!(report.is_ok(), "{}", report.text());
/// assert_eq!(report.entry_points[0].runs[0].with, "sphere");
/// # Ok(())
/// # }
/// ```
pub fn run(module: &Arc<Module>, options: Options) -> Report {
    let entries = module.entry_points.iter();
    Report {
        seed: options.seed,
        entry_points: entries.map(|entry| entry_point(module, entry, options)).collect(),
    }
}

fn entry_point(module: &Arc<Module>, entry: &EntryPoint, options: Options) -> EntryReport {
    let mut report = EntryReport {
        name: entry.name.clone(),
        stage: entry.stage.name(),
        result: Verdict::Ok,
        reasons: Vec::new(),
        runs: Vec::new(),
    };
    let lowered = guarded(|| program::lower(module, entry));
    let program = match lowered {
        Ok(Ok(program)) => Arc::new(program),
        Ok(Err(error)) => {
            report.result = match (entry.stage, error.kind()) {
                (Stage::Other(_), _) => Verdict::OutOfScope,
                (_, ErrorKind::InvalidModule) => Verdict::Invalid,
                _ => Verdict::Unsupported,
            };
            report.reasons = obstacles(module, entry, &error);
            return report;
        }
        Err(bug) => {
            report.result = Verdict::Bug;
            report.reasons.push(bug);
            return report;
        }
    };
    let shader = Subject { variables: module.interface_of(entry), program, options };
    for way in shader.ways() {
        let run = match guarded(|| shader.run(way)) {
            Ok(Ok(run)) => run,
            Ok(Err(error)) => {
                report.reasons.push(error.to_string());
                Run { with: way.name(), result: verdict(&error), trap: None, note: None }
            }
            Err(bug) => {
                report.reasons.push(bug);
                Run { with: way.name(), result: Verdict::Bug, trap: None, note: None }
            }
        };
        report.result = report.result.max(run.result);
        report.runs.push(run);
    }
    report
}

fn verdict(error: &Error) -> Verdict {
    match error.kind() {
        ErrorKind::UnsupportedModule => Verdict::Unsupported,
        ErrorKind::InvalidModule => Verdict::Invalid,
        _ => Verdict::Bug,
    }
}

/// Keeps a panic from ending the whole test: it is a bug, but of one entry point.
fn guarded<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("a panic");
        format!("bug in anyhit: {}", text.trim_start_matches("bug in anyhit: "))
    })
}

/// What a shader is run for.
#[derive(Clone, Copy, Debug)]
enum Way {
    /// A launch of a ray generation shader.
    Launch,
    /// A hit of geometry.
    Hit(Kind),
    /// A box, for an intersection shader.
    Box,
    /// A ray that hit nothing.
    Miss,
    /// A call.
    Call,
    /// A dispatch of a compute shader.
    Dispatch,
}

impl Way {
    fn name(self) -> &'static str {
        match self {
            Self::Launch => "launch",
            Self::Hit(kind) => kind.name(),
            Self::Box => Kind::Aabb.name(),
            Self::Miss => "ray",
            Self::Call => "call",
            Self::Dispatch => "dispatch",
        }
    }
}

/// The shader that is tested.
struct Subject {
    program: Arc<Program>,
    variables: Vec<InterfaceVariable>,
    options: Options,
}

/// How a run ended.
enum End {
    Done,
    Trapped(Box<Trapped>),
}

impl Subject {
    fn ways(&self) -> Vec<Way> {
        match self.program.stage {
            Stage::ClosestHit | Stage::AnyHit => {
                Kind::of_program(&self.program).into_iter().map(Way::Hit).collect()
            }
            Stage::Intersection => vec![Way::Box],
            Stage::Miss => vec![Way::Miss],
            Stage::Callable => vec![Way::Call],
            Stage::Compute => vec![Way::Dispatch],
            _ => vec![Way::Launch],
        }
    }

    /// Runs it with one choice of values after the other, until it runs to its end.
    fn run(&self, way: Way) -> Result<Run> {
        let seed = self.options.seed;
        let next = seed.wrapping_add(1);
        let choices = [
            (LAUNCH, seed, Integers::Small, String::new()),
            (LAUNCH, next, Integers::Small, format!("with the values of seed {next}")),
            ([1; 3], seed, Integers::Small, "as a launch of one invocation".to_owned()),
            ([1; 3], seed, Integers::All(0), "as a launch of one invocation with all integers 0".to_owned()),
            ([1; 3], seed, Integers::All(1), "as a launch of one invocation with all integers 1".to_owned()),
        ];
        let mut first: Option<Trapped> = None;
        for (launch_size, seed, integers, words) in choices {
            match (self.settle(way, launch_size, seed, integers)?, &first) {
                (End::Done, None) => return Ok(self.ended(way, Verdict::Ok, None, None)),
                (End::Done, Some(trapped)) => {
                    let note =
                        format!("ran to its end {words}; seed {}: {}", self.options.seed, trapped.error);
                    return Ok(self.ended(way, Verdict::Ok, None, Some(note)));
                }
                (End::Trapped(trapped), None) => first = Some(*trapped),
                (End::Trapped(_), Some(_)) => {}
            }
        }
        let trap = first.map(|trapped| TrapReport::of(&trapped.error, trapped.offset));
        Ok(self.ended(way, Verdict::Trap, trap, None))
    }

    fn ended(&self, way: Way, result: Verdict, trap: Option<TrapReport>, note: Option<String>) -> Run {
        Run { with: way.name(), result, trap, note }
    }

    /// Runs it until every address that it goes to leads somewhere.
    fn settle(&self, way: Way, launch_size: [u32; 3], seed: u64, integers: Integers) -> Result<End> {
        let mut known = BTreeMap::new();
        let mut wide = Wide::Numbers;
        loop {
            let values = Values { launch_size, seed, integers, wide };
            let given = resources::given(&self.program, &self.variables, values, &known, &hits::scene)?;
            let End::Trapped(trapped) = self.once(way, &given, values)? else { return Ok(End::Done) };
            let lost = match trapped.code {
                TrapCode::NullPointer
                | TrapCode::AddressInvalid
                | TrapCode::AddressMisaligned
                | TrapCode::AddressOutOfBounds => true,
                TrapCode::AccelerationStructureMissing => self.addresses_structures(),
                _ => false,
            };
            let content = lost.then(|| self.content(&trapped)).flatten();
            let place = region_of(trapped.asked).and_then(|region| *given.places.get(region)?);
            match (content, place) {
                (Some(content), Some(place)) if known.len() < MOST_ADDRESSES => {
                    known.insert(place, content);
                }
                (Some(_), None) if wide == Wide::Numbers => wide = Wide::Addresses,
                // What is no address must not be as large as one: a count, say.
                _ if wide == Wide::Addresses && !known.is_empty() && !lost => {
                    let values = Values { wide: Wide::Numbers, ..values };
                    let given =
                        resources::given(&self.program, &self.variables, values, &known, &hits::scene)?;
                    return self.once(way, &given, values);
                }
                _ => return Ok(End::Trapped(trapped)),
            }
        }
    }

    /// Whether the module makes acceleration structures of addresses.
    fn addresses_structures(&self) -> bool {
        const CONVERT: u16 = 4447;
        let functions = self.program.module.functions.iter();
        let blocks = functions.flat_map(|function| &function.blocks);
        blocks.flat_map(|block| &block.instructions).any(|instruction| instruction.opcode == CONVERT)
    }

    /// What the instruction that trapped expects behind its address.
    fn content(&self, trapped: &Trapped) -> Option<Content> {
        if trapped.code == TrapCode::AccelerationStructureMissing {
            return Some(Content::Structure);
        }
        let module = &*self.program.module;
        let functions = module.functions.iter().flat_map(|function| &function.blocks);
        let mut instructions = functions.flat_map(|block| &block.instructions);
        let instruction = instructions.find(|instruction| instruction.offset == trapped.offset)?;
        let pointers = module.operand_ids(instruction).into_iter();
        let mut found = pointers.filter_map(|id| physical_pointer(module, base(module, id)));
        found.next().map(Content::Pointer)
    }

    fn once(&self, way: Way, given: &Given, values: Values) -> Result<End> {
        if let Way::Dispatch = way {
            let compute = Compute::new(self.program.clone())?.budget(self.options.budget);
            let each = compute.workgroup_size().iter().map(|&side| u64::from(side)).product::<u64>();
            let several = values.launch_size == LAUNCH && each <= LARGE;
            let groups = if several { GROUPS } else { [1; 3] };
            let ended = compute.run_alone::<LANES>(&given.resources, groups, &|_| ());
            return Ok(ended.map_or_else(End::Trapped, |_| End::Done));
        }
        let mut builder = Pipeline::builder();
        builder.budget(self.options.budget);
        let shader = builder.shader(self.program.clone());
        let data = |group| Record::with_data(group, &given.record);
        match way {
            Way::Launch => {
                let group = builder.group(Group::General(shader))?;
                builder.sbt().ray_generation = Some(data(group));
            }
            Way::Box => {
                let group = HitGroup { intersection: Some(shader), ..HitGroup::default() };
                let group = builder.group(Group::Hit(group))?;
                builder.sbt().hit.push(Some(data(group)));
            }
            _ => {}
        }
        let sbt = builder.sbt();
        sbt.hit.resize_with(RECORDS, || None);
        sbt.miss.resize_with(RECORDS, || None);
        sbt.callable.resize_with(RECORDS, || None);
        let pipeline = builder.build()?;
        let launch = Launch { pipeline: &pipeline, resources: &given.resources };
        let mut stand_in = StandIn {
            program: &self.program,
            numbers: Numbers::new(values.seed.wrapping_add(1 << 32), values.integers),
        };
        let mut invocation = Invocation {
            launch_size: values.launch_size,
            record: Record::with_data(0, &given.record).shader_record(),
            depth: 1,
            ..Invocation::default()
        };
        let ended = match way {
            Way::Launch => launch.run_alone::<LANES, _>(values.launch_size, &mut stand_in),
            Way::Box => {
                let operands = RayOperands::from(hits::ray());
                launch.trace_alone::<LANES, _>(&hits::one_box()?, operands, &mut stand_in)
            }
            Way::Hit(kind) => {
                let (hit, trace, t) = kind.hit()?;
                (invocation.hit, invocation.trace, invocation.t_max) = (Some(hit), Some(trace), t);
                let attributes = match (&invocation.hit, kind) {
                    (_, Kind::Aabb) | (None, _) => given.attributes.clone(),
                    (Some(hit), _) => hit.candidate.intersection.attributes.map(f32::to_bits).to_vec(),
                };
                launch.invoke::<LANES, _>(shader, invocation, &given.payload, &attributes, &mut stand_in)
            }
            Way::Miss => {
                let ray = Ray::new([0.25, 0.5, 3.0], [0.6, 0.0, 0.8]).with_interval(0.0, 1000.0);
                let trace = TraceRay { ray, flags: RayFlags(0), cull_mask: 0xFF, time: 0.0 };
                (invocation.trace, invocation.t_max) = (Some(trace), ray.t_max);
                launch.invoke::<LANES, _>(shader, invocation, &given.payload, &[], &mut stand_in)
            }
            Way::Call | Way::Dispatch => {
                launch.invoke::<LANES, _>(shader, invocation, &given.payload, &[], &mut stand_in)
            }
        };
        Ok(ended.map_or_else(End::Trapped, |_| End::Done))
    }
}

/// The pointer that a chain of access chains begins with.
fn base(module: &Module, mut id: Id) -> Id {
    // OpAccessChain, OpInBoundsAccessChain, OpPtrAccessChain, OpInBoundsPtrAccessChain
    const CHAINS: [u16; 4] = [65, 66, 67, 70];
    while let Some(Definition::Result(function, block, at)) = module.definition(id) {
        let block = &module.functions[function as usize].blocks[block as usize];
        let instruction = &block.instructions[at as usize];
        match module.operands(instruction).first() {
            Some(&from) if CHAINS.contains(&instruction.opcode) => id = Id(from),
            _ => break,
        }
    }
    id
}

/// The type of an id that is a pointer to device memory.
fn physical_pointer(module: &Module, id: Id) -> Option<TypeId> {
    let ty = module.type_of(id)?;
    let physical = storage::PHYSICAL_STORAGE_BUFFER;
    matches!(module.ty(ty), Type::Pointer { storage_class, .. } if *storage_class == physical).then_some(ty)
}

/// Answers in the place of the shaders that are not there.
struct StandIn<'a> {
    program: &'a Program,
    numbers: Numbers,
}

impl Witness for StandIn<'_> {
    const ACTIVE: bool = true;

    fn event(&mut self, _event: Event) {}

    fn absent(&mut self, caller: Caller, words: &mut [u32]) {
        let rows = self.program.interface.iter().find(|rows| rows.first == caller.payload);
        let Some(rows) = rows.filter(|_| caller.shader == Shader(0)) else { return };
        let answer = resources::answer(&self.program.module, rows, &mut self.numbers);
        words.iter_mut().zip(answer).for_each(|(to, word)| *to = word);
    }
}
