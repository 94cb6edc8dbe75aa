//! Perturbed runs: every float result moved at random within what a device may give.

use std::collections::{BTreeMap, HashMap, HashSet};

use crate::accel::Committed;
use crate::debug::session::SettledRequest;
use crate::error::{Error, ErrorKind, Result};
use crate::harness::expect::Observed;
use crate::harness::run::{found, fresh, look};
use crate::harness::stability::allowed::{self, Envelope, NVIDIA_T};
use crate::harness::stability::calculate::{Draw, Random, mixed};
use crate::harness::stability::outputs::{Comparison, Unstable};
use crate::harness::stability::place::{Programs, Spot};
use crate::harness::stability::probe::{self, Part, Probe};
use crate::harness::stability::shadow::branch_offsets;
use crate::harness::stability::shadows::{bits, float};
use crate::machine::{Batch, Bindings, Reg};
use crate::module::Module;
use crate::ops::lane_kernel::LaneKernel;
use crate::ops::memory;
use crate::ops::op::Op;
use crate::ops::ray_query;
use crate::pipeline::Event;
use crate::program::{Program, Terminator};
use crate::scene::{Assembled, ResolvedScene};

/// How runs are perturbed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Perturbation {
    /// The number of runs.
    pub runs: u32,
    /// What the random numbers depend on, and nothing else: the order of threads does not matter.
    pub seed: u64,
    /// How far results are moved.
    pub envelope: Envelope,
    /// How far floats of the outputs may differ: as a share of the value, or absolutely below 1.
    pub tolerance: f64,
}

impl Default for Perturbation {
    fn default() -> Self {
        Self { runs: 16, seed: 1, envelope: Envelope::Vulkan, tolerance: 0.01 }
    }
}

/// What kind of decision went another way.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Where {
    /// A branch or switch.
    Branch,
    /// What a traced ray hits.
    Hit,
}

/// What was not the same in every run.
#[derive(Clone, Debug, Default)]
pub struct Instability {
    /// How runs were perturbed.
    pub perturbation: Perturbation,
    /// How many outputs there are.
    pub outputs_seen: usize,
    /// Outputs that differ by more than the tolerance.
    pub outputs: Vec<Unstable>,
    /// Where invocations first went another way than without perturbation, and how many did.
    pub branches: BTreeMap<(Spot, Where), u64>,
    /// Runs that trapped, from 1.
    pub traps: Vec<(u32, Error)>,
}

impl Instability {
    /// Whether every output was the same in every run.
    pub fn is_stable(&self) -> bool {
        self.outputs.is_empty() && self.traps.is_empty()
    }
}

