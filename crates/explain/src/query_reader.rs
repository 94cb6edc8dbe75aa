//! Reads the events of the ray queries of one shader run into steps of its transcript.

use std::collections::HashMap;
use std::sync::Arc;

use crate::names::{self, Names};
use crate::transcript::{QueryCandidate, QueryEnd, QueryReport, Step};
use anyhit_engine::accel::{Tlas, TraceRay};
use anyhit_engine::machine::{RayQueryEvent, RayQueryStep};
use anyhit_engine::program::Program;
use anyhit_engine::reflect::value::FloatValue;

/// Reads the ray queries of one shader run.
pub(super) struct QueryReader<'a> {
    program: Option<&'a Program>,
    /// The queries that were initialised so far, by handle.
    queries: HashMap<u32, QueryState>,
}

/// A ray query that was initialised.
struct QueryState {
    /// The index of the query's step.
    step: usize,
    tlas: Arc<Tlas>,
    trace: TraceRay,
    /// The t of the closest committed hit so far.
    closest: Option<f32>,
}

impl<'a> QueryReader<'a> {
    pub(super) fn new(program: Option<&'a Program>) -> Self {
        Self { program, queries: HashMap::new() }
    }

    /// Reads an event: the initialisation of a query adds a step, any other event updates the step
    /// of its query.
    pub(super) fn read(&mut self, event: RayQueryEvent, steps: &mut Vec<Step>, names: &Names<'_>) {
        let RayQueryEvent { query, op, step, .. } = event;
        if let RayQueryStep::Initialize(tlas, trace) = step {
            let called_at = self.program.and_then(|program| names::source_line(program, op));
            let traversal = names.traversal(called_at, &tlas, &trace);
            let report =
                QueryReport { traversal, candidates: Vec::new(), hit: None, end: QueryEnd::Underway };
            self.queries.insert(query, QueryState { step: steps.len(), tlas, trace, closest: None });
            steps.push(Step::RayQuery(Box::new(report)));
            return;
        }
        let Some(state) = self.queries.get_mut(&query) else { return };
        let Some(Step::RayQuery(report)) = steps.get_mut(state.step) else { return };
        match step {
            RayQueryStep::Initialize(..) => {}
            RayQueryStep::Node(instance) => report.traversal.count_node(instance),
            RayQueryStep::Instance(instance, verdict) => {
                report.traversal.set_instance_verdict(instance, verdict)
            }
            RayQueryStep::Primitive(hit_primitive, verdict) => {
                report.traversal.add_tested_primitive(hit_primitive, verdict, &mut state.closest);
            }
            RayQueryStep::Proceed(None) if report.end == QueryEnd::Terminated => {}
            RayQueryStep::Proceed(None) => report.end = QueryEnd::Complete,
            RayQueryStep::Proceed(Some(candidate)) => report.candidates.push(QueryCandidate {
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
                if let Some(candidate) = report.candidates.last_mut() {
                    candidate.confirmed = true;
                }
            }
            RayQueryStep::Generate(t) => {
                if let Some(candidate) = report.candidates.last_mut() {
                    candidate.generated.push(FloatValue::F32(t));
                }
            }
            RayQueryStep::Terminate => report.end = QueryEnd::Terminated,
            RayQueryStep::Commit(hit) => {
                state.closest = Some(state.closest.map_or(hit.t, |closest| closest.min(hit.t)));
                report.hit = Some(names.hit(&state.tlas, &state.trace, &hit));
            }
        }
    }
}
