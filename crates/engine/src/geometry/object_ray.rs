//! A ray in the object space of an instance, approximate with a bound and exact on demand.
//!
//! An instance's 3x4 matrix maps an object-space point x to A x + b. With D = det A and adj A its
//! adjugate, the ray o + t d becomes
//!
//! ```text
//! origin    = adj A (o - b) / D
//! direction = adj A  d      / D        (t is the same number in both spaces)
//! ```
//!
//! **Exactly** the division is never made: [`ExactRay`] is homogeneous, (adj A (o - b), adj A d,
//! D), its signs turned so that the weight D is positive. Every decision is then the sign of a
//! polynomial of the inputs: a point p of a primitive is compared as D p.
//!
//! **In f64**, for entries of magnitude 0 or 2^-149 to 2^128 nothing over- or underflows: products
//! of two f32 are exact, so an entry of adj A costs one rounding (relative error u = 2^-53). D is
//! an inner product of such entries with a row of A: off by at most 4u S, S = sum |a_0j adj_j0|.
//! With e = 6u S / |D| <= 2^-10 an entry of the inverse is off by at most u + u + e/(1-e) + O(u^2)
//! <= 4u + 2e relatively, and a component of the result by (that + u + 3u) sum |inv_kj v_j|, plus u
//! for the difference o - b. The coefficients in the code are greater still (see
//! `math::error_bound`). A transform that only moves, swaps axes and scales by powers of two rounds
//! nothing but that difference, and an error-free sum (Knuth, *The Art of Computer Programming*,
//! vol. 2, 4.2.2) says by how much. Where e is greater (a nearly singular matrix) or the result
//! leaves the range that the intersectors' bounds assume, the error is declared infinite and all is
//! decided exactly.

use std::cmp::Ordering;

use crate::geometry::Ray;
use crate::geometry::approach_terms::ClosestApproachTerms;
use crate::geometry::bounded_ray::BoundedRay;
use crate::math::array;
use crate::math::exact::{self, Dyadic, Vector};
use crate::math::f32x4::F32x4;
use crate::math::real::{Real, norm1};
use crate::math::surd::Surd;

pub(super) const UNIT: f64 = f64::EPSILON / 2.0;

/// 2^130 and 2^-150: the greatest 1-norms of a ray's origin and direction, and the least of a
/// direction, that the intersectors' bounds assume.
const MAX_NORM: f64 = (1u128 << 65) as f64 * (1u128 << 65) as f64;
const MIN_DIRECTION_NORM: f64 = 1.0 / ((1u128 << 75) as f64 * (1u128 << 75) as f64);

/// The greatest relative error of a direction that they assume: 2^-10.
pub(super) const MAX_DIRECTION_ERROR: f64 = 1.0 / 1024.0;

/// An instance's object-to-world transform, inverted once for all its rays.
#[derive(Clone, Copy, Debug)]
pub struct Transform {
    matrix: [[f32; 4]; 3],
    /// The columns of the inverse of the linear part; the fourth components are 0.
    pub(super) inverse: [[f64; 4]; 3],
    /// Relative error of each of its entries; infinite where only exact arithmetic will do.
    pub(super) inverse_error: f64,
    /// Whether it only moves, swaps axes, and scales each by a power of two: then nothing is
    /// rounded but the sum with the translation, and that seldom.
    pub(super) is_exact: bool,
    /// The inverse in f32, if its entries are in range.
    approximate: Option<ApproximateInverse>,
}

/// An inverse transform in f32: the columns of the linear part, and the translation that is applied
/// first. The fourth components are not used.
#[derive(Clone, Copy, Debug)]
struct ApproximateInverse {
    columns: [[f32; 4]; 3],
    translation: [f32; 4],
}

