//! Ray queries and hit objects in words: what a variable of these types holds.

use anyhit_engine::accel::Committed;
use anyhit_engine::accel::hit::Candidate;
use anyhit_engine::geometry::Surface;
use anyhit_engine::machine::hit_object::HitObject;
use anyhit_engine::machine::ray_query::RayQuery;

/// The state of a ray query; `None` for one that is not initialised.
pub(super) fn describe_query(query: Option<&RayQuery>) -> String {
    let Some(query) = query else { return "not initialised".into() };
    let stands = match query.candidate() {
        Ok(candidate) => format!("candidate {}", primitive(candidate, candidate.intersection.t)),
        Err(_) if query.is_complete() => "traversal is over".to_owned(),
        Err(_) if query.is_underway() => "no candidate yet".to_owned(),
        Err(_) => "terminated".to_owned(),
    };
    let committed = query.committed().map_or_else(|| "nothing".to_owned(), hit);
    format!("{stands}; committed {committed}")
}

/// The state of a hit object.
pub(super) fn describe_hit_object(object: Option<&HitObject>) -> String {
    match object {
        None | Some(HitObject::Unrecorded) => "nothing recorded".into(),
        Some(HitObject::Empty) => "empty: neither a hit nor a miss".into(),
        Some(HitObject::Miss(ray)) => format!("a miss: miss record {}", ray.record.0),
        Some(HitObject::Hit(ray, encoded)) => {
            format!("a hit: {}, hit record {}", hit(&encoded.committed), ray.record.0)
        }
    }
}

fn hit(committed: &Committed) -> String {
    primitive(&committed.candidate, committed.t)
}

fn primitive(candidate: &Candidate, t: f32) -> String {
    let kind = match candidate.intersection.surface {
        Surface::TriangleFront | Surface::TriangleBack => "triangle",
        Surface::Aabb => "box",
        Surface::Sphere => "sphere",
        Surface::Side | Surface::Cap0 | Surface::Cap1 => "linear swept sphere",
    };
    let Candidate { instance, geometry, primitive, .. } = candidate;
    format!("{kind}: instance {instance}, geometry {geometry}, primitive {primitive} at t {t}")
}
