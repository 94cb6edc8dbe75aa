//! The exact unit normal of the surface that a ray hits, correctly rounded.
//!
//! # Derivation
//! The normal is the gradient of the implicit surface, and points out of a solid; that of a
//! triangle points to the side from which the ray comes. So its product with the ray's direction is
//! never positive.
//!
//! * **Triangle**: n = (V1 - V0) x (V2 - V0), or its negative where n.d > 0.
//! * **Sphere**, F(x) = |x - C|^2 - r^2: grad F = 2 (x - C).
//! * **Cap** of a linear swept sphere: as its sphere.
//! * **Side** of a linear swept sphere, with D = P1 - P0, δ = r1 - r0, g = D.D - δ^2, w = x - P0
//!   and a = w.D + r0 δ ([derivation](linear_swept_sphere)):
//!
//!   ```text
//!   F(x) = w.w - r0^2 - a^2 / g        grad F / 2 = w - (a / g) D = x - (P0 + u D)
//!   ```
//!
//!   with u = a / g, the hit attribute: the vector from the centre of the sphere of the sweep that
//!   touches the surface at x. It leans by the cone's slope, n.D / |n| |D| = -δ / |D|, where the
//!   projection of x on the axis gives a vector across it.
//!
//! **In world space** x_w = A x + b, so that F(A^-1 (x_w - b)) has the gradient A^-T grad F. With
//! det A < 0 it still points against the ray, as (A^-T n).(A d) = n.d.
//!
//! **At the hit** x = o + t d, and n = base + t slope with exact vectors base and slope. All that
//! is hit has t = (p + q sqrt(r)) / h, so that a component of n is P + Q sqrt(r), times 1 / |h|.
//! Its square divided by |n|^2 is, with A + B sqrt(r) = (P + Q sqrt(r))^2 and
//! C + E sqrt(r) = |n|^2,
//!
//! ```text
//! (A + B sqrt(r)) / (C + E sqrt(r)) = ((A C - B E r) + (B C - A E) sqrt(r)) / (C^2 - E^2 r)
//! ```
//!
//! a number of the same kind, whose square root is rounded exactly ([`Surd::sqrt_to_f32`]). The
//! denominator is |n|^2 times that of the other root of the ray. Where the latter is 0 (an apex),
//! P - Q sqrt(r) = 0 for each component: sqrt(r) is rational, and n = 2 P.

use crate::geometry::entry_normal::EntryNormal;
use crate::geometry::linear_swept_sphere;
use crate::geometry::object_ray::ObjectRay;
use crate::geometry::sphere;
use crate::math::exact::{self, Dyadic};
use crate::math::surd::Surd;

/// The unit normal at a hit, each component the nearest `f32` of the exact one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceNormal {
    /// In the object space of the instance.
    pub object: [f32; 3],
    /// In world space.
    pub world: [f32; 3],
}

impl SurfaceNormal {
    fn of_spaces([object, world]: [[f32; 3]; 2]) -> Self {
        Self { object, world }
    }

    /// The normal of a triangle, towards the ray's origin; `None` where the ray runs along it, and
    /// where it is not finite.
    pub fn of_triangle(ray: &ObjectRay, vertices: [[f32; 3]; 3]) -> Option<Self> {
        if !vertices.as_flattened().iter().all(|x| x.is_finite()) {
            return None;
        }
        let [v0, v1, v2] = vertices.map(exact::vector);
        let across = exact::cross(&exact::sub(&v1, &v0), &exact::sub(&v2, &v0));
        let facing = exact::dot(&across, &ray.exact().direction).sign();
        let base = exact::scale(&Dyadic::integer((-facing).into()), &across);
        let slope = std::array::from_fn(|_| Dyadic::zero());
        let t = Surd::ratio(Dyadic::zero(), Dyadic::integer(1));
        EntryNormal { base, slope, t }.rounded(ray).map(Self::of_spaces)
    }

    /// The normal of a sphere where the ray enters it; `None` where the ray passes by.
    pub fn of_sphere(ray: &ObjectRay, center: [f32; 3], radius: f32) -> Option<Self> {
        let is_finite = radius.is_finite() && center.iter().all(|x| x.is_finite());
        if !is_finite || radius <= 0.0 {
            return None;
        }
        let exact_ray = ray.exact();
        let base = exact_ray.origin_from(&exact::vector(center));
        let slope = exact_ray.direction;
        let t = sphere::entry_exactly(&base, &slope, &(&exact_ray.weight * &Dyadic::from_f32(radius)))?;
        EntryNormal { base, slope, t }.rounded(ray).map(Self::of_spaces)
    }

