//! Executes the operations of invocations in f64 along with the f32 run: a shadow interpreter, as
//! in LLVM's NSan.

use std::collections::HashMap;

use crate::stability::found::{LineFindings, REPORTED_ERROR, ShadowFindings};
use crate::stability::probe::{Probe, RunPart};
use crate::stability::rays::{RayOperandOffset, RayShadow, ShadowedQuery, ShadowedTrace};
use crate::stability::shadow_context::{Memory, ShadowContext};
use crate::stability::shadow_value::ShadowValue;
use crate::stability::shadows::{ShadowFrame, TexelError, WaitsFor, bits, float};
use crate::stability::texel_shadows;
use anyhit_base::sorted::sort_by_key;
use anyhit_engine::accel::Candidate;
use anyhit_engine::machine::format::Class;
use anyhit_engine::machine::object::ObjectRef;
use anyhit_engine::machine::{Batch, Bindings, BlockIndex, Exit, OpIndex, Reg};
use anyhit_engine::module::interface::Stage;
use anyhit_engine::ops::access::{Access, RegCopy};
use anyhit_engine::ops::glsl::{self, parts};
use anyhit_engine::ops::image::ImageOp;
use anyhit_engine::ops::lane_kernel::LaneKernel;
use anyhit_engine::ops::memory::{self, Chunk};
use anyhit_engine::ops::op::Op;
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::ops::shadow_op::{ScratchRegisters, ShadowOp};
use anyhit_engine::ops::{arithmetic, ray_query, ray_tracing};
use anyhit_engine::pipeline::Event;
use anyhit_engine::program::Terminator;

/// A sum or difference that loses more bits than this counts as a cancellation.
const CANCELLATION_BITS: f64 = 8.0;

/// The shadow interpreter of one task of invocations.
pub(super) struct ShadowInterpreter<'a> {
    context: &'a ShadowContext,
    frames: Vec<ShadowFrame>,
    free_frames: Vec<ShadowFrame>,
    /// Invocations of a dispatch that wait at a barrier.
    waiting: HashMap<[u32; 3], ShadowFrame>,
    generation: u64,
    rays: Vec<ShadowedTrace>,
    pub memory: Memory,
    scratch: ScratchRegisters,
    launch_id: Option<[u32; 3]>,
    dispatch: bool,
    pipeline: Option<usize>,
    /// Index of the running pass in the scene.
    pass: usize,
    /// The errors of the texels that invocations have written.
    pub texel_errors: Vec<TexelError>,
    /// The findings by shader and word offset.
    found: HashMap<(usize, u32), LineFindings>,
}

/// The float result that the shadow operation of a kernel gives.
struct ShadowResult<'a> {
    /// The result.
    value: f64,
    /// The greatest relative difference of an operand from its shadow.
    operand_error: f64,
    /// The kernel that computed it; `None` for a copy of the operand.
    kernel: Option<&'a LaneKernel>,
}

impl<'a> ShadowInterpreter<'a> {
    /// An interpreter for a task that has not begun.
    pub(super) fn new(context: &'a ShadowContext) -> Self {
        Self {
            context,
            frames: Vec::new(),
            free_frames: Vec::new(),
            waiting: HashMap::new(),
            generation: 0,
            rays: Vec::new(),
            memory: context.memory().clone(),
            scratch: ScratchRegisters::default(),
            launch_id: None,
            dispatch: false,
            pipeline: None,
            pass: 0,
            texel_errors: Vec::new(),
            found: HashMap::new(),
        }
    }

    /// The findings by source line.
    pub(super) fn findings(&self) -> ShadowFindings {
        let mut shadow = ShadowFindings::default();
        let mut found: Vec<_> = self.found.iter().collect();
        sort_by_key(&mut found, |(key, _)| **key);
        for (&(shader, offset), found) in found {
            shadow.results += found.results;
            shadow.lines.entry(self.context.programs.location(shader, offset)).or_default().add(found);
        }
        shadow
    }

