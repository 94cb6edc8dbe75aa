//! The report of a trap: its message, its source line and the stack of shader calls.

use std::sync::Arc;
use std::time::Duration;

use crate::machine::{
    AccessFault, Batch, HitRecordTerms, LaneTrap, OpIndex, ShaderIndex, TrapCode, Watchdog,
};
use crate::module::interface::Stage;
use crate::ops::lane_kernel::{LaneKernel, Width};
use crate::pipeline::Pipeline;
use crate::pipeline::payload;
use crate::pipeline::sbt::Sbt;
use crate::pipeline::stack::{RunningShader, ShaderCallFrame, Stack};
use crate::pipeline::trace::{RayTrap, Trace};
use crate::program::Program;
use anyhit_base::error::{Error, Place, Trap, TrapOperands};

/// A trap, where it happened, and its error message.
#[derive(Clone, Debug)]
pub struct Trapped {
    /// The launch index of the invocation.
    pub launch_id: [u32; 3],
    /// The code of the trap.
    pub code: TrapCode,
    /// The value that caused it, such as the offset or device address of the access.
    pub fault_value: u64,
    /// The shader that trapped.
    pub shader: ShaderIndex,
    /// The instruction, in words from the start of the shader's module.
    pub offset: u32,
    /// The error, whose [`Error::trap`] has all of this and the values that caused it.
    pub error: Error,
}

/// What a report tells beyond the place of a trap: a note, and the values in it as data.
struct Cause {
    note: String,
    operands: TrapOperands,
}

impl Cause {
    fn tell(self, error: Error) -> Error {
        error.note(self.note).with_trap(|trap| trap.operands = self.operands)
    }
}

/// The number of callers that a report names at each end of the stack.
const SHOWN_CALLERS: usize = 8;

impl<const W: usize> Stack<'_, W>
where
    LaneKernel: Width<W>,
{
    /// Records a trap, if its launch index is the lowest so far.
    pub(super) fn trap(&mut self, running: &RunningShader<W>, lane: usize, trap: LaneTrap) {
        if trap.code == TrapCode::Callee {
            return;
        }
        let launch_id = running.batch.invocations.launch_id(lane);
        let order = |id: [u32; 3]| [id[2], id[1], id[0]];
        if self.trapped.as_ref().is_some_and(|trapped| order(trapped.launch_id) <= order(launch_id)) {
            return;
        }
        let program = &*self.pipeline.programs[running.shader.index()];
        let programs = &self.pipeline.programs;
        let mut error =
            trap_error(running.shader, program, programs, &running.batch, lane, trap).note(format!(
                "in {} `{}`, {}",
                program.stage.name(),
                program.name,
                program.describe_invocation(launch_id)
            ));
        let fault_value = running.batch.fault_value[lane];
        if trap.code == TrapCode::ShaderRecordEmpty {
            error = error.note(
                "set its data with the key `record` of a table in the scene's [pipeline], `{ shader = \
                 ..., record = { ... } }`, or in Rust with SbtRecord::with_data or \
                 ShaderTest::shader_record",
            );
        }
        let terms = match running.batch.access_fault(lane) {
            Some(&AccessFault::HitRecord(terms)) => Some(terms),
            _ => None,
        };
        let record = || unusable_record(&self.pipeline.sbt, trap.code, fault_value, terms);
        let cause = self.limit(trap.code).or_else(record);
        error = cause.into_iter().fold(error, |error, cause| cause.tell(error));
        if trap.code == TrapCode::PayloadMismatch {
            error = with_callee(error, self.pipeline, fault_value);
            if let Some((notes, vuid)) = self.mismatch(running, trap.op, fault_value) {
                error = notes.into_iter().fold(error, Error::note).with_trap(|trap| trap.vuid = vuid);
            }
        }
        let callers: Vec<(&Program, ShaderIndex, OpIndex)> = self
            .frames
            .iter()
            .rev()
            .filter_map(|frame| match frame {
                ShaderCallFrame::Shader(caller) => {
                    let program = &*programs[caller.shader.index()];
                    Some((program, caller.shader, caller.batch.stopped_at()))
                }
                _ => None,
            })
            .collect();
        let frames = callers.iter().map(|&(program, shader, op)| program.frame(shader, op));
        error = error.with_trap(|trap| trap.stack.extend(frames));
        // Of a deep recursion, only the callers at both ends are named.
        let between = callers.len().saturating_sub(2 * SHOWN_CALLERS);
        for (at, (program, _, op)) in callers.into_iter().enumerate() {
            error = match at.checked_sub(SHOWN_CALLERS) {
                Some(0) if between > 0 => error.note(format!("called by {between} more shaders")),
                Some(hidden) if hidden < between => error,
                _ => error.note(format!(
                    "called by {} `{}`{}",
                    program.stage.name(),
                    program.name,
                    source_line(program, op)
                )),
            };
        }
        let offset = program.origins.get(trap.op.index()).map_or(0, |origin| origin.offset);
        let (code, fault_value, shader) = (trap.code, running.batch.fault_value[lane], running.shader);
        self.trapped = Some(Trapped { launch_id, code, fault_value, shader, offset, error });
    }
}