impl Transform {
    /// Inverts a row-major 3x4 matrix (the form of `VkTransformMatrixKHR`). `None` where it is
    /// singular (determinant exactly 0) or not finite: no ray meets such an instance.
    pub fn new(object_to_world: &[[f32; 4]; 3]) -> Option<Self> {
        let m = object_to_world;
        if !m.as_flattened().iter().all(|x| x.is_finite()) {
            return None;
        }
        let a = array::map(*m, |row| array::map([row[0], row[1], row[2]], f64::from));
        let adjugate: [[f64; 3]; 3] = array::from_fn(|i| {
            array::from_fn(|j| cofactor(j, i, |r, c| a[r][c], |x, y| x * y, |x, y| x - y))
        });
        let terms: [f64; 3] = array::from_fn(|j| a[0][j] * adjugate[j][0]);
        let determinant = terms[0] + terms[1] + terms[2];
        let error = 6.0 * UNIT * norm1(terms) / determinant.abs();
        let sure = error < 2f64.powi(-10);
        if !sure && exact_inverse(m).1.is_zero() {
            return None;
        }
        let inverse = array::map(adjugate, |row| array::map(row, |x| x / determinant));
        let inverse_error = if sure { 6.0 * UNIT + 2.0 * error } else { f64::INFINITY };
        let approximate = ApproximateInverse::new(m, &inverse).filter(|_| inverse_error <= 2f64.powi(-30));
        let inverse = array::map([0, 1, 2], |k| [inverse[0][k], inverse[1][k], inverse[2][k], 0.0]);
        Some(Self { matrix: *m, inverse, inverse_error, is_exact: is_monomial(m), approximate })
    }

    /// The matrix it was made from.
    pub fn object_to_world(&self) -> &[[f32; 4]; 3] {
        &self.matrix
    }

    /// The inverse as a row-major 3x4 matrix, each entry the correctly rounded value of the exact
    /// inverse's (the builtin `WorldToObjectKHR`, transposed).
    pub fn world_to_object(&self) -> [[f32; 4]; 3] {
        let (adjugate, determinant) = exact_inverse(&self.matrix);
        let translation = self.matrix.map(|row| Dyadic::from_f32(row[3]));
        let entry = |numerator: Dyadic| Surd::ratio(numerator, determinant.clone()).to_f32();
        adjugate.map(|row| {
            let shift = -&exact::dot(&row, &translation);
            let [x, y, z] = row.map(entry);
            [x, y, z, entry(shift)]
        })
    }

    /// A ray in object space in f32, with bounds; `None` if the ray [is not
    /// well scaled](Ray::is_well_scaled) or the transform is too extreme.
    ///
    /// An entry of the inverse is off by u (and 2^-30), u = 2^-24, the difference of origin and
    /// translation by u, a product and the two sums by 3u: together less than 6u of sum |inv_kj
    /// v_j|, for which 12u stand. A difference is at least 2^-84 where it is not 0, so that a
    /// product may underflow: 2^-100 pays for that. The direction's products don't.
    #[inline(always)]
    pub fn approximate(&self, ray: &Ray) -> Option<ApproximateRay> {
        let approximate = self.approximate.as_ref().filter(|_| ray.is_well_scaled())?;
        let columns = array::map(approximate.columns, F32x4::new);
        let apply = |[x, y, z]: [F32x4; 3]| {
            let terms = [columns[0] * x, columns[1] * y, columns[2] * z];
            let sizes = array::map(terms, F32x4::abs);
            (
                terms[0] + terms[1] + terms[2],
                (sizes[0] + sizes[1] + sizes[2]) * F32x4::splat(APPROXIMATE_ERROR),
            )
        };
        let [bx, by, bz, _] = approximate.translation;
        let [x, y, z] = ray.origin;
        let (origin, origin_error) = apply(array::map([x - bx, y - by, z - bz], F32x4::splat));
        let (direction, direction_error) = apply(array::map(ray.direction, F32x4::splat));
        let origin_error = origin_error + F32x4::splat(APPROXIMATE_UNDERFLOW);
        Some(ApproximateRay { origin, direction, origin_error, direction_error })
    }

