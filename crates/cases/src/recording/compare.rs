//! Compares recorded hits with those that the engine finds.
//!
//! A ray's hit is *missed* if only the recording has one, *extra* if only we do, and on *another
//! primitive* if both do but not on the same, unless both primitives are at the same correctly
//! rounded t: such a tie is counted separately. Rows that a reference itself cannot decide, by
//! their margin, are left out and counted, and so are rays at boxes that graze the sphere of the
//! box's shader.

use serde::Serialize;

use crate::recording::{Driver, RecordedPrimitives, Recording, Reference, TracedRay};
use anyhit_base::threads::map_on_threads;
use anyhit_engine::accel::{Committed, GeometryKind, HitKind, HitPrimitive, Primitive, RayFlags, TraceRay};
use anyhit_engine::math::ulp::{ulp_error, ulp_of};

/// Below this relative margin a reference of 113 bits does not decide (an exact 0 is a tangent).
const MIN_MARGIN: f64 = 1e-28;
/// Below this distance from a triangle's edge a reference of 64 bits does not decide.
const MIN_EDGE_MARGIN: f64 = 1e-15;
/// The number of rows that are described for each kind of comparison.
const EXAMPLES: usize = 5;

/// The results of the comparison of one recording.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// Rays of the recording.
    pub rays: usize,
    /// The kind of primitive of its geometries.
    pub geometry: Option<String>,
    /// Against `reference.*`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference: Option<AgainstReference>,
    /// Against `driver.*`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub driver: Option<AgainstDriver>,
    /// Tensors that would define part of the scene, but whose names are unknown.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub ignored_tensors: Vec<String>,
    /// Notes on geometry that was left out.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
}

/// The comparison of hit or miss, of primitives and of t.
#[derive(Clone, Debug, Default, Serialize)]
pub struct HitComparison {
    /// The number of rows compared.
    pub rows: usize,
    /// The number of rows left out.
    pub undecidable: usize,
    /// The number of rows in which the recording has a hit.
    pub hits: usize,
    /// The number of rows in which only the recording has a hit.
    pub missed: usize,
    /// The number of rows in which only the engine has a hit.
    pub extra: usize,
    /// The number of rows in which both have a hit, on different primitives at different t.
    pub other_primitive: usize,
    /// The number of rows in which both have a hit, on different primitives at the same correctly
    /// rounded t.
    pub ties: usize,
    /// |t - recorded t| in units in the last place of the recorded t, where the primitive is the
    /// same or a tie.
    pub t_ulp: Option<Distribution>,
    /// The first rows that are missed, extra or on another primitive.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub examples: Vec<String>,
}

/// How errors are distributed.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Distribution {
    /// The median.
    pub p50: f64,
    /// The 99th percentile.
    pub p99: f64,
    /// The 99.9th percentile.
    #[serde(rename = "p99.9")]
    pub p999: f64,
    /// The maximum.
    pub max: f64,
}

/// The comparison with `reference.*`.
#[derive(Clone, Debug, Serialize)]
pub struct AgainstReference {
    /// The comparison of the hits.
    #[serde(flatten)]
    pub hits: HitComparison,
    /// u of linear swept spheres, or barycentrics.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub attributes: Option<Attributes>,
}

/// How far attributes are from the reference's.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Attributes {
    /// The number of rows compared.
    pub rows: usize,
    /// The greatest absolute difference.
    pub max_difference: f64,
    /// Greatest |difference| of those that are more than one unit in the last place off.
    pub max_difference_beyond_an_ulp: f64,
    /// Linear swept spheres: a cap (u of exactly 0 or 1) against a side.
    pub cap_or_side: usize,
}

