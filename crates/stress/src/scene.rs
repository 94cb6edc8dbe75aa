//! Judges the traversal of a user's acceleration structures: `anyhit stress SCENE`.
//!
//! Too many primitives for testing all of them with each ray, so that the BVH of another builder
//! (`ObvhsTree`) says which are tested: one for each BLAS, while every instance is entered. Rays
//! are aimed at primitives, their vertices and edges among them, from afar, from beside and from
//! other primitives, singly and in packets. A ray must find the closest hit, any hit and, where
//! nothing is opaque, all hits in their order.

use std::fmt;
use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::case::Shape;
use crate::draw::Draw;
use crate::judge::primitive::{bounds, intersect};
use crate::judge::traversal::{TraversalHit, check_candidates, check_cursor, check_packet};
use crate::judge::{Failure, Tally};
use crate::obvhs_tree::ObvhsTree;
use crate::{MAX_FAILURES, StressSettings};
use anyhit_base::sorted::sort_by;
use anyhit_base::threads::map_on_threads;
use anyhit_engine::accel::rules::{apply_flip_facing, is_culled_by_face};
use anyhit_engine::accel::{
    Blas, Geometry, GeometryKind, HitPrimitive, InstanceFlags, Packet, Primitive, RayFlags, Tlas,
    TlasInstance, TraceRay, micromap,
};
use anyhit_engine::geometry::{Bounds, Intersection, ObjectRay, Precision, Ray};

/// The number of rays that are drawn together: one packet.
const BUNDLE: usize = 32;

/// The number of bundles that run between two checks of the limits.
const ROUND: u64 = 64;

/// A ray that found something else in a structure than the judge.
#[derive(Clone, Debug)]
pub struct SceneFailure {
    /// The name of the structure.
    pub structure: String,
    /// The ray.
    pub trace: TraceRay,
    /// What it found.
    pub failure: Failure,
}

impl fmt::Display for SceneFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { structure, trace, failure } = self;
        let Ray { origin: [x, y, z], direction: [u, v, w], t_min, t_max } = trace.ray;
        let (flags, time) = (trace.flags.0, trace.time);
        write!(
            f,
            "acceleration structure `{structure}`: {failure}\n--ray \"{x:?},{y:?},{z:?} {u:?},{v:?},{w:?}\" \
             --t-min {t_min:?} --t-max {t_max:?} --flags {flags} --time {time:?}"
        )
    }
}

/// The results of a run over a scene.
#[derive(Clone, Debug)]
pub struct SceneReport {
    /// The counts of all rays. There are no others in `lines` than those that were drawn.
    pub tally: Tally,
    /// The first failures.
    pub failures: Vec<SceneFailure>,
    /// The time that the run has taken.
    pub time: Duration,
}

/// Draws rays in structures with their names until the settings or ten failures end it; `progress`
/// is called from time to time. Rays are the same on every machine. Structures without primitives
/// get no rays.
pub fn run(
    structures: &[(String, Arc<Tlas>)],
    settings: &StressSettings,
    mut progress: impl FnMut(&SceneReport),
) -> SceneReport {
    let start = Instant::now();
    let mut judges: Vec<TlasJudge> =
        structures.iter().map(|(name, tlas)| TlasJudge::new(name, tlas, settings.precision)).collect();
    judges.retain(|judge| !judge.targets.is_empty());
    let mut report = SceneReport { tally: Tally::default(), failures: Vec::new(), time: Duration::ZERO };
    let mut next = 0;
    while !judges.is_empty() {
        let results: Vec<(Tally, Vec<SceneFailure>)> = map_on_threads(ROUND as usize, |at| {
            let number = next + at as u64;
            let judge = &judges[(number % judges.len() as u64) as usize];
            let seed = settings.seed.wrapping_mul(0xD134_2543_DE82_EF95).wrapping_add(number);
            judge.check_bundle(&mut Draw::new(seed))
        });
        next += ROUND;
        for (tally, failures) in results {
            report.tally = report.tally.plus(&tally);
            report.failures.extend(failures);
        }
        report.failures.truncate(MAX_FAILURES);
        report.time = start.elapsed();
        progress(&report);
        let over = settings.rays.is_some_and(|rays| report.tally.rays >= rays)
            || settings.time.is_some_and(|time| report.time >= time)
            || report.failures.len() >= MAX_FAILURES;
        if over {
            break;
        }
    }
    report
}

