//! Runs one entry point on one set of made-up values after the other.

use std::cell::OnceCell;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Instant;

use crate::accel::{RayFlags, TraceRay};
use crate::error::{ErrorKind, Result};
use crate::geometry::Ray;
use crate::harness::blocks::Blocks;
use crate::harness::smoke::fill::{FillContent, FillExtent, PlaceId, WideIntegers, region_of};
use crate::harness::smoke::hits::{self, SmokeGeometry};
use crate::harness::smoke::judge::Try;
use crate::harness::smoke::resources::{self, Given, MadeUpValues};
use crate::harness::smoke::sets::{LAUNCH, Set};
use crate::harness::smoke::watch::{BlockRecorder, Happened, StandIn};
use crate::harness::smoke::workgroups::groups;
use crate::harness::smoke::{SmokeOptions, specialized};
use crate::machine::{Invocation, LaunchLimits, Observer, TrapCode};
use crate::module::interface::{EntryPoint, InterfaceVariable, Stage};
use crate::module::ty::{Type, TypeId};
use crate::module::{Definition, Id, Module};
use crate::ops::pointer::storage;
use crate::pipeline::group::{Group, HitGroup};
use crate::pipeline::{Compute, Launch, Pipeline, PipelineObserver, RayOperands, SbtRecord, Trapped};
use crate::program::Program;
use crate::sanitize::rule::image::SAMPLER_MATCH;
use crate::sanitize::{Findings, Level, Levels, ProgramPlan, Sanitizer};

/// Lanes of a batch.
const LANES: usize = 64;
/// Null records of each shader binding table.
const RECORDS: usize = 1024;
/// Bytes of a hit record whose address a shader takes.
const RECORD_SIZE: usize = 256;
/// Addresses that one shader may be taught.
const MOST_ADDRESSES: usize = 256;
/// How many times as large resources may become where an access goes beyond them, and in which
/// steps.
const MOST_SCALE: u32 = 64;
const SCALE_STEP: u32 = 8;
/// Bytes beyond which an offset is not made good by a larger buffer.
const MOST_OFFSET: u64 = 1 << 24;
/// Sets of values that one shader is tried on at most, for one kind of geometry.
const MOST_SETS: usize = 48;
/// New seeds without a new block after which no more are tried.
const PATIENCE: u32 = 4;
/// That number while there is a trap that no run has got past.
const LONG_PATIENCE: u32 = 12;
/// How often the fuel of a shader is halved once it has run out of it.
const LESS_FUEL: u32 = 7;
/// What a run counts beside its operations: making up its values takes time, too.
const FUEL_OF_A_RUN: u64 = 1 << 14;
/// Bytes that are made up for a run without a count, and how many of those beyond count as one
/// operation.
const FREE_BYTES: u64 = 1 << 25;
const BYTES_OF_AN_OPERATION: u64 = 8;
/// By how much the time of launches becomes shorter once the clock has ended one: what else there
/// is to run the shader for must not take as long again.
const LESS_TIME: u32 = 4;
/// What a ray counts beside its operations.
const FUEL_OF_A_RAY: u64 = 1 << 7;

/// What a shader is run for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Way {
    /// A launch of a ray generation shader.
    Launch,
    /// A hit of geometry.
    Hit(SmokeGeometry),
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
    /// Its name in reports.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Launch => "launch",
            Self::Hit(kind) => kind.name(),
            Self::Box => SmokeGeometry::Aabb.name(),
            Self::Miss => "ray",
            Self::Call => "call",
            Self::Dispatch => "dispatch",
        }
    }
}