impl<const W: usize> Stack<'_, W> {
    /// The limit that a trap is about.
    fn limit(&self, code: TrapCode) -> Option<Cause> {
        let pipeline = self.pipeline;
        let (key, value, note) = match code {
            TrapCode::RecursionTooDeep => (
                "max_recursion_depth",
                f64::from(pipeline.max_recursion),
                format!(
                    "the limit is max_recursion_depth = {}, and this trace has depth {}: raise it in the \
                     scene's [pipeline], with --max-recursion-depth, or with \
                     PipelineBuilder::max_recursion",
                    pipeline.max_recursion,
                    u64::from(pipeline.max_recursion) + 1
                ),
            ),
            TrapCode::CallablesTooDeep => (
                "max_callable_depth",
                f64::from(pipeline.max_callable_depth),
                format!(
                    "the limit is max_callable_depth = {}: raise it in the scene's [pipeline], with \
                     --max-callable-depth, or with PipelineBuilder::max_callable_depth",
                    pipeline.max_callable_depth
                ),
            ),
            TrapCode::StackOverflow => (
                "max_stack_size",
                pipeline.max_stack_size as f64,
                format!(
                    "the limit is max_stack_size = {} bytes of registers: raise it in the scene's \
                     [pipeline], with --max-stack-size, or with PipelineBuilder::max_stack_size",
                    pipeline.max_stack_size
                ),
            ),
            _ => {
                let dog = self.watch.as_ref().map(|watch| &**watch.watchdog());
                return limit(code, pipeline.fuel, dog);
            }
        };
        Some(Cause { note, operands: TrapOperands::Limit { key, value } })
    }

    /// The types that two shaders declare for one payload with the rule that they break, and the
    /// VUID of that rule where it has one.
    fn mismatch(
        &self,
        running: &RunningShader<W>,
        op: OpIndex,
        called: u64,
    ) -> Option<([String; 2], Option<String>)> {
        let program = |shader: ShaderIndex| &*self.pipeline.programs[shader.index()];
        let passed = program(running.shader).ops.get(op.index())?.payload_span();
        let passed = passed.map(|span| (running.shader, span.first));
        // The any-hit shader of a reported hit has the payload of the shader that traced.
        let traced = || {
            self.frames.iter().rev().find_map(|frame| match frame {
                ShaderCallFrame::Trace { trace, payload, .. } => {
                    Some((trace.caller()?.shader, payload.first))
                }
                _ => None,
            })
        };
        let (caller, first) = passed.or_else(traced)?;
        let called = program(ShaderIndex(u32::try_from(called).ok()?));
        const TRACE: &str = "VUID-RuntimeSpirv-OpTraceRayKHR-11855";
        let (rule, vuid) = match called.stage {
            Stage::Callable => ("SPV_KHR_ray_tracing, OpExecuteCallableKHR", None),
            _ => (TRACE, Some(TRACE.to_owned())),
        };
        let types = payload::mismatch(program(caller), first, called)?;
        Some(([types, format!("{rule}: both must have the same type")], vuid))
    }
}

/// Names the limit that stopped an invocation, and how it is raised.
pub fn with_limit(error: Error, code: TrapCode, fuel: u64, dog: Option<&Watchdog>) -> Error {
    limit(code, fuel, dog).into_iter().fold(error, |error, cause| cause.tell(error))
}

