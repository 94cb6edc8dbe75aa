//! Checks BVH traversal: a cursor and a packet must find what testing every primitive finds.
//!
//! Both run on the best instruction set of the CPU and on the baseline. A cursor has two code paths
//! through the same trees, and both are tested: an opaque ray commits the hit of the least key (t,
//! instance, geometry, primitive); a ray for which nothing is opaque gets all hits in the order of
//! that key, each once, with or without an observer. Packets are traced as in launches: all rays of
//! a case together, then over intervals that end at each ray's hit or one f32 next to it, and for
//! any hit at all. Where nothing is opaque the rays of a case come to all their hits together.

use std::sync::Arc;

use crate::case::{Shape, StressCase};
use crate::judge::case_at_time::{CaseAtTime, ExactHit};
use crate::judge::{Failure, Tally, fail};
use crate::reference::ObjectLine;
use anyhit_engine::accel::{
    Blas, Candidate, Cursor, HitKind, HitPrimitive, InstanceFlags, LookAhead, Packet, RayFlags, Tlas,
    TlasInstance, TraceRay, TraversalObserver,
};
use anyhit_engine::geometry::{Intersection, Precision, Ray, Surface};
use anyhit_engine::math::lane_ops::CpuTier;

const IDENTITY: [[f32; 4]; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

/// The acceleration structures in which a case's rays are traced.
pub(crate) struct TracedScene {
    /// The structures of the case: for the best instruction set of the CPU, and for the baseline if
    /// that differs.
    structures: Vec<(&'static str, Arc<Tlas>)>,
    precision: Precision,
    /// By shape: the indices of its geometry and of its primitive.
    geom_prims: Vec<(u32, u32)>,
    has_boxes: bool,
}

/// A hit as a cursor or a packet reports it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TraversalHit {
    pub hit_primitive: HitPrimitive,
    pub found: Intersection,
}

impl TracedScene {
    /// `None` if Vulkan does not allow the case: negative radii, boxes with min > max, motion keys
    /// without inverse.
    pub(crate) fn new(case: &StressCase, precision: Precision) -> Result<Option<Self>, Failure> {
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
        // Traversal is compiled for two kinds of SIMD vectors.
        let cpu_tiers = CpuTier::available().into_iter().take(2);
        let structures = cpu_tiers
            .map(|(name, cpu_tier)| Ok((name, Tlas::for_cpu_tier(instances.clone(), precision, cpu_tier)?)));
        let Ok(structures) = structures.collect::<anyhit_base::error::Result<Vec<_>>>() else {
            let has_inverse = |matrix: &[[f32; 4]; 3]| {
                let is_finite = matrix.as_flattened().iter().all(|x| x.is_finite());
                is_finite && ObjectLine::new(&case.ray(), Some(matrix)).is_some()
            };
            let may_refuse = placements.iter().any(|placement| {
                placement.motion.is_some() || !placement.transform.as_ref().is_none_or(has_inverse)
            });
            return if may_refuse { Ok(None) } else { fail("a regular matrix is rejected") };
        };
        let geom_prims = counts.iter().enumerate().flat_map(|(geometry, &count)| {
            (0..count).map(move |primitive| (geometry as u32, primitive as u32))
        });
        let has_boxes = matches!(case.shapes.first(), Some(Shape::Aabb(_)));
        Ok(Some(Self { structures, precision, geom_prims: geom_prims.collect(), has_boxes }))
    }

    /// Hits as they must be reported.
    fn reported(&self, hits: &[ExactHit]) -> Vec<TraversalHit> {
        let reported = |hit: &ExactHit| {
            let (geometry, primitive) = self.geom_prims[hit.shape];
            TraversalHit {
                hit_primitive: HitPrimitive { instance: hit.instance as u32, geometry, primitive },
                found: hit.found,
            }
        };
        hits.iter().map(reported).collect()
    }

    /// Checks the traversal of a single ray.
    pub(crate) fn check_single(
        &self,
        case_at_time: &CaseAtTime,
        trace: &TraceRay,
        tally: &mut Tally,
    ) -> Result<(), Failure> {
        let hits = case_at_time.hits(trace, self.precision);
        let Ray { t_min, t_max, .. } = trace.ray;
        if self.precision == Precision::Exact {
            case_at_time.check_tree(trace, self.precision, &hits)?;
        }
        let hits = self.reported(&hits);
        for (name, tlas) in &self.structures {
            check_cursor(tlas, trace, &hits, self.has_boxes, tally).map_err(|Failure(what)| {
                Failure(format!("traversal ({name}) over {t_min:e}..{t_max:e}: {what}"))
            })?;
        }
        Ok(())
    }

    /// Checks the traversal of rays in packets; each ray has the case at its time.
    pub(crate) fn check_packets(
        &self,
        rays: &[(TraceRay, &CaseAtTime)],
        tally: &mut Tally,
    ) -> Result<(), Failure> {
        if self.has_boxes || rays.is_empty() {
            return Ok(());
        }
        let traces: Vec<_> = rays.iter().map(|(trace, _)| *trace).collect();
        let precision = self.precision;
        let hits: Vec<_> =
            rays.iter().map(|(trace, case_at_time)| case_at_time.hits(trace, precision)).collect();
        let shortened = |(at, (trace, hits)): (usize, (&TraceRay, &Vec<ExactHit>))| {
            let t = hits.first()?.found.t;
            let [min, max] = [trace.ray.t_min, trace.ray.t_max];
            let (t_min, t_max) = [(min, t), (t, max), (min, t.next_down()), (t.next_up(), max)][at % 4];
            let shortened = TraceRay { ray: trace.ray.with_interval(t_min, t_max), ..*trace };
            shortened.check().is_ok().then_some(shortened)
        };
        let shortened: Vec<_> =
            traces.iter().zip(&hits).enumerate().map(|one| shortened(one).unwrap_or(*one.1.0)).collect();
        let cases_at_times = rays.iter().map(|(_, case_at_time)| *case_at_time);
        let hits_of_shortened: Vec<_> = shortened
            .iter()
            .zip(cases_at_times)
            .map(|(trace, case_at_time)| case_at_time.hits(trace, precision))
            .collect();
        let [hits, hits_of_shortened] = [hits, hits_of_shortened]
            .map(|all| all.iter().map(|hits| self.reported(hits)).collect::<Vec<_>>());
        let runs = [(&traces, &hits, false), (&shortened, &hits_of_shortened, false), (&traces, &hits, true)];
        for (name, tlas) in &self.structures {
            // All runs share one `Packet`, which traces single rays for a while when packets do not
            // pay off.
            let mut packet = Packet::default();
            for (traces, hits, any) in runs {
                check_packet(&mut packet, tlas, traces, hits, any, tally)
                    .map_err(|Failure(what)| Failure(format!("a packet ({name}){what}")))?;
            }
            for (traces, hits) in [(&traces, &hits), (&shortened, &hits_of_shortened)] {
                check_candidates(tlas, traces, hits, tally)
                    .map_err(|Failure(what)| Failure(format!("rays traced together ({name}){what}")))?;
            }
        }
        Ok(())
    }
}

/// Checks the traversal of a single ray, given all its hits in order: all of them where nothing is
/// opaque, and the closest and any where everything is, unless shaders decide about boxes.
pub(crate) fn check_cursor(
    tlas: &Tlas,
    trace: &TraceRay,
    hits: &[TraversalHit],
    has_boxes: bool,
    tally: &mut Tally,
) -> Result<(), Failure> {
    let flags = RayFlags(trace.flags.0 & !RayFlags::OPAQUE.0 | RayFlags::NO_OPAQUE.0);
    let all = TraceRay { flags, ..*trace };
    let mut nodes = BlasNodeObserver(false);
    let mut count = |nodes: &BlasNodeObserver| {
        tally.rays += 1;
        tally.hits += u64::from(!hits.is_empty());
        tally.trees += u64::from(nodes.0);
    };
    for is_observed in [true, false] {
        let mut cursor = Cursor::new(tlas, all);
        let mut expected = hits.iter();
        while let Some(candidate) =
            if is_observed { cursor.proceed_observed(tlas, &mut nodes) } else { cursor.proceed(tlas) }
        {
            let (reported, expected) = (reported(&candidate), expected.next());
            if expected != Some(&reported) {
                return fail(format!("{reported:?} is reported, not {expected:?}"));
            }
        }
        if let Some(hit) = expected.next() {
            return fail(format!("{hit:?} is not reported"));
        }
        count(&nodes);
    }
    if has_boxes {
        return Ok(());
    }

    for any in [false, true] {
        let mut cursor = Cursor::new(tlas, *trace);
        if any {
            cursor.end_at_any_opaque_hit();
        }
        if let Some(candidate) = cursor.proceed(tlas) {
            return fail(format!("{:?} is reported, but opaque", reported(&candidate)));
        }
        let committed = cursor.committed().map(|hit| (reported(&hit.candidate), hit.t, hit.hit_kind));
        check_committed(hits, committed, any).or_else(fail)?;
        count(&nodes);
    }
    Ok(())
}

/// Checks the traversal of opaque rays in a packet, given all hits of each.
pub(crate) fn check_packet(
    packet: &mut Packet,
    tlas: &Tlas,
    traces: &[TraceRay],
    hits: &[Vec<TraversalHit>],
    any: bool,
    tally: &mut Tally,
) -> Result<(), Failure> {
    let mut found = Vec::new();
    if !packet.trace(tlas, traces, any, &mut found) || found.len() != traces.len() {
        return fail(format!(" of {} rays: {} results", traces.len(), found.len()));
    }
    for (lane, (found, hits)) in found.iter().zip(hits).enumerate() {
        let committed = found.map(|hit| (reported(&hit.candidate), hit.t, hit.hit_kind));
        check_committed(hits, committed, any).or_else(|what| {
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

/// Checks the candidates that rays of which nothing is opaque come to together, given all hits of
/// each.
pub(crate) fn check_candidates(
    tlas: &Arc<Tlas>,
    traces: &[TraceRay],
    hits: &[Vec<TraversalHit>],
    tally: &mut Tally,
) -> Result<(), Failure> {
    let begin = |trace: &TraceRay| {
        let flags = RayFlags(trace.flags.0 & !RayFlags::OPAQUE.0 | RayFlags::NO_OPAQUE.0);
        Cursor::new(tlas, TraceRay { flags, ..*trace })
    };
    let mut cursors: Vec<_> = traces.iter().map(begin).collect();
    let mut expected: Vec<_> = hits.iter().map(|hits| hits.iter()).collect();
    let mut look_ahead = LookAhead::default();
    let mut running: Vec<_> = (0..traces.len()).collect();
    while !running.is_empty() {
        if look_ahead.begin(tlas, running.len()) {
            running.iter().for_each(|&at| look_ahead.add(at as u32, &cursors[at], tlas));
            look_ahead.find(|at, hit| cursors[at as usize].take_next_hit(hit));
        }
        for at in std::mem::take(&mut running) {
            let found = cursors[at].proceed(tlas).as_ref().map(reported);
            let expected = expected[at].next();
            if found.as_ref() != expected {
                let Ray { t_min, t_max, .. } = traces[at].ray;
                return fail(format!(
                    ", ray {at} over {t_min:e}..{t_max:e}: {found:?} is reported, not {expected:?}"
                ));
            }
            running.extend(found.map(|_| at));
        }
    }
    tally.rays += traces.len() as u64;
    tally.hits += hits.iter().filter(|hits| !hits.is_empty()).count() as u64;
    Ok(())
}

/// Checks the committed hit: the closest one or, with `any`, any of the hits.
fn check_committed(
    hits: &[TraversalHit],
    committed: Option<(TraversalHit, f32, HitKind)>,
    any: bool,
) -> Result<(), String> {
    let allowed = if any { hits } else { &hits[..hits.len().min(1)] };
    let is_right = match &committed {
        None => hits.is_empty(),
        Some((reported, t, kind)) => {
            *t == reported.found.t && *kind == hit_kind(reported.found.surface) && allowed.contains(reported)
        }
    };
    if is_right {
        return Ok(());
    }
    let expected = hits.first();
    Err(format!("{committed:?} is committed, not {expected:?}"))
}
fn reported(candidate: &Candidate) -> TraversalHit {
    TraversalHit { hit_primitive: candidate.hit_primitive(), found: candidate.intersection }
}

/// The expected hit kind: SEMANTICS 4.2 for triangles, values of this crate for the others.
fn hit_kind(surface: Surface) -> HitKind {
    match surface {
        Surface::TriangleFront => HitKind(0xFE),
        Surface::TriangleBack => HitKind(0xFF),
        Surface::Sphere => HitKind::SPHERE,
        Surface::Aabb | Surface::Side | Surface::Cap0 | Surface::Cap1 => HitKind::LINEAR_SWEPT_SPHERE,
    }
}

/// Observes whether nodes of a BLAS are visited.
struct BlasNodeObserver(bool);

impl TraversalObserver for BlasNodeObserver {
    fn node(&mut self, instance: Option<u32>) {
        self.0 |= instance.is_some();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::case::{Neighbour, Placement};

    /// Balls of radius 1 along the x axis, four apart, in a BVH, and a ray through the first
    /// `count` of them.
    fn balls(count: usize) -> StressCase {
        let ball = |k: usize| Shape::Sphere { center: [4.0 * k as f32, 0.0, 0.0], radius: 1.0 };
        let ray = Ray::new([-4.0, 0.0, 0.0], [1.0, 0.0, 0.0]);
        let mut case = StressCase::new((0..count).map(ball).collect(), ray.into());
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
    fn check_against(traced: &StressCase, known: &StressCase) -> [Result<Tally, String>; 2] {
        let scene = TracedScene::new(traced, Precision::Exact).expect("regular").expect("legal");
        let case_at_time = CaseAtTime::new(known, 0.0);
        let mut tallies = [Tally::default(); 2];
        let single = scene.check_single(&case_at_time, &known.trace(), &mut tallies[0]);
        let neighbours = known.neighbours.iter().map(|neighbour| (neighbour.trace(), &case_at_time));
        let packets = scene.check_packets(&neighbours.collect::<Vec<_>>(), &mut tallies[1]);
        let [first, second] = tallies;
        [
            single.map(|()| first).map_err(|what| what.to_string()),
            packets.map(|()| second).map_err(|what| what.to_string()),
        ]
    }

    #[test]
    fn rays_through_trees_and_packets_are_counted() {
        let [single, packets] = check_against(&balls(9), &balls(9)).map(|result| result.expect("right"));
        let cpu_tiers = CpuTier::available().len().min(2) as u64;
        // The ray is traced for all hits, with and without an observer, for the closest and for
        // any.
        assert_eq!((single.rays, single.trees, single.packets), (4 * cpu_tiers, 4 * cpu_tiers, 0));
        // Sixteen rays as they are, over shorter intervals, and for any hit; then the candidates of
        // both intervals.
        assert_eq!((packets.rays, packets.packets), (80 * cpu_tiers, 48 * cpu_tiers));
        // Four have no tree.
        let [single, _] = check_against(&balls(4), &balls(4)).map(|result| result.expect("right"));
        assert_eq!((single.rays, single.trees), (4 * cpu_tiers, 0));
    }

    #[test]
    fn what_a_tree_or_a_packet_loses_or_adds_is_found() {
        let whole = balls(9);
        for missing in [0, 4, 8] {
            let mut fewer = whole.clone();
            fewer.shapes[missing] = Shape::Sphere { center: [0.0, 100.0, 0.0], radius: 1.0 };
            let [single, packets] = check_against(&fewer, &whole);
            assert!(single.is_err() && packets.is_err(), "ball {missing} is lost");
            assert!(check_against(&whole, &fewer)[0].is_err(), "ball {missing} is there");
        }
        // Only one lane is wrong: the sixth ray, which hits nothing else.
        let [mut fewer, mut more] = [whole.clone(), whole];
        fewer.shapes.push(Shape::Sphere { center: [12.0, -10.0, 0.0], radius: 0.5 });
        more.shapes.push(Shape::Sphere { center: [12.0, 10.0, 0.0], radius: 0.5 });
        let [single, packets] = check_against(&fewer, &more);
        assert!(single.is_ok());
        assert!(packets.expect_err("a lane lacks a hit").contains("ray 5"));
    }

    #[test]
    fn instances_are_culled_and_flipped_as_their_flags_say() {
        // Wound so that a ray downwards sees the front: e1 x e2 = (0, 0, 1).
        let triangle = Shape::Triangle([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]]);
        let ray = Ray::new([0.0, 0.0, 1.0], [0.0, 0.0, -1.0]);
        let mut case = StressCase::new(vec![triangle], ray.into());
        let below = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0]];
        case.others = vec![
            Placement { mask: 2, ..Placement::new(None, None) },
            Placement { flags: 2, ..Placement::new(Some(below), None) },
            Placement { flags: 1, ..Placement::new(Some(below), None) },
        ];
        let hits_of = |flags: u32| {
            let trace = TraceRay { flags: RayFlags(flags), ..case.trace() };
            let case_at_time = CaseAtTime::new(&case, 0.0);
            let hits = case_at_time.hits(&trace, Precision::Exact);
            let scene = TracedScene::new(&case, Precision::Exact).expect("regular").expect("legal");
            scene.check_single(&case_at_time, &trace, &mut Tally::default()).expect("the same");
            hits.iter().map(|hit| (hit.instance, hit.found.t, hit.found.surface)).collect::<Vec<_>>()
        };
        let (front, back) = (Surface::TriangleFront, Surface::TriangleBack);
        assert_eq!(hits_of(0), [(0, 1.0, front), (2, 2.0, back), (3, 2.0, front)]);
        // Back faces are culled; then front faces, except where that is disabled.
        assert_eq!(hits_of(16), [(0, 1.0, front), (3, 2.0, front)]);
        assert_eq!(hits_of(32), [(2, 2.0, back), (3, 2.0, front)]);
    }
}
