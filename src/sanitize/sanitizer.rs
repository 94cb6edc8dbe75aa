//! The sanitizer: an observer that keeps a shadow of every register, and reports where something
//! depends on what is undefined.
//!
//! A value is undefined where a variable was not written, or where an instruction's result is for
//! its operands. Whatever is computed from it is undefined, too; nothing is reported until a
//! branch, an index or address, a ray or an output depends on it, as in MemorySanitizer. Undefined
//! behaviour is reported where it happens. Of a NaN the sanitizer keeps the instruction that made
//! it.

mod begin;
mod kernels;
mod memory;

use crate::machine::{Batch, Bindings, Mask, Observer, OpIndex, Reg, ShaderIndex, ShadowRegisters};
use crate::module::interface::Stage;
use crate::ops::access::Access;
use crate::ops::debug_printf::Argument;
use crate::ops::op::Op;
use crate::ops::pointer::storage;
use crate::ops::ray_query::RayQueryOp;
use crate::ops::ray_tracing::RayTracingOp;
use crate::program::{Program, Terminator};
use crate::sanitize::cause::{Cause, CauseDetails, Causes, OpPlace};
use crate::sanitize::finding::Findings;
use crate::sanitize::levels::Levels;
use crate::sanitize::memory_shadow::WorkgroupShadow;
use crate::sanitize::plan::{Executed, ProgramPlan};
use crate::sanitize::races::Races;
use crate::sanitize::report::{Reporter, Sink};
use crate::sanitize::rule::{Level, Rule, race, trace};
use crate::sanitize::{query_checks, ray_checks, shared_checks, stale, subgroup_checks, uniformity};
pub(super) use kernels::{nan_lanes, operand_words};
pub(super) use memory::{each_element, workgroup_lanes};

/// Calls a visitor with the accesses of an operation.
type AccessesOf<'a> = dyn FnMut(&mut dyn FnMut(Access)) + 'a;

/// A shader that runs or waits, and the operation at which it waits.
#[derive(Clone, Copy, Debug)]
pub(super) struct CallFrame {
    pub shader: ShaderIndex,
    pub op: OpIndex,
}

/// Checks the shaders of a pipeline, or of a dispatch, while they run.
#[derive(Debug)]
pub struct Sanitizer<'a> {
    plans: &'a [ProgramPlan],
    levels: &'a Levels,
    causes: Causes,
    findings: Findings,
    frames: Vec<CallFrame>,
    /// The accesses to shared memory so far, unless nobody is told of races.
    races: Option<Races>,
    /// Which workgroup memory is undefined.
    shared: WorkgroupShadow,
    /// The first of the workgroups that run.
    first_workgroup: Option<u32>,
}

impl<'a> Sanitizer<'a> {
    /// A sanitizer of shaders, by their index in the pipeline.
    pub fn new(plans: &'a [ProgramPlan], levels: &'a Levels) -> Self {
        let told = |rule: &&Rule| levels.of(rule) != Level::Allow;
        Self {
            plans,
            levels,
            causes: Causes::default(),
            findings: Findings::default(),
            frames: Vec::new(),
            races: race::RULES.iter().any(told).then(|| Races::new(plans)),
            shared: WorkgroupShadow::default(),
            first_workgroup: None,
        }
    }

    /// What was found.
    pub fn into_findings(self) -> Findings {
        self.findings
    }

    /// The number of a cause.
    pub(super) fn cause(&mut self, cause: Cause, details: impl FnOnce() -> Option<CauseDetails>) -> u32 {
        self.causes.number(cause, details)
    }

    fn plan(&self) -> Option<(ShaderIndex, &'a ProgramPlan)> {
        let shader = self.frames.last()?.shader;
        Some((shader, self.plans.get(shader.index())?))
    }

    /// What makes reports of a batch.
    pub(super) fn reporter<'b, const W: usize>(&'b mut self, batch: &'b Batch<W>) -> Reporter<'b, W> {
        Reporter {
            plans: self.plans,
            levels: self.levels,
            causes: &self.causes,
            findings: &mut self.findings,
            frames: &self.frames,
            batch,
        }
    }

