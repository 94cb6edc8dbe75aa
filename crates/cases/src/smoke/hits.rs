//! What rays meet: one hit of each kind of geometry, and a small scene with all of them.

use std::sync::{Arc, OnceLock};

use crate::smoke::sets::Set;
use anyhit_base::error::Result;
use anyhit_engine::accel::{EndCaps, GeometryData, HitKind, Indexing, RayFlags, Tlas, TraceRay};
use anyhit_engine::geometry::Ray;
use anyhit_engine::machine;
use anyhit_engine::ops::pointer::storage;
use anyhit_engine::program::Program;
use anyhit_unit_test::hit::first_hit;
use anyhit_unit_test::scene::{Instance, Scene};

/// A kind of geometry that a hit shader can be called for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SmokeGeometry {
    /// A triangle.
    Triangle,
    /// A box, whose intersection shader reported a hit.
    Aabb,
    /// A sphere.
    Sphere,
    /// A linear swept sphere.
    Lss,
}

impl SmokeGeometry {
    /// The kinds that a closest-hit or any-hit shader may be called for, as far as what it declares
    /// tells: hit attributes of other than two floats are those of an intersection shader, and a
    /// builtin that only one kind has means that kind.
    pub(super) fn of_program(program: &Program) -> Vec<Self> {
        if program.interface_registers(storage::HIT_ATTRIBUTE).is_some_and(|registers| registers.count != 2) {
            return vec![Self::Aabb];
        }
        let reads =
            |name: &str| program.inputs.iter().any(|registers| registers.builtin.name.starts_with(name));
        let telling = [
            (Self::Triangle, reads("HitTriangle")),
            (Self::Sphere, reads("HitSphere") || reads("HitIsSphere")),
            (Self::Lss, reads("HitLSS") || reads("HitIsLSS")),
        ];
        let told: Vec<_> = telling.into_iter().filter(|(_, read)| *read).map(|(kind, _)| kind).collect();
        if told.is_empty() { vec![Self::Triangle, Self::Aabb, Self::Sphere, Self::Lss] } else { told }
    }

    /// Its name in reports.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Triangle => "triangle",
            Self::Aabb => "aabb",
            Self::Sphere => "sphere",
            Self::Lss => "lss",
        }
    }

    /// So many primitives, of which a ray meets the last one if it is to meet any.
    fn primitives(self, count: usize, is_met: bool) -> Instance {
        // The others lie far away, side by side.
        let aside = |at: usize| if is_met && at + 1 == count { 0.0 } else { FAR_AWAY + 4.0 * at as f32 };
        let moved = |at: usize, [x, y, z]: [f32; 3]| [x + aside(at), y, z];
        match self {
            Self::Triangle => {
                let corners = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]];
                let all = (0..count).flat_map(|at| corners.map(|corner| moved(at, corner)));
                Instance::triangles(all.collect::<Vec<_>>())
            }
            Self::Aabb => Instance::aabbs((0..count).map(|at| [moved(at, [-1.0; 3]), moved(at, [1.0; 3])])),
            Self::Sphere => Instance::spheres((0..count).map(|at| (moved(at, [0.0; 3]), 1.0))),
            Self::Lss => Instance::of(GeometryData::LinearSweptSpheres {
                positions: (0..count)
                    .flat_map(|at| [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]].map(|end| moved(at, end)))
                    .collect(),
                radii: [1.0, 0.75].repeat(count),
                indices: None,
                indexing: Indexing::List,
                end_caps: EndCaps::Chained,
            }),
        }
    }

    /// A structure of which a ray meets one primitive at a place; all are of cluster 0.
    fn structure(self, place: &HitPlace) -> Result<Arc<Tlas>> {
        let HitPlace { instance, geometry, primitive, custom_index, .. } = *place;
        let aside = |at: u32| [FAR_AWAY + 4.0 * at as f32, FAR_AWAY, 0.0];
        let others = (0..instance).map(|at| self.primitives(1, true).translate(aside(at)));
        // The other geometries of the instance have a primitive each, far away.
        let mut geometries = (0..geometry).map(|_| self.primitives(1, false));
        let last = self.primitives(primitive as usize + 1, true);
        let met = match geometries.next() {
            Some(first) => geometries.fold(first, Instance::and).and(last),
            None => last,
        };
        let all = others.chain([met.custom_index(custom_index)]);
        Ok(Scene::new(all.map(|instance| instance.cluster_id(0)))?.tlas().clone())
    }

    /// A hit: what, by which ray, at which t. From behind, a triangle shows its back.
    ///
    /// # Errors
    /// None: the geometry is known.
    pub(super) fn hit(self, behind: bool, place: &HitPlace) -> Result<(machine::TlasHit, TraceRay, f32)> {
        let tlas = self.structure(place)?;
        let trace =
            TraceRay { ray: ray(behind), flags: place.ray_flags, cull_mask: place.cull_mask, time: 0.0 };
        let committed = first_hit(&tlas, trace).expect("bug in anyhit: a ray of the smoke tests misses");
        // What the box's intersection shader would have reported: its entry.
        let (kind, t) = match self {
            Self::Aabb => (place.hit_kind, 2.0),
            _ => (committed.hit_kind, committed.t),
        };
        Ok((machine::TlasHit { tlas, candidate: committed.candidate, kind }, trace, t))
    }
}