    /// What [`Transform::approximate`] takes: the inverse's columns in f32, and the translation
    /// that goes before. `None` where the transform is too extreme.
    #[inline(always)]
    pub fn approximate_inverse(&self) -> Option<([[f32; 3]; 3], [f32; 3])> {
        let three = |[x, y, z, _]: [f32; 4]| [x, y, z];
        self.approximate
            .as_ref()
            .map(|approximate| (array::map(approximate.columns, three), three(approximate.translation)))
    }

    /// The terms of each component of `A^-1 v`.
    #[inline(always)]
    fn inverse_terms(&self, [x, y, z]: [f64; 3]) -> [[f64; 3]; 3] {
        let [cx, cy, cz] = &self.inverse;
        array::map([0, 1, 2], |k| [cx[k] * x, cy[k] * y, cz[k] * z])
    }

    /// The translation, which the inverse in f32 applies first, if there is such an inverse.
    #[inline(always)]
    pub(super) fn approximate_translation(&self) -> Option<&[f32; 4]> {
        self.approximate.as_ref().map(|approximate| &approximate.translation)
    }

    /// `A^-1 v`. The bound of an inexact transform includes the error of v.
    fn apply(&self, v: BoundedVector) -> BoundedVector {
        let terms = self.inverse_terms(v.value);
        let value = array::map(terms, |[x, y, z]| x + y + z);
        if self.is_exact {
            return BoundedVector { value, error: array::map(self.inverse_terms(v.error), norm1) };
        }
        let error = self.inverse_error + 8.0 * UNIT;
        BoundedVector { value, error: array::map(terms, |row| error * norm1(row)) }
    }
}

/// A computed vector with a bound of the error of each component.
#[derive(Clone, Copy)]
struct BoundedVector {
    /// The vector.
    value: [f64; 3],
    /// The bound of each component's error.
    error: [f64; 3],
}

impl BoundedVector {
    /// A vector that is given, without an error.
    #[inline(always)]
    fn exact(v: [f32; 3]) -> Self {
        Self { value: array::map(v, f64::from), error: [0.0; 3] }
    }
}

/// Whether each row and column of the linear part has one entry that is not 0, a power of two or
/// its negative: so have the inverse's, and its products are exact.
fn is_monomial(matrix: &[[f32; 4]; 3]) -> bool {
    let is_power = |x: f32| x.is_normal() && x.to_bits() & 0x7F_FFFF == 0;
    let mut columns = 0;
    for row in matrix {
        let filled = (0..3).filter(|&k| row[k] != 0.0).fold(0u32, |all, k| all | 1 << k);
        if filled.count_ones() != 1 || !is_power(row[filled.trailing_zeros() as usize]) {
            return false;
        }
        columns |= filled;
    }
    columns == 0b111
}

/// The difference of two f32, and a bound of its error: 0 where it is exact (Knuth's error-free sum
/// says).
#[inline(always)]
fn difference(a: f32, b: f32) -> (f64, f64) {
    let (a, b) = (f64::from(a), -f64::from(b));
    let sum = a + b;
    let of_b = sum - a;
    let rest = (a - (sum - of_b)) + (b - of_b);
    (sum, rest.abs() * (1.0 + 8.0 * UNIT))
}

/// The factor by which the sum of the magnitudes of the terms of an approximate component bounds
/// its error: see [`Transform::approximate`].
pub const APPROXIMATE_ERROR: f32 = 12.0 * UNIT_F32;

/// The unit roundoff of f32.
const UNIT_F32: f32 = 1.0 / 16_777_216.0;

/// 2^-100, which covers underflow of the products of an approximate origin.
pub const APPROXIMATE_UNDERFLOW: f32 = UNIT_F32 * UNIT_F32 * UNIT_F32 * UNIT_F32 / 16.0;

