//! What a traversal does, in words.

use crate::debug::debugger::{instance_verdict_name, is_step_of_traversal, verdict_name};
use crate::pipeline::Event;

/// The events that a step through a traversal shows, each in a line.
pub(super) fn told(events: &[Event]) -> Vec<String> {
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
    let triple = |[x, y, z]: [f32; 3]| format!("({x}, {y}, {z})");
    match event {
        Event::Trace { depth, trace, .. } => {
            let (origin, direction) = (triple(trace.ray.origin), triple(trace.ray.direction));
            let (near, far) = (trace.ray.t_min, trace.ray.t_max);
            format!("ray at depth {depth}: origin {origin}, direction {direction}, t from {near} to {far}")
        }
        Event::Node(None) => "node of the tree over the instances".into(),
        Event::Node(Some(instance)) => format!("node of instance {instance}"),
        Event::Instance(instance, verdict) => {
            format!("instance {instance}: {}", instance_verdict_name(*verdict))
        }
        Event::Primitive(hit, verdict) => {
            let t = verdict.t().map_or_else(String::new, |t| format!(" at t {t}"));
            let (instance, geometry, primitive) = (hit.instance, hit.geometry, hit.primitive);
            let verdict = verdict_name(*verdict);
            format!("instance {instance}, geometry {geometry}, primitive {primitive}: {verdict}{t}")
        }
        Event::Candidate { candidate, record, shader, .. } => {
            let decides = match shader {
                Some(_) if candidate.is_box() => "an intersection shader runs",
                Some(_) => "an any-hit shader decides",
                None if candidate.is_box() => "no shader: dropped",
                None => "no shader: accepted",
            };
            let (instance, primitive) = (candidate.instance, candidate.primitive);
            format!("candidate: instance {instance}, primitive {primitive}, hit record {}: {decides}", record.0)
        }
        Event::Opaque(committed) => {
            let candidate = &committed.candidate;
            format!(
                "committed: instance {}, primitive {} at t {}",
                candidate.instance, candidate.primitive, candidate.intersection.t
            )
        }
        Event::Traversed { committed: None, record, .. } => format!("a miss: miss record {}", record.0),
        Event::Traversed { committed: Some(committed), record, .. } => {
            let candidate = &committed.candidate;
            format!(
                "the closest hit: instance {}, primitive {} at t {}, hit record {}",
                candidate.instance, candidate.primitive, candidate.intersection.t, record.0
            )
        }
        Event::RayQuery(query) => format!("ray query: {}", query.step.describe()),
        _ => String::new(),
    }
}
