//! What a shader under test calls: traces, hit objects and callable shaders, answered by the test.

use std::fmt;
use std::fmt::Debug;
use std::sync::Arc;

use bytemuck::NoUninit;

use crate::data::{HostBytes, TypedBytes};
use crate::hit::first_hit;
use crate::instance::Instance;
use crate::trace::HitRecord;
use crate::value::Value;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_engine::accel::{RecordIndex, Tlas, TraceRay};
use anyhit_engine::machine::hit_object::{EncodedHit, EncodedRay, HitObject};

/// `OpTraceRayKHR`, or `OpHitObjectTraceRayEXT`, as the tested shader executes it.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct TraceCall {
    /// How many traces the shader made before.
    pub number: usize,
    /// Ray, flags and cull mask.
    pub trace: TraceRay,
    /// SBT offset.
    pub sbt_offset: u32,
    /// SBT stride.
    pub sbt_stride: u32,
    /// Miss index.
    pub miss_index: u32,
    /// The payload as the shader gives it.
    pub given: Value,
    /// The payload: what the answer leaves here the shader finds afterwards.
    pub payload: TypedBytes,
    /// Whether it is traced into a hit object: no closest-hit or miss shader runs, and
    /// [`TraceCall::hit`] says what it finds.
    pub into_hit_object: bool,
    pub(super) found: Option<Box<Instance>>,
}

/// `OpHitObjectExecuteShaderEXT` as the tested shader executes it, of a hit object that encodes a
/// hit or a miss.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ExecuteCall {
    /// How many hit objects the shader executed before.
    pub number: usize,
    /// The ray that the hit object encodes.
    pub trace: TraceRay,
    /// Its closest hit; `None` for a miss.
    pub hit: Option<HitRecord>,
    /// The index into the table of hit groups, or of miss shaders.
    pub record: u64,
    /// The payload as the shader gives it.
    pub given: Value,
    /// The payload: what the answer leaves here the shader finds afterwards.
    pub payload: TypedBytes,
}

/// `OpExecuteCallableKHR` as the tested shader executes it.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct CallableCall {
    /// How many calls the shader made before.
    pub number: usize,
    /// The SBT index.
    pub index: u32,
    /// The callable data as the shader gives it.
    pub given: Value,
    /// The callable data: what the answer leaves here the shader finds afterwards.
    pub data: TypedBytes,
}

/// A line for each call that was answered, for the explanation of a shader's run.
pub(super) fn answered(
    traces: &[TraceCall],
    executes: &[ExecuteCall],
    calls: &[CallableCall],
) -> Vec<String> {
    let trace = |call: &TraceCall| {
        let (ray, number) = (call.trace.ray, call.number + 1);
        let answer = call.payload.value();
        format!("trace {number}: from {:?} towards {:?}, answered {answer:?}", ray.origin, ray.direction)
    };
    let execute = |call: &ExecuteCall| {
        let what = if call.hit.is_some() { "hit" } else { "miss" };
        let answer = call.payload.value();
        format!(
            "execution {}: {what} record {}, given {:?}, answered {answer:?}",
            call.number + 1,
            call.record,
            call.given
        )
    };
    let call = |call: &CallableCall| {
        let answer = call.data.value();
        format!("call {}: index {}, given {:?}, answered {answer:?}", call.number + 1, call.index, call.given)
    };
    let (traces, executes) = (traces.iter().map(trace), executes.iter().map(execute));
    traces.chain(executes).chain(calls.iter().map(call)).collect()
}

impl TraceCall {
    /// Lets a trace into a hit object meet this instance alone. The ray is really intersected with
    /// it; where it passes by, and without this, the hit object encodes a miss.
    ///
    /// ```
    /// # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).unwrap();
    /// # use anyhit::{Instance, Module, ShaderTest};
    /// # let module = Module::open("spirv-fixtures/pass/hit-object/trace-and-execute/main.rgen.spv")?;
    /// let outcome = ShaderTest::new(&module, "main")?
    ///     .buffer(0, 1, &[[0.0f32; 16]])
    ///     .on_trace(|trace| {
    ///         trace.hit(Instance::triangle([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]));
    ///         Ok(())
    ///     })
    ///     .on_execute(|call| {
    ///         assert_eq!(call.hit.map(|hit| hit.t), Some(4.0));
    ///         call.payload.set("[1]", 7.0f32)
    ///     })
    ///     .run()?;
    /// assert_eq!(outcome.buffer(0, 1)?["outputs"][0][11].f32(), 7.0);
    /// # Ok::<(), anyhit::Error>(())
    /// ```
    pub fn hit(&mut self, instance: impl Into<Instance>) {
        self.found = Some(Box::new(instance.into()));
    }

