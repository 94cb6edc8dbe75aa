//! What one invocation of a shader left.

use std::fmt::Debug;
use std::sync::Arc;

use bytemuck::AnyBitPattern;

use crate::error::Result;
use crate::harness::bound::{Bound, reads_what_is_bound};
use crate::harness::data::TypedBytes;
use crate::harness::explain::{Explain, Explanation};
use crate::harness::mock::{CallableCall, ExecuteCall, TraceCall};
use crate::harness::value::Value;
use crate::machine::Exit;

/// A report of an intersection shader.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ReportedHit {
    /// The hit distance.
    pub t: f32,
    /// The hit kind.
    pub kind: u32,
    /// The hit attributes.
    pub attributes: Value,
    /// The answer: whether t lies in the ray's interval, unless the test answers itself.
    pub accepted: bool,
}

/// What one invocation left.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct ShaderOutcome {
    /// How it ended: returned, ignored the intersection, terminated the ray.
    pub exit: Exit,
    /// The payload, or the callable data, by the names of its members.
    pub payload: Value,
    /// The hit attributes.
    pub attributes: Value,
    /// The reports of an intersection shader, in order.
    pub reports: Vec<ReportedHit>,
    /// The traces that it made, with their answers.
    pub traces: Vec<TraceCall>,
    /// The hit objects that it executed, with their answers.
    pub executes: Vec<ExecuteCall>,
    /// The callable shaders that it called, with their answers.
    pub calls: Vec<CallableCall>,
    /// What it printed (`debugPrintfEXT`).
    pub printed: Vec<String>,
    pub(super) data: Option<TypedBytes>,
    pub(super) bound: Bound,
    pub(super) explanation: Arc<Explanation>,
}

impl ShaderOutcome {
    /// The payload, or the callable data, as a plain Rust type: see
    /// [`layout`](crate::harness::layout) for how its scalars lie.
    ///
    /// # Errors
    /// `InvalidArgument` where size or types differ; it shows both layouts.
    pub fn payload<T: AnyBitPattern + Debug>(&self) -> Result<T> {
        match &self.data {
            Some(data) => data.read(),
            None => self.payload.read(),
        }
    }
}

reads_what_is_bound!(ShaderOutcome);

impl Explain for ShaderOutcome {
    fn explain(&self) -> String {
        self.explanation.text()
    }
}