/// What the runs of an entry point have come to so far.
pub(super) struct Progress {
    /// The blocks that were entered.
    pub blocks: Blocks,
    /// The instructions that were executed, by their word offset.
    pub executed: BTreeSet<u32>,
    /// What happened, how often.
    pub happened: Happened,
    /// Sets of values that were tried.
    pub sets: u32,
    /// Operations that may still run.
    pub fuel: u64,
    /// When to stop whatever is still to be tried.
    pub deadline: Option<Instant>,
    /// Limits of each launch that is still to come.
    pub launch_limits: LaunchLimits,
    /// What kept further sets from being tried.
    pub cut_short: Option<&'static str>,
    /// What the sanitizer found.
    pub findings: Findings,
}

impl Progress {
    fn may_go_on(&mut self) -> bool {
        if self.cut_short.is_some() {
            return false;
        }
        if self.fuel == 0 {
            self.cut_short = Some("fuel");
        } else if self.deadline.is_some_and(|deadline| Instant::now() >= deadline) {
            self.cut_short = Some("time");
        }
        self.cut_short.is_none()
    }

    /// Notes that the clock ended a launch, which no fuel tells: what is costly is the operations,
    /// not how many there are, and with other values they would be as costly again.
    fn run_out_of_time(&mut self) {
        self.cut_short = Some("time");
        let LaunchLimits { timeout, batch_timeout, .. } = &mut self.launch_limits;
        for time in [timeout, batch_timeout].into_iter().flatten() {
            *time /= LESS_TIME;
        }
    }

    fn is_whole(&self) -> bool {
        self.blocks.entered() == self.blocks.all()
    }
}

/// The shader that is tested.
pub(super) struct EntryUnderTest<'a> {
    /// Its module.
    pub module: &'a Arc<Module>,
    /// Its entry point.
    pub entry: &'a EntryPoint,
    /// With the defaults of its specialization constants.
    pub program: Arc<Program>,
    /// With other values of them, made when they are needed; each with its constant in words.
    pub specialized: OnceCell<Vec<(String, Arc<Program>)>>,
    /// What it uses.
    pub variables: Vec<InterfaceVariable>,
    /// How to run it.
    pub options: SmokeOptions,
}

/// What was learned of a shader's memory while it ran.
#[derive(Default)]
struct Learned {
    known: BTreeMap<PlaceId, FillContent>,
    /// Factors of 8.
    scale_steps: u32,
    /// What was changed for which trap, in the run that goes on.
    mended: Option<(String, Box<Trapped>)>,
    /// The one kind of geometry that there is, where a shader needs it.
    geometry: Option<SmokeGeometry>,
    /// Whether it ran out of fuel: it has less of it from then on.
    is_spent: bool,
    /// Instructions, by their word offset, for which no resource is large enough.
    hopeless: BTreeSet<u32>,
    /// The instruction for which resources became larger last.
    larger_for: Option<u32>,
}

impl Learned {
    /// Goes back to resources of the first size where larger ones are larger than is allowed;
    /// whether there are larger ones.
    fn give_up_larger(&mut self) -> bool {
        let Some(offset) = self.larger_for.take().filter(|_| self.scale_steps > 0) else { return false };
        self.scale_steps = 0;
        self.mended = None;
        self.hopeless.insert(offset)
    }
}