    /// Reports that something depends on a register, in the lanes where it is undefined.
    pub(super) fn depend<const W: usize>(
        &mut self,
        batch: &Batch<W>,
        shadow: &mut ShadowRegisters<W>,
        op: OpIndex,
        register: Reg,
        sink: Sink,
    ) {
        self.depend_in(batch, shadow, op, register, sink, batch.mask);
    }

    /// As [`Sanitizer::depend`], in some lanes.
    fn depend_in<const W: usize>(
        &mut self,
        batch: &Batch<W>,
        shadow: &mut ShadowRegisters<W>,
        op: OpIndex,
        register: Reg,
        sink: Sink,
        lanes: Mask<W>,
    ) {
        let undefined = shadow.undefined(register) & lanes;
        if undefined.is_empty() {
            return;
        }
        self.reporter(batch).undefined(shadow, op, register, undefined, sink);
        // Told once: what is computed from the same register is not told again.
        shadow.define_lanes(register, undefined);
    }

    /// As [`Sanitizer::depend`], of consecutive registers.
    pub(super) fn depend_on_all<const W: usize>(
        &mut self,
        batch: &Batch<W>,
        shadow: &mut ShadowRegisters<W>,
        op: OpIndex,
        first: Reg,
        count: u32,
        sink: Sink,
    ) {
        for word in 0..count {
            self.depend(batch, shadow, op, first.plus(word), sink);
        }
    }

    /// Makes the words of a variable undefined, as nobody has written them.
    fn undefine_variable<const W: usize>(
        &mut self,
        shadow: &mut ShadowRegisters<W>,
        lanes: Mask<W>,
        first: Reg,
        count: u32,
        cause: impl Fn(u32) -> Cause,
    ) {
        for word in 0..count {
            let number = self.causes.number(cause(word), || None);
            shadow.undefine(first.plus(word), lanes, number);
        }
    }

    /// Reports undefined operands of an operation, and makes its results defined.
    fn depend_on_reads<const W: usize>(
        &mut self,
        batch: &Batch<W>,
        shadow: &mut ShadowRegisters<W>,
        op: OpIndex,
        sink: Sink,
        accesses: &mut AccessesOf<'_>,
    ) {
        let mut written = Vec::new();
        accesses(&mut |access| match access {
            Access::Read(first, count) => self.depend_on_all(batch, shadow, op, first, count, sink),
            Access::Write(first, count) => written.push((first, count)),
            Access::Effect => {}
        });
        written.into_iter().for_each(|(first, count)| shadow.define_span(first, count, batch.mask));
    }

    fn ray_query<const W: usize>(
        &mut self,
        batch: &Batch<W>,
        shadow: &mut ShadowRegisters<W>,
        op: OpIndex,
        query: &RayQueryOp,
    ) {
        match *query {
            RayQueryOp::Initialize { operands, .. } => {
                ray_checks::check_query(self, batch, shadow, op, operands);
            }
            RayQueryOp::Generate { t, .. } => self.depend(batch, shadow, op, t, Sink::ReportedT),
            _ => {}
        }
        define_writes(shadow, batch.mask, &mut |visit| query.accesses(visit));
    }

    /// A shader hands its batch to the pipeline.
    fn stop<const W: usize>(
        &mut self,
        batch: &Batch<W>,
        shadow: &mut ShadowRegisters<W>,
        op: OpIndex,
        stop: &RayTracingOp,
    ) {
        match *stop {
            RayTracingOp::TraceRay { operands, .. } | RayTracingOp::HitObjectTrace { operands, .. } => {
                ray_checks::check_trace(self, batch, shadow, op, operands);
            }
            RayTracingOp::ExecuteCallable { index, .. } => {
                self.depend(batch, shadow, op, index, Sink::Record);
            }
            RayTracingOp::ReportIntersection { t, hit_kind, accepted } => {
                self.depend(batch, shadow, op, t, Sink::ReportedT);
                self.depend(batch, shadow, op, hit_kind, Sink::HitKind);
                let nans = nan_lanes(&batch.registers, t, 32) & batch.mask;
                if !nans.is_empty() {
                    self.reporter(batch).nan(&trace::REPORT_NAN_T, shadow, op, t, nans);
                }
                self.depend_on_attributes(batch, shadow, op);
                shadow.define(accepted);
            }
            RayTracingOp::HitObjectRecordHandle { to, .. } => {
                (0..2).for_each(|word| shadow.define(to.plus(word)));
            }
            RayTracingOp::HitObjectExecute { .. } => {}
        }
    }

