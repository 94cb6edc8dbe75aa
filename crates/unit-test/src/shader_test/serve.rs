//! Answers the traces, calls and reports of the shader under test.

use crate::data::TypedBytes;
use crate::mock::{CallableCall, ExecuteCall, TraceCall};
use crate::shader_outcome::ReportedHit;
use crate::shader_test::{RunningTest, ShaderTest, invalid};
use anyhit_base::error::{Error, Result};
use anyhit_engine::accel::HitKind;
use anyhit_engine::machine::hit_object::HitObject;
use anyhit_engine::machine::object::ObjectRef;
use anyhit_engine::machine::stop::{RegSpan, Stop};
use anyhit_engine::machine::{Batch, Mask, Reg, TrapCode};
use anyhit_engine::ops::hit_object::store;
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::ops::ray_tracing::TRACE_OPERANDS;
use anyhit_engine::pipeline::{Event, trace_operands};

impl ShaderTest {
    /// Serves what the shader stopped at, if it is anything that a test answers.
    pub(super) fn serve(&self, running: &mut RunningTest, stop: Stop<1>) -> Result<()> {
        let RunningTest { batch, events, traces, executes, calls, reports } = running;
        let answered = match stop {
            Stop::Done | Stop::Paused => None,
            Stop::Barrier { .. } => {
                unreachable!("bug in anyhit: a barrier of a workgroup outside compute")
            }
            Stop::ReportIntersection { t, hit_kind, accepted, .. } => {
                let report = self.report(batch, t, hit_kind)?;
                batch.registers[accepted].0[0] = u32::from(report.accepted);
                let hit_kind = HitKind(report.kind);
                events.push(Event::Report { t: report.t, hit_kind, accepted: report.accepted });
                reports.push(report);
                None
            }
            Stop::TraceRay { operands, payload, .. } => {
                traces.extend(self.trace(batch, operands, payload, traces.len(), None)?);
                Some(payload)
            }
            Stop::ExecuteCallable { index, data, .. } => {
                calls.push(self.call(batch, index, data, calls.len())?);
                Some(data)
            }
            Stop::HitObjectTrace { object, operands, payload, .. } => {
                traces.extend(self.trace(batch, operands, payload, traces.len(), Some(object))?);
                Some(payload)
            }
            Stop::HitObjectExecute { object, payload, .. } => {
                executes.extend(self.execute(batch, object, payload, executes.len())?);
                Some(payload)
            }
            Stop::HitObjectRecordHandle { object, to, .. } => {
                self.record_handle(batch, object, to)?;
                None
            }
        };
        if let Some(span) = answered {
            batch.registers.define(span.first, span.count, Mask::ALL);
        }
        Ok(())
    }

    /// The variable of the interface whose registers an instruction names.
    fn data_at(&self, batch: &Batch<1>, at: RegSpan, what: &'static str) -> TypedBytes {
        let registers = self.program.interface.iter().find(|registers| registers.first == at.first);
        let registers = registers.expect("bug in anyhit: the payload is not a variable of the interface");
        self.data(batch, registers, what)
    }

    /// Serves a trace; `None` where the shader traps at it.
    fn trace(
        &self,
        batch: &mut Batch<1>,
        at: Reg,
        payload: RegSpan,
        number: usize,
        object: Option<ObjectRef>,
    ) -> Result<Option<TraceCall>> {
        let mut operands = [0; TRACE_OPERANDS as usize];
        let read = batch.registers.lane_words(at, TRACE_OPERANDS, 0);
        operands.iter_mut().zip(read).for_each(|(to, word)| *to = word);
        let trace = match trace_operands(&operands) {
            Ok(trace) => trace,
            Err(broken) => {
                let op = batch.stopped_at();
                batch.fault_value[0] = broken as u64;
                batch.trap(Mask::ALL, TrapCode::InvalidTrace, op);
                return Ok(None);
            }
        };
        let data = self.data_at(batch, payload, "the payload");
        let mut call = TraceCall {
            number,
            trace,
            sbt_offset: operands[4],
            sbt_stride: operands[5],
            miss_index: operands[6],
            given: data.value(),
            payload: data,
            into_hit_object: object.is_some(),
            found: None,
        };
        let in_trace = |error: Error| error.context(format!("trace {}", number + 1));
        if let Some(answer) = &self.traces {
            answer.give(&mut call).map_err(in_trace)?;
        }
        if let Some(object) = object {
            let found = call.hit_object().map_err(in_trace)?;
            if let Err(code) = store(batch, object, 0, found) {
                let op = batch.stopped_at();
                batch.trap(Mask::ALL, code, op);
                return Ok(None);
            }
        }
        batch.registers.set_lane_words(payload.first, 0, call.payload.words().take(payload.count as usize));
        Ok(Some(call))
    }