impl ApproximateInverse {
    /// `None` where an entry is neither 0 nor of a magnitude from 2^-40 to 2^40, or the translation
    /// is not in the range of a well-scaled ray's origin.
    fn new(matrix: &[[f32; 4]; 3], inverse: &[[f64; 3]; 3]) -> Option<Self> {
        let within =
            |x: f32, power: i32| x == 0.0 || x.abs() >= 2f32.powi(-power) && x.abs() <= 2f32.powi(power);
        let row = |k: usize| array::map([0, 1, 2], |i| inverse[i][k] as f32);
        let columns = array::map([0, 1, 2], |k| [row(k)[0], row(k)[1], row(k)[2], 0.0]);
        let [x, y, z] = array::map(*matrix, |row| row[3]);
        let fits =
            columns.as_flattened().iter().all(|&x| within(x, 40)) && [x, y, z].iter().all(|&x| within(x, 60));
        fits.then_some(Self { columns, translation: [x, y, z, 0.0] })
    }
}

/// A ray in object space in f32, with a bound of the error of each component. The fourth components
/// are not used and not NaN.
#[derive(Clone, Copy, Debug)]
pub struct ApproximateRay {
    /// Where t is 0.
    pub origin: F32x4,
    /// The displacement per unit of t. A component is exact where its bound is 0, and off by at
    /// most half of the bound elsewhere.
    pub direction: F32x4,
    /// A bound of the error of each component of the origin.
    pub origin_error: F32x4,
    /// A bound of the error of each component of the direction.
    pub direction_error: F32x4,
}

impl ApproximateRay {
    /// Placeholder value.
    pub const EMPTY: Self = Self {
        origin: F32x4::ZERO,
        direction: F32x4::ZERO,
        origin_error: F32x4::ZERO,
        direction_error: F32x4::ZERO,
    };
}

/// The exact inverse of a 3x4 matrix, each entry correctly rounded; `None` where it has none.
pub fn world_to_object(object_to_world: &[[f32; 4]; 3]) -> Option<[[f32; 4]; 3]> {
    Some(Transform::new(object_to_world)?.world_to_object())
}

/// A ray as the primitives of one instance see it.
#[derive(Clone, Copy, Debug)]
pub struct ObjectRay {
    world: Ray,
    matrix: Option<[[f32; 4]; 3]>,
    pub(super) origin: [f64; 3],
    pub(super) direction: [f64; 3],
    /// Bounds of each component's error; infinite where only exact arithmetic will do.
    pub(super) origin_error: [f64; 3],
    pub(super) direction_error: [f64; 3],
    /// The 1-norms of the two errors and of the direction, the direction's relative.
    origin_error_norm: f64,
    direction_relative_error: f64,
    pub(super) direction_norm: f64,
    pub(super) approach_terms: ClosestApproachTerms,
}

impl ObjectRay {
    /// The ray in the object space of a row-major 3x4 matrix; no matrix is the identity and costs
    /// nothing. `None` where the matrix is singular (determinant exactly 0), or where matrix or ray
    /// hold a NaN or an infinity (`t_min` and `t_max` may be infinite): nothing is hit then.
    pub fn new(ray: &Ray, object_to_world: Option<&[[f32; 4]; 3]>) -> Option<Self> {
        match object_to_world {
            None => Self::in_world(ray),
            Some(matrix) => Self::in_instance(ray, &Transform::new(matrix)?),
        }
    }

    /// The ray in world space. `None` where it holds a NaN or an infinite origin or direction.
    #[inline]
    pub fn in_world(ray: &Ray) -> Option<Self> {
        let mut out = Self::EMPTY;
        out.set_in_world(ray).then_some(out)
    }

    /// The ray in the object space of an instance. `None` where it holds a NaN or an infinite
    /// origin or direction.
    #[inline]
    pub fn in_instance(ray: &Ray, transform: &Transform) -> Option<Self> {
        let mut out = Self::EMPTY;
        out.set_in_instance(ray, transform).then_some(out)
    }

