//! What rays meet: one hit of each kind of geometry, and a small scene with all of them.

use std::sync::Arc;

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
pub enum Kind {
    /// A triangle.
    Triangle,
    /// A box, whose intersection shader reported a hit.
    Aabb,
    /// A sphere.
    Sphere,
    /// A linear swept sphere.
    Lss,
}

impl Kind {
    /// The kinds that a closest-hit or any-hit shader may be called for, as far as what it declares
    /// tells: hit attributes of other than two floats are those of an intersection shader, and a
    /// builtin that only one kind has means that kind.
    pub fn of_program(program: &Program) -> Vec<Self> {
        if program.interface_rows(storage::HIT_ATTRIBUTE).is_some_and(|rows| rows.count != 2) {
            return vec![Self::Aabb];
        }
        let reads = |name: &str| program.inputs.iter().any(|rows| rows.builtin.name.starts_with(name));
        let telling = [
            (Self::Triangle, reads("HitTriangle")),
            (Self::Sphere, reads("HitSphere") || reads("HitIsSphere")),
            (Self::Lss, reads("HitLSS") || reads("HitIsLSS")),
        ];
        let told: Vec<_> = telling.into_iter().filter(|(_, read)| *read).map(|(kind, _)| kind).collect();
        if told.is_empty() { vec![Self::Triangle, Self::Aabb, Self::Sphere, Self::Lss] } else { told }
    }

    /// Its name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Triangle => "triangle",
            Self::Aabb => "aabb",
            Self::Sphere => "sphere",
            Self::Lss => "lss",
        }
    }

    /// A hit: what, by which ray, at which t.
    ///
    /// # Errors
    /// None: the geometry is known.
    pub fn hit(self) -> Result<(machine::Hit, TraceRay, f32)> {
        let hit = match self {
            Self::Triangle => Hit::triangle([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]]),
            Self::Aabb => Hit::aabb([-1.0; 3], [1.0; 3]),
            Self::Sphere => Hit::sphere([0.0; 3], 1.0),
            Self::Lss => Hit::lss([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [1.0, 0.75]),
        };
        let resolved = hit.ray(ray()).resolve()?;
        // What the box's intersection shader would have reported: its entry.
        let t = if self == Self::Aabb { 2.0 } else { resolved.t };
        Ok((resolved.hit, resolved.trace, t))
    }
}

/// A ray that meets each of the hits.
pub fn ray() -> Ray {
    Ray::new([0.25, 0.5, 3.0], [0.0, 0.0, -1.0])
}

/// A structure with one box, for intersection shaders.
///
/// # Errors
/// None: the geometry is known.
pub fn one_box() -> Result<Arc<Tlas>> {
    Ok(Scene::new([Instance::aabbs([[[-1.0; 3], [1.0; 3]]])])?.tlas().clone())
}

/// A structure with every kind of primitive, which shaders trace: walls in front of and behind the
/// origin, a floor, and a box, a sphere and a linear swept sphere beside it.
///
/// # Errors
/// None: the geometry is known.
pub fn scene() -> Result<Arc<Tlas>> {
    let wall = |z: f32| {
        let corners = [[-8.0, -8.0, z], [8.0, -8.0, z], [8.0, 8.0, z], [-8.0, 8.0, z]];
        [0, 1, 2, 0, 2, 3].map(|at: usize| corners[at])
    };
    let floor = [[-8.0, -2.0, -8.0], [8.0, -2.0, -8.0], [0.0, -2.0, 8.0]];
    let scene = Scene::new([
        Instance::triangles(wall(4.0)),
        Instance::triangles([wall(-4.0).as_slice(), floor.as_slice()].concat()).custom_index(1),
        Instance::aabbs([[[-4.0, -1.0, -1.0], [-2.0, 1.0, 1.0]]]).custom_index(2),
        Instance::sphere([3.0, 0.0, 0.0], 1.0).custom_index(3),
        Instance::lss([[-1.0, 3.0, 0.0], [1.0, 3.0, 0.0]], [1.0, 0.5]).opaque(),
    ])?;
    Ok(scene.tlas().clone())
}