/// The comparison with `driver.*`; what was not recorded is absent.
#[derive(Clone, Debug, Serialize)]
pub struct AgainstDriver {
    /// The comparison of the hits.
    #[serde(flatten)]
    pub hits: HitComparison,
    /// Which of the closest-hit and miss shaders ran.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shaders_ran: Option<Agreement>,
    /// `HitKindKHR`, where a closest-hit shader saw it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hit_kind: Option<Agreement>,
    /// Whether the hit is a sphere, a linear swept sphere, or neither.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shape: Option<Agreement>,
    /// How often an any-hit shader that accepts ran: for boxes it depends on the driver's order.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub any_hit_count: Option<Agreement>,
    /// How often an any-hit shader that ignores ran.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub candidate_count: Option<Agreement>,
    /// `InstanceCustomIndexKHR`
    #[serde(skip_serializing_if = "Option::is_none")]
    pub instance_custom_index: Option<Agreement>,
    /// Barycentrics, u, or what an intersection shader reported (whose first number depends, for
    /// the recorded shader, on the driver's order).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub attributes: Option<Agreement>,
    /// Positions and radii of spheres and linear swept spheres, bit for bit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub positions_and_radii: Option<Agreement>,
    /// `ObjectRayOriginKHR` and `ObjectRayDirectionKHR`
    #[serde(skip_serializing_if = "Option::is_none")]
    pub object_ray: Option<Agreement>,
}

/// The number of rows in which a value differs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Agreement {
    /// The number of rows compared.
    pub rows: usize,
    /// Rows that differ at all.
    pub differ: usize,
    /// Greatest |difference|, for floats.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_difference: Option<f64>,
}

impl Recording {
    /// Traces every ray again and compares what it hits with what was recorded.
    pub fn compare(&self) -> Comparison {
        let traced: Vec<ComparedRay> =
            map_on_threads(self.rays.len(), |at| ComparedRay::of(self, at, self.rays[at]));
        Comparison {
            rays: self.rays.len(),
            geometry: self.kind().map(|kind| kind.to_string()),
            reference: self.reference.as_ref().map(|reference| compare_with_reference(reference, &traced)),
            driver: self.driver.as_ref().map(|driver| compare_with_driver(self, driver, &traced)),
            ignored_tensors: self.unknown_tensors.clone(),
            notes: self.notes.clone(),
        }
    }
}

/// A ray of the recording, and the engine's result.
struct ComparedRay {
    at: usize,
    ray: TraceRay,
    traced: TracedRay,
    candidates: Option<i64>,
    undecidable: bool,
}

impl ComparedRay {
    fn of(recording: &Recording, at: usize, ray: TraceRay) -> Self {
        let traced = recording.trace(ray);
        let by_margin = recording.reference.as_ref().is_some_and(|reference| reference.undecidable(at));
        let counted = recording.driver.as_ref().is_some_and(|driver| driver.candidate_count.is_some());
        let candidates = counted.then(|| recording.candidates(ray).len() as i64);
        let undecidable = by_margin || traced.nearly_tangent;
        Self { at, ray, traced, candidates, undecidable }
    }

    fn hit(&self) -> Option<&Committed> {
        self.traced.committed.as_ref()
    }

    fn skips_closest_hit(&self) -> bool {
        self.ray.flags.contains(RayFlags::SKIP_CLOSEST_HIT_SHADER)
    }
}

impl Reference {
    /// Whether the reference's own arithmetic could not decide whether this ray hits, or what.
    fn undecidable(&self, at: usize) -> bool {
        let near = |margins: &Option<Vec<f64>>, least: f64, tangent_decides: bool| {
            margins.as_ref().is_some_and(|all| {
                let margin = all[at].abs();
                margin < least && !(tangent_decides && margin == 0.0)
            })
        };
        // On a triangle's edge the reference hits both neighbours and we one of them, or on an
        // outline both or none.
        near(&self.margin, MIN_MARGIN, true) || near(&self.edge_margin, MIN_EDGE_MARGIN, false)
    }

    fn t(&self, at: usize) -> [f64; 2] {
        [self.t[at], self.t_low.as_ref().map_or(0.0, |low| low[at])]
    }
}

/// The hit of one ray, as far as it was recorded.
struct RecordedHit {
    hit: bool,
    /// t as the sum of a high and a low part, if it was recorded.
    t: Option<[f64; 2]>,
    primitive_ids: [Option<i64>; 3],
}

/// The relation of the engine's hit to the recorded one.
enum Relation {
    BothMiss,
    Missed,
    Extra,
    Other,
    /// Both hit the same primitive, or two at the same t. `ulp` is the error of the engine's t, if
    /// the recorded t is known.
    Same {
        tie: bool,
        ulp: Option<f64>,
        attributes: [f32; 2],
    },
}

impl RecordedPrimitives {
    fn at(&self, at: usize) -> [Option<i64>; 3] {
        [&self.instance, &self.geometry, &self.primitive].map(|all| all.as_ref().map(|all| all[at]))
    }
}

