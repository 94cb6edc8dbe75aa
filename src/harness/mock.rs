//! What a shader under test calls: traces and callable shaders, answered by the test.

use std::fmt;
use std::fmt::Debug;
use std::sync::Arc;

use bytemuck::NoUninit;

use crate::accel::TraceRay;
use crate::error::{Error, ErrorKind, Result};
use crate::harness::data::{Bytes, Data};
use crate::harness::value::Value;

/// `OpTraceRayKHR` as the tested shader executes it.
#[derive(Clone, Debug)]
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
    pub payload: Data,
}

/// `OpExecuteCallableKHR` as the tested shader executes it.
#[derive(Clone, Debug)]
pub struct CallableCall {
    /// How many calls the shader made before.
    pub number: usize,
    /// The SBT index.
    pub index: u32,
    /// The callable data as the shader gives it.
    pub given: Value,
    /// The callable data: what the answer leaves here the shader finds afterwards.
    pub data: Data,
}

impl TraceCall {
    pub(super) fn parts(&mut self) -> (usize, &mut Data) {
        (self.number, &mut self.payload)
    }
}

impl CallableCall {
    pub(super) fn parts(&mut self) -> (usize, &mut Data) {
        (self.number, &mut self.data)
    }
}

/// How calls are answered.
#[allow(clippy::type_complexity, reason = "a closure that threads may share has this type")]
pub(super) struct Answer<C>(Arc<dyn Fn(&mut C) -> Result<()> + Send + Sync>);

impl<C> Answer<C> {
    pub fn new(answer: impl Fn(&mut C) -> Result<()> + Send + Sync + 'static) -> Self {
        Self(Arc::new(answer))
    }

    pub fn give(&self, call: &mut C) -> Result<()> {
        (self.0)(call)
    }
}

impl<C> Clone for Answer<C> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
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
    parts: fn(&mut C) -> (usize, &mut Data),
) -> Answer<C> {
    let answers: Vec<Bytes> = answers.iter().map(Bytes::of).collect();
    Answer::new(move |call| {
        let (number, data) = parts(call);
        match answers.get(number) {
            Some(answer) => data.take(answer),
            None => {
                let message = format!(
                    "the shader makes {what} {}, and there are {} answers",
                    number + 1,
                    answers.len()
                );
                Err(Error::new(ErrorKind::InvalidArgument, message))
            }
        }
    })
}
