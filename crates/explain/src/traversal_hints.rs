//! Hints about rays that are traced as written, and rarely as meant: candidates on which no shader
//! decides, a world-space ray in object space, a time that is lost.

use crate::transcript::{Decision, QueryCandidate, QueryEnd, QueryReport, Trace};
use crate::walk::{AnyRay, PlacedRay};
use anyhit_base::count::grouped;

/// A ray query that is complete without a hit, of whose candidates none was confirmed or generated
/// in.
pub(super) fn undecided_candidates(placed: &PlacedRay<'_, '_>) -> Option<String> {
    let AnyRay::Query(QueryReport { candidates, hit: None, end: QueryEnd::Complete, .. }) = placed.ray else {
        return None;
    };
    let is_dropped = |one: &QueryCandidate| !one.confirmed && one.generated.is_empty();
    (!candidates.is_empty() && candidates.iter().all(is_dropped)).then(|| {
        let count = candidates.len();
        let plural = if count == 1 { "candidate" } else { "candidates" };
        format!(
            "it finds {} {plural}, but its shader confirms none and generates no hit, so it misses",
            grouped(count)
        )
    })
}

/// An intersection shader of a transformed instance that reads the ray in world space alone.
pub(super) fn world_ray(placed: &PlacedRay<'_, '_>) -> Option<String> {
    let AnyRay::Trace(Trace { decisions, traversal, .. }) = placed.ray else { return None };
    decisions.iter().filter(|decision| decision.is_box).find_map(|decision: &Decision| {
        let run = decision.shader.as_ref()?;
        let reads = |name: &str| run.builtins.iter().any(|builtin| builtin.name == name);
        let is_transformed = traversal.instances.get(decision.instance as usize)?.transformed;
        let knows_object_space = ["ObjectToWorldKHR", "WorldToObjectKHR"].into_iter().any(reads);
        let pairs = [
            ("WorldRayOriginKHR", "ObjectRayOriginKHR"),
            ("WorldRayDirectionKHR", "ObjectRayDirectionKHR"),
        ];
        let mut wrong = pairs.into_iter().filter(|(world, object)| reads(world) && !reads(object));
        let (world, object) = wrong.next().filter(|_| is_transformed && !knows_object_space)?;
        Some(format!(
            "the intersection shader of instance {}, which is transformed, reads {world}; the AABBs of an instance \
             are in object space, like {object}",
            decision.instance
        ))
    })
}

/// A ray at time 0 into moving geometry, after a ray at another time.
pub(super) fn time_lost(placed: &PlacedRay<'_, '_>) -> Option<String> {
    let traversal = placed.ray.traversal();
    let is_at_zero = traversal.time.is_some_and(|time| time.as_f64() == 0.0);
    let moves = traversal.instances.iter().any(|instance| instance.moves);
    let before = placed.from.first()?.traversal().time.filter(|time| time.as_f64() != 0.0)?;
    (is_at_zero && moves)
        .then(|| format!("it intersects moving geometry at time 0, but the previous ray has time {before}"))
}
