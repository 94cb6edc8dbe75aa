//! The input and the result of every intersector.

use bytemuck::{Pod, Zeroable};

use crate::math::f32x4::F32x4;

/// A ray as a shader passes it to a trace: world space, direction not normalised, t in units of
/// the direction's length.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
#[must_use]
pub struct Ray {
    /// Where t is 0.
    pub origin: [f32; 3],
    /// The displacement per unit of t, of any length. With one of 0 the ray [goes
    /// nowhere](Self::goes_nowhere).
    pub direction: [f32; 3],
    /// The lower end of the interval.
    pub t_min: f32,
    /// The upper end of the interval.
    pub t_max: f32,
}

impl Ray {
    /// The least nonzero magnitude of the components of a [well-scaled](Self::is_well_scaled) ray:
    /// 2^-60.
    pub const MIN_MAGNITUDE: f32 = 1.0 / (1u64 << 60) as f32;
    /// The greatest magnitude of the components of a [well-scaled](Self::is_well_scaled) ray: 2^60.
    pub const MAX_MAGNITUDE: f32 = (1u64 << 60) as f32;

    /// A ray over the whole half-line: `t_min` 0, `t_max` infinity.
    #[must_use]
    pub fn new(origin: [f32; 3], direction: [f32; 3]) -> Self {
        Self { origin, direction, t_min: 0.0, t_max: f32::INFINITY }
    }

    /// Whether origin and direction are finite, and the interval holds no NaN.
    #[inline(always)]
    #[must_use]
    pub fn is_finite(&self) -> bool {
        // Zero times what is not finite is a NaN, and no sum of zeros is.
        let zero = |v: [f32; 3]| v[0] * 0.0 + v[1] * 0.0 + v[2] * 0.0;
        zero(self.origin) + zero(self.direction) == 0.0 && !self.t_min.is_nan() && !self.t_max.is_nan()
    }

    /// Whether each component of origin and direction is 0 or of a magnitude from 2^-60 to 2^60,
    /// the direction is not 0, and the interval holds no NaN.
    #[inline(always)]
    #[must_use]
    pub fn is_well_scaled(&self) -> bool {
        let zero = F32x4::splat(0.0);
        let [ox, oy, oz] = self.origin;
        let [dx, dy, dz] = self.direction;
        let origin = F32x4::new([ox, oy, oz, 0.0]).abs();
        let direction = F32x4::new([dx, dy, dz, 0.0]).abs();
        let within = |magnitudes: F32x4| {
            let some = magnitudes.cmp_ge(F32x4::splat(Self::MIN_MAGNITUDE)) | zero.cmp_ge(magnitudes);
            some & F32x4::splat(Self::MAX_MAGNITUDE).cmp_ge(magnitudes)
        };
        within(origin) & within(direction) == 0b1111
            && zero.cmp_ge(direction) != 0b1111
            && !(self.t_min.is_nan() || self.t_max.is_nan())
    }

    /// Whether the direction is zero: the ray is its origin alone, for every t. It meets no
    /// triangle, sphere or swept sphere, and a box that holds its origin is a candidate.
    /// In the object space of an instance its direction is zero as well, and that of no other ray
    /// is, since the transform has an inverse.
    #[inline]
    #[must_use]
    pub fn goes_nowhere(&self) -> bool {
        let [x, y, z] = self.direction;
        x == 0.0 && y == 0.0 && z == 0.0
    }

    /// Replaces the interval.
    #[must_use]
    pub fn with_interval(self, t_min: f32, t_max: f32) -> Self {
        Self { t_min, t_max, ..self }
    }
}

/// Which surface of a primitive a ray entered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Surface {
    /// A triangle seen from its front (as wound in object space, before instance flags).
    TriangleFront,
    /// A triangle seen from its back.
    TriangleBack,
    /// A box's entry (or a start inside it).
    Aabb,
    /// The surface of a sphere.
    Sphere,
    /// The side of a linear swept sphere.
    Side,
    /// The cap around the first point of a linear swept sphere.
    Cap0,
    /// The cap around the second point of a linear swept sphere.
    Cap1,
}

/// Where a ray meets a primitive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intersection {
    /// The correctly rounded ray parameter.
    pub t: f32,
    /// Triangles: the barycentrics of the second and third vertex. Linear swept spheres: u of the
    /// generating sphere, then 0. Spheres and boxes: 0, 0.
    pub attributes: [f32; 2],
    /// Which surface was entered.
    pub surface: Surface,
}