fn limit(code: TrapCode, fuel: u64, dog: Option<&Watchdog>) -> Option<Cause> {
    let limits = dog.map(Watchdog::limits);
    let seconds = |limit: Option<Option<Duration>>| limit.flatten().unwrap_or_default().as_secs_f64();
    let (key, value, note) = match code {
        TrapCode::OutOfFuel => (
            "fuel",
            fuel as f64,
            format!(
                "the limit is fuel = {fuel} instructions per invocation: raise it in the scene's \
                 [pipeline], with --fuel, or with `fuel` of PipelineBuilder, Compute and ShaderTest"
            ),
        ),
        TrapCode::LaunchOutOfFuel => {
            let fuel = dog.map_or(0, Watchdog::fuel);
            let note = format!(
                "the limit is launch_fuel = {fuel} instructions of all invocations together: raise it in \
                 the scene's [pipeline], with --launch-fuel, or with LaunchLimits::fuel"
            );
            ("launch_fuel", fuel as f64, note)
        }
        TrapCode::LaunchTimedOut => {
            let timeout = seconds(limits.map(|limits| limits.timeout));
            let note = format!(
                "the limit is timeout = {timeout} s per launch (wall-clock time, which depends on the \
                 machine): raise it with --timeout, or with LaunchLimits::timeout"
            );
            ("timeout", timeout, note)
        }
        TrapCode::BatchTimedOut => {
            let timeout = seconds(limits.map(|limits| limits.batch_timeout));
            let note = format!(
                "the limit is batch_timeout = {timeout} s per batch of invocations (wall-clock time, \
                 which depends on the machine): raise it with --batch-timeout, or with \
                 LaunchLimits::batch_timeout"
            );
            ("batch_timeout", timeout, note)
        }
        _ => return None,
    };
    Some(Cause { note, operands: TrapOperands::Limit { key, value } })
}

/// Names the shader, by its index, whose payload does not match.
fn with_callee(error: Error, pipeline: &Pipeline, shader: u64) -> Error {
    error.with_trap(|trap| {
        if let Some(program) = pipeline.programs.get(shader as usize) {
            let (stage, entry_point) = (program.stage, program.name.clone());
            trap.operands = TrapOperands::Callee { shader: shader as u32, stage, entry_point };
        }
    })
}

/// The trap of a launch whose invocations, up to one, have spent more together than they may.
pub(super) fn spent_together(program: Option<&Program>, launch_id: [u32; 3], dog: &Watchdog) -> Trapped {
    let code = TrapCode::LaunchOutOfFuel;
    let [x, y, z] = launch_id;
    let last = match program.and_then(|program| program.workgroup) {
        Some(_) => format!("invocation ({x}, {y}, {z})"),
        None => format!("launch id ({x}, {y}, {z})"),
    };
    let error = Error::trapped(Trap { launch_id, ..Trap::new(code) })
        .note(format!("the invocations up to {last} used it up together"));
    let error = with_limit(error, code, 0, Some(dog));
    Trapped { launch_id, code, fault_value: 0, shader: ShaderIndex(0), offset: 0, error }
}

/// The trap of a launch that takes too long altogether, though each of its invocations, up to one,
/// has come to its end.
pub(super) fn timed_out(launch_id: [u32; 3], code: TrapCode, dog: &Watchdog) -> Trapped {
    let [x, y, z] = launch_id;
    let error = Error::trapped(Trap { launch_id, ..Trap::new(code) }).note(format!(
        "the invocations up to ({x}, {y}, {z}) completed without an endless loop: the launch has too \
         many invocations for its time limit"
    ));
    let error = with_limit(error, code, 0, Some(dog));
    Trapped { launch_id, code, fault_value: 0, shader: ShaderIndex(0), offset: 0, error }
}

/// The trap of a launch, or of a ray from the host, that a limit ends while no shader runs.
pub(super) fn ended_without_shader(code: TrapCode, fuel: u64, dog: &Watchdog) -> Trapped {
    let error = with_limit(Error::trapped(Trap::new(code)), code, fuel, Some(dog));
    Trapped { launch_id: [0; 3], code, fault_value: 0, shader: ShaderIndex(0), offset: 0, error }
}