    fn enter(&mut self, shader: usize) -> &mut ShadowFrame {
        let mut frame = self.free_frames.pop().unwrap_or_default();
        self.generation += 1;
        frame.begin(shader, self.context.programs.all[shader].register_count as usize, self.generation);
        self.frames.push(frame);
        self.frames.last_mut().expect("bug in anyhit: no frame was pushed")
    }

    fn findings_at(&mut self, offset: u32) -> Option<&mut LineFindings> {
        let shader = self.frames.last()?.shader;
        Some(self.found.entry((shader, offset)).or_default())
    }

    /// Runs the shadow operation of a kernel and compares the results.
    fn lane_kernel(
        &mut self,
        batch: &Batch<1>,
        offset: u32,
        shadow_op: ShadowOp,
        kernel: &LaneKernel,
        to: Reg,
        from: &[Reg; 3],
    ) {
        let Some(frame) = self.frames.last_mut() else { return };
        let read = |at: usize| bits(batch, from[at], kernel.operands[at].max(1));
        let result = bits(batch, to, kernel.words);
        match shadow_op {
            ShadowOp::None => frame.invalidate(to, kernel.words),
            ShadowOp::Select => {
                let chosen = if read(0) != 0 { from[1] } else { from[2] };
                let entry = frame.entry(chosen);
                frame.set(to, entry);
                frame.join_packed(to, result, &[(chosen, result)]);
            }
            ShadowOp::Pack(width) => {
                let value = frame.value(from[0], read(0)).unwrap_or_else(|| float(read(0), 32));
                let value = if kernel.is_one_of(&[&parts::Unorm8, &parts::Unorm16]) {
                    value.clamp(0.0, 1.0)
                } else if kernel.is_one_of(&[&parts::Snorm8, &parts::Snorm16]) {
                    value.clamp(-1.0, 1.0)
                } else {
                    value
                };
                frame.invalidate(to, 1);
                frame.pack(to, result, read(1) as u32 / width, value);
            }
            ShadowOp::Join => {
                let operands = [0, 1].map(|at| (from[at], read(at)));
                frame.invalidate(to, 1);
                frame.join_packed(to, result, &operands);
            }
            ShadowOp::Unpack(width) => {
                let value = frame.packed(from[0], read(0), read(1) as u32 / width);
                frame.set(to, value.map(|value| ShadowValue { bits: result, value }));
                if let Some(value) = value {
                    self.read_back(offset, float(result, 32), value, width);
                }
            }
            ShadowOp::Identity => {
                let width = kernel.float_operands[0];
                let value = frame.value(from[0], read(0)).unwrap_or_else(|| float(read(0), width));
                frame.set(to, Some(ShadowValue { bits: result, value }));
                let error = relative_difference(float(read(0), width), value);
                let shadow = ShadowResult { value, operand_error: error, kernel: None };
                self.compare(offset, kernel, result, to, shadow);
            }
            ShadowOp::Logical => {
                let known = [0, 1].map(|at| frame.value(from[at], read(at)));
                if known == [None, None] {
                    return frame.invalidate(to, 1);
                }
                let operands = [0, 1].map(|at| known[at].map_or(read(at), |value| value as u64));
                let value = self.scratch.run(kernel, [operands[0], operands[1], 0]) as f64;
                frame.set(to, Some(ShadowValue { bits: result, value }));
            }
            ShadowOp::Number(wide) | ShadowOp::Comparison(wide) | ShadowOp::Integer(wide) => {
                let mut operands = [0; 3];
                let (mut worst, mut known) = (0.0_f64, false);
                for at in 0..3 {
                    let bits = if kernel.operands[at] > 0 { read(at) } else { 0 };
                    operands[at] = bits;
                    let width = kernel.float_operands[at];
                    if width > 0 {
                        let own = float(bits, width);
                        let value = frame.value(from[at], bits);
                        known |= value.is_some();
                        let value = value.unwrap_or(own);
                        worst = worst.max(relative_difference(own, value));
                        operands[at] = value.to_bits();
                    }
                }
                let decides = !matches!(shadow_op, ShadowOp::Number(_));
                if decides && !known {
                    return frame.invalidate(to, kernel.words);
                }
                let value = self.scratch.run(wide, operands);
                if !decides {
                    let value = f64::from_bits(value);
                    let shadow = ShadowResult { value, operand_error: worst, kernel: Some(wide) };
                    return self.compare(offset, kernel, result, to, shadow);
                }
                frame.set(to, Some(ShadowValue { bits: result, value: value as f64 }));
                if value != result
                    && let Some(found) = self.findings_at(offset)
                {
                    match shadow_op {
                        ShadowOp::Comparison(_) => found.comparisons += 1,
                        _ => found.integers += 1,
                    }
                }
            }
        }
    }