impl RecordedHit {
    fn relation(&self, traced: &TracedRay) -> Relation {
        let Some(closest) = &traced.committed else {
            return if self.hit { Relation::Missed } else { Relation::BothMiss };
        };
        if !self.hit {
            return Relation::Extra;
        }
        let ulp = self.t.map(|[high, low]| {
            let difference = (f64::from(closest.t) - high) - low;
            if difference == 0.0 { 0.0 } else { difference.abs() / ulp_of(high) }
        });
        if self.matches(closest.candidate.hit_primitive()) {
            return Relation::Same { tie: false, ulp, attributes: traced.attributes };
        }
        let recorded_primitive = traced
            .intersections
            .iter()
            .find(|(primitive, found)| self.matches(*primitive) && found.t == closest.t);
        let rounds_to_ours = self.t.is_some_and(|[high, low]| (high + low) as f32 == closest.t);
        match recorded_primitive {
            Some((_, found)) => Relation::Same { tie: true, ulp, attributes: found.attributes },
            None if rounds_to_ours => Relation::Same { tie: true, ulp, attributes: traced.attributes },
            None => Relation::Other,
        }
    }

    fn matches(&self, hit: HitPrimitive) -> bool {
        let ours = [hit.instance, hit.geometry, hit.primitive];
        self.primitive_ids
            .iter()
            .zip(ours)
            .all(|(theirs, ours)| theirs.is_none_or(|theirs| theirs == i64::from(ours)))
    }

    fn describe(&self, row: &ComparedRay, what: &str) -> String {
        let word = |part: Option<i64>| part.map_or_else(|| "?".to_owned(), |part| part.to_string());
        let [instance, geometry, primitive] = self.primitive_ids.map(word);
        let t = self.t.map_or_else(String::new, |[high, _]| format!(" at t {high:?}"));
        let theirs = match self.hit {
            true => format!("instance {instance}, geometry {geometry}, primitive {primitive}{t}"),
            false => "nothing".to_owned(),
        };
        let ours = row.hit().map_or_else(
            || "nothing".to_owned(),
            |hit| {
                let HitPrimitive { instance, geometry, primitive } = hit.candidate.hit_primitive();
                format!("instance {instance}, geometry {geometry}, primitive {primitive} at t {:?}", hit.t)
            },
        );
        format!("ray {}: {what}: recorded {theirs}; ours {ours}", row.at)
    }
}

/// Whether a recorded t is that of a hit: a miss has -1, or in some recordings infinity or NaN.
fn is_hit(t: f64) -> bool {
    t >= 0.0 && t.is_finite()
}

/// Compares the hits of all rays, and passes on each row whose hits agree.
fn compare_hits<'a>(
    rows: &'a [ComparedRay],
    recorded: impl Fn(usize) -> RecordedHit,
    mut agreed: impl FnMut(&'a ComparedRay, bool, [f32; 2]),
) -> HitComparison {
    let mut hits = HitComparison::default();
    let mut errors = Vec::new();
    for row in rows {
        if row.undecidable {
            hits.undecidable += 1;
            continue;
        }
        let recorded = recorded(row.at);
        hits.rows += 1;
        hits.hits += usize::from(recorded.hit);
        let mut wrong = |what: &str| {
            if hits.examples.len() < EXAMPLES {
                hits.examples.push(recorded.describe(row, what));
            }
        };
        match recorded.relation(&row.traced) {
            Relation::BothMiss => {}
            Relation::Missed => {
                wrong("missed");
                hits.missed += 1;
            }
            Relation::Extra => {
                wrong("extra");
                hits.extra += 1;
            }
            Relation::Other => {
                wrong("another primitive");
                hits.other_primitive += 1;
            }
            Relation::Same { tie, ulp, attributes } => {
                hits.ties += usize::from(tie);
                errors.extend(ulp);
                agreed(row, tie, attributes);
            }
        }
    }
    hits.t_ulp = Distribution::of(errors);
    hits
}

impl Distribution {
    /// The distribution of errors; a NaN counts as the greatest.
    fn of(mut errors: Vec<f64>) -> Option<Self> {
        errors.sort_by(f64::total_cmp);
        let max = *errors.last()?;
        // Nearest rank: the least value that this many in a thousand do not exceed.
        let rank = |thousandths: usize| errors[(errors.len() * thousandths).div_ceil(1000) - 1];
        Some(Self { p50: rank(500), p99: rank(990), p999: rank(999), max })
    }
}