    /// Placeholder value.
    pub const EMPTY: Self = Self {
        world: Ray { origin: [0.0; 3], direction: [0.0; 3], t_min: 0.0, t_max: 0.0 },
        matrix: None,
        origin: [0.0; 3],
        direction: [0.0; 3],
        origin_error: [0.0; 3],
        direction_error: [0.0; 3],
        origin_error_norm: 0.0,
        direction_relative_error: 0.0,
        direction_norm: 0.0,
        approach_terms: ClosestApproachTerms::EMPTY,
    };

    /// [`ObjectRay::in_world`], written to `self`; returns whether there is one.
    #[inline(always)]
    pub fn set_in_world(&mut self, ray: &Ray) -> bool {
        let (origin, direction) = (BoundedVector::exact(ray.origin), BoundedVector::exact(ray.direction));
        self.set(ray, None, origin, direction, 0.0)
    }

    /// [`ObjectRay::in_instance`], written to `self`; returns whether there is one.
    #[inline]
    pub fn set_in_instance(&mut self, ray: &Ray, transform: &Transform) -> bool {
        let offset = array::map([0, 1, 2], |i| difference(ray.origin[i], transform.matrix[i][3]));
        let offset = BoundedVector {
            value: array::map(offset, |(sum, _)| sum),
            error: array::map(offset, |(_, error)| error),
        };
        let origin = transform.apply(offset);
        let direction = transform.apply(BoundedVector::exact(ray.direction));
        let direction_relative_error = norm1(direction.error) / norm1(direction.value);
        self.set(ray, Some(transform.matrix), origin, direction, direction_relative_error)
    }

    #[inline(always)]
    fn set(
        &mut self,
        ray: &Ray,
        matrix: Option<[[f32; 4]; 3]>,
        origin: BoundedVector,
        direction: BoundedVector,
        direction_relative_error: f64,
    ) -> bool {
        let BoundedVector { value: origin, error: origin_error } = origin;
        let BoundedVector { value: direction, error: direction_error } = direction;
        let origin_error_norm = norm1(origin_error);
        let direction_norm = norm1(direction);
        *self = Self {
            world: *ray,
            matrix,
            origin,
            direction,
            origin_error,
            direction_error,
            origin_error_norm,
            direction_relative_error,
            direction_norm,
            approach_terms: ClosestApproachTerms::new(
                direction,
                direction_norm,
                origin_error_norm,
                direction_relative_error,
                ray.t_min,
                ray.t_max,
            ),
        };
        // A NaN fails each of these comparisons.
        let (least, most) = ClosestApproachTerms::RANGE;
        let is_common = norm1(origin) + direction_norm <= most
            && direction_norm >= least
            && direction_relative_error <= MAX_DIRECTION_ERROR
            && ray.t_min <= ray.t_max;
        is_common || self.require_exact()
    }

    /// Makes the error bounds infinite where they do not hold, so that exact arithmetic decides;
    /// returns whether there is a ray.
    #[cold]
    #[inline(never)]
    fn require_exact(&mut self) -> bool {
        let (least, most) = ClosestApproachTerms::RANGE;
        if !(least..=most).contains(&self.direction_norm) {
            self.approach_terms.disable();
        }
        let origin_error = (self.origin_error, self.origin_error_norm);
        let is_sure = norm1(self.origin) <= MAX_NORM
            && (MIN_DIRECTION_NORM..=MAX_NORM).contains(&self.direction_norm)
            && self.direction_relative_error <= MAX_DIRECTION_ERROR;
        if !is_sure {
            self.origin_error = [f64::INFINITY; 3];
            self.direction_error = [f64::INFINITY; 3];
            self.origin_error_norm = f64::INFINITY;
            self.direction_relative_error = f64::INFINITY;
            self.approach_terms.disable();
        }
        if self.world.goes_nowhere() {
            // A direction of zero is exact in every space: boxes are culled by the origin alone.
            self.direction = [0.0; 3];
            self.direction_error = [0.0; 3];
            if norm1(self.origin) <= MAX_NORM && origin_error.1.is_finite() {
                (self.origin_error, self.origin_error_norm) = origin_error;
            }
        }
        self.world.is_finite()
    }

    /// The ray that it was made from.
    pub fn world(&self) -> &Ray {
        &self.world
    }

