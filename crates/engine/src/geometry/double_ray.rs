//! A ray in f64 for tests that operate on four numbers at once.

use crate::geometry::bounded_ray::BoundedRay;
use crate::geometry::object_ray::{MAX_DIRECTION_ERROR, ObjectRay, Transform, UNIT};
use crate::geometry::ray::Ray;
use crate::math::f64x4::F64x4Ops;

/// A ray in f64 with bounds of its errors, for tests that operate on four numbers at once.
#[derive(Clone, Copy, Debug)]
pub struct DoubleRay<D: F64x4Ops> {
    /// (x, y, z, 0), and so the direction.
    pub(super) origin: D::F64x4,
    pub(super) direction: D::F64x4,
    /// As [`BoundedRay`] has them, in all lanes.
    pub(super) origin_error: D::F64x4,
    pub(super) relative_error: D::F64x4,
    pub(super) direction_norm: D::F64x4,
    pub(super) t_min: f32,
    pub(super) t_max: f32,
}

impl<D: F64x4Ops> DoubleRay<D> {
    /// The ray as an instance's primitives see it.
    #[inline(always)]
    pub fn of(simd: D, ray: &ObjectRay) -> Self {
        let BoundedRay { origin, direction, origin_error, relative_error, direction_norm, .. } =
            ray.bounded::<f64>();
        let three = |[x, y, z]: [f64; 3]| simd.load_f64([x, y, z, 0.0]);
        Self {
            origin: three(origin),
            direction: three(direction),
            origin_error: simd.splat(origin_error),
            relative_error: simd.splat(relative_error),
            direction_norm: simd.splat(direction_norm),
            t_min: ray.t_min(),
            t_max: ray.t_max(),
        }
    }

    /// A finite ray in world space.
    #[inline(always)]
    pub fn in_world(simd: D, ray: &Ray) -> Self {
        // Each is loaded together with the number that follows it, as that is one load.
        let numbers: &[f32; 8] = bytemuck::cast_ref(ray);
        let three = |four: Option<&[f32; 4]>| simd.xyz0(simd.load_f32(four.expect("four of eight")));
        let (origin, direction) = (three(numbers.first_chunk()), three(numbers[3..].first_chunk()));
        Self {
            origin,
            direction,
            origin_error: simd.splat(0.0),
            relative_error: simd.splat(12.0 * UNIT),
            direction_norm: simd.reduce_sum(simd.abs(direction)),
            t_min: ray.t_min,
            t_max: ray.t_max,
        }
    }

    /// A [well-scaled](Ray::is_well_scaled) ray in the object space of an instance; `None` where
    /// its error may be greater than the intersectors' bounds assume, or the transform has no
    /// inverse in f32 ([`Transform::approximate_inverse`]).
    ///
    /// The numbers of [`ObjectRay::in_instance`], with the same bounds. Entries of the inverse are
    /// from 2^-40 to 2^40, and the numbers of the ray from 2^-60 to 2^60. So no norm is above
    /// 2^103; and as the relative error is at least 8u times the sizes of the terms over the norm,
    /// one that is accepted leaves the direction a norm of 2^-140 or more.
    #[inline(always)]
    pub fn in_instance(simd: D, ray: &Ray, transform: &Transform) -> Option<Self> {
        let translation = simd.load_f32(transform.approximate_translation()?);
        let Self { origin, direction, t_min, t_max, .. } = Self::in_world(simd, ray);
        // The difference and its error, as in `difference`.
        let offset = simd.sub(origin, translation);
        let of_translation = simd.sub(offset, origin);
        let of_origin = simd.sub(offset, of_translation);
        let rest = simd.sub(simd.sub(origin, of_origin), simd.add(translation, of_translation));
        let rest = simd.mul(simd.abs(rest), simd.splat(1.0 + 8.0 * UNIT));
        let [cx, cy, cz] = &transform.inverse;
        let columns = [simd.load_f64(*cx), simd.load_f64(*cy), simd.load_f64(*cz)];
        let from = inverse_terms(simd, columns, offset);
        let along = inverse_terms(simd, columns, direction);
        let error = simd.splat(transform.inverse_error + 8.0 * UNIT);
        let (origin_error, direction_error) = if transform.is_exact {
            (simd.norm1(inverse_terms(simd, columns, rest)), simd.splat(0.0))
        } else {
            (simd.mul(error, simd.norm1(from)), simd.mul(error, simd.norm1(along)))
        };
        let direction = simd.add(simd.add(along[0], along[1]), along[2]);
        let direction_norm = simd.reduce_sum(simd.abs(direction));
        let relative_error = simd.div(simd.reduce_sum(direction_error), direction_norm);
        // A NaN fails this comparison.
        if simd.cmp_ge(simd.splat(MAX_DIRECTION_ERROR), relative_error) == 0 {
            return None;
        }
        Some(Self {
            origin: simd.add(simd.add(from[0], from[1]), from[2]),
            direction,
            origin_error: simd.reduce_sum(origin_error),
            relative_error: simd.add(relative_error, simd.splat(12.0 * UNIT)),
            direction_norm,
            t_min,
            t_max,
        })
    }
}

