//! Perturbed runs: every float result is moved at random within the errors that a device may make.

use std::collections::{HashMap, HashSet};

use crate::expect::Observed;
use crate::observe::{first_ray, fresh_resources, read_resources};
use crate::stability::allowed::{self, NVIDIA_T};
use crate::stability::calculate::{Draw, SplitMix64, mix64};
use crate::stability::envelope::Envelope;
use crate::stability::instability::{DecisionKind, Instability, Perturbation};
use crate::stability::outputs::OutputComparison;
use crate::stability::place::Programs;
use crate::stability::probe::{self, Probe, RunPart};
use crate::stability::shadow_context::branch_offsets;
use crate::stability::shadows::{bits, float};
use anyhit_base::error::{ErrorKind, Result};
use anyhit_base::progress::Work;
use anyhit_base::sorted::SortedMap;
use anyhit_debugger::session::ResolvedRequest;
use anyhit_engine::accel::Committed;
use anyhit_engine::machine::{Batch, Bindings, BlockIndex, OpIndex, Reg};
use anyhit_engine::module::Module;
use anyhit_engine::module::decoration::number;
use anyhit_engine::ops::access::RegCopy;
use anyhit_engine::ops::lane_kernel::LaneKernel;
use anyhit_engine::ops::op::Op;
use anyhit_engine::ops::ray_query;
use anyhit_engine::pipeline::Event;
use anyhit_engine::program::{Program, Terminator};
use anyhit_scene::{Assembled, ResolvedScene};

