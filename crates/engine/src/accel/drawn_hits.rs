//! The hits of a ray in an order that is drawn, within what Vulkan leaves open ("Ray Traversal").
//!
//! * Operations on different candidates are not ordered: any-hit shaders may run for all hits in
//!   the interval in any order, as long as no closer hit is committed.
//! * Non-opaque candidates may be confirmed several times, unless their geometry is
//!   `NO_DUPLICATE_ANY_HIT`, and the shader code of a box may run several times.
//! * The bounds of a box are the implementation's, as long as they include the box: its shader code
//!   may run for rays that miss it.
//! * Of two hits with equal t either may be the closest.

use crate::accel::flags::GeometryFlags;
use crate::accel::geometry_data::{GeometryData, GeometryKind};
use crate::accel::hit::Candidate;
use crate::accel::rules::{is_culled_by_opacity, is_opaque, is_skipped, is_visible};
use crate::accel::tlas::Tlas;
use crate::accel::trace_ray::TraceRay;
use crate::geometry::aabb;
use crate::math::array;
use crate::math::random::Random;

/// A candidate comes a second time once in so many.
const REPEATED_ONCE_IN: u64 = 3;

/// A box is enlarged by this share of its longest side.
const ENLARGED_BY: f32 = 1.0 / 16.0;

/// Of geometries with more boxes none is enlarged: all of them would be tested for each ray.
const MOST_ENLARGED: usize = 1024;

/// The seeds of what is drawn about a traversal; `None` where this crate's own choice holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TraversalSeeds {
    /// Of the order of candidates and opaque hits.
    pub any_hit_order: Option<u64>,
    /// Of the candidates for which any-hit shaders run a second time.
    pub any_hit_duplicates: Option<u64>,
    /// Of the boxes for which intersection shaders run a second time, or although the ray misses
    /// them.
    pub intersection_repeats: Option<u64>,
    /// Of which of several hits at equal t is committed.
    pub ties: Option<u64>,
}

/// The hits of a ray that are still to come.
#[derive(Clone, Debug)]
pub(super) struct DrawnHits {
    /// The next one is the last of the list.
    rest: Vec<Candidate>,
    ties_are_drawn: bool,
}

impl DrawnHits {
    /// Draws an order of all hits of a ray, given in the order of hits. Returns it with the seeds
    /// that make a difference to that order.
    pub(super) fn new(
        mut hits: Vec<Candidate>,
        tlas: &Tlas,
        trace: &TraceRay,
        seeds: TraversalSeeds,
    ) -> (Self, TraversalSeeds) {
        let mut effective = TraversalSeeds::default();
        if let Some(seed) = seeds.intersection_repeats {
            let missed = missed_boxes(&hits, tlas, trace, &mut Random::of(seed, [0]));
            if !missed.is_empty() {
                effective.intersection_repeats = Some(seed);
                hits.extend(missed);
                hits.sort_by(|one, other| one.intersection.t.total_cmp(&other.intersection.t));
            }
        }
        let mut drawn = Vec::with_capacity(hits.len());
        let mut duplicates = seeds.any_hit_duplicates.map(Random::new);
        let mut repeats = seeds.intersection_repeats.map(Random::new);
        for hit in &hits {
            drawn.push(*hit);
            let (random, seed, used) = match hit.is_box() {
                true => (&mut repeats, seeds.intersection_repeats, &mut effective.intersection_repeats),
                false if hit.opaque => continue,
                false => (&mut duplicates, seeds.any_hit_duplicates, &mut effective.any_hit_duplicates),
            };
            let comes_again = random.as_mut().is_some_and(|random| random.below(REPEATED_ONCE_IN) == 0);
            if comes_again && may_come_again(hit, tlas) {
                drawn.push(*hit);
                *used = seed;
            }
        }
        if let Some(seed) = seeds.ties {
            let mut random = Random::new(seed);
            for tied in drawn.chunk_by_mut(|one, next| one.intersection.t == next.intersection.t) {
                if tied.iter().any(|hit| hit.hit_primitive() != tied[0].hit_primitive()) {
                    random.shuffle(tied);
                    effective.ties = Some(seed);
                }
            }
        }
        if let Some(seed) = seeds.any_hit_order
            && hits.len() > 1
            && hits.iter().any(|hit| hit.is_box() || !hit.opaque)
        {
            Random::new(seed).shuffle(&mut drawn);
            effective.any_hit_order = Some(seed);
        }
        drawn.reverse();
        (Self { rest: drawn, ties_are_drawn: effective.ties.is_some() }, effective)
    }

    /// Takes the next hit.
    pub(super) fn next(&mut self) -> Option<Candidate> {
        self.rest.pop()
    }

    /// The hits that are still to come, in their order.
    pub(super) fn iter(&self) -> impl Iterator<Item = &Candidate> {
        self.rest.iter().rev()
    }

    /// Whether a later one of two hits at equal t may be committed, whichever it is.
    pub(super) fn ties_are_drawn(&self) -> bool {
        self.ties_are_drawn
    }
}

/// Some of the boxes that the ray misses, and that it hits where they are enlarged.
fn missed_boxes(hits: &[Candidate], tlas: &Tlas, trace: &TraceRay, random: &mut Random) -> Vec<Candidate> {
    let mut missed = Vec::new();
    for (number, instance) in (0..).zip(tlas.instances()) {
        if !is_visible(instance.mask, trace.cull_mask) || is_skipped(trace.flags, GeometryKind::Aabbs) {
            continue;
        }
        let Some(ray) = tlas.object_ray(number, &trace.ray, trace.time) else { continue };
        for (geometry, one) in (0..).zip(instance.blas.geometries()) {
            let GeometryData::Aabbs(boxes) = &one.data else { continue };
            let opaque = is_opaque(trace.flags, instance.flags, one.flags);
            if is_culled_by_opacity(trace.flags, opaque) || boxes.len() > MOST_ENLARGED {
                continue;
            }
            for (primitive, &[ax, ay, az, bx, by, bz]) in (0..).zip(boxes) {
                let (min, max) = ([ax, ay, az], [bx, by, bz]);
                let sides: [f32; 3] = array::from_fn(|axis| max[axis] - min[axis]);
                if !sides.iter().all(|&side| side >= 0.0) {
                    continue;
                }
                let by = sides.into_iter().fold(0.0, f32::max) * ENLARGED_BY;
                let (min, max) = (array::map(min, |side| side - by), array::map(max, |side| side + by));
                let Some(intersection) = aabb::intersect(&ray, min, max, tlas.precision()) else { continue };
                let candidate = Candidate { instance: number, geometry, primitive, intersection, opaque };
                let is_hit = hits.iter().any(|hit| hit.hit_primitive() == candidate.hit_primitive());
                if !is_hit && random.below(REPEATED_ONCE_IN) == 0 {
                    missed.push(candidate);
                }
            }
        }
    }
    missed
}

/// Whether shaders may be called for a candidate a second time. A second run of an intersection
/// shader would call the any-hit shader a second time, too.
fn may_come_again(hit: &Candidate, tlas: &Tlas) -> bool {
    let geometry = &hit.instance_in(tlas).blas.geometries()[hit.geometry as usize];
    !geometry.flags.contains(GeometryFlags::NO_DUPLICATE_ANY_HIT)
}
