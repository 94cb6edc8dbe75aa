//! Rules about the states of ray queries that are no traps.
//!
//! Each query carries what was noted of it. Whether a use was too early is known when the query
//! goes on, is initialized again, or its shader ends.

use smallvec::SmallVec;

use crate::rule::{Rule, query, stop, traversal};
use crate::sanitizer::Sanitizer;
use anyhit_engine::accel::RayFlags;
use anyhit_engine::machine::object::ObjectRef;
use anyhit_engine::machine::{Batch, Exit, Mask, OpIndex, QueryNotes, RayQuery};
use anyhit_engine::ops::op::Op;
use anyhit_engine::ops::ray_query::{MicromapMode, RayQueryOp};

/// Rules that a query breaks, each with the operation that is to be shown.
type Broken = SmallVec<[(&'static Rule, OpIndex); 2]>;

/// Notes what an operation did to the queries of the running lanes, and reports what is wrong.
pub(crate) fn check<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &mut Batch<W>,
    op: OpIndex,
    query_op: &RayQueryOp,
    ignores_result: bool,
) {
    let Some(object) = query_op.query() else { return };
    for lane in batch.mask.lanes() {
        let Ok(register) = object.register(&batch.registers, lane) else { continue };
        let handle = batch.registers[register].0[lane];
        let Ok(query) = batch.queries.query(handle) else { continue };
        for (rule, at) in note(query, op, query_op, ignores_result) {
            if rule != &traversal::RQ_UNDECIDED || !decides_elsewhere(sanitizer, object) {
                tell(sanitizer, batch, rule, at, lane);
            }
        }
    }
}

/// Reports what is wrong with the queries of a batch whose shader has ended.
pub(crate) fn ended<const W: usize>(sanitizer: &mut Sanitizer<'_>, batch: &Batch<W>) {
    let trapped = |lane: usize| matches!(batch.exits.get(lane), Some(Exit::Trapped(_)));
    for query in batch.queries.iter().filter(|query| !trapped(query.lane())) {
        for (rule, at) in pending(&query.notes) {
            tell(sanitizer, batch, rule, at, query.lane());
        }
    }
}

fn tell<const W: usize>(
    sanitizer: &mut Sanitizer<'_>,
    batch: &Batch<W>,
    rule: &'static Rule,
    at: OpIndex,
    lane: usize,
) {
    let message = match () {
        () if rule == &query::RQ_TERMINATE_LATE => {
            "a ray query is terminated after rayQueryProceedEXT has returned false"
        }
        () if rule == &query::RQ_NOT_FINISHED => {
            "the committed hit of a ray query is used, though rayQueryProceedEXT has not returned false, and is \
             not called again"
        }
        () if rule == &stop::RQ_MICROMAP => {
            "a ray query in an acceleration structure with opacity micromaps, and the shader does not have the \
             execution mode OpacityMicromapIdKHR"
        }
        () if rule == &query::RQ_IGNORED_RESULT => {
            "rayQueryProceedEXT comes to a candidate, at which the shader does not look"
        }
        () if rule == &traversal::RQ_UNDECIDED => {
            "the shader neither confirms nor looks at the candidates to which rayQueryProceedEXT comes, and uses the \
             committed hit"
        }
        () => "a candidate is confirmed by what is read of the committed hit, which is another one",
    };
    sanitizer.tell(batch, rule, at, Mask::lane(lane), |_| message.to_owned());
}

/// Notes what an operation did to a query.
fn note(query: &mut RayQuery, op: OpIndex, query_op: &RayQueryOp, ignores_result: bool) -> Broken {
    let mut broken = Broken::new();
    let has_candidate = query.candidate().is_ok();
    let is_open = query.is_underway() && !ends_at_first_hit(query);
    let has_committed = query.committed().is_some();
    let is_complete = query.is_complete();
    let notes = &mut query.notes;
    match *query_op {
        RayQueryOp::Initialize { micromaps, .. } => {
            broken = pending(notes);
            *notes = QueryNotes::default();
            let is_undeclared = micromaps == MicromapMode::Undeclared && query.tlas().has_micromaps();
            broken.extend(is_undeclared.then_some((&stop::RQ_MICROMAP, op)));
        }
        RayQueryOp::Proceed { .. } => {
            broken.extend(notes.ignored.map(|at| (&query::RQ_IGNORED_RESULT, at)));
            let QueryNotes { undecided, decides, .. } = *notes;
            let ignored = (ignores_result && has_candidate).then_some(op);
            let undecided = undecided.or_else(|| (has_candidate && !ignores_result).then_some(op));
            *notes = QueryNotes { ignored, undecided, decides, ..Default::default() };
        }
        RayQueryOp::Terminate { .. } => {
            broken.extend(is_complete.then_some((&query::RQ_TERMINATE_LATE, op)));
            notes.ignored = None;
            notes.decides = true;
        }
        RayQueryOp::Confirm { .. } | RayQueryOp::Generate { .. } => {
            let wrong = notes.committed_use.take().filter(|_| !notes.candidate_used);
            broken.extend(wrong.map(|at| (&query::RQ_WRONG_SELECTOR, at)));
            notes.ignored = None;
            notes.decides = true;
        }
        RayQueryOp::Type { committed: false, .. } => {
            notes.ignored = None;
            notes.decides = true;
        }
        RayQueryOp::Get { committed: false, .. } => {
            notes.ignored = None;
            notes.decides = true;
            notes.candidate_used = true;
        }
        RayQueryOp::Type { committed: true, .. } | RayQueryOp::Get { committed: true, .. } => {
            if let RayQueryOp::Get { getter, .. } = query_op
                && has_candidate
                && !getter.reads_t()
            {
                notes.committed_use.get_or_insert(op);
            }
            if is_complete && !notes.decides {
                broken.extend(notes.undecided.take().map(|at| (&traversal::RQ_UNDECIDED, at)));
            }
            // That there is a hit remains true, whichever follows.
            let is_final = matches!(query_op, RayQueryOp::Type { .. }) && has_committed;
            if let Some(at) = notes.ignored.take() {
                broken.push((&query::RQ_IGNORED_RESULT, at));
            } else if is_open && !is_final {
                notes.early_use.get_or_insert(op);
            }
        }
        RayQueryOp::GetRay { .. } | RayQueryOp::Uninitialize { .. } => {}
    }
    broken
}

/// Whether the program decides on candidates of a query somewhere, though not in this invocation:
/// then a condition was meant. Where a query lies in a register that is computed, it may be any.
fn decides_elsewhere(sanitizer: &Sanitizer<'_>, object: ObjectRef) -> bool {
    let Some((_, plan)) = sanitizer.plan() else { return false };
    let is_same = |other: ObjectRef| match (object, other) {
        (ObjectRef::Register(own), ObjectRef::Register(other)) => own == other,
        _ => true,
    };
    plan.program.ops.iter().any(|op| match op {
        Op::RayQuery(
            RayQueryOp::Confirm { query }
            | RayQueryOp::Generate { query, .. }
            | RayQueryOp::Type { query, committed: false, .. }
            | RayQueryOp::Get { query, committed: false, .. },
        ) => is_same(*query),
        _ => false,
    })
}

/// What is wrong with a query that does not go on.
fn pending(notes: &QueryNotes) -> Broken {
    let early = notes.early_use.map(|at| (&query::RQ_NOT_FINISHED, at));
    let ignored = notes.ignored.map(|at| (&query::RQ_IGNORED_RESULT, at));
    early.into_iter().chain(ignored).map(|(rule, at)| (rule as &'static Rule, at)).collect()
}

/// Whether the committed hit of a query is the last one, as its ray ends at the first.
fn ends_at_first_hit(query: &RayQuery) -> bool {
    query.trace().flags.contains(RayFlags::TERMINATE_ON_FIRST_HIT) && query.committed().is_some()
}