/// Runs a scene's launch and dispatches again and again, each time on a copy of its resources.
///
/// # Errors
/// The trap of the run without perturbation; `UnsupportedModule` where invocations cannot run one
/// by one.
pub fn perturb(
    scene: &ResolvedScene,
    assembled: &Assembled,
    perturbation: &Perturbation,
) -> Result<Instability> {
    let plan = Plan::new(scene, assembled, perturbation);
    let run = |number: u32, reference: Option<&Ways>| {
        let resources = fresh(&assembled.resources);
        let mut seen = Seen::default();
        let new = |_| Mover::new(&plan, number, reference);
        let outcome = probe::run(assembled, &resources, &new, &mut |mover: Mover<'_>| seen.add(mover));
        let mut observed = Observed::default();
        look(scene, &resources, &mut observed);
        (observed, seen, outcome)
    };
    all(scene, assembled, &plan, &run)
}

/// Perturbs one ray or one invocation of ray generation.
///
/// # Errors
/// As [`perturb`], and where the ray does not fit the scene.
pub fn perturb_one(
    scene: &ResolvedScene,
    assembled: &Assembled,
    which: &SettledRequest,
    perturbation: &Perturbation,
) -> Result<Instability> {
    let plan = Plan::new(scene, assembled, perturbation);
    let run = |number: u32, reference: Option<&Ways>| {
        let resources = fresh(&assembled.resources);
        let (mut seen, mut events) = (Seen::default(), Vec::new());
        let mover = Mover::new(&plan, number, reference);
        let mut event = |event: Event| events.push(event);
        let outcome = probe::one(scene, assembled, &resources, which, mover, &mut event);
        let outcome = outcome.and_then(|(mover, outcome)| {
            seen.add(mover);
            outcome
        });
        let mut observed = Observed::default();
        observed.rays.push((None, Ok(found(&assembled.pipeline, &events))));
        look(scene, &resources, &mut observed);
        (observed, seen, outcome)
    };
    all(scene, assembled, &plan, &run)
}

/// A run: what it left, which ways it went, and how it ended. Run 0 moves nothing.
type Run<'r> = dyn Fn(u32, Option<&Ways>) -> (Observed, Seen, Result<()>) + 'r;

fn all(scene: &ResolvedScene, assembled: &Assembled, plan: &Plan, run: &Run<'_>) -> Result<Instability> {
    let mut before = Observed::default();
    look(scene, &fresh(&assembled.resources), &mut before);
    let (reference, ways, outcome) = run(0, None);
    outcome?;
    let mut comparison = Comparison::new(assembled, &reference, plan.perturbation.tolerance);
    let mut found = Instability {
        perturbation: plan.perturbation,
        outputs_seen: comparison.outputs(&before),
        ..Instability::default()
    };
    for number in 1..=plan.perturbation.runs {
        let (observed, seen, outcome) = run(number, Some(&ways.ways));
        for ((shader, offset, kind), count) in seen.parted {
            *found.branches.entry((plan.programs.spot(shader, offset), kind)).or_default() += count;
        }
        match outcome {
            Ok(()) => comparison.add(number, &observed),
            Err(error) if error.kind() == ErrorKind::Trap => found.traps.push((number, error)),
            Err(error) => return Err(error),
        }
    }
    found.outputs = comparison.unstable();
    Ok(found)
}

/// What is known before anything runs.
struct Plan {
    programs: Programs,
    perturbation: Perturbation,
    shaders: Vec<Shader>,
}

/// What is known of a shader.
struct Shader {
    /// The word offset of the branch that ends each block.
    branches: Vec<u32>,
    /// Word offsets of instructions decorated `NoContraction`.
    no_contraction: HashSet<u32>,
    /// Widths whose results are rounded to nearest (`RoundingModeRTE`), as a mask.
    nearest: u32,
    /// Widths whose denormals may be flushed: neither `DenormPreserve` nor `DenormFlushToZero`.
    flushes: u32,
}

impl Plan {
    fn new(scene: &ResolvedScene, assembled: &Assembled, perturbation: &Perturbation) -> Self {
        let programs = Programs::of(scene, assembled);
        let shaders = programs.all.iter().map(|program| Shader::of(program)).collect();
        Self { programs, perturbation: *perturbation, shaders }
    }
}

impl Shader {
    fn of(program: &Program) -> Self {
        const DENORM_PRESERVE: u32 = 4459;
        const DENORM_FLUSH_TO_ZERO: u32 = 4460;
        const ROUNDING_MODE_RTE: u32 = 4462;
        let module = &*program.module;
        let entry = module
            .entry_points
            .iter()
            .find(|entry| entry.stage == program.stage && entry.name == program.name);
        let widths = |wanted: u32| {
            let modes = entry.into_iter().flat_map(|entry| &entry.modes);
            let modes = modes.filter(|(mode, _)| *mode == wanted);
            modes.filter_map(|(_, operands)| operands.first()).fold(0, |mask, width| mask | width)
        };
        Self {
            branches: branch_offsets(program),
            no_contraction: no_contraction(module),
            nearest: widths(ROUNDING_MODE_RTE),
            flushes: !(widths(DENORM_PRESERVE) | widths(DENORM_FLUSH_TO_ZERO)),
        }
    }
}

fn no_contraction(module: &Module) -> HashSet<u32> {
    const NO_CONTRACTION: u32 = 42;
    let blocks = module.functions.iter().flat_map(|function| &function.blocks);
    let instructions = blocks.flat_map(|block| &block.instructions);
    let decorated = instructions
        .filter(|one| one.result.is_some_and(|id| module.decorations.find(id, NO_CONTRACTION).is_some()));
    decorated.map(|one| one.offset).collect()
}

/// An invocation: of ray generation, or of the dispatch whose shader stands at a place.
type Who = (usize, [u32; 3]);
/// The way of each invocation: branches, and what rays hit.
type Ways = HashMap<Who, Vec<u64>>;

/// What the movers of a run have seen.
#[derive(Default)]
struct Seen {
    ways: Ways,
    parted: BTreeMap<(usize, u32, Where), u64>,
}

impl Seen {
    fn add(&mut self, mover: Mover<'_>) {
        self.ways.extend(mover.ways);
        for (place, count) in mover.parted {
            *self.parted.entry(place).or_default() += count;
        }
    }
}

/// A product whose rounding a sum may leave out.
#[derive(Clone, Copy)]
struct Product {
    bits: u64,
    factors: [f64; 2],
}

/// Moves the results of one task of invocations.
struct Mover<'a> {
    plan: &'a Plan,
    /// From 1; 0 moves nothing.
    run: u32,
    random: Random,
    /// The shaders that run or wait, with the instruction that they wait at.
    frames: Vec<(usize, u32)>,
    shader: usize,
    products: HashMap<Reg, Product>,
    who: Who,
    dispatch: Option<usize>,
    /// The ways taken, where this is the run without perturbation.
    ways: Ways,
    /// The ways of that run, and how far each invocation has gone along.
    reference: Option<&'a Ways>,
    along: HashMap<Who, Option<usize>>,
    parted: BTreeMap<(usize, u32, Where), u64>,
}

