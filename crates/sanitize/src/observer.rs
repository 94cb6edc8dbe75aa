//! The sanitizer as an observer: an operation has run, and the checks of its kind look at it.

use crate::cause::OpPlace;
use crate::checks::bounds::TexelAccess;
use crate::checks::image_format::ImageAccess;
use crate::checks::lanes::workgroup_lanes;
use crate::checks::{
    barrier, begin, births, bounds, call, contents, cooperative, hit_object, image, image_format, kernel,
    memory, query, query_ray, ray, shared, stale, stop, subgroup, uniformity,
};
use crate::plan::{Executed, ProgramPlan};
use crate::report::specials::SpecialSink;
use crate::report::{CallFrame, Sink};
use crate::sanitizer::{Accesses, Sanitizer};
use anyhit_engine::machine::{Batch, Bindings, Mask, Observer, OpIndex, ShaderIndex, ShadowRegisters};
use anyhit_engine::module::interface::Stage;
use anyhit_engine::ops::access::Access;
use anyhit_engine::ops::atomic::{AtomicKind, AtomicOp, AtomicTarget};
use anyhit_engine::ops::debug_printf::Argument;
use anyhit_engine::ops::op::Op;
use anyhit_engine::ops::ray_query::RayQueryOp;
use anyhit_engine::ops::ray_tracing::RayTracingOp;
use anyhit_engine::program::Terminator;

/// An observer of batches of each width. These are no generic functions: such a one would be
/// compiled with the whole sanitizer once more in each crate that calls it.
macro_rules! observe {
    ($($lanes:literal),*) => {$(
        impl Observer<$lanes> for Sanitizer<'_> {
            fn began(&mut self, shader: ShaderIndex, batch: &mut Batch<$lanes>) {
                self.on_began(shader, batch);
            }

            fn stopped(&mut self, shader: ShaderIndex, batch: &Batch<$lanes>) {
                self.on_stopped(shader, batch);
            }

            fn resumed(&mut self, shader: ShaderIndex, batch: &mut Batch<$lanes>) {
                self.on_resumed(shader, batch);
            }

            fn block(&mut self, batch: &Batch<$lanes>) {
                barrier::enter_block(self, batch);
            }

            fn before(&mut self, batch: &mut Batch<$lanes>, op: OpIndex) -> bool {
                self.on_before(batch, op);
                false
            }

            fn after(&mut self, batch: &mut Batch<$lanes>, bindings: &Bindings, op: OpIndex) {
                self.on_after(batch, bindings, op);
            }

            fn terminator(&mut self, batch: &mut Batch<$lanes>) -> bool {
                self.depend_on_branch(batch);
                false
            }
        }
    )*};
}
observe!(1, 64, 128);