impl EntryUnderTest<'_> {
    /// What it is run for.
    pub(super) fn ways(&self) -> Vec<Way> {
        match self.program.stage {
            Stage::ClosestHit | Stage::AnyHit => {
                SmokeGeometry::of_program(&self.program).into_iter().map(Way::Hit).collect()
            }
            Stage::Intersection => vec![Way::Box],
            Stage::Miss => vec![Way::Miss],
            Stage::Callable => vec![Way::Call],
            Stage::Compute => vec![Way::Dispatch],
            _ => vec![Way::Launch],
        }
    }

    /// Runs it on sets of values until every block was entered and it ran to its end, or new ones
    /// lead nowhere new; the first one at least.
    ///
    /// # Errors
    /// What making up its values reports.
    pub(super) fn explore(&self, way: Way, progress: &mut Progress) -> Result<Vec<Try>> {
        let mut tries: Vec<Try> = Vec::new();
        let mut learned = Learned::default();
        let mut dry = 0;
        for at in 0..MOST_SETS {
            let is_settled = Try::verdict(&tries).is_none();
            if at > 0 && (progress.is_whole() && is_settled || !progress.may_go_on()) {
                break;
            }
            let specialized = if at < Set::fixed(0) { &[][..] } else { self.specialized() };
            let patience = if is_settled { PATIENCE } else { LONG_PATIENCE };
            if at >= Set::fixed(specialized.len()) && dry >= patience {
                break;
            }
            let set = Set::nth(at, self.options.seed, specialized.len());
            let program = match set.specialization.checked_sub(1) {
                Some(other) => &specialized[other].1,
                None => &self.program,
            };
            let reached = |progress: &Progress| (progress.blocks.entered(), progress.executed.len());
            let before = reached(progress);
            let (one, values) = self.settle(way, program, set, &mut learned, progress)?;
            if at == 0 {
                self.check_unwatched(way, &one, values, &learned)?;
            }
            if self.options.sanitize {
                let found = self.sanitized(way, program, &one, values, &learned)?;
                progress.findings.extend(found);
            }
            dry = if reached(progress) > before || at < Set::fixed(specialized.len()) { 0 } else { dry + 1 };
            progress.sets += 1;
            tries.push(one);
        }
        Ok(tries)
    }

    /// The programs with other values of specialization constants.
    pub(super) fn specialized(&self) -> &[(String, Arc<Program>)] {
        self.specialized.get_or_init(|| specialized::programs(self.module, self.entry, &self.program))
    }

    /// Runs it until every address that it goes to leads somewhere, and no resource is too small
    /// that a larger one would do for.
    fn settle(
        &self,
        way: Way,
        program: &Arc<Program>,
        set: Set,
        learned: &mut Learned,
        progress: &mut Progress,
    ) -> Result<(Try, MadeUpValues)> {
        let mut wide = WideIntegers::Numbers;
        learned.geometry = None;
        loop {
            let extent = FillExtent {
                invocations: self.invocations(way, program)?,
                scale: SCALE_STEP.pow(learned.scale_steps),
            };
            let values = MadeUpValues { numbers: set.numbers, wide, extent };
            let scene = || hits::scene(learned.geometry);
            let given = match resources::given(program, &self.variables, values, &learned.known, &scene) {
                Err(error) if error.kind() == ErrorKind::UnsupportedModule && learned.give_up_larger() => {
                    continue;
                }
                given => given?,
            };
            let mut watch = BlockRecorder::new(program);
            let mut stand_in = StandIn::new(program, set.numbers);
            let fuel = self.options.fuel >> if learned.is_spent { LESS_FUEL } else { 0 };
            let limits = progress.launch_limits;
            let run = Once { way, program, given: &given, set, fuel, limits };
            let trapped = run.run(&mut stand_in, &mut watch)?;
            learned.is_spent |= trapped.as_ref().is_some_and(|trap| trap.code.is_limit());
            let is_late = trapped.as_ref().is_some_and(|trap| trap.code.is_of_clock());
            if is_late {
                progress.run_out_of_time();
            }
            let happened = stand_in.happened;
            let rays = (happened.traces + happened.ray_queries).saturating_mul(FUEL_OF_A_RAY);
            let made = given.made.saturating_sub(FREE_BYTES) / BYTES_OF_AN_OPERATION;
            progress.fuel = progress.fuel.saturating_sub(watch.spent + rays + made + FUEL_OF_A_RUN);
            let is_last = match &trapped {
                None => true,
                Some(_) if is_late => true,
                Some(trapped) => !self.learn(trapped, &given, learned, &mut wide, &mut progress.fuel),
            };
            if is_last {
                watch.add_to(&mut progress.blocks, &mut progress.executed);
                let sum = &mut progress.happened;
                sum.traces += happened.traces;
                sum.ray_queries += happened.ray_queries;
                sum.any_hits += happened.any_hits;
                sum.reports += happened.reports;
                let mended = learned.mended.take().filter(|_| trapped.is_none());
                return Ok((Try { set, trapped, passed: watch.passed(), mended }, values));
            }
        }
    }

    /// Learns from a trap what memory lacks; whether that was anything new.
    fn learn(
        &self,
        trapped: &Trapped,
        given: &Given,
        learned: &mut Learned,
        wide: &mut WideIntegers,
        fuel: &mut u64,
    ) -> bool {
        if *fuel == 0 {
            return false;
        }
        let lost = match trapped.code {
            TrapCode::NullPointer
            | TrapCode::AddressInvalid
            | TrapCode::AddressMisaligned
            | TrapCode::AddressOutOfBounds => true,
            TrapCode::AccelerationStructureMissing => self.addresses_structures(),
            _ => false,
        };
        let content = lost.then(|| self.content(trapped)).flatten();
        let place = region_of(trapped.fault_value).and_then(|region| *given.places.get(region)?);
        if let (Some(content), Some(place)) = (content, place)
            && learned.known.len() < MOST_ADDRESSES
        {
            return learned.known.insert(place, content).is_none();
        }
        let beyond = match trapped.code {
            TrapCode::BufferOutOfBounds | TrapCode::AddressOutOfBounds => {
                trapped.fault_value & u64::from(u32::MAX) < MOST_OFFSET
            }
            TrapCode::ImageOutOfBounds => true,
            TrapCode::DescriptorMissing | TrapCode::IndexOutOfBounds => self.has_runtime_descriptors(),
            _ => false,
        };
        if beyond && !learned.hopeless.contains(&trapped.offset) {
            if SCALE_STEP.pow(learned.scale_steps + 1) <= MOST_SCALE {
                learned.scale_steps += 1;
                learned.larger_for = Some(trapped.offset);
                let mended = || ("larger resources".to_owned(), Box::new(trapped.clone()));
                learned.mended.get_or_insert_with(mended);
                return true;
            }
            learned.scale_steps = 0;
            learned.hopeless.insert(trapped.offset);
        }
        let kind = match trapped.code {
            TrapCode::NotTriangle | TrapCode::RayQueryNotTriangle => Some(SmokeGeometry::Triangle),
            TrapCode::RayQueryNotAabb => Some(SmokeGeometry::Aabb),
            TrapCode::NotSphere => Some(SmokeGeometry::Sphere),
            TrapCode::NotLinearSweptSphere => Some(SmokeGeometry::Lss),
            _ => None,
        };
        if let (Some(kind), None) = (kind, learned.geometry) {
            learned.geometry = Some(kind);
            let mended = || (format!("no geometry but {}", kind.name()), Box::new(trapped.clone()));
            learned.mended.get_or_insert_with(mended);
            return true;
        }
        match (content, place) {
            (Some(_), None) if *wide == WideIntegers::Numbers => {
                *wide = WideIntegers::Addresses;
                true
            }
            // What is no address must not be as large as one: a count, say.
            _ if *wide == WideIntegers::Addresses && !learned.known.is_empty() && !lost => {
                *wide = WideIntegers::Known;
                true
            }
            _ => false,
        }
    }

    /// Whether the module makes acceleration structures of addresses.
    fn addresses_structures(&self) -> bool {
        const CONVERT: u16 = 4447;
        let functions = self.module.functions.iter();
        let blocks = functions.flat_map(|function| &function.blocks);
        blocks.flat_map(|block| &block.instructions).any(|instruction| instruction.opcode == CONVERT)
    }

    /// What the instruction that trapped expects behind its address.
    fn content(&self, trapped: &Trapped) -> Option<FillContent> {
        if trapped.code == TrapCode::AccelerationStructureMissing {
            return Some(FillContent::Structure);
        }
        let module = &**self.module;
        let functions = module.functions.iter().flat_map(|function| &function.blocks);
        let mut instructions = functions.flat_map(|block| &block.instructions);
        let instruction = instructions.find(|instruction| instruction.offset == trapped.offset)?;
        let pointers = module.operand_ids(instruction).into_iter();
        let mut found = pointers.filter_map(|id| physical_pointer(module, base(module, id)));
        found.next().map(FillContent::Pointer)
    }

    /// Whether there are arrays of descriptors without a length.
    fn has_runtime_descriptors(&self) -> bool {
        let arrays = self.variables.iter().filter(|variable| variable.binding.is_some());
        let mut types = arrays.filter_map(|variable| variable.ty);
        types.any(|ty| matches!(self.module.ty(ty), Type::RuntimeArray { .. }))
    }

    /// Invocations along each axis.
    fn invocations(&self, way: Way, program: &Arc<Program>) -> Result<[u32; 3]> {
        if way != Way::Dispatch {
            return Ok(LAUNCH);
        }
        let size = Compute::new(program.clone())?.workgroup_size();
        let groups = groups(&program.module, size, true);
        Ok([0, 1, 2].map(|axis| size[axis].saturating_mul(groups[axis])))
    }

    /// Runs it once more without observers, in its optimised form, which must end alike.
    fn check_unwatched(
        &self,
        way: Way,
        watched: &Try,
        values: MadeUpValues,
        learned: &Learned,
    ) -> Result<()> {
        // What ends only for want of fuel takes long enough.
        if learned.is_spent {
            return Ok(());
        }
        let (program, scene) = (&self.program, || hits::scene(learned.geometry));
        let given = resources::given(program, &self.variables, values, &learned.known, &scene)?;
        let mut stand_in = StandIn::new(program, watched.set.numbers);
        let (fuel, limits) = (self.options.fuel, self.options.launch_limits);
        let run = Once { way, program, given: &given, set: watched.set, fuel, limits };
        let trapped = run.run(&mut stand_in, &mut ())?;
        // The clock is no part of what a shader does.
        if trapped.as_ref().is_some_and(|trap| trap.code.is_of_clock()) {
            return Ok(());
        }
        let end = |trapped: &Option<Box<Trapped>>| trapped.as_ref().map(|trap| (trap.code, trap.offset));
        let (watched, unwatched) = (end(&watched.trapped), end(&trapped));
        assert_eq!(
            watched, unwatched,
            "bug in anyhit: optimised, the shader does not end as it does otherwise"
        );
        Ok(())
    }
}