    /// The hit attributes that a report carries.
    fn depend_on_attributes<const W: usize>(
        &mut self,
        batch: &Batch<W>,
        shadow: &mut ShadowRegisters<W>,
        op: OpIndex,
    ) {
        let Some((_, plan)) = self.plan() else { return };
        let Some(registers) = plan.program.interface_registers(storage::HIT_ATTRIBUTE) else { return };
        self.depend_on_all(batch, shadow, op, registers.first, registers.count, Sink::Report);
    }

    /// As [`Sanitizer::tell`], of which the message needs the shader that runs.
    pub(super) fn tell_of_program<const W: usize>(
        &mut self,
        batch: &Batch<W>,
        rule: &'static Rule,
        op: OpIndex,
        lanes: Mask<W>,
        message: impl FnOnce(&Program) -> String,
    ) {
        let Some((_, plan)) = self.plan() else { return };
        self.tell(batch, rule, op, lanes, |_| message(&plan.program));
    }

    /// An error about the shaders of this sanitizer, for what is told apart from values.
    pub(super) fn tell<const W: usize>(
        &mut self,
        batch: &Batch<W>,
        rule: &'static Rule,
        op: OpIndex,
        lanes: Mask<W>,
        message: impl FnOnce(usize) -> String,
    ) {
        let Some(lane) = lanes.lowest() else { return };
        self.reporter(batch).broken(rule, op, lanes, message(lane));
    }
}