fn compare_with_reference(reference: &Reference, rows: &[ComparedRay]) -> AgainstReference {
    let recorded = |at: usize| {
        let hit = is_hit(reference.t[at]);
        RecordedHit { hit, t: hit.then(|| reference.t(at)), primitive_ids: reference.primitives.at(at) }
    };
    let mut attributes = Attributes::default();
    let hits = compare_hits(rows, recorded, |row, _, ours| {
        let values: &[f64] = match (&reference.barycentrics, &reference.lss_hit_value) {
            (Some(all), _) => &all[row.at],
            (None, Some(all)) => {
                let ends = [0.0, 1.0];
                let (is_cap, should_be) = (ends.contains(&f64::from(ours[0])), ends.contains(&all[row.at]));
                attributes.cap_or_side += usize::from(is_cap != should_be);
                std::slice::from_ref(&all[row.at])
            }
            (None, None) => return,
        };
        attributes.rows += 1;
        for (&theirs, ours) in values.iter().zip(ours) {
            let difference = (f64::from(ours) - theirs).abs();
            attributes.max_difference = attributes.max_difference.max(difference);
            if ulp_error(ours, theirs) > 1.0 {
                attributes.max_difference_beyond_an_ulp =
                    attributes.max_difference_beyond_an_ulp.max(difference);
            }
        }
    });
    AgainstReference { hits, attributes: (attributes.rows > 0).then_some(attributes) }
}

fn compare_with_driver(recording: &Recording, driver: &Driver, rows: &[ComparedRay]) -> AgainstDriver {
    let recorded = |at: usize| {
        let hit = driver.miss_ran.as_ref().map_or(is_hit(driver.t[at]), |all| all[at] == 0);
        // If no closest-hit shader ran, nothing of the hit is known.
        let seen = hit && is_hit(driver.t[at]);
        let primitive_ids = if seen { driver.primitives.at(at) } else { [None; 3] };
        RecordedHit { hit, t: seen.then(|| [driver.t[at], 0.0]), primitive_ids }
    };
    let [mut attributes, mut positions, mut object_ray, mut custom_index] = [Agreement::default(); 4];
    let hits = compare_hits(rows, recorded, |row, tie, ours| {
        let (Some(hit), false) = (row.hit(), tie || !is_hit(driver.t[row.at])) else { return };
        if let Some(all) = &driver.instance_custom_index {
            let instance = &recording.tlas.instances()[hit.candidate.instance as usize];
            custom_index.add(i64::from(instance.custom_index) == all[row.at]);
        }
        if let Some(all) = &driver.attribute {
            // The second number of a report is t, which has its own comparison.
            let count = if hit.candidate.is_box() { 1 } else { 2 };
            attributes.add_floats(&ours[..count], &all[row.at][..count]);
        } else if let Some(all) = &driver.lss_hit_value {
            attributes.add_floats(&ours[..1], &all[row.at..][..1]);
        }
        if let Some(all) = &driver.position_radius
            && let Some(ours) = positions_and_radii(recording, hit)
        {
            positions.add_floats(&ours, &all[row.at]);
        }
        let ray = recording.tlas.object_ray(hit.candidate.instance, &row.ray.ray, 0.0);
        if let (Some(ray), [Some(origins), Some(directions)]) = (ray, &driver.object_ray) {
            let theirs = [origins[row.at], directions[row.at]].concat();
            object_ray.add_floats(&[ray.object_origin_f32(), ray.object_direction_f32()].concat(), &theirs);
        }
    });
    let decided = || rows.iter().filter(|row| !row.undecidable);
    AgainstDriver {
        hits,
        shaders_ran: shaders_ran(driver, decided()),
        hit_kind: driver.hit_kind.as_ref().and_then(|kinds| {
            let seen = |row: &&ComparedRay| is_hit(driver.t[row.at]) && row.hit().is_some();
            agreement(decided().filter(seen), |row| Some(i64::from(row.hit()?.hit_kind.0) == kinds[row.at]))
        }),
        shape: shape(driver, decided()),
        any_hit_count: driver
            .any_hit_count
            .as_ref()
            .and_then(|counts| agreement(decided(), |row| Some(row.traced.any_hits == counts[row.at]))),
        candidate_count: driver
            .candidate_count
            .as_ref()
            .and_then(|counts| agreement(decided(), |row| Some(row.candidates? == counts[row.at]))),
        instance_custom_index: custom_index.if_any(),
        attributes: attributes.if_any(),
        positions_and_radii: positions.if_any(),
        object_ray: object_ray.if_any(),
    }
}