impl<'a> Mover<'a> {
    fn new(plan: &'a Plan, run: u32, reference: Option<&'a Ways>) -> Self {
        Self {
            plan,
            run,
            random: Random(0),
            frames: Vec::new(),
            shader: 0,
            products: HashMap::new(),
            who: (usize::MAX, [0; 3]),
            dispatch: None,
            ways: HashMap::new(),
            reference,
            along: HashMap::new(),
            parted: BTreeMap::new(),
        }
    }

    /// The invocation decides something at a place.
    fn decide(&mut self, code: u64, place: (usize, u32, Where)) {
        let Some(reference) = self.reference else {
            self.ways.entry(self.who).or_default().push(code);
            return;
        };
        let along = self.along.entry(self.who).or_insert(Some(0));
        let Some(at) = *along else { return };
        let same = reference.get(&self.who).and_then(|way| way.get(at)) == Some(&code);
        *along = same.then_some(at + 1);
        if !same {
            *self.parted.entry(place).or_default() += 1;
        }
    }

    /// Moves the result of a kernel.
    fn kernel(
        &mut self,
        batch: &mut Batch<1>,
        offset: u32,
        (kernel, to, from): (&LaneKernel, Reg, &[Reg; 3]),
    ) {
        let width = kernel.float_result;
        if !matches!(width, 16 | 32) {
            return;
        }
        let shader = &self.plan.shaders[self.shader];
        let mut operands = [0.0; 3];
        for at in 0..3 {
            if kernel.operands[at] > 0 {
                let bits = bits(batch, from[at], kernel.operands[at]);
                operands[at] = match kernel.float_operands[at] {
                    0 if kernel.signed => signed(bits, kernel.width),
                    0 => bits as f64,
                    width => float(bits, width),
                };
            }
        }
        let old = bits(batch, to, 1);
        let own = float(old, width);
        let free = !shader.no_contraction.contains(&offset);
        let random = &mut self.random;
        let envelope = self.plan.perturbation.envelope;
        let nearest = shader.nearest & width != 0;
        let mut draw = Draw { random, envelope, width, nearest, contracts: free };
        // What is infinite or NaN stays so.
        if own.is_finite() {
            let fused = match kernel.name {
                "FAdd" | "FSub" if free => {
                    let product = |at: usize| {
                        let product = self.products.get(&from[at])?;
                        (product.bits == bits(batch, from[at], 1)).then_some((at, *product))
                    };
                    product(0).or_else(|| product(1))
                }
                _ => None,
            };
            let drawn = match fused {
                Some((at, Product { factors: [a, b], .. })) if draw.coin() => {
                    let sign = if kernel.name == "FSub" { -1.0 } else { 1.0 };
                    let (a, c) = match at {
                        0 => (a, sign * operands[1]),
                        _ => (sign * a, operands[0]),
                    };
                    Some(draw.fused(a, b, c))
                }
                _ => allowed::drawn(kernel.name, operands, &mut draw),
            };
            if let Some(mut value) = drawn {
                let least = if width == 16 { 2f64.powi(-14) } else { f64::from(f32::MIN_POSITIVE) };
                let denormal = value != 0.0 && value.abs() < least;
                let flushes = shader.flushes & width != 0 && envelope == Envelope::Vulkan;
                if denormal && flushes && draw.coin() {
                    value = 0f64.copysign(value);
                }
                let word = match width {
                    16 => crate::math::float::f64_to_f16(value).to_bits().into(),
                    _ => (value as f32).to_bits(),
                };
                batch.registers[to].0[0] = word;
            }
        }
        if kernel.name == "FMul" && free {
            let product = Product { bits: bits(batch, to, 1), factors: [operands[0], operands[1]] };
            self.products.insert(to, product);
        }
    }

    fn program(&self) -> &Program {
        &self.plan.programs.all[self.shader]
    }
}

/// An integer of a width with its sign.
fn signed(bits: u64, width: u32) -> f64 {
    let empty = 64 - width.clamp(1, 64);
    ((bits << empty) as i64 >> empty) as f64
}