/// The tree of another builder over the primitives of a BLAS.
struct BlasJudge {
    blas: Arc<Blas>,
    tree: ObvhsTree,
    /// By number in the tree: the indices of geometry and primitive.
    geom_prims: Vec<(u32, u32)>,
}

impl BlasJudge {
    fn new(blas: &Arc<Blas>) -> Self {
        let geometries = blas.geometries().iter().zip(0..);
        let geom_prims: Vec<(u32, u32)> = geometries
            .flat_map(|(geometry, at)| {
                (0..geometry.data.primitive_count() as u32).map(move |primitive| (at, primitive))
            })
            .collect();
        let around = |&(geometry, primitive): &(u32, u32)| {
            let geometry = &blas.geometries()[geometry as usize];
            let [first, second] = [0.0, 1.0].map(|time| shape(geometry, primitive, time));
            match (first, second) {
                // The interpolated vertices lie between those of both keys.
                (Shape::Triangle(first), Shape::Triangle(second)) if first != second => {
                    bounds(&Shape::MovingTriangle([first, second]))
                }
                _ => bounds(&first),
            }
        };
        let tree = ObvhsTree::new(geom_prims.iter().map(around));
        Self { blas: blas.clone(), tree, geom_prims }
    }
}

/// A primitive at a time.
fn shape(geometry: &Geometry, primitive: u32, time: f32) -> Shape {
    match geometry.primitive_at(primitive, time) {
        Primitive::Triangle(vertices) => Shape::Triangle(vertices),
        Primitive::Aabb([a, b, c, d, e, f]) => Shape::Aabb([[a, b, c], [d, e, f]]),
        Primitive::Sphere { position: center, radius } => Shape::Sphere { center, radius },
        Primitive::LinearSweptSphere { positions, radii, caps } => {
            Shape::LinearSweptSphere { positions, radii, caps }
        }
    }
}

/// The judge of one structure.
struct TlasJudge<'a> {
    name: &'a str,
    tlas: Arc<Tlas>,
    blases: Vec<BlasJudge>,
    /// For each instance the index of its BLAS.
    blas_of: Vec<usize>,
    /// The instances that have primitives.
    targets: Vec<usize>,
    /// The box around all of them at time 0, if it is finite.
    around: Bounds,
    has_boxes: bool,
}

impl<'a> TlasJudge<'a> {
    fn new(name: &'a str, tlas: &Arc<Tlas>, precision: Precision) -> Self {
        let tlas = tlas.at_precision(precision);
        let mut blases: Vec<BlasJudge> = Vec::new();
        let mut index = |instance: &TlasInstance| {
            let known = blases.iter().position(|known| Arc::ptr_eq(&known.blas, &instance.blas));
            known.unwrap_or_else(|| {
                blases.push(BlasJudge::new(&instance.blas));
                blases.len() - 1
            })
        };
        let blas_of: Vec<usize> = tlas.instances().iter().map(&mut index).collect();
        let targets: Vec<usize> =
            (0..blas_of.len()).filter(|&at| !blases[blas_of[at]].geom_prims.is_empty()).collect();
        let bounds = |&at: &usize| {
            let instance = &tlas.instances()[at];
            instance.blas.bounds().transformed(&instance.object_to_world(0.0))
        };
        let around = targets.iter().map(bounds).fold(Bounds::EMPTY, |all, one| all.union(&one));
        let is_finite = around.min.iter().chain(&around.max).all(|x| x.is_finite());
        let around = if is_finite { around } else { Bounds { min: [-1.0; 3], max: [1.0; 3] } };
        let has_boxes = blases.iter().any(|one| one.blas.kind() == Some(GeometryKind::Aabbs));
        Self { name, tlas, blases, blas_of, targets, around, has_boxes }
    }