/// Runs a scene's passes several times, each time on a copy of its resources.
///
/// # Errors
/// The trap of the run without perturbation; `UnsupportedModule` where invocations cannot run one
/// by one.
pub fn perturb(
    scene: &ResolvedScene,
    assembled: &Assembled,
    perturbation: &Perturbation,
) -> Result<Instability> {
    let context = PerturbContext::new(scene, assembled, perturbation);
    let run = |number: u32, reference: Option<&DecisionLog>| {
        let resources = fresh_resources(assembled);
        let mut seen = RunDecisions::default();
        let new = || Perturber::new(&context, number, reference);
        let outcome =
            probe::run(assembled, &resources, &new, &mut |perturber: Perturber<'_>| seen.add(perturber));
        let mut observed = Observed::default();
        read_resources(scene, &resources, &mut observed);
        (observed, seen, outcome)
    };
    compare_runs(scene, assembled, &context, &run)
}

/// Perturbs one ray or one invocation of ray generation.
///
/// # Errors
/// As [`perturb`], and where the ray does not fit the scene.
pub fn perturb_one(
    scene: &ResolvedScene,
    assembled: &Assembled,
    which: &ResolvedRequest,
    perturbation: &Perturbation,
) -> Result<Instability> {
    let context = PerturbContext::new(scene, assembled, perturbation);
    let run = |number: u32, reference: Option<&DecisionLog>| {
        let resources = fresh_resources(assembled);
        let (mut seen, mut events) = (RunDecisions::default(), Vec::new());
        let perturber = Perturber::new(&context, number, reference);
        let mut event = |event: Event| events.push(event);
        let outcome = probe::run_one(scene, assembled, &resources, which, perturber, &mut event);
        let outcome = outcome.and_then(|(perturber, outcome)| {
            seen.add(perturber);
            outcome
        });
        let mut observed = Observed::default();
        if let Ok(single) = assembled.single_launch(which.pass.as_deref()) {
            observed.rays.push((None, Ok(first_ray(&single.pipeline, &events))));
        }
        read_resources(scene, &resources, &mut observed);
        (observed, seen, outcome)
    };
    compare_runs(scene, assembled, &context, &run)
}

/// A run by its number: returns its outputs, its decisions, and how it ended. Run 0 is not
/// perturbed.
type Run<'r> = dyn Fn(u32, Option<&DecisionLog>) -> (Observed, RunDecisions, Result<()>) + 'r;

fn compare_runs(
    scene: &ResolvedScene,
    assembled: &Assembled,
    context: &PerturbContext,
    run: &Run<'_>,
) -> Result<Instability> {
    let mut before = Observed::default();
    read_resources(scene, &fresh_resources(assembled), &mut before);
    let (reference, decisions, outcome) = run(0, None);
    outcome?;
    let mut comparison = OutputComparison::new(assembled, &reference, context.perturbation.tolerance);
    let mut found = Instability {
        perturbation: context.perturbation,
        output_count: comparison.output_count(&before),
        ..Instability::default()
    };
    let Perturbation { first_run, runs, .. } = context.perturbation;
    let work = Work::counted("running perturbed", u64::from(runs.saturating_sub(first_run)) + 1);
    for number in first_run..=runs {
        let (observed, seen, outcome) = run(number, Some(&decisions.decisions));
        work.advance(1);
        for (DecisionSite { shader, offset, kind }, count) in seen.divergences {
            *found.branches.entry((context.programs.location(shader, offset), kind)).or_default() += count;
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

/// What perturbed runs need to know of a scene.
struct PerturbContext {
    programs: Programs,
    perturbation: Perturbation,
    shaders: Vec<ShaderFacts>,
}

/// What perturbed runs need to know of a shader.
struct ShaderFacts {
    /// The word offset of the branch that ends each block.
    branches: Vec<u32>,
    /// Word offsets of instructions decorated `NoContraction`.
    no_contraction: HashSet<u32>,
    /// Widths whose results are rounded to nearest (`RoundingModeRTE`), as a mask.
    rounds_to_nearest: u32,
    /// Widths whose denormals may be flushed, as a mask: neither `DenormPreserve` nor
    /// `DenormFlushToZero`.
    flushes: u32,
}

impl PerturbContext {
    fn new(scene: &ResolvedScene, assembled: &Assembled, perturbation: &Perturbation) -> Self {
        let programs = Programs::of(scene, assembled);
        let shaders = programs.all.iter().map(|program| ShaderFacts::of(program)).collect();
        Self { programs, perturbation: *perturbation, shaders }
    }
}

impl ShaderFacts {
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
            rounds_to_nearest: widths(ROUNDING_MODE_RTE),
            flushes: !(widths(DENORM_PRESERVE) | widths(DENORM_FLUSH_TO_ZERO)),
        }
    }
}

/// The words of the instructions of a module that are decorated `NoContraction`.
pub(crate) fn no_contraction(module: &Module) -> HashSet<u32> {
    let decorated = module.instructions().filter(|one| {
        one.result.is_some_and(|id| module.decorations.find(id, number::NO_CONTRACTION).is_some())
    });
    decorated.map(|one| one.offset).collect()
}

/// An invocation: the index of the dispatch's program, or for ray generation `usize::MAX` less the
/// number of the launch, and the launch index.
type InvocationKey = (usize, [u32; 3]);
/// The way of each invocation: branches, and what rays hit.
type DecisionLog = HashMap<InvocationKey, Vec<u64>>;

/// Where a shader decides.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct DecisionSite {
    /// The index of the shader's program.
    shader: usize,
    /// The word offset of the instruction.
    offset: u32,
    /// What is decided there.
    kind: DecisionKind,
}

/// The decisions of a run.
#[derive(Default)]
struct RunDecisions {
    decisions: DecisionLog,
    divergences: SortedMap<DecisionSite, u64>,
}

impl RunDecisions {
    fn add(&mut self, perturber: Perturber<'_>) {
        self.decisions.extend(perturber.decisions);
        for (site, count) in perturber.divergences {
            *self.divergences.entry(site).or_default() += count;
        }
    }
}

/// A product that a sum may contract, so that it is not rounded.
#[derive(Clone, Copy)]
struct Product {
    bits: u64,
    factors: [f64; 2],
}

/// Perturbs the results of one task of invocations, and records or compares their decisions.
struct Perturber<'a> {
    context: &'a PerturbContext,
    /// The number of the run, from 1; run 0 is not perturbed.
    run: u32,
    random: SplitMix64,
    /// The shaders that run or wait, with the word offset of the instruction that they wait at.
    frames: Vec<(usize, u32)>,
    shader: usize,
    products: HashMap<Reg, Product>,
    invocation: InvocationKey,
    dispatch: Option<usize>,
    pipeline: Option<usize>,
    /// The decisions, recorded in the run without perturbation.
    decisions: DecisionLog,
    /// The decisions of the run without perturbation, and how many of them each invocation has
    /// made; `None` after it diverged.
    reference: Option<&'a DecisionLog>,
    progress: HashMap<InvocationKey, Option<usize>>,
    divergences: SortedMap<DecisionSite, u64>,
}