/// What a ray hits, as a step of an invocation's way; no code of a branch has the highest bit.
fn hit_code(committed: Option<&Committed>) -> u64 {
    let place = committed.map(|hit| hit.candidate.hit_primitive());
    let numbers = place.map_or([u32::MAX; 3], |place| [place.instance, place.geometry, place.primitive]);
    numbers.iter().fold(1, |sum, &number| mixed(sum) ^ u64::from(number)) | 1 << 63
}

/// `RayTmaxKHR`
const RAY_T_MAX: u32 = 5326;

impl Probe for Mover<'_> {
    fn begin(&mut self, part: Part) {
        self.frames.clear();
        self.products.clear();
        let id = if let Part::Invocation(id) = part { id } else { [0; 3] };
        self.dispatch = if let Part::Dispatch(at) = part { Some(at) } else { None };
        self.who = (self.dispatch.map_or(usize::MAX, |at| at), id);
        let perturbation = &self.plan.perturbation;
        let place = id.iter().fold(self.who.0 as u64, |sum, &axis| mixed(sum) ^ u64::from(axis));
        self.random = Random(mixed(mixed(perturbation.seed) ^ u64::from(self.run)) ^ mixed(place));
    }

    fn resumed(&mut self, shader: usize, batch: &mut Batch<1>) {
        self.shader = shader;
        self.products.clear();
        if let Some(dispatch) = self.dispatch {
            self.who = (dispatch, batch.invocations.launch_id(0));
        }
        let begins = batch.block == 0 && batch.op == self.program().blocks[0].first;
        let moves = self.run > 0 && self.plan.perturbation.envelope == Envelope::Nvidia;
        if !begins || !moves || !batch.invocations.hit {
            return;
        }
        let input = self.program().inputs.iter().find(|input| input.builtin.number == RAY_T_MAX);
        let Some(first) = input.map(|input| input.first) else { return };
        let t = float(bits(batch, first, 1), 32);
        let (random, envelope) = (&mut self.random, Envelope::Nvidia);
        let mut draw = Draw { random, envelope, width: 32, nearest: false, contracts: true };
        let moved = draw.ulps(t, NVIDIA_T);
        let least = f64::from(batch.invocations.rays.get(0).ray.t_min);
        batch.registers[first].0[0] = (moved.max(least) as f32).to_bits();
    }

    fn stopped(&mut self, batch: &Batch<1>) {
        let at = (batch.op as usize).checked_sub(1).filter(|_| !batch.mask.is_empty());
        let Some(origin) = at.and_then(|at| self.program().origins.get(at)) else { return };
        let offset = origin.offset;
        if let Some(frame) = self.frames.last_mut() {
            frame.1 = offset;
        }
    }

    fn after(&mut self, batch: &mut Batch<1>, _: &Bindings, op: u32) {
        let plan = self.plan;
        let program = &plan.programs.all[self.shader];
        match &program.ops[op as usize] {
            &Op::RayQuery(ray_query::RayQueryOp::Proceed { query, to }) if batch.registers[to].0[0] == 0 => {
                let handle =
                    query.register(&batch.registers, 0).map(|register| batch.registers[register].0[0]);
                if let Ok(query) = handle.and_then(|handle| batch.queries.query(handle)) {
                    let place = (self.shader, program.origins[op as usize].offset, Where::Hit);
                    self.decide(hit_code(query.committed()), place);
                }
            }
            _ if self.run == 0 => {}
            Op::LaneKernel { kernel, to, from } => {
                let offset = program.origins[op as usize].offset;
                self.kernel(batch, offset, (kernel, *to, from));
            }
            Op::Memory(memory::MemoryOp::Move { to, from } | memory::MemoryOp::MoveMasked { to, from }) => {
                match self.products.get(from).copied() {
                    Some(product) => self.products.insert(*to, product),
                    None => self.products.remove(to),
                };
            }
            _ => {}
        }
    }

    fn taken(&mut self, block: u32, edge: u32) {
        let shader = self.shader;
        if let Terminator::BranchConditional { .. } | Terminator::Switch { .. } =
            self.program().blocks[block as usize].terminator
        {
            let offset = self.plan.shaders[shader].branches[block as usize];
            let code = (shader as u64) << 44 | u64::from(block) << 20 | u64::from(edge);
            self.decide(code, (shader, offset, Where::Branch));
        }
    }

    fn event(&mut self, event: &Event) {
        match event {
            Event::Enter { shader, .. } => self.frames.push((shader.0 as usize, 0)),
            Event::Leave { .. } => {
                self.frames.pop();
            }
            Event::Traversed { committed, .. } => {
                if let Some(&(shader, offset)) = self.frames.last() {
                    self.decide(hit_code(committed.as_ref()), (shader, offset, Where::Hit));
                }
            }
            _ => {}
        }
    }
}