impl Sanitizer<'_> {
    fn on_began<const W: usize>(&mut self, shader: ShaderIndex, batch: &mut Batch<W>) {
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
            begin::begin_workgroups(self, batch);
        }
        if first == Some(Stage::Callable) {
            stop::check_callable_depth(self, batch);
        }
        call::check(self, shader, batch);
        let caller = self.frames.last().map(|frame| frame.call);
        let call = self.races.as_mut().map_or(0, |races| races.begin_call(caller));
        self.frames.push(CallFrame { shader, op: OpIndex(0), call });
        begin::begin(self, shader, batch, &mut shadow);
        batch.registers.shadow = Some(shadow);
    }

    fn on_stopped<const W: usize>(&mut self, shader: ShaderIndex, batch: &Batch<W>) {
        let is_compute =
            self.plans.get(shader.index()).is_some_and(|plan| plan.program.stage == Stage::Compute);
        if batch.live().is_empty() {
            query::ended(self, batch);
        }
        if batch.live().is_empty() && !is_compute {
            self.frames.pop();
            let is_called =
                self.plans.get(shader.index()).is_some_and(|plan| plan.program.stage != Stage::RayGeneration);
            if self.frames.is_empty() && is_called {
                self.ended.push(shader);
            }
        } else if let Some(frame) = self.frames.last_mut() {
            frame.op = batch.op.previous().unwrap_or(batch.op);
            if let Some(races) = &mut self.races {
                races.stop_call(frame.call);
            }
        }
    }

    fn on_resumed<const W: usize>(&mut self, shader: ShaderIndex, batch: &mut Batch<W>) {
        if let Some(frame) = self.frames.last_mut() {
            frame.shader = shader;
        }
        let call = self.frames.last().map_or(0, |frame| frame.call);
        self.accepted(batch);
        if let Some(races) = &mut self.races {
            races.resumed(call);
        }
    }

    #[inline]
    fn on_before<const W: usize>(&mut self, batch: &mut Batch<W>, op: OpIndex) {
        let Some((shader, plan)) = self.plan() else { return };
        if let Some(next @ (Op::Stop(_) | Op::RayQuery(_) | Op::Barrier)) = plan.program.ops.get(op.index()) {
            self.look_before(batch, plan, OpPlace { shader, op }, next);
        }
    }

    #[inline]
    fn on_after<const W: usize>(&mut self, batch: &mut Batch<W>, bindings: &Bindings, op: OpIndex) {
        let Some((shader, plan)) = self.plan() else { return };
        let Some(mut shadow) = batch.registers.shadow.take() else { return };
        let executed = Executed { place: OpPlace { shader, op }, step: &plan.steps[op.index()] };
        match &plan.program.ops[op.index()] {
            Op::LaneKernel { kernel, to, from } if plan.stale.is_empty() && executed.step.is_plain => {
                kernel::check(self, batch, &mut shadow, executed, kernel, *to, from);
            }
            Op::Memory(op) if plan.stale.is_empty() && executed.step.uniformity.is_none() => {
                memory::check(self, batch, bindings, &mut shadow, executed, op);
            }
            _ => self.look_after(batch, bindings, &mut shadow, plan, executed),
        }
        batch.registers.shadow = Some(shadow);
    }

    /// Looks at an operation that is about to run, and hands the batch to the pipeline or starts a
    /// ray query.
    #[inline(never)]
    fn look_before<const W: usize>(
        &mut self,
        batch: &mut Batch<W>,
        plan: &ProgramPlan,
        place: OpPlace,
        next: &Op,
    ) {
        let op = place.op;
        match next {
            Op::Stop(stopped) => {
                let Some(mut shadow) = batch.registers.shadow.take() else { return };
                stop::check(self, batch, &mut shadow, op, stopped);
                if let Some(uniform) = &plan.steps[op.index()].uniformity {
                    uniformity::check(self, batch, op, uniform);
                }
                stale::stop(&mut shadow, &plan.stale, next, batch.mask);
                batch.registers.shadow = Some(shadow);
            }
            Op::RayQuery(RayQueryOp::Initialize { operands, .. }) => {
                let Some(shadow) = batch.registers.shadow.take() else { return };
                ray::check_specials(self, batch, &shadow, op, operands.plus(4));
                query_ray::before_initialize(self, batch, *operands);
                batch.registers.shadow = Some(shadow);
            }
            Op::Barrier => {
                if let Some(races) = &mut self.races {
                    races.barrier(batch, &plan.program, place);
                }
            }
            _ => {}
        }
    }

    /// Looks at an operation that has run, of whatever kind.
    #[inline(never)]
    fn look_after<const W: usize>(
        &mut self,
        batch: &mut Batch<W>,
        bindings: &Bindings,
        shadow: &mut ShadowRegisters<W>,
        plan: &ProgramPlan,
        executed: Executed<'_>,
    ) {
        let Executed { place, step } = executed;
        let op = place.op;
        if let Some(uniform) = &step.uniformity {
            uniformity::check(self, batch, op, uniform);
        }
        match &plan.program.ops[op.index()] {
            Op::LaneKernel { kernel: lane_kernel, to, from } => {
                kernel::check(self, batch, shadow, executed, lane_kernel, *to, from);
                if let Some(watched) = step.watched {
                    bounds::check_kernel(self, batch, bindings, op, watched, *to, from);
                }
            }
            Op::Memory(op) => memory::check(self, batch, bindings, shadow, executed, op),
            Op::HeapDescriptor(found) => {
                self.depend(batch, shadow, op, found.index, Sink::Index);
                shadow.define(found.to);
            }
            Op::Image(operation) => {
                image::check(self, batch, bindings, shadow, op, operation);
                image_format::check_image(self, batch, bindings, shadow, place, operation);
                bounds::check_image(self, batch, bindings, shadow, place, operation);
                contents::image(self, batch, bindings, shadow, place, operation);
                if let Some(races) = self.races.as_mut().filter(|races| races.watches(place)) {
                    let found = races.access_image(batch, bindings, place, operation);
                    self.tell_races(batch, op, &found);
                }
            }
            Op::RayQuery(ray_query) => {
                check_ray_query(self, batch, shadow, op, ray_query);
                query::check(self, batch, op, ray_query, step.ignores_result);
                match *ray_query {
                    RayQueryOp::Initialize { query, .. } => query_ray::initialized(self, batch, op, query),
                    RayQueryOp::Generate { query, .. } => query_ray::generated(self, batch, op, query),
                    _ => {}
                }
            }
            Op::Subgroup(op) => subgroup::check(self, batch, shadow, executed, op),
            Op::Cooperative(op) => cooperative::check(self, batch, bindings, shadow, place, op),
            Op::Atomic(atomic) => {
                let mut accesses = |visit: &mut dyn FnMut(Access)| atomic.accesses(visit);
                self.depend_on_reads(batch, shadow, op, Sink::Atomic, &mut accesses);
                reach_memory(self, batch, shadow, op, atomic);
                shared::atomic(self, batch, bindings, shadow, place, atomic);
                match &atomic.target {
                    AtomicTarget::Buffer(chunk) => bounds::check_buffer(self, batch, bindings, op, chunk),
                    AtomicTarget::Texel(texel) => {
                        let to = Some((atomic.to, atomic.words()));
                        let access = TexelAccess { texel, to, writes: atomic.kind != AtomicKind::Load };
                        bounds::check_texel(self, batch, bindings, shadow, place, access);
                        let (view, handle) = (texel.view, texel.image);
                        let access = ImageAccess { view, handle, to: None, does: "an atomic update of" };
                        image_format::check(self, batch, bindings, shadow, place, access);
                    }
                    AtomicTarget::Registers { .. } => {}
                }
                contents::atomic(self, batch, bindings, shadow, place, atomic);
                if let Some(races) = self.races.as_mut().filter(|races| races.watches(place)) {
                    let found = races.access_atomic(batch, bindings, &plan.program, place, atomic);
                    self.tell_races(batch, op, &found);
                }
            }
            Op::Print(print) => {
                for &reg in print.arguments.iter().flat_map(Argument::registers) {
                    self.depend(batch, shadow, op, reg, Sink::Print);
                    births::reach(self, batch, shadow, op, reg, batch.mask, SpecialSink::Print);
                }
            }
            Op::HitObject(object) => {
                hit_object::check(self, batch, shadow, op, object);
                define_writes(shadow, batch.mask, &mut |visit| object.accesses(visit));
            }
            Op::Step => {
                if let Some(races) = &mut self.races {
                    races.fence(batch, &plan.program, place);
                }
            }
            Op::Stop(_) | Op::Barrier => {}
        }
        for (kind, tracked) in plan.stale.iter().enumerate() {
            stale::track(self, batch, shadow, executed, &plan.program.ops[op.index()], (kind, tracked));
        }
    }

    /// What a branch or switch depends on must be defined.
    fn depend_on_branch<const W: usize>(&mut self, batch: &mut Batch<W>) {
        let Some((_, plan)) = self.plan() else { return };
        let (register, words, sink) = match plan.program.blocks[batch.block.index()].terminator {
            Terminator::BranchConditional { condition, .. } => (condition, 1, Sink::Branch),
            Terminator::Switch { selector, wide, .. } => (selector, 1 + u32::from(wide), Sink::Switch),
            _ => return,
        };
        let Some(mut shadow) = batch.registers.shadow.take() else { return };
        let op = plan.program.terminator_index(batch.block);
        self.depend_on_all(batch, &mut shadow, op, register, words, sink);
        stale::branch(self, batch, &shadow, &plan.stale, op, register);
        batch.registers.shadow = Some(shadow);
    }

    /// What is kept of the nearest hit goes stale where a report that a batch made was accepted.
    fn accepted<const W: usize>(&mut self, batch: &mut Batch<W>) {
        let (Some((_, plan)), Some(frame)) = (self.plan(), self.frames.last()) else { return };
        let stopped = plan.program.ops.get(frame.op.index());
        if let Some(&Op::Stop(RayTracingOp::ReportIntersection { accepted, .. })) = stopped
            && let Some(mut shadow) = batch.registers.shadow.take()
        {
            stale::report_accepted(&mut shadow, &plan.stale, batch.registers.mask(accepted));
            batch.registers.shadow = Some(shadow);
        }
    }
}

