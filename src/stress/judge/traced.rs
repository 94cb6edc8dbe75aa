//! Judges BVH traversal: a cursor and a packet must find what testing every primitive finds.
//!
//! Both run on the best instruction set of the CPU and on the baseline. A cursor has two code paths
//! through the same trees, and both are tested: an opaque ray commits the hit of the least key (t,
//! instance, geometry, primitive); a ray for which nothing is opaque gets all hits in the order of
//! that key, each once, with or without an observer. Packets are traced as in launches: all rays of
//! a case together, then over intervals that end at each ray's hit or one f32 next to it, and for
//! any hit at all.

use std::sync::Arc;

use crate::accel::{
    Blas, Candidate, Cursor, HitKind, HitPrimitive, InstanceFlags, Packet, RayFlags, Tlas, TlasInstance,
    TraceRay, TraversalObserver,
};
use crate::geometry::{Intersection, Precision, Ray, Surface};
use crate::math::lane_ops::CpuTier;
use crate::stress::case::{Shape, StressCase};
use crate::stress::judge::moment::{ExactHit, Moment};
use crate::stress::judge::{Failure, Tally, fail};
use crate::stress::reference::LineOf;

const IDENTITY: [[f32; 4]; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

/// The structures that a case's rays are traced in.
pub struct TracedScene {
    /// The structures of the case: for the best instruction set of the CPU, and for the baseline if
    /// that differs.
    structures: Vec<(&'static str, Arc<Tlas>)>,
    precision: Precision,
    /// Geometry and primitive of each shape.
    places: Vec<(u32, u32)>,
    has_boxes: bool,
}

/// A hit as both report it.
#[derive(Debug, PartialEq)]
struct Seen {
    hit_primitive: HitPrimitive,
    found: Intersection,
}

impl TracedScene {
    /// `None` if Vulkan does not allow the case: negative radii, boxes with min > max, motion keys
    /// without inverse.
    pub fn new(case: &StressCase, precision: Precision) -> Result<Option<Self>, Failure> {
        let Some((geometries, counts)) = case.geometries() else { return Ok(None) };
        let Ok(blas) = Blas::new(geometries) else { return Ok(None) };
        let placements = case.placements();
        let instances = placements.iter().map(|placement| TlasInstance {
            motion: placement.motion.map(|moves| moves.motion()),
            mask: placement.mask,
            flags: InstanceFlags(placement.flags),
            ..TlasInstance::of(blas.clone(), placement.transform.unwrap_or(IDENTITY))
        });
        let instances: Vec<_> = instances.collect();
        // Traversal has two kinds of SIMD vectors.
        let levels = CpuTier::available().into_iter().take(2);
        let structures = levels
            .map(|(name, cpu_tier)| Ok((name, Tlas::for_cpu_tier(instances.clone(), precision, cpu_tier)?)));
        let Ok(structures) = structures.collect::<crate::error::Result<Vec<_>>>() else {
            let has_inverse = |matrix: &[[f32; 4]; 3]| {
                let is_finite = matrix.as_flattened().iter().all(|x| x.is_finite());
                is_finite && LineOf::new(&case.ray(), Some(matrix)).is_some()
            };
            let may_refuse = placements.iter().any(|placement| {
                placement.motion.is_some() || !placement.transform.as_ref().is_none_or(has_inverse)
            });
            return if may_refuse { Ok(None) } else { fail("a regular matrix is refused") };
        };
        let places = counts.iter().enumerate().flat_map(|(geometry, &count)| {
            (0..count).map(move |primitive| (geometry as u32, primitive as u32))
        });
        let has_boxes = matches!(case.shapes.first(), Some(Shape::Aabb(_)));
        Ok(Some(Self { structures, precision, places: places.collect(), has_boxes }))
    }

    fn seen(&self, hit: &ExactHit) -> Seen {
        let (geometry, primitive) = self.places[hit.shape];
        Seen {
            hit_primitive: HitPrimitive { instance: hit.instance as u32, geometry, primitive },
            found: hit.found,
        }
    }

    /// Checks the traversal of a single ray.
    pub fn check_alone(&self, moment: &Moment, trace: &TraceRay, tally: &mut Tally) -> Result<(), Failure> {
        let hits = moment.hits(trace, self.precision);
        let Ray { t_min, t_max, .. } = trace.ray;
        for (name, tlas) in &self.structures {
            self.check_cursor(tlas, trace, &hits, tally).map_err(|Failure(what)| {
                Failure(format!("traversal ({name}) over {t_min:e}..{t_max:e}: {what}"))
            })?;
        }
        Ok(())
    }

    fn check_cursor(
        &self,
        tlas: &Tlas,
        trace: &TraceRay,
        hits: &[ExactHit],
        tally: &mut Tally,
    ) -> Result<(), Failure> {
        let flags = RayFlags(trace.flags.0 & !RayFlags::OPAQUE.0 | RayFlags::NO_OPAQUE.0);
        let all = TraceRay { flags, ..*trace };
        let mut nodes = Nodes(false);
        let mut count = |nodes: &Nodes| {
            tally.rays += 1;
            tally.hits += u64::from(!hits.is_empty());
            tally.trees += u64::from(nodes.0);
        };
        for is_watched in [true, false] {
            let mut cursor = Cursor::new(tlas, all);
            let mut wanted = hits.iter();
            while let Some(candidate) =
                if is_watched { cursor.proceed_with(tlas, &mut nodes) } else { cursor.proceed(tlas) }
            {
                let (seen, wanted) = (seen(&candidate), wanted.next().map(|hit| self.seen(hit)));
                if wanted.as_ref() != Some(&seen) {
                    return fail(format!("{seen:?} is handed out, not {wanted:?}"));
                }
            }
            if let Some(hit) = wanted.next() {
                return fail(format!("{:?} is not handed out", self.seen(hit)));
            }
            count(&nodes);
        }
        if self.has_boxes {
            return Ok(());
        }

        for any in [false, true] {
            let mut cursor = Cursor::new(tlas, *trace);
            if any {
                cursor.end_at_any_opaque_hit();
            }
            if let Some(candidate) = cursor.proceed(tlas) {
                return fail(format!("{:?} is handed out, but opaque", seen(&candidate)));
            }
            let committed = cursor.committed().map(|hit| (seen(&hit.candidate), hit.t, hit.hit_kind));
            self.check_committed(hits, committed, any).or_else(fail)?;
            count(&nodes);
        }
        Ok(())
    }

    /// Checks the traversal of rays in packets, each with its moment.
    pub fn check_together(&self, rays: &[(TraceRay, &Moment)], tally: &mut Tally) -> Result<(), Failure> {
        if self.has_boxes || rays.is_empty() {
            return Ok(());
        }
        let traces: Vec<_> = rays.iter().map(|(trace, _)| *trace).collect();
        let precision = self.precision;
        let hits: Vec<_> = rays.iter().map(|(trace, moment)| moment.hits(trace, precision)).collect();
        let ended = |(at, (trace, hits)): (usize, (&TraceRay, &Vec<ExactHit>))| {
            let t = hits.first()?.found.t;
            let [min, max] = [trace.ray.t_min, trace.ray.t_max];
            let (t_min, t_max) = [(min, t), (t, max), (min, t.next_down()), (t.next_up(), max)][at % 4];
            let ended = TraceRay { ray: trace.ray.with_interval(t_min, t_max), ..*trace };
            ended.check().is_ok().then_some(ended)
        };
        let ended: Vec<_> =
            traces.iter().zip(&hits).enumerate().map(|one| ended(one).unwrap_or(*one.1.0)).collect();
        let moments = rays.iter().map(|(_, moment)| *moment);
        let hits_of_ended: Vec<_> =
            ended.iter().zip(moments).map(|(trace, moment)| moment.hits(trace, precision)).collect();
        let told = [(&traces, &hits, false), (&ended, &hits_of_ended, false), (&traces, &hits, true)];
        for (name, tlas) in &self.structures {
            // All with one `Packet`, which traces single rays for a while after it did not pay.
            let mut packet = Packet::default();
            for (traces, hits, any) in told {
                self.check_packet(&mut packet, tlas, (traces, hits), any, tally)
                    .map_err(|Failure(what)| Failure(format!("a packet ({name}){what}")))?;
            }
        }
        Ok(())
    }

    fn check_packet(
        &self,
        packet: &mut Packet,
        tlas: &Tlas,
        (traces, hits): (&[TraceRay], &[Vec<ExactHit>]),
        any: bool,
        tally: &mut Tally,
    ) -> Result<(), Failure> {
        let mut found = Vec::new();
        if !packet.trace(tlas, traces, any, &mut found) || found.len() != traces.len() {
            return fail(format!(" of {} rays: {} answers", traces.len(), found.len()));
        }
        for (lane, (found, hits)) in found.iter().zip(hits).enumerate() {
            let committed = found.map(|hit| (seen(&hit.candidate), hit.t, hit.hit_kind));
            self.check_committed(hits, committed, any).or_else(|what| {
                let Ray { t_min, t_max, .. } = traces[lane].ray;
                let any = if any { " for any hit" } else { "" };
                fail(format!("{any}, ray {lane} over {t_min:e}..{t_max:e}: {what}"))
            })?;
            tally.hits += u64::from(!hits.is_empty());
        }
        tally.rays += traces.len() as u64;
        tally.packets += u64::from(packet.traced_together());
        Ok(())
    }

    /// With `any`, it may be any of the hits.
    fn check_committed(
        &self,
        hits: &[ExactHit],
        committed: Option<(Seen, f32, HitKind)>,
        any: bool,
    ) -> Result<(), String> {
        let allowed = if any { hits } else { &hits[..hits.len().min(1)] };
        let is_right = match &committed {
            None => hits.is_empty(),
            Some((seen, t, kind)) => {
                *t == seen.found.t
                    && *kind == hit_kind(seen.found.surface)
                    && allowed.iter().any(|hit| self.seen(hit) == *seen)
            }
        };
        if is_right {
            return Ok(());
        }
        let wanted = hits.first().map(|hit| self.seen(hit));
        Err(format!("{committed:?} is committed, not {wanted:?}"))
    }
}

fn seen(candidate: &Candidate) -> Seen {
    Seen { hit_primitive: candidate.hit_primitive(), found: candidate.intersection }
}

/// SEMANTICS 4.2 for triangles; the other two are ours.
fn hit_kind(surface: Surface) -> HitKind {
    match surface {
        Surface::TriangleFront => HitKind(0xFE),
        Surface::TriangleBack => HitKind(0xFF),
        Surface::Sphere => HitKind::SPHERE,
        Surface::Aabb | Surface::Side | Surface::Cap0 | Surface::Cap1 => HitKind::LINEAR_SWEPT_SPHERE,
    }
}

/// Whether nodes of a BLAS were opened.
struct Nodes(bool);

impl TraversalObserver for Nodes {
    const EXPLAINS_MISSES: bool = false;

    fn node(&mut self, instance: Option<u32>) {
        self.0 |= instance.is_some();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stress::case::{Neighbour, Placement};

    /// Balls of radius 1 along the x axis, four apart, in a tree, and a ray through the first
    /// `count` of them.
    fn balls(count: usize) -> StressCase {
        let ball = |k: usize| Shape::Sphere { center: [4.0 * k as f32, 0.0, 0.0], radius: 1.0 };
        let ray = Ray::new([-4.0, 0.0, 0.0], [1.0, 0.0, 0.0]);
        let mut case = StressCase::new((0..count).map(ball).collect(), (ray, None));
        case.hidden = 0;
        let Ray { origin, t_min, t_max, .. } = ray;
        // All but the first rays miss everything.
        case.neighbours = (0..16)
            .map(|k| {
                let direction = [1.0, k as f32 * 0.125, 0.0];
                Neighbour { origin, direction, t_min, t_max, time: 0.0, flags: 0, cull_mask: 1 }
            })
            .collect();
        case
    }

    /// Checks the traversal of one case against the hits of another one.
    fn judged(traced: &StressCase, known: &StressCase) -> [Result<Tally, String>; 2] {
        let scene = TracedScene::new(traced, Precision::Exact).expect("regular").expect("legal");
        let moment = Moment::new(known, 0.0);
        let mut tallies = [Tally::default(); 2];
        let alone = scene.check_alone(&moment, &known.trace(), &mut tallies[0]);
        let neighbours = known.neighbours.iter().map(|neighbour| (neighbour.trace(), &moment));
        let together = scene.check_together(&neighbours.collect::<Vec<_>>(), &mut tallies[1]);
        let [first, second] = tallies;
        [
            alone.map(|()| first).map_err(|what| what.to_string()),
            together.map(|()| second).map_err(|what| what.to_string()),
        ]
    }

    #[test]
    fn rays_through_trees_and_packets_are_counted() {
        let [alone, together] = judged(&balls(9), &balls(9)).map(|result| result.expect("right"));
        let levels = CpuTier::available().len().min(2) as u64;
        // The ray is traced for all hits, with and without an observer, for the closest and for
        // any.
        assert_eq!((alone.rays, alone.trees, alone.packets), (4 * levels, 4 * levels, 0));
        // Sixteen rays as they are, over shorter intervals, and for any hit.
        assert_eq!((together.rays, together.packets), (48 * levels, 48 * levels));
        // Four have no tree.
        let [alone, _] = judged(&balls(4), &balls(4)).map(|result| result.expect("right"));
        assert_eq!((alone.rays, alone.trees), (4 * levels, 0));
    }

    #[test]
    fn what_a_tree_or_a_packet_loses_or_adds_is_found() {
        let whole = balls(9);
        for lost in [0, 4, 8] {
            let mut less = whole.clone();
            less.shapes[lost] = Shape::Sphere { center: [0.0, 100.0, 0.0], radius: 1.0 };
            let [alone, together] = judged(&less, &whole);
            assert!(alone.is_err(), "ball {lost} is lost");
            // Packets find only the closest.
            assert_eq!(together.is_err(), lost == 0, "ball {lost}: {together:?}");
            assert!(judged(&whole, &less)[0].is_err(), "ball {lost} is there");
        }
        // Only one lane is wrong: the sixth ray, which hits nothing else.
        let [mut less, mut more] = [whole.clone(), whole];
        less.shapes.push(Shape::Sphere { center: [12.0, -10.0, 0.0], radius: 0.5 });
        more.shapes.push(Shape::Sphere { center: [12.0, 10.0, 0.0], radius: 0.5 });
        let [alone, together] = judged(&less, &more);
        assert!(alone.is_ok());
        assert!(together.expect_err("a lane lacks a hit").contains("ray 5"));
    }

    #[test]
    fn instances_are_culled_and_flipped_as_their_flags_say() {
        // Wound so that a ray downwards sees the front: e1 x e2 = (0, 0, 1).
        let triangle = Shape::Triangle([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]]);
        let ray = Ray::new([0.0, 0.0, 1.0], [0.0, 0.0, -1.0]);
        let mut case = StressCase::new(vec![triangle], (ray, None));
        let below = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0]];
        case.others = vec![
            Placement { mask: 2, ..Placement::new(None, None) },
            Placement { flags: 2, ..Placement::new(Some(below), None) },
            Placement { flags: 1, ..Placement::new(Some(below), None) },
        ];
        let hits_of = |flags: u32| {
            let trace = TraceRay { flags: RayFlags(flags), ..case.trace() };
            let moment = Moment::new(&case, 0.0);
            let hits = moment.hits(&trace, Precision::Exact);
            let scene = TracedScene::new(&case, Precision::Exact).expect("regular").expect("legal");
            scene.check_alone(&moment, &trace, &mut Tally::default()).expect("the same");
            hits.iter().map(|hit| (hit.instance, hit.found.t, hit.found.surface)).collect::<Vec<_>>()
        };
        let (front, back) = (Surface::TriangleFront, Surface::TriangleBack);
        assert_eq!(hits_of(0), [(0, 1.0, front), (2, 2.0, back), (3, 2.0, front)]);
        // Back faces are culled; then front faces, except where that is disabled.
        assert_eq!(hits_of(16), [(0, 1.0, front), (3, 2.0, front)]);
        assert_eq!(hits_of(32), [(2, 2.0, back), (3, 2.0, front)]);
    }
}