    /// Whether object space is world space.
    #[inline(always)]
    pub fn is_in_world(&self) -> bool {
        self.matrix.is_none()
    }

    /// The lower end of the interval.
    pub fn t_min(&self) -> f32 {
        self.world.t_min
    }

    /// The upper end of the interval.
    pub fn t_max(&self) -> f32 {
        self.world.t_max
    }

    /// The origin, each component correctly rounded from the exact one (`ObjectRayOriginKHR`).
    pub fn object_origin_f32(&self) -> [f32; 3] {
        if self.matrix.is_none() {
            return self.world.origin;
        }
        round(self.origin, self.origin_error, || {
            let exact = self.exact();
            (exact.origin, exact.weight)
        })
    }

    /// The direction, each component correctly rounded from the exact one
    /// (`ObjectRayDirectionKHR`); not normalised.
    pub fn object_direction_f32(&self) -> [f32; 3] {
        if self.matrix.is_none() {
            return self.world.direction;
        }
        round(self.direction, self.direction_error, || {
            let exact = self.exact();
            (exact.direction, exact.weight)
        })
    }

    /// The object-space origin in f64 and a bound of each component's error (infinite where nothing
    /// is known): the input of the node test.
    #[inline]
    pub fn origin_bounded(&self) -> ([f64; 3], [f64; 3]) {
        (self.origin, self.origin_error)
    }

    /// The object-space direction in f64 and a bound of each component's error (infinite where
    /// nothing is known).
    #[inline]
    pub fn direction_bounded(&self) -> ([f64; 3], [f64; 3]) {
        (self.direction, self.direction_error)
    }

    /// The ray in another format, with its error bounds as 1-norms.
    #[inline(always)]
    pub(super) fn bounded<R: Real>(&self) -> BoundedRay<R> {
        let origin = array::map(self.origin, R::from_f64);
        let direction = array::map(self.direction, R::from_f64);
        // Rounding to f32 costs up to its u again.
        let rounding = if size_of::<R>() == 4 { R::UNIT + R::UNIT } else { R::ZERO };
        BoundedRay {
            origin,
            direction,
            origin_error: R::from_f64(self.origin_error_norm) + rounding * norm1(origin),
            relative_error: R::from_f64(self.direction_relative_error)
                + rounding
                + R::from_f32(12.0) * R::UNIT,
            direction_norm: R::from_f64(self.direction_norm),
            t_min: R::from_f32(self.world.t_min),
            t_max: R::from_f32(self.world.t_max),
        }
    }

    /// The exact homogeneous ray.
    #[cold]
    pub(super) fn exact(&self) -> ExactRay {
        let origin = exact::vector(self.world.origin);
        let direction = exact::vector(self.world.direction);
        let Some(matrix) = &self.matrix else {
            return ExactRay { origin, direction, weight: Dyadic::integer(1) };
        };
        let (mut adjugate, mut weight) = exact_inverse(matrix);
        if weight.sign() < 0 {
            adjugate = adjugate.map(|row| row.map(|x| -&x));
            weight = -&weight;
        }
        let offset = exact::sub(&origin, &matrix.map(|row| Dyadic::from_f32(row[3])));
        let apply = |v: &Vector| std::array::from_fn(|i| exact::dot(&adjugate[i], v));
        ExactRay { origin: apply(&offset), direction: apply(&direction), weight }
    }

    /// A positive multiple of the normal in world space of an object-space normal: that times the
    /// inverse transpose of the linear part.
    pub(super) fn normal_to_world(&self, normal: &Vector) -> Vector {
        let Some(matrix) = &self.matrix else { return normal.clone() };
        let (adjugate, determinant) = exact_inverse(matrix);
        let sign = Dyadic::integer(determinant.sign().into());
        std::array::from_fn(|i| {
            let column = std::array::from_fn(|j| adjugate[j][i].clone());
            &sign * &exact::dot(&column, normal)
        })
    }

