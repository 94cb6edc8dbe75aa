//! A hit made by hand: one primitive, one ray, really intersected.

use std::sync::Arc;

use crate::accel::{
    Blas, Candidate, Cursor, EndCaps, Geometry, GeometryData, GeometryFlags, HitKind, Indexing, Instance,
    InstanceFlags, RayFlags, Tlas, TraceRay,
};
use crate::error::{Error, ErrorKind, Result};
use crate::geometry::Ray;
use crate::machine;

/// A primitive and the ray that hits it, from which every builtin of a hit shader follows.
///
/// ```
/// use anyhit::{Hit, Ray};
///
/// // A cone-like segment from (0, 0, 0) to (0, 1, 0), met from the front.
/// let hit = Hit::lss([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [0.5, 0.25])
///     .ray(Ray::new([0.0, 0.5, 4.0], [0.0, 0.0, -1.0]));
/// ```
#[derive(Clone, Debug)]
pub struct Hit {
    geometry: GeometryData,
    transform: [[f32; 4]; 3],
    custom_index: u32,
    flags: InstanceFlags,
    ray: Option<Ray>,
    ray_flags: RayFlags,
    cull_mask: u32,
}

/// What a [`Hit`] comes to.
pub(super) struct Resolved {
    pub hit: machine::Hit,
    pub trace: TraceRay,
    /// `RayTmaxKHR`
    pub t: f32,
}

impl Hit {
    /// A hit of a linear swept sphere with both end caps: centres and radii of its ends.
    pub fn lss(positions: [[f32; 3]; 2], radii: [f32; 2]) -> Self {
        Self::of(GeometryData::LinearSweptSpheres {
            positions: positions.to_vec(),
            radii: radii.to_vec(),
            indices: None,
            indexing: Indexing::List,
            end_caps: EndCaps::Chained,
        })
    }

    /// A hit of a sphere.
    pub fn sphere(position: [f32; 3], radius: f32) -> Self {
        Self::of(GeometryData::Spheres { positions: vec![position], radii: vec![radius], indices: None })
    }

    /// A hit of a triangle.
    pub fn triangle(vertices: [[f32; 3]; 3]) -> Self {
        Self::of(GeometryData::Triangles { vertices: vertices.to_vec(), indices: None, transform: None })
    }

    /// A box for an intersection shader: minimum and maximum.
    pub fn aabb(minimum: [f32; 3], maximum: [f32; 3]) -> Self {
        let [a, b, c] = minimum;
        let [d, e, f] = maximum;
        Self::of(GeometryData::Aabbs(vec![[a, b, c, d, e, f]]))
    }

    /// A hit of the first primitive of any geometry.
    pub fn of(geometry: GeometryData) -> Self {
        Self {
            geometry,
            transform: [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
            custom_index: 0,
            flags: InstanceFlags::default(),
            ray: None,
            ray_flags: RayFlags(0),
            cull_mask: 0xFF,
        }
    }

    /// The ray that hits it, in world space.
    #[must_use]
    pub fn ray(self, ray: Ray) -> Self {
        Self { ray: Some(ray), ..self }
    }

    /// The instance's transform: object to world, row-major 3x4 (`VkTransformMatrixKHR`).
    #[must_use]
    pub fn transform(self, transform: [[f32; 4]; 3]) -> Self {
        Self { transform, ..self }
    }

    /// `InstanceCustomIndexKHR`
    #[must_use]
    pub fn custom_index(self, custom_index: u32) -> Self {
        Self { custom_index, ..self }
    }

    /// The instance's flags.
    #[must_use]
    pub fn instance_flags(self, flags: InstanceFlags) -> Self {
        Self { flags, ..self }
    }

    /// `IncomingRayFlagsKHR`
    #[must_use]
    pub fn ray_flags(self, ray_flags: RayFlags) -> Self {
        Self { ray_flags, ..self }
    }

    /// `CullMaskKHR`
    #[must_use]
    pub fn cull_mask(self, cull_mask: u32) -> Self {
        Self { cull_mask, ..self }
    }

    /// Traces the ray at the primitive alone.
    ///
    /// # Errors
    /// `InvalidScene` for numbers that no geometry may have, `InvalidArgument` without a ray and
    /// where the ray misses.
    pub(super) fn resolve(self) -> Result<Resolved> {
        let wrong = |message: String| Error::new(ErrorKind::InvalidArgument, message);
        let Some(ray) = self.ray else {
            return Err(wrong(
                "a hit needs its ray: `Hit::sphere(...).ray(Ray::new(origin, direction))`".into(),
            ));
        };
        let what = format!("{:?}", self.geometry);
        let blas = Blas::new(vec![Geometry { data: self.geometry, flags: GeometryFlags::default() }])?;
        let instance = Instance {
            blas,
            transform: self.transform,
            custom_index: self.custom_index,
            mask: 0xFF,
            sbt_record_offset: 0,
            flags: self.flags,
        };
        let tlas = Tlas::new(vec![instance])?;
        let trace = TraceRay { ray, flags: self.ray_flags, cull_mask: self.cull_mask };
        match nearest(&tlas, trace) {
            Some((candidate, kind, t)) => {
                Ok(Resolved { hit: machine::Hit { tlas, candidate, kind }, trace, t })
            }
            None => Err(wrong(format!("the ray misses the primitive: {ray:?}"))
                .note(what)
                .note("spheres and linear swept spheres have no hit from inside, and flags may cull a hit")
                .note("to give a shader what no ray sees, set builtins by name: `.builtin(\"RayTmaxKHR\", 2.0)`")),
        }
    }
}

/// The hit that a ray finds first; for a box its entry, seen at the ray's own t_max.
fn nearest(tlas: &Arc<Tlas>, trace: TraceRay) -> Option<(Candidate, HitKind, f32)> {
    let mut cursor = Cursor::new(tlas, trace);
    while let Some(candidate) = cursor.proceed(tlas) {
        if candidate.is_box() {
            return Some((candidate, HitKind(0), trace.ray.t_max));
        }
        cursor.confirm();
    }
    cursor.committed().map(|committed| (committed.candidate, committed.hit_kind, committed.t))
}