impl EntryUnderTest<'_> {
    /// What the sanitizer finds in a run on a set of values that was tried.
    fn sanitized(
        &self,
        way: Way,
        program: &Arc<Program>,
        tried: &Try,
        values: MadeUpValues,
        learned: &Learned,
    ) -> Result<Findings> {
        // What ends for want of fuel takes long enough.
        if learned.is_spent {
            return Ok(Findings::default());
        }
        let program = &Arc::new(program.unoptimized()?);
        let scene = || hits::scene(learned.geometry);
        let given = resources::given(program, &self.variables, values, &learned.known, &scene)?;
        let mut stand_in = StandIn::new(program, tried.set.numbers);
        let (fuel, limits) = (self.options.fuel, self.options.launch_limits);
        let run = Once { way, program, given: &given, set: tried.set, fuel, limits };
        // The inputs may be such that the shader never gets: nothing is denied.
        let mut levels = Levels::default();
        levels.set_all(Level::Warn);
        // The made-up samplers are of all kinds at once.
        levels.set(SAMPLER_MATCH.id, Level::Allow)?;
        let plans = [ProgramPlan::new(program)];
        let mut sanitizer = Sanitizer::new(&plans, &levels);
        run.run(&mut stand_in, &mut sanitizer)?;
        Ok(sanitizer.into_findings().with_note("on made-up inputs"))
    }
}