    /// Checks a bundle of rays; returns the counts, and the failures with their rays.
    fn check_bundle(&self, draw: &mut Draw) -> (Tally, Vec<SceneFailure>) {
        let mut tally = Tally::default();
        let mut failures = Vec::new();
        let traces = self.draw_bundle(draw);
        tally.lines = traces.len() as u64;
        let hits: Vec<Vec<TraversalHit>> = traces.iter().map(|trace| self.hits(trace)).collect();
        let told = |trace: &TraceRay, failure| SceneFailure {
            structure: self.name.to_owned(),
            trace: *trace,
            failure,
        };
        for (trace, hits) in traces.iter().zip(&hits) {
            if let Err(failure) = check_cursor(&self.tlas, trace, hits, self.has_boxes, &mut tally) {
                failures.push(told(trace, failure));
            }
        }
        let together = traces.iter().all(|trace| self.tlas.is_fully_opaque(trace.flags));
        if together && let Some(first) = traces.first() {
            let mut packet = Packet::default();
            for any in [false, true] {
                let found = check_packet(&mut packet, &self.tlas, &traces, &hits, any, &mut tally);
                if let Err(Failure(what)) = found {
                    failures.push(told(first, Failure(format!("a packet{what}"))));
                }
            }
            if let Err(Failure(what)) = check_candidates(&self.tlas, &traces, &hits, &mut tally) {
                failures.push(told(first, Failure(format!("rays traced together{what}"))));
            }
        }
        (tally, failures)
    }

    /// All hits of a ray in the order of (t, instance, geometry, primitive).
    fn hits(&self, trace: &TraceRay) -> Vec<TraversalHit> {
        let mut hits = Vec::new();
        for (at, instance) in self.tlas.instances().iter().enumerate() {
            let is_masked = u32::from(instance.mask) & trace.cull_mask == 0;
            let ray = self.tlas.object_ray(at as u32, &trace.ray, trace.time);
            if let Some(ray) = ray.filter(|_| !is_masked) {
                self.hits_of_instance(at as u32, instance, &ray, trace, &mut hits);
            }
        }
        let key = |hit: &TraversalHit| {
            let HitPrimitive { instance, geometry, primitive } = hit.hit_primitive;
            (instance, geometry, primitive)
        };
        sort_by(&mut hits, |a, b| a.found.t.total_cmp(&b.found.t).then_with(|| key(a).cmp(&key(b))));
        hits
    }

    fn hits_of_instance(
        &self,
        number: u32,
        instance: &TlasInstance,
        ray: &ObjectRay,
        trace: &TraceRay,
        hits: &mut Vec<TraversalHit>,
    ) {
        let blas = &self.blases[self.blas_of[number as usize]];
        blas.tree.visit(ray, &mut |at| {
            let (geometry, primitive) = blas.geom_prims[at];
            let data = &instance.blas.geometries()[geometry as usize];
            let found = intersect(&shape(data, primitive, trace.time), ray, self.tlas.precision());
            if let Some(found) = found.filter(|found| is_there(data, primitive, instance, found, trace)) {
                let found =
                    Intersection { surface: apply_flip_facing(found.surface, instance.flags), ..found };
                hits.push(TraversalHit {
                    hit_primitive: HitPrimitive { instance: number, geometry, primitive },
                    found,
                });
            }
        });
    }