    /// Serves the execution of a hit object; `None` where the shader traps at it, or there is
    /// nothing to execute.
    fn execute(
        &self,
        batch: &mut Batch<1>,
        object: ObjectRef,
        payload: RegSpan,
        number: usize,
    ) -> Result<Option<ExecuteCall>> {
        let found = match held(batch, object) {
            Ok(HitObject::Empty) => return Ok(None),
            Ok(HitObject::Unrecorded) => Err(TrapCode::HitObjectUnrecorded),
            other => other,
        };
        let found = match found {
            Ok(found) => found,
            Err(code) => {
                let op = batch.stopped_at();
                batch.trap(Mask::ALL, code, op);
                return Ok(None);
            }
        };
        let data = self.data_at(batch, payload, "the payload");
        let Some(mut call) = ExecuteCall::of(&found, number, data) else { return Ok(None) };
        if let Some(answer) = &self.executes {
            answer.give(&mut call).map_err(|error| error.context(format!("execution {}", number + 1)))?;
        }
        batch.registers.set_lane_words(payload.first, 0, call.payload.words().take(payload.count as usize));
        Ok(Some(call))
    }

    /// Serves the question for the handle of a hit object's shader record.
    fn record_handle(&self, batch: &mut Batch<1>, object: ObjectRef, to: Reg) -> Result<()> {
        if let Err(code) = held(batch, object).and_then(|found| found.encoded().map(|_| ())) {
            let op = batch.stopped_at();
            batch.trap(Mask::ALL, code, op);
            return Ok(());
        }
        let Some(record) = &self.object_record else {
            let (stage, name) = (self.program.stage.name(), &self.program.name);
            let error = invalid(format!("{stage} `{name}` reads the shader record of a hit object"));
            return Err(error.note("set it with `.hit_object_record(&data)`"));
        };
        // Where a run puts it, too.
        let address = self.given.resources.memory.clone().add_buffer(record);
        batch.registers.set_lane_words(to, 0, [address as u32, (address >> 32) as u32]);
        Ok(())
    }

    fn call(&self, batch: &mut Batch<1>, index: Reg, span: RegSpan, number: usize) -> Result<CallableCall> {
        let index = batch.registers[index].0[0];
        let data = self.data_at(batch, span, "the callable data");
        let mut call = CallableCall { number, index, given: data.value(), data };
        if let Some(answer) = &self.calls {
            answer.give(&mut call).map_err(|error| error.context(format!("call {}", number + 1)))?;
        }
        batch.registers.set_lane_words(span.first, 0, call.data.words().take(span.count as usize));
        Ok(call)
    }

    fn report(&self, batch: &mut Batch<1>, t: Reg, kind: Reg) -> Result<ReportedHit> {
        let (t, kind) = (f32::from_bits(batch.registers[t].0[0]), batch.registers[kind].0[0]);
        let attributes = self.read(batch, self.program.interface_registers(storage::HIT_ATTRIBUTE));
        let t_min = batch.invocations.rays.get(0).ray.t_min;
        let accepted = kind < 128 && (t_min..=batch.invocations.t_max(0)).contains(&t);
        let mut report = ReportedHit { t, kind, attributes, accepted };
        if let Some(answer) = self.reports.as_ref().filter(|_| accepted) {
            answer.give(&mut report)?;
        }
        if kind > 127 {
            let op = batch.stopped_at();
            batch.fault_value[0] = kind.into();
            batch.trap(Mask::ALL, TrapCode::InvalidHitKind, op);
        } else if report.accepted {
            batch.invocations.set_t_max(0, t);
            self.program.refresh_inputs(batch, Mask::ALL, true);
            self.override_builtins(batch);
        }
        Ok(report)
    }
}

/// What a hit object holds.
fn held(batch: &Batch<1>, object: ObjectRef) -> Result<HitObject, TrapCode> {
    let register = object.register(&batch.registers, 0)?;
    Ok(batch.hit_objects.get(batch.registers[register].0[0]).cloned().unwrap_or_default())
}