/// The terms of each component of the product of a matrix, given as columns, and a vector.
#[inline(always)]
fn inverse_terms<D: F64x4Ops>(simd: D, columns: [D::F64x4; 3], v: D::F64x4) -> [D::F64x4; 3] {
    let [x, y, z] = simd.splat_xyz(v);
    [simd.mul(columns[0], x), simd.mul(columns[1], y), simd.mul(columns[2], z)]
}

#[cfg(test)]
mod tests {
    use dashu_ratio::RBig;
    use proptest::prelude::*;

    use super::*;
    use crate::math::baseline_simd::BaselineSimd;

    /// Solves A x = v by Cramer's rule, exactly.
    fn solved(matrix: &[[f32; 4]; 3], v: &[RBig; 3]) -> [RBig; 3] {
        let entry = |row: usize, column: usize| exact_number(f64::from(matrix[row][column]));
        let determinant = |entry: &dyn Fn(usize, usize) -> RBig| {
            let minor = |r: usize, s: usize| entry(r, 1) * entry(s, 2) - entry(s, 1) * entry(r, 2);
            entry(0, 0) * minor(1, 2) - entry(1, 0) * minor(0, 2) + entry(2, 0) * minor(0, 1)
        };
        let whole = determinant(&entry);
        [0, 1, 2].map(|k| {
            determinant(&|row, column| if column == k { v[row].clone() } else { entry(row, column) }) / &whole
        })
    }

    fn exact_number(x: f64) -> RBig {
        RBig::try_from(x).expect("finite")
    }

    fn absolute(x: RBig) -> RBig {
        if x < RBig::ZERO { -x } else { x }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]
        #[test]
        fn the_numbers_of_four_lanes_are_within_their_bounds(
            rows in prop::array::uniform3(prop::array::uniform4(-4i32..=4)),
            powers in prop::array::uniform3(-12i32..=12),
            noise in prop::array::uniform3(-1e-3f32..1e-3),
            origin in prop::array::uniform3(-9f32..9.0),
            direction in prop::array::uniform3(-1f32..1.0),
        ) {
            let mut matrix = rows.map(|row| row.map(|x| x as f32));
            for (k, row) in matrix.iter_mut().enumerate() {
                row.iter_mut().take(3).for_each(|x| *x *= 2f32.powi(powers[k]));
                row[3] += noise[k];
            }
            let Some(transform) = Transform::new(&matrix) else { return Ok(()) };
            let ray = Ray::new(origin, direction);
            let Some(four) = DoubleRay::in_instance(BaselineSimd, &ray, &transform) else { return Ok(()) };
            let offset = [0, 1, 2].map(|k| exact_number(origin[k].into()) - exact_number(matrix[k][3].into()));
            let along = direction.map(|x| exact_number(x.into()));
            let off = |computed: [f64; 4], wanted: [RBig; 3]| {
                let each = [0, 1, 2].map(|k| absolute(exact_number(computed[k]) - &wanted[k]));
                each.into_iter().fold(RBig::ZERO, |sum, x| sum + x)
            };
            let norm = |v: &[RBig; 3]| v.iter().cloned().map(absolute).fold(RBig::ZERO, |sum, x| sum + x);
            let (from, to) = (solved(&matrix, &offset), solved(&matrix, &along));
            let size = norm(&to);
            prop_assert!(off(four.origin, from) <= exact_number(four.origin_error[0]));
            // Twelve units are for the arithmetic of the tests.
            let relative = exact_number(four.relative_error[0]) - exact_number(12.0 * UNIT);
            prop_assert!(off(four.direction, to) <= relative * &size);
            let rounding = &size * exact_number(f64::from(f32::EPSILON));
            prop_assert!(absolute(exact_number(four.direction_norm[0]) - &size) <= rounding);
        }
    }
}
