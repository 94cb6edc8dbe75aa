//! What a traversal does, in words.

use crate::debugger::{instance_verdict_name, is_step_of_traversal, verdict_name};
use anyhit_base::count::grouped;
use anyhit_engine::accel::hit::HitPrimitive;
use anyhit_engine::accel::observer::{InstanceVerdict, PrimitiveVerdict};
use anyhit_engine::accel::{Committed, TraceRay};
use anyhit_engine::geometry::Ray;
use anyhit_engine::machine::RayQueryStep;
use anyhit_engine::pipeline::Event;

/// The events that a step through a traversal shows, each in a line.
pub fn told(events: &[Event]) -> Vec<String> {
    events.iter().filter(|event| is_step_of_traversal(event)).map(describe).collect()
}

/// The events up to the one that stopped, which is marked, and some after it.
pub(super) fn list(events: &[Event], matched: Option<usize>) -> String {
    const MOST: usize = 8;
    let shown = events.iter().enumerate().filter(|(_, event)| is_step_of_traversal(event));
    let all: Vec<(usize, &Event)> = shown.collect();
    let at = all.iter().position(|(number, _)| Some(*number) == matched).unwrap_or(all.len());
    let first = (at + 1).min(all.len()).saturating_sub(MOST);
    let end = (first + MOST).min(all.len());
    let left_out = |count: usize, place: &str| match count {
        0 => String::new(),
        count => format!("  ... {} {place}\n", grouped(count)),
    };
    let mut text = left_out(first, "before");
    for (number, event) in &all[first..end] {
        let mark = if Some(*number) == matched { "> " } else { "  " };
        text += &format!("{mark}{}\n", describe(event));
    }
    text + &left_out(all.len() - end, "after")
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
        None => "node of the instance tree".into(),
        Some(instance) => format!("node of instance {instance}"),
    }
}

fn instance(instance: u32, verdict: InstanceVerdict) -> String {
    format!("instance {instance}: {}", instance_verdict_name(verdict))
}

fn primitive(hit: HitPrimitive, verdict: PrimitiveVerdict) -> String {
    let t = verdict.intersection().map_or_else(String::new, |at| format!(" at t {}", at.t));
    let HitPrimitive { instance, geometry, primitive } = hit;
    format!("instance {instance}, geometry {geometry}, primitive {primitive}: {}{t}", verdict_name(verdict))
}

fn hit(committed: &Committed) -> String {
    let candidate = &committed.candidate;
    let (instance, primitive, t) = (candidate.instance, candidate.primitive, candidate.intersection.t);
    format!("instance {instance}, primitive {primitive} at t {t}")
}