/// Where what a ray does not meet lies.
const FAR_AWAY: f32 = 1e4;
/// `LaunchIdKHR` and what else the host says of a hit come from this root of numbers.
const ROOT: u64 = 0x4849_5400_0000;

/// What a hit is numbered with, and the ray that found it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct HitPlace {
    /// `InstanceId`
    instance: u32,
    /// `RayGeometryIndexKHR`
    geometry: u32,
    /// `PrimitiveId`
    primitive: u32,
    /// `InstanceCustomIndexKHR`
    custom_index: u32,
    /// `HitKindKHR` of a box: what its intersection shader reported.
    hit_kind: HitKind,
    /// `IncomingRayFlagsKHR`
    pub ray_flags: RayFlags,
    /// `CullMaskKHR`
    pub cull_mask: u32,
    /// `LaunchIdKHR`
    pub launch_id: [u32; 3],
}

impl HitPlace {
    /// The first of everything.
    const FIRST: Self = Self {
        instance: 0,
        geometry: 0,
        primitive: 0,
        custom_index: 0,
        hit_kind: HitKind(0),
        ray_flags: RayFlags(0),
        cull_mask: 0xFF,
        launch_id: [0; 3],
    };

    /// That of a set of values, in a launch of a size.
    pub(super) fn of(set: &Set, launch_size: [u32; 3]) -> Self {
        if !set.varies_hits {
            return Self::FIRST;
        }
        // At most what integers of memory are.
        let number = |at: u64, most: u64| set.numbers.integer(ROOT, at).min(most) as u32;
        let inside = |axis: usize| number(axis as u64, u64::MAX) % launch_size[axis].max(1);
        // Flags that no hit shader's own existence denies, each as likely as not.
        let flags = [RayFlags::NO_OPAQUE, RayFlags::TERMINATE_ON_FIRST_HIT];
        let flags = flags.iter().enumerate().filter(|(at, _)| number(8 + *at as u64, 3) & 1 == 1);
        Self {
            instance: number(3, 3),
            geometry: number(4, 3),
            primitive: number(5, 1000),
            custom_index: number(6, 1000),
            hit_kind: HitKind(number(7, 0x7F)),
            ray_flags: RayFlags(flags.fold(0, |all, (_, flag)| all | flag.0)),
            cull_mask: if number(10, 3) & 1 == 1 { 1 } else { 0xFF },
            launch_id: [0, 1, 2].map(inside),
        }
    }
}

/// A ray that meets each of the hits.
pub(super) fn ray(behind: bool) -> Ray {
    let side = if behind { -1.0 } else { 1.0 };
    Ray::new([0.25, 0.5, 3.0 * side], [0.0, 0.0, -side])
}

/// A structure with a box at a place, for intersection shaders.
///
/// # Errors
/// None: the geometry is known.
pub(super) fn one_box(place: &HitPlace) -> Result<Arc<Tlas>> {
    SmokeGeometry::Aabb.structure(place)
}

/// A structure with every kind of primitive, or with one alone, which shaders trace: walls in front
/// of and behind the origin, a floor, and a box, a sphere and a linear swept sphere beside it. All
/// are of cluster 0.
///
/// # Errors
/// None: the geometry is known.
pub(super) fn scene(only: Option<SmokeGeometry>) -> Result<Arc<Tlas>> {
    static SCENES: [OnceLock<Arc<Tlas>>; 5] = [const { OnceLock::new() }; 5];
    let all = || {
        let wall = |z: f32| {
            let corners = [[-8.0, -8.0, z], [8.0, -8.0, z], [8.0, 8.0, z], [-8.0, 8.0, z]];
            [0, 1, 2, 0, 2, 3].map(|at: usize| corners[at])
        };
        let floor = [[-8.0, -2.0, -8.0], [8.0, -2.0, -8.0], [0.0, -2.0, 8.0]];
        let instances = [
            (SmokeGeometry::Triangle, Instance::triangles(wall(4.0))),
            (
                SmokeGeometry::Triangle,
                Instance::triangles([wall(-4.0).as_slice(), floor.as_slice()].concat()).custom_index(1),
            ),
            (SmokeGeometry::Aabb, Instance::aabbs([[[-4.0, -1.0, -1.0], [-2.0, 1.0, 1.0]]]).custom_index(2)),
            (SmokeGeometry::Sphere, Instance::sphere([3.0, 0.0, 0.0], 1.0).custom_index(3)),
            (SmokeGeometry::Lss, Instance::lss([[-1.0, 3.0, 0.0], [1.0, 3.0, 0.0]], [1.0, 0.5]).opaque()),
        ];
        let wanted = instances.into_iter().filter(|(kind, _)| only.is_none_or(|only| only == *kind));
        wanted.map(|(_, instance)| instance).collect()
    };
    cached(&SCENES[only.map_or(0, |kind| kind as usize + 1)], all)
}

/// What is always the same is built once.
fn cached(kept: &OnceLock<Arc<Tlas>>, instances: impl FnOnce() -> Vec<Instance>) -> Result<Arc<Tlas>> {
    if let Some(tlas) = kept.get() {
        return Ok(tlas.clone());
    }
    let instances = instances().into_iter().map(|instance| instance.cluster_id(0));
    let tlas = Scene::new(instances)?.tlas().clone();
    Ok(kept.get_or_init(|| tlas).clone())
}