    /// What the hit object encodes.
    ///
    /// # Errors
    /// `InvalidScene` for an instance that cannot be.
    pub(super) fn hit_object(&self) -> Result<HitObject> {
        let miss = EncodedRay::new(self.trace, RecordIndex::of_miss(self.miss_index), None);
        let Some(instance) = &self.found else { return Ok(HitObject::Miss(miss)) };
        let tlas = Tlas::new(vec![instance.as_ref().clone().make()?])?;
        Ok(match first_hit(&tlas, self.trace) {
            None => HitObject::Miss(miss),
            Some(committed) => {
                let (sbt, geometry) = (&tlas.instances()[0], committed.candidate.geometry);
                let record =
                    RecordIndex::of_hit(sbt.sbt_record_offset, geometry, self.sbt_stride, self.sbt_offset);
                let attributes = committed.candidate.intersection.attributes.map(f32::to_bits);
                let hit = EncodedHit { tlas, committed, attributes: attributes.into_iter().collect() };
                HitObject::Hit(EncodedRay::new(self.trace, record, None), hit)
            }
        })
    }

    pub(super) fn parts(&mut self) -> (usize, &mut TypedBytes) {
        (self.number, &mut self.payload)
    }
}

impl ExecuteCall {
    /// Of a hit object that encodes a hit or a miss.
    pub(super) fn of(object: &HitObject, number: usize, payload: TypedBytes) -> Option<Self> {
        let encoded = object.encoded().ok()?;
        let hit = object.hit().ok().map(|(_, EncodedHit { tlas, committed, .. })| {
            let instance = &tlas.instances()[committed.candidate.instance as usize];
            HitRecord::of(committed, instance.custom_index)
        });
        let (trace, record) = (encoded.trace, encoded.record.0);
        Some(Self { number, trace, hit, record, given: payload.value(), payload })
    }

    pub(super) fn parts(&mut self) -> (usize, &mut TypedBytes) {
        (self.number, &mut self.payload)
    }
}

impl CallableCall {
    pub(super) fn parts(&mut self) -> (usize, &mut TypedBytes) {
        (self.number, &mut self.data)
    }
}

/// How calls are answered.
#[allow(clippy::type_complexity, reason = "a closure that threads may share has this type")]
pub(super) struct Answer<C> {
    answer: Arc<dyn Fn(&mut C) -> Result<()> + Send + Sync>,
    /// What is answered, and how many answers there are, where they are listed.
    listed: Option<(&'static str, usize)>,
}

impl<C> Answer<C> {
    pub(super) fn new(answer: impl Fn(&mut C) -> Result<()> + Send + Sync + 'static) -> Self {
        Self { answer: Arc::new(answer), listed: None }
    }

    /// Checks that a run took all answers that were listed for it.
    ///
    /// # Errors
    /// `InvalidArgument` where it made fewer calls than there are answers.
    pub(super) fn check_taken(&self, calls: usize) -> Result<()> {
        let Some((what, count)) = self.listed.filter(|&(_, count)| count > calls) else { return Ok(()) };
        let plural = |count: usize, one: &str| match count {
            1 => format!("1 {one}"),
            _ => format!("{count} {one}s"),
        };
        let message = format!("{}, {}", plural(count, "answer"), plural(calls, what));
        let how = "list as many answers as the shader makes calls, or answer with a closure";
        Err(Error::new(ErrorKind::InvalidArgument, message).note(how))
    }

    pub(super) fn give(&self, call: &mut C) -> Result<()> {
        (self.answer)(call)
    }
}

impl<C> Clone for Answer<C> {
    fn clone(&self) -> Self {
        Self { answer: self.answer.clone(), listed: self.listed }
    }
}

impl<C> fmt::Debug for Answer<C> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a closure")
    }
}

/// One answer after the other, and an error beyond the last.
pub(super) fn in_turn<C: 'static, T: NoUninit + Debug>(
    answers: &[T],
    what: &'static str,
    parts: fn(&mut C) -> (usize, &mut TypedBytes),
) -> Answer<C> {
    let answers: Vec<HostBytes> = answers.iter().map(HostBytes::of).collect();
    let listed = Some((what, answers.len()));
    let answer = Answer::new(move |call| {
        let (number, data) = parts(call);
        match answers.get(number) {
            Some(answer) => data.take(answer),
            None => {
                let message = format!(
                    "the shader makes {what} {}, but there are only {} answers",
                    number + 1,
                    answers.len()
                );
                Err(Error::new(ErrorKind::InvalidArgument, message))
            }
        }
    });
    Answer { listed, ..answer }
}