    /// Compares a float result with its shadow.
    fn compare(&mut self, offset: u32, kernel: &LaneKernel, result: u64, to: Reg, shadow: ShadowResult<'_>) {
        let ShadowResult { value, operand_error, kernel: wide } = shadow;
        let own = float(result, kernel.float_result);
        let launch_id = self.launch_id;
        let comparable = own.is_finite() && value.is_finite();
        let entry = comparable.then_some(ShadowValue { bits: result, value });
        let Some(frame) = self.frames.last_mut() else { return };
        frame.set(to, entry);
        let Some(found) = self.findings_at(offset) else { return };
        found.results += 1;
        if !comparable {
            found.not_finite += u64::from(own.is_finite() != value.is_finite());
            return;
        }
        let error = relative_difference(own, value);
        if error > found.error {
            (found.error, found.launch_id) = (error, launch_id);
        }
        let roundoff = unit_roundoff(kernel.float_result);
        if error > roundoff {
            let lost = (error / operand_error.max(roundoff)).log2();
            found.bits_lost = found.bits_lost.max(lost);
            let sums = [&arithmetic::FAdd, &arithmetic::FSub, &glsl::Fma, &arithmetic::FmaKHR, &glsl::FMix];
            let is_sum = wide.is_some_and(|kernel| kernel.is_one_of(&sums));
            found.cancellations += u64::from(is_sum && lost > CANCELLATION_BITS);
        }
    }

    /// Compares a number that was stored in fewer bits than it was computed in with its shadow.
    fn read_back(&mut self, offset: u32, own: f64, value: f64, width: u32) {
        let launch_id = self.launch_id;
        let error = relative_difference(own, value);
        if width >= 32 || error <= REPORTED_ERROR {
            return;
        }
        let Some(found) = self.findings_at(offset) else { return };
        found.read_back += 1;
        found.storage_bits = match found.storage_bits {
            0 => width,
            known => known.min(width),
        };
        if error > found.error {
            (found.error, found.launch_id) = (error, launch_id);
        }
    }

    /// Follows copies of registers, loads and stores; other results have no shadow.
    fn move_op(&mut self, batch: &Batch<1>, bindings: &Bindings, op: &Op, offset: u32) {
        let Some(frame) = self.frames.last_mut() else { return };
        if let Some(RegCopy { to, from, .. }) = op.copy() {
            let entry = frame.entry(from);
            frame.set(to, entry);
            let bits = bits(batch, from, 1);
            frame.join_packed(to, bits, &[(from, bits)]);
        } else if let Some(computed) = op.computed_registers() {
            let element = computed.first.computed(batch.registers[computed.index].0[0]);
            let (to, from) =
                if computed.writes { (element, computed.other) } else { (computed.other, element) };
            for word in 0..computed.count {
                let entry = frame.entry(from.plus(word));
                frame.set(to.plus(word), entry);
            }
        } else if let Some((to, chunk)) = op.buffer_load() {
            let keys = memory_keys(batch, bindings, chunk);
            let mut halves = Vec::new();
            for word in 0..chunk.count {
                let known = keys.and_then(|key| self.memory.get(&key(word)).copied());
                frame.set(to.plus(word), known);
                if let Some(key) = keys.filter(|_| chunk.width == 32) {
                    frame.load_packed(to.plus(word), key(word), &self.memory);
                }
                let bits = bits(batch, to.plus(word), 1);
                if let Some(entry) = known.filter(|entry| chunk.width == 16 && entry.bits == bits) {
                    halves.push((float(bits, 16), entry.value));
                }
            }
            for (own, value) in halves {
                self.read_back(offset, own, value, 16);
            }
        } else if let Some((from, chunk)) = op.buffer_store() {
            let Some(key) = memory_keys(batch, bindings, chunk) else { return };
            for word in 0..chunk.count {
                match frame.entry(from.plus(word)) {
                    Some(entry) => self.memory.insert(key(word), entry),
                    None => self.memory.remove(&key(word)),
                };
                if chunk.width == 32 {
                    frame.store_packed(from.plus(word), key(word), &mut self.memory);
                }
            }
        } else {
            op.accesses(|access| {
                if let Access::Write(first, count) = access {
                    frame.invalidate(first, count);
                }
            });
        }
    }