/// The trap of a ray from the host at which no shader trapped: its table has no record for it, say.
pub(super) fn host_ray_trap<const W: usize>(pipeline: &Pipeline, trace: &Trace<W>) -> Option<Trapped> {
    let RayTrap { code, fault_value, terms, .. } = trace.ray_trap(0)?;
    let fault_value = fault_value.unwrap_or(0);
    let record = unusable_record(&pipeline.sbt, code, fault_value, terms);
    let error = Error::trapped(Trap { fault_value, ..Trap::new(code) });
    let mut error = record.into_iter().fold(error, |error, cause| cause.tell(error));
    if code == TrapCode::PayloadMismatch {
        error = with_callee(error, pipeline, fault_value);
    }
    Some(Trapped { launch_id: [0; 3], code, fault_value, shader: ShaderIndex(0), offset: 0, error })
}

/// The record that a trap is about, as it is missing or has no shader.
fn unusable_record(sbt: &Sbt, code: TrapCode, index: u64, terms: Option<HitRecordTerms>) -> Option<Cause> {
    let (records, table) = match code {
        TrapCode::HitRecordMissing
        | TrapCode::NullAnyHit
        | TrapCode::NullClosestHit
        | TrapCode::NullIntersection => (&sbt.hit, "hit"),
        TrapCode::MissRecordMissing | TrapCode::NullMiss => (&sbt.miss, "miss"),
        TrapCode::ShaderRecordMissing => (&sbt.callable, "callable"),
        _ => return None,
    };
    let what = match (table, terms) {
        ("miss", _) => "the miss index".to_owned(),
        ("callable", _) => "the SBT index of the call".to_owned(),
        (_, Some(HitRecordTerms { instance_offset, geometry, stride, offset })) => format!(
            "instance offset {instance_offset} + geometry index {geometry} x SBT stride {} + SBT offset {}",
            stride & 0xF,
            offset & 0xF
        ),
        (_, None) => "instance offset + geometry index x SBT stride + SBT offset".to_owned(),
    };
    let count = records.len();
    let of_table = if count == 1 { "1 record".to_owned() } else { format!("{count} records") };
    let null = usize::try_from(index).ok().and_then(|index| records.get(index));
    let is = match null {
        Some(None) => ", is null".to_owned(),
        Some(Some(record)) => format!(", refers to group {}, which has no such shader", record.group),
        None => String::new(),
    };
    let note = format!(
        "record {index} ({what}), counted from 0, of a table with {of_table}{is}: see `{table}` of the \
         scene's [pipeline], or PipelineBuilder::{table}"
    );
    Some(Cause { note, operands: TrapOperands::Record { table, index, records: count as u64 } })
}

/// The error of a trap without its callers: message, source position, and access. Other programs
/// run with the one that trapped.
pub fn trap_error<const W: usize>(
    shader: ShaderIndex,
    program: &Program,
    others: &[Arc<Program>],
    batch: &Batch<W>,
    lane: usize,
    trap: LaneTrap,
) -> Error {
    let (fault_value, accessed) = (batch.fault_value[lane], batch.access_fault(lane));
    if let (TrapCode::ImageUnreadable, Some(AccessFault::ImageFile(failure))) = (trap.code, accessed) {
        let (error, line) = (Error::clone(failure), source_line(program, trap.op));
        return if line.is_empty() { error } else { error.note(format!("a texel is read{line}")) };
    }
    let last_out_of_bounds = |op| batch.out_of_bounds_indices.last(op, lane);
    let index = program.out_of_bounds_index(trap, fault_value, accessed, last_out_of_bounds);
    let (index, operand) = index.unzip();
    let data = Trap {
        launch_id: batch.invocations.launch_id(lane),
        // The offset of an index that is out of bounds is none of the access.
        fault_value: if trap.code == TrapCode::IndexOutOfBounds { 0 } else { fault_value },
        operands: program.trap_operands(trap, fault_value, accessed, operand),
        stack: vec![program.frame(shader, trap.op)],
        vuid: program.ray_vuid(trap, fault_value).or_else(|| trap.code.vuid().map(str::to_owned)),
        ..Trap::new(trap.code)
    };
    let error = with_location(program, trap.op, Error::trapped(data), "");
    let of_loop = trap.code.is_limit().then(|| program.describe_loop(trap, batch.turns.of(lane)));
    let error = of_loop.flatten().into_iter().fold(error, Error::note);
    let access = program.describe_access(trap, fault_value, accessed);
    let bound = match trap.code {
        TrapCode::DescriptorMissing | TrapCode::AccelerationStructureMissing => {
            program.describe_bound(accessed, others)
        }
        _ => Vec::new(),
    };
    index.into_iter().chain(access).chain(bound).fold(error, Error::note)
}

