//! What rays meet: one hit of each kind of geometry, and a small scene with all of them.

use std::sync::{Arc, OnceLock};

use crate::accel::{Tlas, TraceRay};
use crate::error::Result;
use crate::geometry::Ray;
use crate::harness::hit::Hit;
use crate::harness::scene::{Instance, Scene};
use crate::machine;
use crate::ops::pointer::storage;
use crate::program::Program;

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

    /// A hit: what, by which ray, at which t. From behind, a triangle shows its back.
    ///
    /// # Errors
    /// None: the geometry is known.
    pub(super) fn hit(self, behind: bool) -> Result<(machine::TlasHit, TraceRay, f32)> {
        let instance = match self {
            Self::Triangle => Instance::triangle([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]]),
            Self::Aabb => Instance::aabb([-1.0; 3], [1.0; 3]),
            Self::Sphere => Instance::sphere([0.0; 3], 1.0),
            Self::Lss => Instance::lss([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [1.0, 0.75]),
        };
        let resolved = Hit::of(instance.cluster_id(0)).ray(ray(behind)).resolve()?;
        // What the box's intersection shader would have reported: its entry.
        let t = if self == Self::Aabb { 2.0 } else { resolved.t };
        Ok((resolved.hit, resolved.trace, t))
    }
}

/// A ray that meets each of the hits.
pub(super) fn ray(behind: bool) -> Ray {
    let side = if behind { -1.0 } else { 1.0 };
    Ray::new([0.25, 0.5, 3.0 * side], [0.0, 0.0, -side])
}

/// A structure with one box, for intersection shaders.
///
/// # Errors
/// None: the geometry is known.
pub(super) fn one_box() -> Result<Arc<Tlas>> {
    static BOX: OnceLock<Arc<Tlas>> = OnceLock::new();
    cached(&BOX, || vec![Instance::aabbs([[[-1.0; 3], [1.0; 3]]])])
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