    /// Follows a ray query. At its end, and when its committed hit is read, that hit is compared.
    fn ray_query_op(&mut self, batch: &mut Batch<1>, offset: u32, op: &ray_query::RayQueryOp) {
        let Some(frame) = self.frames.last_mut() else { return };
        op.accesses(&mut |access| {
            if let Access::Write(first, count) = access {
                frame.invalidate(first, count);
            }
        });
        let register = |query: ObjectRef| query.register(&batch.registers, 0).ok();
        let handle = op.query().and_then(register).map(|register| batch.registers[register].0[0]);
        let Some((handle, Ok(query))) = handle.map(|handle| (handle, batch.queries.query(handle))) else {
            return;
        };
        if let ray_query::RayQueryOp::Initialize { operands, .. } = *op {
            let ray_shadow = frame.ray_shadow(RayOperandOffset::QUERY, operands);
            frame.queries.insert(handle, ShadowedQuery::new(ray_shadow));
            return;
        }
        let Some(shadowed_query) = frame.queries.get_mut(&handle) else { return };
        let is_final = match *op {
            ray_query::RayQueryOp::Confirm { .. } | ray_query::RayQueryOp::Generate { .. } => {
                shadowed_query.confirm();
                false
            }
            ray_query::RayQueryOp::Terminate { .. } => {
                shadowed_query.terminate();
                false
            }
            ray_query::RayQueryOp::Proceed { .. } => {
                let candidate = query.candidate().ok();
                shadowed_query.proceed(candidate);
                candidate.is_none()
            }
            ray_query::RayQueryOp::Type { committed, .. } => committed,
            ray_query::RayQueryOp::GetRay { getter, to, .. } => {
                let ray_shadow = shadowed_query.ray_shadow.clone();
                for word in 0..getter.words() {
                    let number =
                        getter.operand().and_then(|first| first.checked_sub(RayOperandOffset::QUERY.0));
                    frame.set(to.plus(word), number.and_then(|first| ray_shadow.entry(first + word)));
                }
                return;
            }
            _ => false,
        };
        if is_final
            && shadowed_query.hit_differs(query)
            && let Some(found) = self.findings_at(offset)
        {
            found.hits += 1;
        }
    }

