//! Hits and shaders in a few words.

use crate::transcript::{HitReport, ShaderLabel};
use crate::walk::AnyRay;
use anyhit_base::count::grouped;

/// `12 hit, 4 missed`
pub fn counts(rays: &[AnyRay<'_>]) -> String {
    let hit = rays.iter().filter(|ray| ray.hit().is_some()).count();
    let trapped = rays.iter().filter(|ray| ray.hit().is_none() && ray.is_trapped()).count();
    let missed = rays.len() - hit - trapped;
    let all = [(hit, "hit"), (missed, "missed"), (trapped, "ended by a trap")];
    let words: Vec<String> = all
        .into_iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, what)| format!("{} {what}", grouped(count)))
        .collect();
    words.join(", ")
}

/// What became of a ray: ``hit instance 2 `chains`, geometry 0, primitive 62 at t 4.5``.
pub fn outcome(ray: AnyRay<'_>) -> String {
    match ray.hit() {
        Some(hit) => format!("hit {} at t {}", primitive(hit), hit.t),
        None if ray.is_trapped() => "ended by a trap".to_owned(),
        None => "missed".to_owned(),
    }
}

/// ``instance 2 `chains`, primitive 62``; the geometry's number stands there if it is not 0.
pub(super) fn primitive(hit: &HitReport) -> String {
    let name = hit.geometry_name.as_ref().map_or_else(String::new, |name| format!(" `{name}`"));
    let geometry = match hit.geometry {
        0 => String::new(),
        geometry => format!(", geometry {geometry}"),
    };
    format!("instance {}{name}{geometry}, primitive {}", hit.instance, hit.primitive)
}

/// ``ClosestHitKHR `chains` ``, by the entry point where a shader has no name.
pub fn label(shader: &ShaderLabel) -> String {
    format!("{} `{}`", shader.stage, shader.name.as_ref().unwrap_or(&shader.entry))
}
