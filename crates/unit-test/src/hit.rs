//! A hit made by hand: one instance, one ray, really intersected.

use std::sync::Arc;

use crate::instance::Instance;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_engine::accel::{Committed, Cursor, GeometryData, HitKind, RayFlags, Tlas, TraceRay};
use anyhit_engine::geometry::Ray;
use anyhit_engine::machine;
use anyhit_engine::ops::ray_rules;

/// A primitive and the ray that hits it, from which every builtin of a hit shader follows.
///
/// ```
/// use anyhit::{Hit, Instance, Ray};
///
/// // A cone-like segment from (0, 0, 0) to (0, 1, 0), met from the front.
/// let hit = Hit::lss([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [0.5, 0.25])
///     .ray(Ray::new([0.0, 0.5, 4.0], [0.0, 0.0, -1.0]));
///
/// // That hit as one of an instance with a transform and an index.
/// let instance = Instance::lss([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [0.5, 0.25])
///     .translate([0.0, 0.0, -2.0])
///     .custom_index(7);
/// let hit = Hit::of(instance).ray(Ray::new([0.0, 0.5, 4.0], [0.0, 0.0, -1.0]));
/// ```
#[derive(Clone, Debug, PartialEq)]
#[must_use]
pub struct Hit {
    /// What the ray hits.
    #[doc(hidden)]
    pub instance: Instance,
    /// The ray, in world space.
    #[doc(hidden)]
    pub ray: Option<Ray>,
    /// `IncomingRayFlagsKHR`
    #[doc(hidden)]
    pub ray_flags: RayFlags,
    /// `CullMaskKHR`
    #[doc(hidden)]
    pub cull_mask: u32,
    /// `CurrentRayTimeNV`
    #[doc(hidden)]
    pub time: f32,
}

/// What a [`Hit`] comes to.
pub(super) struct Resolved {
    pub hit: machine::TlasHit,
    pub trace: TraceRay,
    /// `RayTmaxKHR`
    pub t: f32,
}

impl Hit {
    /// A hit of a linear swept sphere with both end caps: centres and radii of its ends.
    #[must_use]
    pub fn lss(positions: [[f32; 3]; 2], radii: [f32; 2]) -> Self {
        Self::of(Instance::lss(positions, radii))
    }

    /// A hit of a sphere.
    #[must_use]
    pub fn sphere(position: [f32; 3], radius: f32) -> Self {
        Self::of(Instance::sphere(position, radius))
    }

    /// A hit of a triangle.
    #[must_use]
    pub fn triangle(vertices: [[f32; 3]; 3]) -> Self {
        Self::of(Instance::triangle(vertices))
    }

    /// A box for an intersection shader: minimum and maximum.
    #[must_use]
    pub fn aabb(minimum: [f32; 3], maximum: [f32; 3]) -> Self {
        Self::of(Instance::aabb(minimum, maximum))
    }

    /// A hit of an instance, with its transform, index, flags and however many geometries: of what
    /// the ray meets first.
    #[must_use]
    pub fn of(instance: impl Into<Instance>) -> Self {
        Self { instance: instance.into(), ray: None, ray_flags: RayFlags(0), cull_mask: 0xFF, time: 0.0 }
    }

    /// The ray that hits it, in world space.
    #[must_use]
    pub fn ray(self, ray: Ray) -> Self {
        Self { ray: Some(ray), ..self }
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

    /// `CurrentRayTimeNV`, from 0 to 1: where an instance that moves is hit. 0 unless set.
    #[must_use]
    pub fn time(self, time: f32) -> Self {
        Self { time, ..self }
    }

    /// Traces the ray at the instance alone.
    ///
    /// # Errors
    /// `InvalidScene` for numbers that no geometry may have, `InvalidArgument` without a ray,
    /// for one that breaks a rule or has unknown flags, and where it misses.
    pub(super) fn resolve(self) -> Result<Resolved> {
        let wrong = |message: String| Error::new(ErrorKind::InvalidArgument, message);
        let Some(ray) = self.ray else {
            return Err(wrong(
                "a hit needs its ray: `Hit::sphere(...).ray(Ray::new(origin, direction))`".into(),
            ));
        };
        let what = self.instance.describe();
        let tlas = Tlas::new(vec![self.instance.make()?])?;
        let trace = TraceRay { ray, flags: self.ray_flags, cull_mask: self.cull_mask, time: self.time };
        trace.flags.check_known().map_err(|message| {
            wrong(message)
                .note("combine the constants of `RayFlags`: `RayFlags::OPAQUE | RayFlags::SKIP_AABBS`")
        })?;
        trace
            .check()
            .map_err(|rule| wrong(format!("invalid ray: {}", ray_rules::describe_of_trace(rule))))?;
        match first_hit(&tlas, trace) {
            Some(Committed { candidate, t, hit_kind: kind }) => {
                Ok(Resolved { hit: machine::TlasHit { tlas, candidate, kind }, trace, t })
            }
            None => Err(wrong(format!("the ray misses the primitive: {ray:?}"))
                .note(what)
                .note("spheres and linear swept spheres are not hit from inside, and flags can cull a hit")
                .note(
                    "to test values that no ray produces, set builtins by name: \
                    `.builtin(\"RayTmaxKHR\", 2.0)`",
                )),
        }
    }
}

impl From<GeometryData> for Instance {
    fn from(data: GeometryData) -> Self {
        Self::of(data)
    }
}

/// The hit that a ray finds first. Of a box, it is its entry, seen at the ray's own t_max.
pub fn first_hit(tlas: &Arc<Tlas>, trace: TraceRay) -> Option<Committed> {
    let mut cursor = Cursor::new(tlas, trace);
    while let Some(candidate) = cursor.proceed(tlas) {
        if candidate.is_box() {
            return Some(Committed { candidate, t: trace.ray.t_max, hit_kind: HitKind(0) });
        }
        cursor.confirm();
    }
    cursor.committed().copied()
}