    fn enter_stage(&mut self, shader: usize, stage: Stage) {
        let program = self.context.programs.all[shader].clone();
        let caller = self.frames.last();
        let data = match stage {
            Stage::Callable => caller.and_then(|caller| match caller.waits_for {
                WaitsFor::Call(span) => Some(caller.entries(span)),
                _ => None,
            }),
            _ => self.rays.last().map(|ray| ray.payload.clone()),
        };
        let class = match stage {
            Stage::Callable => storage::INCOMING_CALLABLE_DATA,
            _ => storage::INCOMING_RAY_PAYLOAD,
        };
        let reported = matches!(caller, Some(ShadowFrame { waits_for: WaitsFor::Report, .. }));
        let (t, attributes) = match (stage, self.rays.last()) {
            (Stage::AnyHit, Some(ray)) if reported => ray.reported.clone(),
            (Stage::ClosestHit | Stage::Intersection, Some(ray)) => ray.accepted.clone(),
            _ => Default::default(),
        };
        let ray_shadow = match stage {
            Stage::Callable | Stage::RayGeneration => RayShadow::default(),
            _ => self.rays.last().map_or_else(RayShadow::default, |ray| ray.ray_shadow.clone()),
        };
        let frame = self.enter(shader);
        if let (Some(registers), Some(data)) = (program.interface_registers(class), data) {
            frame.set_all(registers.span(), &data);
        }
        if let Some(registers) = program.interface_registers(storage::HIT_ATTRIBUTE) {
            frame.set_all(registers.span(), &attributes);
        }
        for input in &program.inputs {
            let entry = |word: u32| match input.builtin.number {
                WORLD_RAY_ORIGIN => ray_shadow.entry(word),
                WORLD_RAY_DIRECTION => ray_shadow.entry(RayOperandOffset::DIRECTION + word),
                RAY_T_MIN => ray_shadow.entry(RayOperandOffset::T_MIN),
                // Without a reported hit it is the ray's t max. A shadow value is used only if its
                // bits match the register's.
                RAY_T_MAX => t.or_else(|| ray_shadow.entry(RayOperandOffset::T_MAX)),
                _ => None,
            };
            for word in 0..input.count {
                frame.set(input.first.plus(word), entry(word));
            }
        }
    }

    fn leave(&mut self, stage: Stage, exit: Exit) {
        let Some(frame) = self.frames.pop() else { return };
        let program = &self.context.programs.all[frame.shader];
        if stage == Stage::Callable {
            let registers = program.interface_registers(storage::INCOMING_CALLABLE_DATA);
            if let (Some(registers), Some(caller)) = (registers, self.frames.last_mut())
                && let WaitsFor::Call(data) = caller.waits_for
            {
                caller.set_all(data, &frame.entries(registers.span()));
            }
        } else if let Some(ray) = self.rays.last_mut() {
            if let Some(registers) = program.interface_registers(storage::INCOMING_RAY_PAYLOAD) {
                ray.payload = frame.entries(registers.span());
            }
            if let (Stage::AnyHit, Exit::Ignored, Some(candidate)) = (stage, exit, ray.candidate) {
                ray.ignored.insert(candidate);
            }
        }
        self.free_frames.push(frame);
    }
}

/// The numbers of builtins that have the shadow values of the traced ray.
const WORLD_RAY_ORIGIN: u32 = 5321;
const WORLD_RAY_DIRECTION: u32 = 5322;
const RAY_T_MIN: u32 = 5325;
const RAY_T_MAX: u32 = 5326;

/// The keys in [`Memory`] of the scalars of an access, by word.
fn memory_keys<'a>(
    batch: &Batch<1>,
    bindings: &Bindings,
    chunk: &'a Chunk,
) -> Option<impl Fn(u32) -> (usize, u64) + Copy + use<'a>> {
    let (buffer, offset) = memory::access_location(batch, 0, bindings, chunk)?;
    // Views of one buffer have its memory in common.
    let (memory, offset) = (buffer.memory_id(), buffer.offset() + offset);
    let width = u64::from(chunk.width / 8);
    Some(move |word: u32| (memory, offset + u64::from(word) * width))
}

/// The difference of two numbers divided by the greater magnitude; 0 below the normal numbers of
/// f32, where relative accuracy is lost.
fn relative_difference(own: f64, value: f64) -> f64 {
    let scale = own.abs().max(value.abs());
    if own == value || !scale.is_finite() || scale < f64::from(f32::MIN_POSITIVE) {
        return 0.0;
    }
    (own - value).abs() / scale
}