/// Reports a NaN or infinity that an atomic instruction writes to a buffer or an image.
fn reach_memory<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    shadow: &ShadowRegisters<W>,
    op: OpIndex,
    atomic: &AtomicOp,
) {
    let (lanes, sink) = match &atomic.target {
        _ if atomic.kind == AtomicKind::Load => return,
        AtomicTarget::Registers { .. } => return,
        AtomicTarget::Buffer(chunk) => {
            (batch.mask.without(workgroup_lanes(batch, chunk)), SpecialSink::Buffer)
        }
        AtomicTarget::Texel(texel) => {
            let handle = batch.mask.lowest().map_or(0, |lane| batch.registers[texel.image].0[lane]);
            (batch.mask, SpecialSink::Image(handle))
        }
    };
    for word in 0..atomic.words() {
        births::reach(sanitizer, batch, shadow, op, atomic.value.plus(word), lanes, sink);
    }
}

/// Makes defined what an operation has written.
fn define_writes<const W: usize>(
    shadow: &mut ShadowRegisters<W>,
    lanes: Mask<W>,
    accesses: &mut Accesses<'_>,
) {
    accesses(&mut |access| {
        if let Access::Write(first, count) = access {
            shadow.define_span(first, count, lanes);
        }
    });
}

/// What a ray query is given, and what it writes.
fn check_ray_query<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    shadow: &mut ShadowRegisters<W>,
    op: OpIndex,
    query: &RayQueryOp,
) {
    match *query {
        RayQueryOp::Initialize { operands, .. } => {
            ray::check_query(sanitizer, batch, shadow, op, operands);
        }
        RayQueryOp::Generate { t, .. } => sanitizer.depend(batch, shadow, op, t, Sink::ReportedT),
        _ => {}
    }
    define_writes(shadow, batch.mask, &mut |visit| query.accesses(visit));
}