impl<'a> Perturber<'a> {
    fn new(context: &'a PerturbContext, run: u32, reference: Option<&'a DecisionLog>) -> Self {
        Self {
            context,
            run,
            random: SplitMix64(0),
            frames: Vec::new(),
            shader: 0,
            products: HashMap::new(),
            invocation: (usize::MAX, [0; 3]),
            dispatch: None,
            pipeline: None,
            decisions: HashMap::new(),
            reference,
            progress: HashMap::new(),
            divergences: SortedMap::new(),
        }
    }

    /// Records a decision of the invocation, or compares it with the reference.
    fn decide(&mut self, code: u64, site: DecisionSite) {
        let Some(reference) = self.reference else {
            self.decisions.entry(self.invocation).or_default().push(code);
            return;
        };
        let progress = self.progress.entry(self.invocation).or_insert(Some(0));
        let Some(at) = *progress else { return };
        let same = reference.get(&self.invocation).and_then(|decisions| decisions.get(at)) == Some(&code);
        *progress = same.then_some(at + 1);
        if !same {
            *self.divergences.entry(site).or_default() += 1;
        }
    }

    /// Perturbs the result of a kernel.
    fn perturb_kernel(
        &mut self,
        batch: &mut Batch<1>,
        offset: u32,
        kernel: &LaneKernel,
        to: Reg,
        from: &[Reg; 3],
    ) {
        let width = kernel.float_result;
        if !matches!(width, 16 | 32) {
            return;
        }
        let shader = &self.context.shaders[self.shader];
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
        let value_before = float(old, width);
        let may_contract = !shader.no_contraction.contains(&offset);
        let random = &mut self.random;
        let envelope = self.context.perturbation.envelope;
        let nearest = shader.rounds_to_nearest & width != 0;
        let mut draw = Draw { random, envelope, width, nearest, may_contract };
        // Infinities and NaN are not perturbed.
        if value_before.is_finite() {
            let fused = match kernel.name {
                "FAdd" | "FSub" if may_contract => {
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
                    Some(draw.fma(a, b, c))
                }
                _ => allowed::perturbed_result(kernel.name, operands, &mut draw),
            };
            if let Some(mut value) = drawn {
                let min_normal = if width == 16 { 2f64.powi(-14) } else { f64::from(f32::MIN_POSITIVE) };
                let denormal = value != 0.0 && value.abs() < min_normal;
                let flushes = shader.flushes & width != 0 && envelope == Envelope::Vulkan;
                if denormal && flushes && draw.coin() {
                    value = 0f64.copysign(value);
                }
                let word = match width {
                    16 => anyhit_engine::math::float::f64_to_f16(value).to_bits().into(),
                    _ => (value as f32).to_bits(),
                };
                batch.registers[to].0[0] = word;
            }
        }
        if kernel.name == "FMul" && may_contract {
            let product = Product { bits: bits(batch, to, 1), factors: [operands[0], operands[1]] };
            self.products.insert(to, product);
        }
    }

    fn program(&self) -> &Program {
        &self.context.programs.all[self.shader]
    }
}

/// The value of a signed integer of a width.
fn signed(bits: u64, width: u32) -> f64 {
    let empty = 64 - width.clamp(1, 64);
    ((bits << empty) as i64 >> empty) as f64
}

/// The code of a decision about what a ray hits. It has the highest bit, unlike the code of a
/// branch.
fn hit_code(committed: Option<&Committed>) -> u64 {
    let hit = committed.map(|hit| hit.candidate.hit_primitive());
    let numbers = hit.map_or([u32::MAX; 3], |hit| [hit.instance, hit.geometry, hit.primitive]);
    numbers.iter().fold(1, |sum, &number| mix64(sum) ^ u64::from(number)) | 1 << 63
}

/// `RayTmaxKHR`
const RAY_T_MAX: u32 = 5326;