    /// A bundle of rays that mostly share an origin and are aimed at places near each other.
    fn draw_bundle(&self, draw: &mut Draw) -> Vec<TraceRay> {
        let time = match self.tlas.moves() {
            true => [0.0, 1.0, 0.5 + 0.5 * draw.unit()][draw.below(3)],
            false => 0.0,
        };
        let Bounds { min, max } = self.around;
        let size = (0..3).map(|axis| max[axis] - min[axis]).fold(f32::MIN_POSITIVE, f32::max);
        let target = self.draw_point(draw, time);
        let apart = size * 2f32.powi(-(draw.below(24) as i32));
        let origin = match draw.below(4) {
            0 => self.draw_point(draw, time),
            1 => moved(target, draw.direction(), apart),
            _ => moved([0, 1, 2].map(|axis| 0.5 * (min[axis] + max[axis])), draw.anywhere(2.0), size),
        };
        let is_parallel = draw.one_in(6);
        // Packets of rays that have little in common are traced ray by ray.
        let is_coherent = draw.one_in(2);
        let culls = if draw.one_in(4) { RayFlags::CULL_BACK_FACING_TRIANGLES.0 } else { 0 };
        let flags = RayFlags(culls | RayFlags::OPAQUE.0);
        let mut traces = Vec::new();
        for at in 0..BUNDLE {
            let near = draw.anywhere(1.0);
            let aim = match at {
                0 => target,
                _ if !is_coherent && draw.one_in(8) => self.draw_point(draw, time),
                _ => moved(target, near, apart),
            };
            let origin = if is_parallel { moved(origin, near, apart) } else { origin };
            let mut direction = [0, 1, 2].map(|axis| aim[axis] - origin[axis]);
            if !is_coherent && draw.one_in(8) {
                // Along an axis, towards the target on it.
                let axis = draw.below(3);
                direction = [0, 1, 2].map(|other| if other == axis { direction[axis] } else { 0.0 });
            }
            if direction == [0.0; 3] {
                direction = draw.direction();
            }
            // The target lies at t = 1.
            let (t_min, t_max) =
                [(0.0, f32::INFINITY), (0.0, f32::INFINITY), (0.0, 1.0), (1.0, 2.0)][draw.below(4)];
            let ray = Ray::new(origin, direction).with_interval(t_min, t_max);
            let trace = TraceRay { ray, flags, cull_mask: 0xFF, time };
            if trace.check().is_ok() {
                traces.push(trace);
            }
        }
        traces
    }

    /// A point on or near a primitive, in world space.
    fn draw_point(&self, draw: &mut Draw, time: f32) -> [f32; 3] {
        let instance = self.targets[draw.below(self.targets.len())];
        let BlasJudge { blas, geom_prims, .. } = &self.blases[self.blas_of[instance]];
        let (geometry, primitive) = geom_prims[draw.below(geom_prims.len())];
        let between = |a: [f32; 3], b: [f32; 3], share: f32| [0, 1, 2].map(|k| a[k] + share * (b[k] - a[k]));
        // A vertex, the middle of an edge, or in between.
        let share = [0.0, 0.5, 0.5 + 0.5 * draw.unit()][draw.below(3)];
        let point = match shape(&blas.geometries()[geometry as usize], primitive, time) {
            Shape::Triangle([a, b, c]) | Shape::MovingTriangle([[a, b, c], _]) => {
                let [a, b, c] = [[a, b, c], [b, c, a], [c, a, b]][draw.below(3)];
                between(between(a, b, share), c, if draw.one_in(2) { 0.0 } else { 0.5 * share })
            }
            Shape::Aabb([min, max]) => between(min, max, share),
            Shape::Sphere { center, radius } => moved(center, draw.direction(), radius),
            Shape::LinearSweptSphere { positions: [p, q], radii: [r, s], .. } => {
                moved(between(p, q, share), draw.direction(), r + share * (s - r))
            }
        };
        let matrix = self.tlas.instances()[instance].object_to_world(time);
        matrix.map(|[x, y, z, w]| x * point[0] + y * point[1] + z * point[2] + w)
    }
}

