//! Reads the events of the ray queries of one shader run into steps of its transcript.

use std::collections::HashMap;
use std::sync::Arc;

use crate::accel::{Tlas, TraceRay};
use crate::debug::names;
use crate::debug::reader::EventReader;
use crate::debug::transcript::{QueryCandidate, QueryEnd, QueryReport, Step};
use crate::debug::values::FloatValue;
use crate::machine::{RayQueryEvent, RayQueryStep};
use crate::program::Program;

/// The queries of a shader that were initialised so far.
pub(super) struct Queries<'a> {
    program: Option<&'a Program>,
    /// The queries by handle.
    known: HashMap<u32, Known>,
}

struct Known {
    /// The index of its step.
    step: usize,
    tlas: Arc<Tlas>,
    trace: TraceRay,
    /// The t of the closest hit that traversal knows of.
    closest: Option<f32>,
}

impl<'a> Queries<'a> {
    pub(super) fn new(program: Option<&'a Program>) -> Self {
        Self { program, known: HashMap::new() }
    }

    /// Takes an event: a query that begins is a step of its own, all else belongs to the step of
    /// its query.
    pub(super) fn take(&mut self, event: RayQueryEvent, steps: &mut Vec<Step>, reader: &EventReader<'_>) {
        let RayQueryEvent { query, op, step } = event;
        if let RayQueryStep::Initialize(tlas, trace) = step {
            let called_at = self.program.and_then(|program| names::source_line(program, op));
            let traversal = reader.traversal(called_at, &tlas, &trace);
            let transcript =
                QueryReport { traversal, candidates: Vec::new(), hit: None, end: QueryEnd::Underway };
            self.known.insert(query, Known { step: steps.len(), tlas, trace, closest: None });
            steps.push(Step::RayQuery(Box::new(transcript)));
            return;
        }
        let Some(known) = self.known.get_mut(&query) else { return };
        let Some(Step::RayQuery(transcript)) = steps.get_mut(known.step) else { return };
        match step {
            RayQueryStep::Initialize(..) => {}
            RayQueryStep::Node(instance) => transcript.traversal.open(instance),
            RayQueryStep::Instance(instance, verdict) => transcript.traversal.reach(instance, verdict),
            RayQueryStep::Primitive(place, verdict) => {
                transcript.traversal.test(place, verdict, &mut known.closest);
            }
            RayQueryStep::Proceed(None) if transcript.end == QueryEnd::Terminated => {}
            RayQueryStep::Proceed(None) => transcript.end = QueryEnd::Complete,
            RayQueryStep::Proceed(Some(candidate)) => transcript.candidates.push(QueryCandidate {
                instance: candidate.instance,
                geometry: candidate.geometry,
                primitive: candidate.primitive,
                t: FloatValue::F32(candidate.intersection.t),
                is_box: candidate.is_box(),
                opaque: candidate.opaque,
                confirmed: false,
                generated: Vec::new(),
            }),
            RayQueryStep::Confirm => {
                if let Some(candidate) = transcript.candidates.last_mut() {
                    candidate.confirmed = true;
                }
            }
            RayQueryStep::Generate(t) => {
                if let Some(candidate) = transcript.candidates.last_mut() {
                    candidate.generated.push(FloatValue::F32(t));
                }
            }
            RayQueryStep::Terminate => transcript.end = QueryEnd::Terminated,
            RayQueryStep::Commit(hit) => {
                known.closest = Some(known.closest.map_or(hit.t, |closest| closest.min(hit.t)));
                transcript.hit = Some(reader.hit(&known.tlas, &known.trace, &hit));
            }
        }
    }
}