impl Probe for Perturber<'_> {
    fn begin(&mut self, part: RunPart) {
        self.frames.clear();
        self.products.clear();
        (self.dispatch, self.invocation) = match part {
            RunPart::Invocation { launch, id, .. } => (None, (usize::MAX - launch, id)),
            RunPart::Dispatch { program, .. } => (Some(program), (program, [0; 3])),
            RunPart::Ray(_) => (None, (usize::MAX, [0; 3])),
        };
        self.pipeline = part.pipeline();
        let id = self.invocation.1;
        let perturbation = &self.context.perturbation;
        let hash = id.iter().fold(self.invocation.0 as u64, |sum, &axis| mix64(sum) ^ u64::from(axis));
        self.random = SplitMix64(mix64(mix64(perturbation.seed) ^ u64::from(self.run)) ^ mix64(hash));
    }

    fn first_program(&self) -> usize {
        self.context.programs.first(self.pipeline)
    }

    fn resumed(&mut self, shader: usize, batch: &mut Batch<1>) {
        self.shader = shader;
        self.products.clear();
        if let Some(dispatch) = self.dispatch {
            self.invocation = (dispatch, batch.invocations.launch_id(0));
        }
        let begins = batch.block == BlockIndex(0) && batch.op == self.program().blocks[0].first;
        let moves = self.run > 0 && self.context.perturbation.envelope == Envelope::Nvidia;
        if !begins || !moves || !batch.invocations.hit {
            return;
        }
        let input = self.program().inputs.iter().find(|input| input.builtin.number == RAY_T_MAX);
        let Some(first) = input.map(|input| input.first) else { return };
        let t = float(bits(batch, first, 1), 32);
        let (random, envelope) = (&mut self.random, Envelope::Nvidia);
        let mut draw = Draw { random, envelope, width: 32, nearest: false, may_contract: true };
        let moved = draw.ulps(t, NVIDIA_T);
        let t_min = f64::from(batch.invocations.rays.get(0).ray.t_min);
        batch.registers[first].0[0] = (moved.max(t_min) as f32).to_bits();
    }

    fn stopped(&mut self, batch: &Batch<1>) {
        let at = batch.op.previous().filter(|_| !batch.mask.is_empty());
        let Some(origin) = at.and_then(|at| self.program().origins.get(at.index())) else { return };
        let offset = origin.offset;
        if let Some(frame) = self.frames.last_mut() {
            frame.1 = offset;
        }
    }

    fn after(&mut self, batch: &mut Batch<1>, _: &Bindings, op: OpIndex) {
        let context = self.context;
        let program = &context.programs.all[self.shader];
        match &program.ops[op.index()] {
            &Op::RayQuery(ray_query::RayQueryOp::Proceed { query, to }) if batch.registers[to].0[0] == 0 => {
                let handle =
                    query.register(&batch.registers, 0).map(|register| batch.registers[register].0[0]);
                if let Ok(query) = handle.and_then(|handle| batch.queries.query(handle)) {
                    let (shader, offset) = (self.shader, program.origins[op.index()].offset);
                    let site = DecisionSite { shader, offset, kind: DecisionKind::Hit };
                    self.decide(hit_code(query.committed()), site);
                }
            }
            _ if self.run == 0 => {}
            Op::LaneKernel { kernel, to, from } => {
                let offset = program.origins[op.index()].offset;
                self.perturb_kernel(batch, offset, kernel, *to, from);
            }
            op => {
                if let Some(RegCopy { to, from, .. }) = op.copy() {
                    match self.products.get(&from).copied() {
                        Some(product) => self.products.insert(to, product),
                        None => self.products.remove(&to),
                    };
                }
            }
        }
    }

    fn edge_taken(&mut self, block: BlockIndex, edge: u32) {
        let shader = self.shader;
        if let Terminator::BranchConditional { .. } | Terminator::Switch { .. } =
            self.program().blocks[block.index()].terminator
        {
            let offset = self.context.shaders[shader].branches[block.index()];
            let code = (shader as u64) << 44 | u64::from(block.0) << 20 | u64::from(edge);
            self.decide(code, DecisionSite { shader, offset, kind: DecisionKind::Branch });
        }
    }

    fn event(&mut self, event: &Event) {
        match event {
            Event::Enter { shader, .. } => {
                let shader = self.first_program() + shader.index();
                self.frames.push((shader, 0));
            }
            Event::Leave { .. } => {
                self.frames.pop();
            }
            Event::Traversed { committed, .. } => {
                if let Some(&(shader, offset)) = self.frames.last() {
                    let site = DecisionSite { shader, offset, kind: DecisionKind::Hit };
                    self.decide(hit_code(committed.as_ref()), site);
                }
            }
            _ => {}
        }
    }
}