/// Adds the location of an operation to an error: its word offset, its source line and the inlined
/// calls.
pub fn with_location(program: &Program, op: OpIndex, error: Error, label: &str) -> Error {
    let Some(origin) = program.origins.get(op.index()) else { return error };
    let mut error = match program.place_at(origin.offset) {
        Some(line) => error.at_with(line, label).at(Place::Word(origin.offset as usize)),
        None => match program.place_near(origin.offset) {
            Some(line) => {
                let near = format!("near {}: the instruction has no line information", file_and_line(&line));
                error.at_with(line, near).at(Place::Word(origin.offset as usize))
            }
            None => {
                // What a compiler adds has no lines; its caller does.
                let call = program.inlined_calls(op).find_map(|call| program.place_at(call));
                match call {
                    Some(line) => error.at_with(line, label).at(Place::Word(origin.offset as usize)),
                    None => error.at_with(Place::Word(origin.offset as usize), label),
                }
            }
        },
    };
    let mut scope = origin.scope;
    while scope != 0 {
        let inlined = program.scopes[scope as usize];
        let line = source_line_of(program, inlined.call);
        error =
            error.note(format!("in function {}, called{line}", program.module.describe_id(inlined.function)));
        scope = inlined.parent;
    }
    error
}

/// `FILE:LINE`; nothing for a place that is in no text.
fn file_and_line(place: &Place) -> String {
    place.file_line().map_or_else(String::new, |(file, line)| format!("{file}:{line}"))
}

/// ` at FILE:LINE` or ` near FILE:LINE`, for an operation.
pub fn source_line(program: &Program, op: OpIndex) -> String {
    program.origins.get(op.index()).map_or_else(String::new, |origin| source_line_of(program, origin.offset))
}

/// ` at FILE:LINE` or ` near FILE:LINE`, for the instruction at a word offset.
pub fn source_line_of(program: &Program, offset: u32) -> String {
    match (program.place_at(offset), program.place_near(offset)) {
        (Some(place), _) => format!(" at {}", file_and_line(&place)),
        (None, Some(place)) => format!(" near {}", file_and_line(&place)),
        (None, None) => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::SbtRecord;

    #[test]
    fn a_missing_record_is_told_with_its_table() {
        let sbt = Sbt { hit: vec![None; 3], miss: vec![None], callable: vec![None; 2], ..Sbt::default() };
        let note = |code, index| unusable_record(&sbt, code, index, None).expect("a note").note;
        assert_eq!(
            note(TrapCode::ShaderRecordMissing, 7),
            "record 7 (the SBT index of the call), counted from 0, of a table with 2 records: see \
             `callable` of the scene's [pipeline], or PipelineBuilder::callable"
        );
        assert!(
            note(TrapCode::HitRecordMissing, 3)
                .ends_with("3 records: see `hit` of the scene's [pipeline], or PipelineBuilder::hit")
        );
        assert!(
            note(TrapCode::MissRecordMissing, 1)
                .ends_with("1 record: see `miss` of the scene's [pipeline], or PipelineBuilder::miss")
        );
        assert!(unusable_record(&sbt, TrapCode::RecursionTooDeep, 0, None).is_none());
        assert_eq!(
            unusable_record(&sbt, TrapCode::HitRecordMissing, 3, None).map(|cause| cause.operands),
            Some(TrapOperands::Record { table: "hit", index: 3, records: 3 })
        );
        let terms = HitRecordTerms { instance_offset: 2, geometry: 1, stride: 0x11, offset: 0 };
        let made = unusable_record(&sbt, TrapCode::HitRecordMissing, 3, Some(terms)).expect("a note").note;
        assert!(made.starts_with(
            "record 3 (instance offset 2 + geometry index 1 x SBT stride 1 + SBT offset 0), counted"
        ));
    }

    #[test]
    fn a_record_without_a_shader_is_told_with_its_group() {
        let sbt = Sbt { hit: vec![None, Some(SbtRecord::new(4))], miss: vec![None], ..Sbt::default() };
        let note = |code, index| unusable_record(&sbt, code, index, None).expect("a note").note;
        assert!(note(TrapCode::NullMiss, 0).contains("of a table with 1 record, is null: see `miss`"));
        let named = note(TrapCode::NullClosestHit, 1);
        assert!(
            named.contains("2 records, refers to group 4, which has no such shader: see `hit`"),
            "{named}"
        );
    }
}