    /// The normal of a linear swept sphere where the ray enters it, through its side or a cap;
    /// `None` where the ray passes by, and in an apex.
    pub fn of_linear_swept_sphere(
        ray: &ObjectRay,
        positions: [[f32; 3]; 2],
        radii: [f32; 2],
    ) -> Option<Self> {
        let is_finite = positions.as_flattened().iter().chain(&radii).all(|x| x.is_finite());
        if !is_finite || radii.iter().all(|&radius| radius <= 0.0) {
            return None;
        }
        linear_swept_sphere::exact_normal(ray, positions, radii)?.rounded(ray).map(Self::of_spaces)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Ray;

    fn object_ray(origin: [f32; 3], direction: [f32; 3]) -> ObjectRay {
        ObjectRay::new(&Ray::new(origin, direction), None).expect("a finite ray")
    }

    #[test]
    fn a_triangles_normal_points_to_where_the_ray_comes_from() {
        let triangle = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]];
        for side in [1.0, -1.0] {
            let ray = object_ray([0.0, 0.0, 4.0 * side], [0.0, 0.0, -side]);
            let normal = SurfaceNormal::of_triangle(&ray, triangle).expect("a normal");
            assert_eq!(normal.object, [0.0, 0.0, side]);
        }
        let along = object_ray([-4.0, 0.0, 0.0], [1.0, 0.0, 0.0]);
        assert_eq!(SurfaceNormal::of_triangle(&along, triangle), None);
    }

    #[test]
    fn a_spheres_normal_is_that_of_the_entry() {
        // (0.6, 0, 0.8) of the unit sphere, from above.
        let ray = object_ray([3.0, 0.0, 9.0], [0.0, 0.0, -1.0]);
        let normal = SurfaceNormal::of_sphere(&ray, [0.0; 3], 5.0).expect("a normal");
        assert_eq!(normal.world, [0.6, 0.0, 0.8]);
        let beside = object_ray([6.0, 0.0, 9.0], [0.0, 0.0, -1.0]);
        assert_eq!(SurfaceNormal::of_sphere(&beside, [0.0; 3], 5.0), None);
    }

    #[test]
    fn a_cones_normal_leans_by_its_slope() {
        // δ / |D| = -1/8: the component along the axis is 1/8, the other sqrt(63/64).
        let ray = object_ray([0.0, 0.0, 4.0], [0.0, 0.0, -1.0]);
        let normal =
            SurfaceNormal::of_linear_swept_sphere(&ray, [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [0.5, 0.25]);
        assert_eq!(normal.expect("a normal").object, [0.125, 0.0, (63f64 / 64.0).sqrt() as f32]);
        // On the cap of the first end, (0.6, 0.8) of its sphere from its centre.
        let ray = object_ray([-1.0 - 0.3, 0.0, 4.0], [0.0, 0.0, -1.0]);
        let normal =
            SurfaceNormal::of_linear_swept_sphere(&ray, [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [0.5, 0.5])
                .expect("a normal");
        let expected = [-0.6, 0.0, 0.8f32];
        assert!(normal.object.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-6));
    }

    #[test]
    fn world_space_takes_the_inverse_transpose() {
        // A mirror and a scale: the plane x + z = 0 becomes -x / 2 + z = 0, with the normal
        // (-1, 0, 2) / sqrt 5, whatever the sign of the determinant.
        let matrix = [[-2.0, 0.0, 0.0, 7.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
        let triangle = [[-1.0, -9.0, 1.0], [1.0, -9.0, -1.0], [0.0, 9.0, 0.0]];
        let ray = Ray::new([7.0, 0.0, 4.0], [0.0, 0.0, -1.0]);
        let ray = ObjectRay::new(&ray, Some(&matrix)).expect("a ray");
        let normal = SurfaceNormal::of_triangle(&ray, triangle).expect("a normal");
        let length = 5f64.sqrt();
        assert_eq!(normal.world, [(-1.0 / length) as f32, 0.0, (2.0 / length) as f32]);
        let half = std::f32::consts::FRAC_1_SQRT_2;
        assert_eq!(normal.object, [half, 0.0, half]);
    }
}