/// The relative error of one rounding to a width.
fn unit_roundoff(width: u32) -> f64 {
    match width {
        16 => 2f64.powi(-11),
        32 => 2f64.powi(-24),
        _ => 2f64.powi(-53),
    }
}

impl Probe for ShadowInterpreter<'_> {
    fn begin(&mut self, part: RunPart) {
        self.frames.clear();
        self.rays.clear();
        // A ray from the host has no shadow values.
        self.rays.push(ShadowedTrace::default());
        (self.pass, self.launch_id) = match part {
            RunPart::Invocation { pass, id, .. } => (pass, Some(id)),
            RunPart::Dispatch { pass, .. } => (pass, None),
            RunPart::Ray(_) => (0, None),
        };
        self.pipeline = part.pipeline();
        self.dispatch = matches!(part, RunPart::Dispatch { .. });
    }

    fn first_program(&self) -> usize {
        self.context.programs.first(self.pipeline)
    }

    fn resumed(&mut self, shader: usize, batch: &mut Batch<1>) {
        if self.dispatch {
            let id = batch.invocations.launch_id(0);
            self.launch_id = Some(id);
            match self.waiting.remove(&id) {
                Some(frame) => self.frames.push(frame),
                None => {
                    self.enter(shader);
                }
            }
            return;
        }
        let Some(frame) = self.frames.last_mut() else { return };
        match std::mem::take(&mut frame.waits_for) {
            WaitsFor::Trace(span) => {
                if let Some(ray) = self.rays.pop() {
                    frame.set_all(span, &ray.payload);
                }
            }
            WaitsFor::No | WaitsFor::Call(_) | WaitsFor::Report => {}
        }
    }

    fn stopped(&mut self, batch: &Batch<1>) {
        if self.dispatch {
            let Some(frame) = self.frames.pop() else { return };
            // No lane runs after a barrier or after the end; only after the end none is live.
            match batch.live().is_empty() {
                true => self.free_frames.push(frame),
                false => {
                    self.waiting.insert(batch.invocations.launch_id(0), frame);
                }
            }
            return;
        }
        let Some(frame) = self.frames.last_mut().filter(|_| !batch.mask.is_empty()) else { return };
        let program = &self.context.programs.all[frame.shader];
        let Some(at) = batch.op.previous().map(OpIndex::index) else { return };
        let Some(Op::Stop(stop)) = program.ops.get(at) else { return };
        frame.wait_offset = program.origins[at].offset;
        match *stop {
            ray_tracing::RayTracingOp::TraceRay { operands, payload }
            | ray_tracing::RayTracingOp::HitObjectTrace { operands, payload, .. } => {
                frame.waits_for = WaitsFor::Trace(payload);
                let ray_shadow = frame.ray_shadow(RayOperandOffset::TRACE, operands);
                let payload = frame.entries(payload);
                self.rays.push(ShadowedTrace { payload, ray_shadow, ..ShadowedTrace::default() });
            }
            ray_tracing::RayTracingOp::HitObjectExecute { payload, .. } => {
                frame.waits_for = WaitsFor::Trace(payload);
                let payload = frame.entries(payload);
                self.rays.push(ShadowedTrace { payload, ..ShadowedTrace::default() });
            }
            ray_tracing::RayTracingOp::ExecuteCallable { data, .. } => frame.waits_for = WaitsFor::Call(data),
            ray_tracing::RayTracingOp::ReportIntersection { t, accepted, .. } => {
                frame.waits_for = WaitsFor::Report;
                frame.invalidate(accepted, 1);
                let t = frame.entry(t);
                let registers = program.interface_registers(storage::HIT_ATTRIBUTE);
                let attributes = registers.map_or_else(Vec::new, |registers| frame.entries(registers.span()));
                if let Some(ray) = self.rays.last_mut() {
                    ray.reported = (t, attributes);
                }
            }
            ray_tracing::RayTracingOp::HitObjectRecordHandle { to, .. } => frame.invalidate(to, 2),
        }
    }

    fn after(&mut self, batch: &mut Batch<1>, bindings: &Bindings, op: OpIndex) {
        let Some(frame) = self.frames.last_mut() else { return };
        let context = self.context;
        let (shader, at) = (frame.shader, op.index());
        let program = &context.programs.all[shader];
        let mut read_back = Vec::new();
        match &program.ops[at] {
            Op::LaneKernel { kernel, to, from } => {
                let offset = program.origins[at].offset;
                self.lane_kernel(batch, offset, context.shadow_ops[shader][at], kernel, *to, from);
            }
            Op::RayQuery(op) => self.ray_query_op(batch, program.origins[at].offset, op),
            Op::Image(ImageOp::Write(op)) if op.is_float() => {
                if let Some(id) = self.launch_id {
                    let ulps = frame.texel_ulps(batch, op);
                    self.texel_errors.push(TexelError { pass: self.pass, id, ulps });
                }
                self.memory.extend(texel_shadows::stored(frame, batch, bindings, op));
            }
            Op::Image(ImageOp::Read(op)) if op.texel.view.class == Class::Float => {
                let offset = program.origins[at].offset;
                for read in texel_shadows::read(batch, bindings, op) {
                    let known = self.memory.get(&read.key).filter(|entry| entry.bits == read.bits).copied();
                    frame.set(read.to, known);
                    if let Some(entry) = known {
                        let own = f64::from(f32::from_bits(read.bits as u32));
                        read_back.push((offset, own, entry.value, read.width));
                    }
                }
            }
            op => self.move_op(batch, bindings, op, program.origins[at].offset),
        }
        for (offset, own, value, width) in read_back {
            self.read_back(offset, own, value, width);
        }
    }

    fn edge_taken(&mut self, block: BlockIndex, edge: u32) {
        let Some(frame) = self.frames.last() else { return };
        let program = &self.context.programs.all[frame.shader];
        let flips = match &program.blocks[block.index()].terminator {
            Terminator::BranchConditional { condition, .. } => frame
                .entry(*condition)
                .is_some_and(|entry| entry.bits == u64::from(edge == 0) && entry.value as u64 != entry.bits),
            Terminator::Switch { selector, cases, .. } => frame.entry(*selector).is_some_and(|entry| {
                let case = |value: u64| cases.iter().position(|case| case.0 == value).unwrap_or(cases.len());
                case(entry.bits) == edge as usize && case(entry.value as u64) != edge as usize
            }),
            _ => false,
        };
        let offset = self.context.branches[frame.shader][block.index()];
        if flips && let Some(found) = self.findings_at(offset) {
            found.branches += 1;
        }
    }

    fn event(&mut self, event: &Event) {
        match event {
            Event::Trace { tlas, trace, .. } => {
                if let Some(ray) = self.rays.last_mut() {
                    ray.traced = Some((tlas.clone(), *trace));
                }
            }
            Event::Candidate { candidate: Candidate { instance, geometry, primitive, .. }, .. } => {
                if let Some(ray) = self.rays.last_mut() {
                    ray.candidate = Some((*instance, *geometry, *primitive));
                    ray.reported = Default::default();
                }
            }
            Event::Report { accepted: true, .. } => {
                if let Some(ray) = self.rays.last_mut() {
                    ray.accepted = ray.reported.clone();
                }
            }
            Event::Traversed { committed, .. } => {
                let flags = self.context.flags(self.pipeline);
                let other = |ray: &ShadowedTrace| ray.hit_differs(committed.as_ref(), flags);
                if self.rays.last().is_some_and(other)
                    && let Some(at) = self.frames.last().map(|frame| frame.wait_offset)
                    && let Some(found) = self.findings_at(at)
                {
                    found.hits += 1;
                }
            }
            Event::Enter { shader, stage, .. } => {
                self.enter_stage(self.first_program() + shader.index(), *stage);
            }
            Event::Leave { stage, exit, .. } => self.leave(*stage, *exit),
            _ => {}
        }
    }
}