    /// Rounds an exact parameter if it lies in the closed interval: `None` outside, and where it
    /// rounds to infinity.
    pub(super) fn round_within_closed(&self, t: &Surd) -> Option<f32> {
        let inside = t.compare_f32(self.world.t_min) != Ordering::Less
            && t.compare_f32(self.world.t_max) != Ordering::Greater;
        inside.then(|| t.to_f32()).filter(|t| t.is_finite())
    }

    /// Rounds an exact parameter if it lies in the open interval: `None` outside or at its ends,
    /// and where it rounds to infinity.
    pub(super) fn round_within_open(&self, t: &Surd) -> Option<f32> {
        let inside = t.compare_f32(self.world.t_min) == Ordering::Greater
            && t.compare_f32(self.world.t_max) == Ordering::Less;
        inside.then(|| t.to_f32()).filter(|t| t.is_finite())
    }
}

/// A ray whose points are (origin + t direction) / weight, weight > 0.
#[derive(Clone, Debug)]
pub(super) struct ExactRay {
    pub origin: Vector,
    pub direction: Vector,
    pub weight: Dyadic,
}

impl ExactRay {
    /// The vector from an object-space point to the origin, times the weight.
    pub(super) fn origin_from(&self, point: &Vector) -> Vector {
        exact::sub(&self.origin, &exact::scale(&self.weight, point))
    }
}

/// The components rounded to f32: at once where the bound allows, from the exact ones otherwise.
fn round(value: [f64; 3], error: [f64; 3], exact: impl FnOnce() -> (Vector, Dyadic)) -> [f32; 3] {
    let below: [f32; 3] = array::from_fn(|i| (value[i] - error[i]) as f32 + 0.0);
    let above: [f32; 3] = array::from_fn(|i| (value[i] + error[i]) as f32 + 0.0);
    if below == above {
        return below;
    }
    let (numerators, denominator) = exact();
    numerators.map(|numerator| Surd::ratio(numerator, denominator.clone()).to_f32())
}

/// The adjugate and the determinant of the linear part.
fn exact_inverse(matrix: &[[f32; 4]; 3]) -> ([Vector; 3], Dyadic) {
    let a = matrix.map(|row| [row[0], row[1], row[2]].map(Dyadic::from_f32));
    let adjugate: [Vector; 3] = std::array::from_fn(|i| {
        std::array::from_fn(|j| cofactor(j, i, |r, c| a[r][c].clone(), |x, y| &x * &y, |x, y| &x - &y))
    });
    let column = std::array::from_fn(|j| adjugate[j][0].clone());
    let determinant = exact::dot(&a[0], &column);
    (adjugate, determinant)
}