/// One run.
struct Once<'a> {
    way: Way,
    program: &'a Arc<Program>,
    given: &'a Given,
    set: Set,
    fuel: u64,
    limits: LaunchLimits,
}

impl Once<'_> {
    /// Where it trapped.
    fn run<O: Observer<1> + Observer<LANES>>(
        &self,
        stand_in: &mut StandIn<'_>,
        observer: &mut O,
    ) -> Result<Option<Box<Trapped>>> {
        let &Self { way, program, given, set, fuel, limits } = self;
        if let Way::Dispatch = way {
            let compute = Compute::new(program.clone())?.fuel(fuel).launch_limits(limits);
            let groups = groups(&program.module, compute.workgroup_size(), set.launch_size == LAUNCH);
            if !<O as Observer<LANES>>::is_active() {
                return Ok(compute.run_to_trap::<LANES>(&given.resources, groups, &|_| ())?.err());
            }
            let mut event = |event| stand_in.event(event);
            return Ok(compute.run_to_trap_observed(&given.resources, groups, &mut event, observer)?.err());
        }
        let mut builder = Pipeline::builder();
        builder = builder.fuel(fuel).launch_limits(limits);
        let shader = builder.shader(program.clone());
        let data = |group| SbtRecord::with_data(group, &given.record);
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
        // A handle of a record needs one: of a group without shaders, so that the stand-in answers.
        let hit = match program.addresses_records {
            true => {
                Some(SbtRecord::with_data(builder.group(Group::Hit(HitGroup::default()))?, &[0; RECORD_SIZE]))
            }
            false => None,
        };
        let sbt = builder.sbt();
        sbt.hit.resize_with(RECORDS, || hit.clone());
        sbt.miss.resize_with(RECORDS, || None);
        sbt.callable.resize_with(RECORDS, || None);
        let pipeline = builder.build()?;
        let launch = Launch { pipeline: &pipeline, resources: &given.resources };
        let mut invocation = Invocation {
            launch_size: set.launch_size,
            record: SbtRecord::with_data(0, &given.record).shader_record(),
            depth: 1,
            ..Invocation::default()
        };
        let ended = match way {
            Way::Launch => launch.run_single_threaded::<LANES, _, _>(set.launch_size, stand_in, observer)?,
            Way::Box => {
                let operands = RayOperands::from(hits::ray(set.behind));
                launch.trace_single::<LANES, _, _>(&hits::one_box()?, operands, stand_in, observer)?
            }
            Way::Hit(kind) => {
                let (hit, trace, t) = kind.hit(set.behind)?;
                (invocation.hit, invocation.trace, invocation.t_max) = (Some(hit), Some(trace), t);
                let attributes = match (&invocation.hit, kind) {
                    (_, SmokeGeometry::Aabb) | (None, _) => given.attributes.clone(),
                    (Some(hit), _) => hit.candidate.intersection.attributes.map(f32::to_bits).to_vec(),
                };
                launch.invoke::<LANES, _, _>(
                    shader,
                    invocation,
                    &given.payload,
                    &attributes,
                    stand_in,
                    observer,
                )?
            }
            Way::Miss => {
                let ray = Ray::new([0.25, 0.5, 3.0], [0.6, 0.0, 0.8]).with_interval(0.0, 1000.0);
                let trace = TraceRay { ray, flags: RayFlags(0), cull_mask: 0xFF, time: 0.0 };
                (invocation.trace, invocation.t_max) = (Some(trace), ray.t_max);
                launch.invoke::<LANES, _, _>(shader, invocation, &given.payload, &[], stand_in, observer)?
            }
            Way::Call | Way::Dispatch => {
                launch.invoke::<LANES, _, _>(shader, invocation, &given.payload, &[], stand_in, observer)?
            }
        };
        Ok(ended.err())
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
