//! The normal at a ray's entry as an exact vector, and its rounding: the derivation is that of
//! [`normal`](super::normal).

use crate::geometry::object_ray::ObjectRay;
use crate::math::exact::{self, Dyadic, Vector};
use crate::math::surd::Surd;

/// A multiple of the normal in object space at a ray's entry: `base + t slope`, times a positive
/// number.
#[derive(Clone, Debug)]
pub(super) struct EntryNormal {
    pub base: Vector,
    pub slope: Vector,
    /// The ray parameter of the entry.
    pub t: Surd,
}

impl EntryNormal {
    /// The unit normals in object and in world space; `None` for a vector of zeros.
    pub(super) fn rounded(&self, ray: &ObjectRay) -> Option<[[f32; 3]; 2]> {
        let object = self.unit()?;
        let world = if ray.is_in_world() {
            object
        } else {
            let [base, slope] = [&self.base, &self.slope].map(|vector| ray.normal_to_world(vector));
            Self { base, slope, t: self.t.clone() }.unit()?
        };
        Some([object, world])
    }

    /// The normal of length 1, rounded; `None` for a vector of zeros.
    fn unit(&self) -> Option<[f32; 3]> {
        let [p, q, r, h] = self.t.parts();
        // Times |h|: P and Q of each component.
        let sign = Dyadic::integer(h.sign().into());
        let rational: Vector =
            std::array::from_fn(|i| &sign * &(&(&self.base[i] * h) + &(&self.slope[i] * p)));
        let mut irrational: Vector = std::array::from_fn(|i| &sign * &(&self.slope[i] * q));
        let product = exact::dot(&rational, &irrational);
        let [mut c, mut e] = [
            &exact::dot(&rational, &rational) + &(r * &exact::dot(&irrational, &irrational)),
            &product + &product,
        ];
        if Surd::new(c.clone(), e.clone(), r.clone(), Dyadic::integer(1)).sign() == 0 {
            return None;
        }
        let mut denominator = &c.square() - &(&e.square() * r);
        if denominator.is_zero() {
            irrational = std::array::from_fn(|_| Dyadic::zero());
            c = exact::dot(&rational, &rational);
            e = Dyadic::zero();
            denominator = c.square();
        }
        let component = |i: usize| {
            let [p, q] = [&rational[i], &irrational[i]];
            let sign = Surd::new(p.clone(), q.clone(), r.clone(), Dyadic::integer(1)).sign();
            let a = &p.square() + &(&q.square() * r);
            let b = &(p * q) + &(p * q);
            let square = Surd::new(
                &(&a * &c) - &(&(&b * &e) * r),
                &(&b * &c) - &(&a * &e),
                r.clone(),
                denominator.clone(),
            );
            if sign == 0 { 0.0 } else { square.sqrt_to_f32().copysign(sign as f32) }
        };
        Some([component(0), component(1), component(2)])
    }
}
