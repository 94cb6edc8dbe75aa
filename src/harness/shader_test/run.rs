//! Runs the shader under test.

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::harness::bound::Bound;
use crate::harness::data::TypedBytes;
use crate::harness::explain::{Explanation, What};
use crate::harness::memory;
use crate::harness::mock::answered;
use crate::harness::shader_outcome::ShaderOutcome;
use crate::harness::shader_test::ShaderTest;
use crate::harness::value::Value;
use crate::interp;
use crate::machine::stop::Stop;
use crate::machine::{Batch, Exit, Mask, Observer, Reg, ShaderIndex};
use crate::module::interface::Stage;
use crate::ops::pointer::storage;
use crate::ops::translate::InterfaceRegisters;
use crate::pipeline::{Event, Pipeline, trap_error, with_limit};
use crate::sanitize::module_checks::check_module;
use crate::sanitize::{Levels, ProgramPlan, Sanitizer};

impl ShaderTest {
    /// Runs the shader once. Buffers and images are copied first: a test can be run again.
    ///
    /// # Errors
    /// `Trap` where the shader misbehaves, with its source line; `InvalidArgument` for a builtin or
    /// a layout that does not fit, with both layouts, where the ray misses, and where the shader
    /// traces or calls and nothing answers; what an answer returns.
    pub fn run(&self) -> Result<ShaderOutcome> {
        self.run_observed(&mut ())
    }

    /// Runs the shader as [`ShaderTest::run`] does, under the sanitizer: it checks what no driver
    /// tells, such as reads of what nobody has written. Returns what it only warns of. What the
    /// test gives, and what answers write, counts as written.
    ///
    /// ```
    /// use anyhit::{Module, ShaderTest};
    ///
    /// # fn main() -> anyhit::Result<()> {
    /// let module = Module::open("spirv-fixtures/fail/memory/array-index/main.rgen.spv")?;
    /// let test = ShaderTest::new(&module, "main")?.buffer(0, 1, &[0.0f32; 6]);
    /// assert!(test.launch([3, 0, 0], [6, 1, 1]).sanitize()?.is_empty());
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// `Finding` for what it denies, all in one error; else as [`ShaderTest::run`].
    pub fn sanitize(&self) -> Result<Vec<Error>> {
        let test = Self { program: Arc::new(self.program.unoptimized()?), ..self.clone() };
        let (plans, levels) = ([ProgramPlan::new(&test.program)], Levels::default());
        let mut sanitizer = Sanitizer::new(&plans, &levels);
        let outcome = {
            let mut observer: &mut dyn Observer<1> = &mut sanitizer;
            test.run_observed(&mut observer)
        };
        let mut findings = check_module(&test.program, ShaderIndex(0), &levels);
        findings.extend(sanitizer.into_findings());
        findings.into_warnings(outcome.map(|_| ()))
    }