impl<const W: usize> Observer<W> for Sanitizer<'_> {
    fn began(&mut self, shader: ShaderIndex, batch: &mut Batch<W>) {
        let registers = batch.registers.len();
        let mut shadow = match batch.registers.shadow.take() {
            Some(shadow) => shadow,
            None => Box::new(ShadowRegisters::new(registers)),
        };
        let first = self.plans.get(shader.index()).map(|plan| plan.program.stage);
        if matches!(first, Some(Stage::RayGeneration | Stage::Compute)) {
            self.frames.clear();
        }
        if first == Some(Stage::Compute) {
            self.begin_workgroups(batch);
        }
        self.frames.push(CallFrame { shader, op: OpIndex(0) });
        self.begin(shader, batch, &mut shadow);
        batch.registers.shadow = Some(shadow);
    }

    fn stopped(&mut self, shader: ShaderIndex, batch: &Batch<W>) {
        let is_compute =
            self.plans.get(shader.index()).is_some_and(|plan| plan.program.stage == Stage::Compute);
        if batch.live().is_empty() {
            query_checks::ended(self, batch);
        }
        if batch.live().is_empty() && !is_compute {
            self.frames.pop();
        } else if let Some(frame) = self.frames.last_mut() {
            frame.op = batch.op.previous().unwrap_or(batch.op);
        }
    }

    fn resumed(&mut self, shader: ShaderIndex, _: &mut Batch<W>) {
        if let Some(frame) = self.frames.last_mut() {
            frame.shader = shader;
        }
        if let Some(races) = &mut self.races {
            races.resumed();
        }
    }

    fn before(&mut self, batch: &mut Batch<W>, op: OpIndex) -> bool {
        let Some((shader, plan)) = self.plan() else { return false };
        match plan.program.ops.get(op.index()) {
            Some(Op::Stop(stop)) => {
                let Some(mut shadow) = batch.registers.shadow.take() else { return false };
                self.stop(batch, &mut shadow, op, stop);
                if let Some(uniformity) = &plan.steps[op.index()].uniformity {
                    uniformity::check(self, batch, op, uniformity);
                }
                if plan.lane_inputs.is_some() && stale::may_repack(stop) {
                    shadow.repack(batch.mask);
                }
                batch.registers.shadow = Some(shadow);
            }
            Some(Op::Barrier) => {
                if let Some(races) = &mut self.races {
                    races.barrier(batch, &plan.program, OpPlace { shader, op });
                }
            }
            _ => {}
        }
        false
    }

    fn after(&mut self, batch: &mut Batch<W>, bindings: &Bindings, op: OpIndex) {
        let Some((shader, plan)) = self.plan() else { return };
        let Some(mut shadow) = batch.registers.shadow.take() else { return };
        let place = OpPlace { shader, op };
        let step = &plan.steps[op.index()];
        let executed = Executed { place, step };
        if let Some(uniformity) = &step.uniformity {
            uniformity::check(self, batch, op, uniformity);
        }
        match &plan.program.ops[op.index()] {
            Op::LaneKernel { kernel, to, from } => {
                self.kernel(batch, &mut shadow, executed, kernel, *to, from);
            }
            Op::Memory(memory) => self.memory(batch, bindings, &mut shadow, executed, memory),
            Op::Image(image) => {
                self.image(batch, &mut shadow, op, image);
                if let Some(races) = self.races.as_mut().filter(|races| races.watches(place)) {
                    let found = races.access_image(batch, bindings, place, image);
                    self.tell_races(batch, op, &found);
                }
            }
            Op::RayQuery(query) => {
                self.ray_query(batch, &mut shadow, op, query);
                query_checks::check(self, batch, op, query, step.ignores_result);
            }
            Op::Subgroup(subgroup) => subgroup_checks::check(self, batch, &mut shadow, executed, subgroup),
            Op::Atomic(atomic) => {
                let mut accesses = |visit: &mut dyn FnMut(Access)| atomic.accesses(visit);
                self.depend_on_reads(batch, &mut shadow, op, Sink::Atomic, &mut accesses);
                shared_checks::atomic(self, batch, bindings, &mut shadow, place, atomic);
                if let Some(races) = self.races.as_mut().filter(|races| races.watches(place)) {
                    let found = races.access_atomic(batch, bindings, &plan.program, place, atomic);
                    self.tell_races(batch, op, &found);
                }
            }
            Op::Print(print) => {
                for argument in &*print.arguments {
                    let Argument::Numbers { components, .. } = argument else { continue };
                    for &component in components {
                        self.depend(batch, &mut shadow, op, component, Sink::Print);
                    }
                }
            }
            Op::HitObject(object) => {
                define_writes(&mut shadow, batch.mask, &mut |visit| object.accesses(visit));
            }
            Op::Stop(_) | Op::Barrier => {}
        }
        if let Some(inputs) = &plan.lane_inputs {
            stale::track(self, batch, &mut shadow, op, &plan.program.ops[op.index()], inputs);
        }
        batch.registers.shadow = Some(shadow);
    }

    fn terminator(&mut self, batch: &mut Batch<W>) {
        let Some((_, plan)) = self.plan() else { return };
        let (register, words, sink) = match plan.program.blocks[batch.block.index()].terminator {
            Terminator::BranchConditional { condition, .. } => (condition, 1, Sink::Branch),
            Terminator::Switch { selector, wide, .. } => (selector, 1 + u32::from(wide), Sink::Switch),
            _ => return,
        };
        let Some(mut shadow) = batch.registers.shadow.take() else { return };
        let op = plan.program.terminator_index(batch.block);
        self.depend_on_all(batch, &mut shadow, op, register, words, sink);
        batch.registers.shadow = Some(shadow);
    }
}

/// Makes defined what an operation has written.
fn define_writes<const W: usize>(
    shadow: &mut ShadowRegisters<W>,
    lanes: Mask<W>,
    accesses: &mut AccessesOf<'_>,
) {
    accesses(&mut |access| {
        if let Access::Write(first, count) = access {
            shadow.define_span(first, count, lanes);
        }
    });
}
