//! What a traversal does, in words.

use crate::accel::hit::HitPrimitive;
use crate::accel::observer::{InstanceVerdict, PrimitiveVerdict};
use crate::accel::{Committed, TraceRay};
use crate::debug::debugger::{instance_verdict_name, is_step_of_traversal, verdict_name};
use crate::geometry::Ray;
use crate::machine::RayQueryStep;
use crate::pipeline::Event;

/// The events that a step through a traversal shows, each in a line.
pub fn told(events: &[Event]) -> Vec<String> {
    events.iter().filter(|event| is_step_of_traversal(event)).map(describe).collect()
}

/// The last events, the one that stopped last.
pub(super) fn list(events: &[Event]) -> String {
    const MOST: usize = 8;
    let all = told(events);
    let left_out = all.len().saturating_sub(MOST);
    let before = if left_out > 0 { format!("  ... {left_out} before\n") } else { String::new() };
    all[left_out..].iter().fold(before, |text, line| text + "  " + line + "\n")
}

fn describe(event: &Event) -> String {
    match event {
        Event::Trace { depth, trace, .. } => format!("ray at depth {depth}: {}", ray(trace)),
        Event::Node(of) => node(*of),
        Event::Instance(at, verdict) => instance(*at, *verdict),
        Event::Primitive(hit, verdict) => primitive(*hit, *verdict),
        Event::Candidate { candidate, record, shader, .. } => {
            let decides = match shader {
                Some(_) if candidate.is_box() => "an intersection shader runs",
                Some(_) => "an any-hit shader decides",
                None if candidate.is_box() => "no shader: dropped",
                None => "no shader: accepted",
            };
            let (instance, primitive) = (candidate.instance, candidate.primitive);
            format!(
                "candidate: instance {instance}, primitive {primitive}, hit record {}: {decides}",
                record.0
            )
        }
        Event::Opaque(committed) => format!("committed: {}", hit(committed)),
        Event::Traversed { committed: None, record, .. } => format!("a miss: miss record {}", record.0),
        Event::Traversed { committed: Some(committed), record, .. } => {
            format!("the closest hit: {}, hit record {}", hit(committed), record.0)
        }
        Event::RayQuery(query) => format!("ray query: {}", describe_query(&query.step)),
        _ => String::new(),
    }
}

fn describe_query(step: &RayQueryStep) -> String {
    match step {
        RayQueryStep::Initialize(_, trace) => format!("begins: {}", ray(trace)),
        RayQueryStep::Node(of) => node(*of),
        RayQueryStep::Instance(at, verdict) => instance(*at, *verdict),
        RayQueryStep::Primitive(hit, verdict) => primitive(*hit, *verdict),
        RayQueryStep::Proceed(Some(candidate)) => {
            format!("a candidate: instance {}, primitive {}", candidate.instance, candidate.primitive)
        }
        RayQueryStep::Proceed(None) => "traversal is over".into(),
        RayQueryStep::Confirm => "the candidate is confirmed".into(),
        RayQueryStep::Generate(t) => format!("an intersection is generated at t {t}"),
        RayQueryStep::Terminate => "terminated".into(),
        RayQueryStep::Commit(committed) => format!("committed: {}", hit(committed)),
    }
}

fn ray(trace: &TraceRay) -> String {
    let triple = |[x, y, z]: [f32; 3]| format!("({x}, {y}, {z})");
    let Ray { origin, direction, t_min, t_max } = trace.ray;
    format!("origin {}, direction {}, t from {t_min} to {t_max}", triple(origin), triple(direction))
}

fn node(instance: Option<u32>) -> String {
    match instance {
        None => "node of the tree over the instances".into(),
        Some(instance) => format!("node of instance {instance}"),
    }
}

fn instance(instance: u32, verdict: InstanceVerdict) -> String {
    format!("instance {instance}: {}", instance_verdict_name(verdict))
}

fn primitive(hit: HitPrimitive, verdict: PrimitiveVerdict) -> String {
    let t = match verdict {
        PrimitiveVerdict::Missed => String::new(),
        PrimitiveVerdict::OutsideInterval(at)
        | PrimitiveVerdict::Transparent(at)
        | PrimitiveVerdict::CulledByOpacity(at)
        | PrimitiveVerdict::CulledByFace(at)
        | PrimitiveVerdict::Behind(at)
        | PrimitiveVerdict::Opaque(at)
        | PrimitiveVerdict::Candidate(at) => format!(" at t {}", at.t),
    };
    let HitPrimitive { instance, geometry, primitive } = hit;
    format!("instance {instance}, geometry {geometry}, primitive {primitive}: {}{t}", verdict_name(verdict))
}

fn hit(committed: &Committed) -> String {
    let candidate = &committed.candidate;
    let (instance, primitive, t) = (candidate.instance, candidate.primitive, candidate.intersection.t);
    format!("instance {instance}, primitive {primitive} at t {t}")
}