    fn run_observed<O: Observer<1>>(&self, observer: &mut O) -> Result<ShaderOutcome> {
        if let Some(mistake) = &self.mistake {
            return Err(mistake.clone());
        }
        let program = &*self.program;
        self.given.check(program)?;
        let mut resources = memory::copied(&self.given.resources);
        if let Some(record) = &self.object_record {
            resources.memory.add_buffer(record);
        }
        resources.printed = Some(Arc::default());
        let bindings = resources.bindings(program.bindings());
        let (invocation, attributes) = self.invocation()?;
        let record = invocation.record.iter().map(|record| record.data.clone());
        let roots = record.map(|data| (storage::SHADER_RECORD_BUFFER, data)).collect();
        let mut batch: Batch<1> = program.batch();
        batch.invocations.set(0, invocation);
        program.begin(&mut batch, Mask::ALL, self.fuel);
        if O::is_active() {
            observer.began(ShaderIndex(0), &mut batch);
        }
        self.override_builtins(&mut batch);
        self.fill_payload(&mut batch)?;
        let attribute_rows = program.interface_registers(storage::HIT_ATTRIBUTE);
        if let (Some(registers), Some(words)) = (attribute_rows, attributes) {
            batch.registers.set_lane_words(
                registers.first,
                0,
                words.into_iter().take(registers.count as usize),
            );
        }
        self.fill_attributes(&mut batch)?;
        let mut events = vec![self.enter(&batch)];
        let (mut traces, mut calls, mut reports) = (Vec::new(), Vec::new(), Vec::new());
        let mut executes = Vec::new();
        loop {
            if O::is_active() {
                observer.resumed(ShaderIndex(0), &mut batch);
            }
            let stop = interp::run(&mut batch, program, &bindings, observer);
            if O::is_active() {
                observer.stopped(ShaderIndex(0), &batch);
            }
            let answered = match stop {
                Stop::TraceRay { payload: span, .. }
                | Stop::ExecuteCallable { data: span, .. }
                | Stop::HitObjectTrace { payload: span, .. }
                | Stop::HitObjectExecute { payload: span, .. } => Some(span),
                _ => None,
            };
            match stop {
                Stop::Done => break,
                Stop::Paused => {}
                Stop::Barrier { .. } => {
                    unreachable!("bug in anyhit: a barrier of a workgroup outside compute")
                }
                Stop::ReportIntersection { t, hit_kind, accepted, .. } => {
                    let report = self.report(&mut batch, t, hit_kind)?;
                    batch.registers[accepted].0[0] = u32::from(report.accepted);
                    let hit_kind = crate::accel::HitKind(report.kind);
                    events.push(Event::Report { t: report.t, hit_kind, accepted: report.accepted });
                    reports.push(report);
                }
                Stop::TraceRay { operands, payload, .. } => {
                    traces.extend(self.trace(&mut batch, operands, payload, traces.len(), None)?);
                }
                Stop::ExecuteCallable { index, data, .. } => {
                    calls.push(self.call(&mut batch, index, data, calls.len())?);
                }
                Stop::HitObjectTrace { object, operands, payload, .. } => {
                    let call = self.trace(&mut batch, operands, payload, traces.len(), Some(object))?;
                    traces.extend(call);
                }
                Stop::HitObjectExecute { object, payload, .. } => {
                    executes.extend(self.execute(&mut batch, object, payload, executes.len())?);
                }
                Stop::HitObjectRecordHandle { object, to, .. } => {
                    self.record_handle(&mut batch, object, to, &bindings.memory)?;
                }
            }
            if let Some(span) = answered {
                batch.registers.define(span.first, span.count, Mask::ALL);
            }
        }
        let exit = batch.exits[0];
        if let Exit::Trapped(trap) = exit {
            let error = trap_error(ShaderIndex(0), program, &[], &batch, 0, trap);
            return Err(with_limit(error, trap.code, self.fuel, None));
        }
        let words = self.payload_rows().map_or_else(Vec::new, |registers| words(&batch, registers));
        events.push(Event::Leave { shader: ShaderIndex(0), stage: program.stage, exit, payload: words });
        let explanation = Arc::new(Explanation {
            pipeline: self.pipeline(),
            what: What::Shader {
                events,
                calls: answered(&traces, &executes, &calls),
                memory: resources.memory.clone(),
            },
        });
        let mut payload = self.read(&batch, self.payload_rows());
        payload.explained_by(&explanation);
        let printed = resources.printed.take().map_or_else(Vec::new, |printed| printed.take());
        Ok(ShaderOutcome {
            exit,
            payload,
            attributes: self.read(&batch, attribute_rows),
            reports,
            traces,
            executes,
            calls,
            printed: printed.into_iter().map(|line| line.text).collect(),
            data: self.payload_rows().map(|registers| self.data(&batch, registers, "the payload")),
            bound: Bound { programs: vec![self.program.clone()], resources, roots },
            explanation,
        })
    }

    /// A pipeline of this shader alone, to explain its run.
    fn pipeline(&self) -> Pipeline {
        let mut builder = Pipeline::builder();
        builder.shader(self.program.clone());
        builder.build().expect("bug in anyhit: a pipeline without groups is refused")
    }

    fn enter(&self, batch: &Batch<1>) -> Event {
        let read = |first: Reg, count| batch.registers.lane_words(first, count, 0).collect();
        let inputs = self.program.inputs.iter();
        let registers = |registers: Option<&InterfaceRegisters>| {
            registers.map_or_else(Vec::new, |registers| words(batch, registers))
        };
        Event::Enter {
            shader: ShaderIndex(0),
            stage: self.program.stage,
            builtins: inputs
                .map(|registers| (registers.builtin, read(registers.first, registers.count)))
                .collect(),
            payload: registers(self.payload_rows()),
            attributes: registers(self.program.interface_registers(storage::HIT_ATTRIBUTE)),
        }
    }

    pub(super) fn data(
        &self,
        batch: &Batch<1>,
        registers: &InterfaceRegisters,
        what: &'static str,
    ) -> TypedBytes {
        let words = batch.registers.lane_words(registers.first, registers.count, 0);
        TypedBytes::new(&self.program.module, registers.ty, what, words)
    }

    pub(super) fn read(&self, batch: &Batch<1>, registers: Option<&InterfaceRegisters>) -> Value {
        let Some(registers) = registers else { return Value::nothing() };
        self.data(batch, registers, "").value()
    }

    pub(super) fn payload_rows(&self) -> Option<&InterfaceRegisters> {
        let class = match self.program.stage {
            Stage::Callable => storage::INCOMING_CALLABLE_DATA,
            _ => storage::INCOMING_RAY_PAYLOAD,
        };
        self.program.interface_registers(class)
    }
}

/// The words of an interface variable.
fn words(batch: &Batch<1>, registers: &InterfaceRegisters) -> Vec<u32> {
    batch.registers.lane_words(registers.first, registers.count, 0).collect()
}