/// Whether a hit is one: not on a side that the ray culls, and not where a micromap is transparent.
fn is_there(
    geometry: &Geometry,
    primitive: u32,
    instance: &TlasInstance,
    found: &Intersection,
    trace: &TraceRay,
) -> bool {
    let surface = apply_flip_facing(found.surface, instance.flags);
    if is_culled_by_face(trace.flags, instance.flags, surface) {
        return false;
    }
    match &geometry.opacity_micromap {
        Some(map) if !instance.flags.contains(InstanceFlags::DISABLE_OPACITY_MICROMAPS) => {
            let two_state = micromap::is_two_state(trace.flags, instance.flags);
            map.opacity(primitive, found.attributes).is_opaque(two_state).is_some()
        }
        _ => true,
    }
}

/// A point plus a multiple of a vector.
fn moved(point: [f32; 3], by: [f32; 3], times: f32) -> [f32; 3] {
    [0, 1, 2].map(|axis| point[axis] + times * by[axis])
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhit::demo;
    use anyhit_engine::accel::{GeometryData, GeometryFlags};
    use anyhit_scene::LoadOptions;

    fn settings(rays: u64) -> StressSettings {
        StressSettings { seed: 1, rays: Some(rays), time: None, precision: Precision::Exact }
    }

    /// A sheet of triangles over a grid, with hills.
    fn sheet() -> Vec<Geometry> {
        let height = |x: u32, y: u32| ((x * x + 3 * y * y) % 7) as f32 * 0.25;
        let vertices =
            (0..81u32).map(|at| (at % 9, at / 9)).map(|(x, y)| [x as f32, y as f32, height(x, y)]).collect();
        let cells = (0..64u32).map(|at| at / 8 * 9 + at % 8);
        let indices = cells.flat_map(|a| [a, a + 1, a + 9, a + 1, a + 10, a + 9]).collect();
        let data = GeometryData::Triangles { vertices, indices: Some(indices), transform: None };
        vec![Geometry::new(data, GeometryFlags::OPAQUE)]
    }

    fn placed(blas: Arc<Blas>) -> Vec<(String, Arc<Tlas>)> {
        // Beside and upon each other, one of them turned about.
        let places = [
            [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
            [[0.0, -0.5, 0.0, 3.0], [0.5, 0.0, 0.0, 0.1], [0.0, 0.25, 1.0, -2.0]],
        ];
        let instances = places.map(|place| TlasInstance::of(blas.clone(), place)).to_vec();
        vec![("sheets".to_owned(), Tlas::new(instances).expect("valid instances"))]
    }

    #[test]
    fn the_judge_agrees_with_trees_and_packets() {
        let sheets = placed(Blas::new(sheet()).expect("a sheet"));
        let demo = demo::scene(&LoadOptions::default()).expect("the demo").tlas;
        for structures in [sheets, demo] {
            let report = run(&structures, &settings(20_000), |_| ());
            assert!(report.failures.is_empty(), "{}", report.failures[0]);
            let Tally { rays, hits, trees, packets, .. } = report.tally;
            assert!(hits > rays / 4 && trees > rays / 4 && packets > 0, "{:?}", report.tally);
        }
    }

    #[test]
    fn a_box_that_is_too_small_is_found() {
        for slot in 0..2 {
            let blas = Blas::with_small_box(sheet(), slot).expect("a sheet");
            let report = run(&placed(blas), &settings(20_000), |_| ());
            assert_eq!(report.failures.len(), MAX_FAILURES, "slot {slot}");
            let text = report.failures[0].to_string();
            assert!(text.contains("`sheets`") && text.contains("--ray \""), "{text}");
        }
    }

    #[test]
    fn a_broken_judge_is_found_too() {
        let structures = placed(Blas::new(sheet()).expect("a sheet"));
        let (name, tlas) = &structures[0];
        let failures = |judge: &TlasJudge| -> usize {
            (0..20).map(|seed| judge.check_bundle(&mut Draw::new(seed)).1.len()).sum()
        };
        let mut judge = TlasJudge::new(name, tlas, Precision::Exact);
        assert_eq!(failures(&judge), 0);
        judge.blases[0].tree.shrink_box();
        assert!(failures(&judge) > 0);
    }
}