/// The cofactor of row `r` and column `c`, in whatever numbers `at` gives.
fn cofactor<T>(
    r: usize,
    c: usize,
    at: impl Fn(usize, usize) -> T,
    mul: impl Fn(T, T) -> T,
    sub: impl Fn(T, T) -> T,
) -> T {
    let (r1, r2) = ((r + 1) % 3, (r + 2) % 3);
    let (c1, c2) = ((c + 1) % 3, (c + 2) % 3);
    sub(mul(at(r1, c1), at(r2, c2)), mul(at(r1, c2), at(r2, c1)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHEAR: [[f32; 4]; 3] = [[2.0, 1.0, 0.0, 5.0], [0.0, 4.0, 0.0, 6.0], [0.0, 0.0, -3.0, 7.0]];

    #[test]
    fn moving_and_scaling_by_powers_of_two_is_exact() {
        let tile = [[0.0, 0.0, 0.125, -4.375], [0.0, 0.5, 0.0, 0.0], [-0.125, 0.0, 0.0, 1.5]];
        let transform = Transform::new(&tile).expect("it has an inverse");
        let ray = |x: f32| Ray::new([x, 2.2, 6.5], [-0.39, -0.16, -0.9]);
        let placed = ObjectRay::in_instance(&ray(0.5), &transform).expect("a finite ray");
        // z = 8 (x + 4.375), y = 2 y, x = -8 (z - 1.5).
        let wanted = [-40.0, 2.0 * f64::from(2.2f32), 39.0];
        assert_eq!(placed.origin_bounded(), (wanted, [0.0; 3]));
        let wanted = [-8.0 * f64::from(-0.9f32), 2.0 * f64::from(-0.16f32), 8.0 * f64::from(-0.39f32)];
        assert_eq!(placed.direction_bounded(), (wanted, [0.0; 3]));
        // 2^-60 is lost beside 4.375, and no more than that.
        let placed = ObjectRay::in_instance(&ray(1.0 / (1u64 << 60) as f32), &transform).expect("finite");
        let (origin, error) = placed.origin_bounded();
        assert_eq!(origin[2], 35.0);
        assert!(error[2] >= 8.0 / (1u64 << 60) as f64 && error[2] < 8.1 / (1u64 << 60) as f64);
        // A factor of 3 is not exact, and neither is a shear.
        assert!(is_monomial(&tile) && !is_monomial(&SHEAR));
        assert!(!is_monomial(&[[3.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]));
        assert!(!is_monomial(&[[1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]));
    }

    #[test]
    fn the_inverse_is_rounded_from_exact_rationals() {
        // By hand: A^-1 = [1/2 -1/8 0; 0 1/4 0; 0 0 -1/3], -A^-1 b = (-7/4, -3/2, 7/3).
        let expected = [[0.5, -0.125, 0.0, -1.75], [0.0, 0.25, 0.0, -1.5], [0.0, 0.0, -1.0 / 3.0, 7.0 / 3.0]];
        assert_eq!(world_to_object(&SHEAR), Some(expected));
    }

    #[test]
    fn the_object_ray_is_rounded_from_exact_rationals() {
        let ray = Ray::new([6.0, 10.0, 8.0], [1.0, 1.0, 1.0]);
        let object = ObjectRay::new(&ray, Some(&SHEAR)).unwrap();
        // o - b = (1, 4, 1): (1/2 - 1/2, 1, -1/3); direction (3/8, 1/4, -1/3).
        assert_eq!(object.object_origin_f32(), [0.0, 1.0, -1.0 / 3.0]);
        assert_eq!(object.object_direction_f32(), [0.375, 0.25, -1.0 / 3.0]);
        assert_eq!(object.exact().weight.sign(), 1);
    }

    #[test]
    fn singular_is_decided_exactly() {
        let ray = Ray::new([0.0; 3], [0.0, 0.0, 1.0]);
        // Rows 1 and 2 are the same but for the last bit of one entry.
        let mut matrix = [[0.1, 0.2, 0.3, 0.0], [0.7, 0.11, 0.13, 0.0], [0.7, 0.11, 0.13, 0.0]];
        assert!(ObjectRay::new(&ray, Some(&matrix)).is_none());
        matrix[2][1] = 0.11f32.next_up();
        let object = ObjectRay::new(&ray, Some(&matrix)).unwrap();
        assert!(object.object_direction_f32().iter().all(|x| x.is_finite()));
        // The determinant of rows (1e-20, 2e-20), (2e-20, 4e-20) scaled up elsewhere is 0 in f32.
        let tiny = [[1e-30, 0.0, 0.0, 0.0], [0.0, 1e-30, 0.0, 0.0], [0.0, 0.0, 1e-30, 0.0]];
        assert!(ObjectRay::new(&ray, Some(&tiny)).is_some());
    }

    #[test]
    fn what_is_not_finite_meets_nothing() {
        assert!(ObjectRay::new(&Ray::new([f32::NAN, 0.0, 0.0], [1.0; 3]), None).is_none());
        assert!(ObjectRay::new(&Ray::new([0.0; 3], [f32::INFINITY, 0.0, 0.0]), None).is_none());
        assert!(ObjectRay::new(&Ray::new([0.0; 3], [1.0; 3]).with_interval(0.0, f32::NAN), None).is_none());
    }
}