/// Compares which shaders ran: closest-hit if something is hit, unless the ray's flags skip it;
/// otherwise miss.
fn shaders_ran<'a>(driver: &Driver, rows: impl Iterator<Item = &'a ComparedRay>) -> Option<Agreement> {
    agreement(rows, |row| {
        let hit = row.hit().is_some();
        let miss = driver.miss_ran.as_ref().map(|all| (all[row.at] != 0) != hit);
        let skips = row.skips_closest_hit();
        let closest = driver.closest_hit_ran.as_ref().map(|all| (all[row.at] != 0) == (hit && !skips));
        if miss.is_none() && closest.is_none() {
            return None;
        }
        Some(miss.unwrap_or(true) && closest.unwrap_or(true))
    })
}

fn shape<'a>(driver: &Driver, rows: impl Iterator<Item = &'a ComparedRay>) -> Option<Agreement> {
    agreement(rows, |row| {
        let hit = row.hit().filter(|_| is_hit(driver.t[row.at]))?;
        let agrees = |all: &Option<Vec<i64>>, kind: HitKind| {
            all.as_ref().map(|all| (all[row.at] == 1) == (hit.hit_kind == kind))
        };
        let swept = agrees(&driver.is_lss, HitKind::LINEAR_SWEPT_SPHERE);
        let sphere = agrees(&driver.is_sphere, HitKind::SPHERE);
        if swept.is_none() && sphere.is_none() {
            return None;
        }
        Some(swept.unwrap_or(true) && sphere.unwrap_or(true))
    })
}

/// Counts the rows that `agrees` compares: it returns `None` for the others.
fn agreement<'a>(
    rows: impl Iterator<Item = &'a ComparedRay>,
    agrees: impl Fn(&ComparedRay) -> Option<bool>,
) -> Option<Agreement> {
    let mut sum = Agreement::default();
    for row in rows {
        if let Some(agrees) = agrees(row) {
            sum.add(agrees);
        }
    }
    sum.if_any()
}

impl Agreement {
    fn add(&mut self, agrees: bool) {
        self.rows += 1;
        self.differ += usize::from(!agrees);
    }

    fn add_floats(&mut self, ours: &[f32], theirs: &[f64]) {
        let pairs = || ours.iter().zip(theirs).map(|(&ours, &theirs)| (f64::from(ours), theirs));
        self.add(pairs().all(|(ours, theirs)| ours == theirs) && ours.len() == theirs.len());
        let greatest = pairs().map(|(ours, theirs)| (ours - theirs).abs()).fold(0.0, f64::max);
        self.max_difference = Some(self.max_difference.unwrap_or(0.0).max(greatest));
    }

    fn if_any(self) -> Option<Self> {
        (self.rows > 0).then_some(self)
    }
}

/// The numbers of a sphere or linear swept sphere as the recorded shaders wrote them.
fn positions_and_radii(recording: &Recording, hit: &Committed) -> Option<Vec<f32>> {
    let HitPrimitive { instance, geometry, primitive } = hit.candidate.hit_primitive();
    let blas = &recording.tlas.instances()[instance as usize].blas;
    match blas.primitive(geometry, primitive, 0.0)? {
        Primitive::Sphere { position: [x, y, z], radius } => Some(vec![x, y, z, radius]),
        Primitive::LinearSweptSphere { positions: [a, b], radii, .. } => {
            Some(vec![a[0], a[1], a[2], radii[0], b[0], b[1], b[2], radii[1]])
        }
        Primitive::Triangle(_) | Primitive::Aabb(_) => None,
    }
}

impl Comparison {
    /// Whether t was computed by an intersection shader, in its own arithmetic.
    pub fn is_procedural(&self) -> bool {
        self.geometry.as_deref() == Some(GeometryKind::Aabbs.to_string().as_str())
    }
}
