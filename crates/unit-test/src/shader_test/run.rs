//! Runs the shader under test.

use std::sync::Arc;

use crate::block_counts::BlockCounts;
use crate::bound::Bound;
use crate::data::TypedBytes;
use crate::explain::Explanation;
use crate::mock::answered;
use crate::shader_outcome::ShaderOutcome;
use crate::shader_test::{RunningTest, ShaderTest};
use crate::value::Value;
use anyhit_base::error::{Error, Result, Trap};
use anyhit_base::sorted::SortedMap;
use anyhit_engine::accel::HitPrimitive;
use anyhit_engine::interp;
use anyhit_engine::machine::stop::Stop;
use anyhit_engine::machine::{Batch, Exit, Mask, Observer, Reg, Resources, ShaderIndex, Watchdog};
use anyhit_engine::module::interface::Stage;
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::ops::translate::InterfaceRegisters;
use anyhit_engine::pipeline::WrittenMemory;
use anyhit_engine::pipeline::{Event, trap_error, with_limit};

/// An observer, borrowed for a shorter time.
fn again<'a>(observer: &'a mut Option<&mut dyn Observer<1>>) -> Option<&'a mut dyn Observer<1>> {
    observer.as_mut().map(|one| &mut **one as &mut dyn Observer<1>)
}

impl ShaderTest {
    /// Runs the shader once. What it writes is in the outcome; the test does not change, so that it
    /// can be run again. Buffers and images that the shader cannot write are not copied.
    ///
    /// # Errors
    /// `Trap` where the shader misbehaves or takes longer than its limits, with its source line;
    /// `InvalidArgument` for a builtin that the shader does not read or of another type, a layout
    /// or an image format that does not fit, with both, a launch id outside the launch size, where
    /// the ray misses, where the shader traces or calls and nothing answers, and where it takes
    /// fewer answers than are listed; what an answer returns.
    pub fn run(&self) -> Result<ShaderOutcome> {
        self.run_observed(None)
    }

    /// Runs the shader as [`ShaderTest::run`] does, and counts its blocks and branches.
    ///
    /// # Errors
    /// As [`ShaderTest::run`].
    #[doc(hidden)]
    pub fn run_counted(&self, counts: &mut BlockCounts) -> Result<ShaderOutcome> {
        self.run_observed(Some(counts))
    }

    pub(crate) fn run_observed(&self, mut observer: Option<&mut dyn Observer<1>>) -> Result<ShaderOutcome> {
        let given = self.given_resources()?;
        let resources = WrittenMemory::of([&self.program], &given).own(given);
        let program = &*self.program;
        let bindings = resources.bindings(program.bindings());
        let mut running = self.begin(again(&mut observer))?;
        let watch = Watchdog::new(self.launch_limits, 1).watch();
        watch.begin_task(1);
        watch.begin_batch();
        running.batch.watch = Some(watch.clone());
        loop {
            let stop = interp::run_lane(&mut running.batch, program, &bindings, again(&mut observer));
            if let Stop::Done = stop {
                break;
            }
            self.serve(&mut running, stop)?;
        }
        if let Some(error) = self.trap(&running.batch) {
            return Err(error);
        }
        // What a shader without a loop spends is known at its end.
        watch.charge(running.batch.take_charged());
        if let Some(code) = watch.expired() {
            let error = Error::trapped(Trap::new(code));
            return Err(with_limit(error, code, self.fuel, Some(watch.watchdog())));
        }
        let RunningTest { traces, executes, calls, .. } = &running;
        self.traces.as_ref().map_or(Ok(()), |answers| answers.check_taken(traces.len()))?;
        self.executes.as_ref().map_or(Ok(()), |answers| answers.check_taken(executes.len()))?;
        self.calls.as_ref().map_or(Ok(()), |answers| answers.check_taken(calls.len()))?;
        Ok(self.outcome(running, resources))
    }

    /// What the shader is bound to.
    pub(super) fn given_resources(&self) -> Result<Resources> {
        if let Some(mistake) = &self.mistake {
            return Err(mistake.clone());
        }
        self.check_builtins()?;
        self.given.check(&self.program)?;
        let mut resources = self.given.resources.clone();
        if let Some(record) = &self.object_record {
            resources.memory.add_buffer(record);
        }
        resources.printed = Some(Arc::default());
        Ok(resources)
    }

    /// The invocation before its first instruction.
    pub(super) fn begin(&self, observer: Option<&mut dyn Observer<1>>) -> Result<RunningTest> {
        let program = &*self.program;
        let (invocation, attributes) = self.invocation()?;
        let mut batch: Batch<1> = program.batch();
        batch.invocations.set(0, invocation);
        program.begin(&mut batch, Mask::ALL, self.fuel);
        if let Some(observer) = observer {
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
        let events = vec![self.enter(&batch)];
        let (traces, executes, calls, reports) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Ok(RunningTest { batch, events, traces, executes, calls, reports })
    }

    /// The trap that the invocation ended with.
    pub(super) fn trap(&self, batch: &Batch<1>) -> Option<Error> {
        let Exit::Trapped(trap) = batch.exits[0] else { return None };
        let error = trap_error(ShaderIndex(0), &self.program, &[], batch, 0, trap);
        let watchdog = batch.watch.as_ref().map(|watch| &**watch.watchdog());
        Some(with_limit(error, trap.code, self.fuel, watchdog))
    }

    /// What an invocation that has ended without a trap left.
    fn outcome(&self, running: RunningTest, mut resources: Resources) -> ShaderOutcome {
        let RunningTest { batch, mut events, traces, executes, calls, reports } = running;
        let (exit, program) = (batch.exits[0], &*self.program);
        let record = batch.invocations.record(0).map(|record| record.data.clone());
        let roots = record.into_iter().map(|data| (storage::SHADER_RECORD_BUFFER, data)).collect();
        let attribute_rows = program.interface_registers(storage::HIT_ATTRIBUTE);
        let words = self.payload_rows().map_or_else(Vec::new, |registers| words(&batch, registers));
        events.push(Event::Leave { shader: ShaderIndex(0), stage: program.stage, exit, payload: words });
        let explanation = Arc::new(Explanation::Shader {
            program: self.program.clone(),
            events,
            calls: answered(&traces, &executes, &calls),
            memory: resources.memory.clone(),
        });
        let mut payload = self.read(&batch, self.payload_rows());
        payload.explained_by(&explanation);
        let invocations = &batch.invocations;
        let hit = invocations.structures.get(0).filter(|_| invocations.hit).map(|tlas| {
            let [instance, geometry, primitive] =
                [&invocations.hits.instance, &invocations.hits.geometry, &invocations.hits.primitive]
                    .map(|lanes| lanes.0[0]);
            (tlas.clone(), invocations.rays.get(0), HitPrimitive { instance, geometry, primitive })
        });
        let printed = resources.printed.take().map_or_else(Vec::new, |printed| printed.take());
        ShaderOutcome {
            exit,
            payload,
            attributes: self.read(&batch, attribute_rows),
            reports,
            traces,
            executes,
            calls,
            printed: printed.into_iter().map(|line| line.text).collect(),
            data: self.payload_rows().map(|registers| self.data(&batch, registers, "the payload")),
            bound: Bound {
                programs: vec![self.program.clone()],
                resources,
                roots,
                readers: SortedMap::new(),
            },
            explanation,
            hit,
        }
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
            push_constants: None,
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
