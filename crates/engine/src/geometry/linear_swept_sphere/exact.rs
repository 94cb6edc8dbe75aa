//! The exact step for linear swept spheres: the three conditions of the parent module, evaluated in
//! dyadic numbers and in the order of the intervals along the line.

use std::cmp::Ordering;

use crate::geometry::entry_normal::EntryNormal;
use crate::geometry::object_ray::ObjectRay;
use crate::geometry::{Intersection, sphere};
use crate::math::array;
use crate::math::exact::{self, Dyadic, Vector};
use crate::math::surd::Surd;

/// Where the exact ray enters, for finite ends, at least one of which has a positive radius.
#[cold]
#[inline(never)]
pub(super) fn intersect(
    ray: &ObjectRay,
    positions: [[f32; 3]; 2],
    radii: [f32; 2],
    caps: [bool; 2],
) -> Option<Intersection> {
    // An end of negative radius comes second; u is then reversed.
    let swapped = radii[0] < 0.0;
    let order = if swapped { [1, 0] } else { [0, 1] };
    let shape =
        ExactShape::new(ray, array::map(order, |end| positions[end]), array::map(order, |end| radii[end]));
    let entry = shape.entry()?;
    let (surface, t) = match entry {
        Entry::Cap(end, t) => {
            let end = order[end];
            if !caps[end] {
                return None;
            }
            return Some(super::cap(ray.round_within_closed(&t)?, end));
        }
        Entry::Side(t) => (shape.parameter(&t), t),
        Entry::Apex(t) => (Surd::ratio(shape.end_numerator.clone(), shape.end_denominator.clone()), t),
    };
    let u = if swapped {
        let one = Dyadic::integer(1);
        surface.affine(&one, &Dyadic::integer(-1), &one)
    } else {
        surface
    };
    Some(super::side(ray.round_within_closed(&t)?, u.to_f32()))
}

/// The normal at the entry of a ray, which points away from the axis: that of the sphere of the
/// sweep that touches the surface there. `None` where the ray misses, and in an apex, which has
/// none.
pub(in crate::geometry) fn normal(
    ray: &ObjectRay,
    positions: [[f32; 3]; 2],
    radii: [f32; 2],
) -> Option<EntryNormal> {
    let order = if radii[0] < 0.0 { [1, 0] } else { [0, 1] };
    let shape =
        ExactShape::new(ray, array::map(order, |end| positions[end]), array::map(order, |end| radii[end]));
    match shape.entry()? {
        Entry::Cap(0, t) => Some(EntryNormal { base: shape.w, slope: shape.d, t }),
        Entry::Cap(_, t) => Some(EntryNormal { base: exact::sub(&shape.w, &shape.axis), slope: shape.d, t }),
        Entry::Side(t) => {
            let (a, b) = shape.line();
            let from_centre = |from: &Vector, along: &Dyadic| {
                exact::sub(&exact::scale(&shape.g, from), &exact::scale(along, &shape.axis))
            };
            Some(EntryNormal { base: from_centre(&shape.w, &a), slope: from_centre(&shape.d, &b), t })
        }
        Entry::Apex(_) => None,
    }
}

enum Entry {
    Cap(usize, Surd),
    Side(Surd),
    /// The point in which a shape with one negative radius ends.
    Apex(Surd),
}

/// Ray and shape, multiplied by the ray's weight and, where the shape is cut at its apex, by
/// `end_denominator`, so that no coordinate needs a division.
struct ExactShape {
    /// From the first end to the ray's origin.
    w: Vector,
    d: Vector,
    axis: Vector,
    r0: Dyadic,
    r1: Dyadic,
    delta: Dyadic,
    g: Dyadic,
    /// The shape ends at u = cut / whole; both are 1 where no radius is negative.
    end_numerator: Dyadic,
    end_denominator: Dyadic,
    has_apex: bool,
}

impl ExactShape {
    fn new(ray: &ObjectRay, positions: [[f32; 3]; 2], radii: [f32; 2]) -> Self {
        let ray = ray.exact();
        let [p0, p1] = positions.map(exact::vector);
        let [r0, r1] = radii.map(Dyadic::from_f32);
        let has_apex = r1.sign() < 0;
        let one = Dyadic::integer(1);
        // The radius r0 + u (r1 - r0) is 0 at u = r0 / (r0 - r1).
        let (end_numerator, end_denominator, r1) =
            if has_apex { (r0.clone(), &r0 - &r1, Dyadic::zero()) } else { (one.clone(), one, r1) };
        let length = &ray.weight * &end_denominator;
        let axis = exact::scale(&(&ray.weight * &end_numerator), &exact::sub(&p1, &p0));
        let (r0, r1) = (&length * &r0, &length * &r1);
        let delta = &r1 - &r0;
        let g = &exact::dot(&axis, &axis) - &delta.square();
        Self {
            w: exact::scale(&end_denominator, &ray.origin_from(&p0)),
            d: exact::scale(&end_denominator, &ray.direction),
            axis,
            r0,
            r1,
            delta,
            g,
            end_numerator,
            end_denominator,
            has_apex,
        }
    }

    fn entry(&self) -> Option<Entry> {
        if self.d.iter().all(Dyadic::is_zero) {
            return None;
        }
        if self.g.sign() <= 0 {
            let end = usize::from(self.r1.compare(&self.r0) == Ordering::Greater);
            return Some(Entry::Cap(end, self.sphere(end)?));
        }
        // Along the line: a touch at the far end's boundary must not hide an earlier entry.
        let (_, b) = self.line();
        let order = if b.sign() < 0 { [1, 0] } else { [0, 1] };
        if let Some(entry) = self.end(order[0]) {
            return Some(entry);
        }
        if let Some(t) = self.cone()
            && self.sweep(&t).sign() > 0
            && self.sweep(&t).compare(&self.g) == Ordering::Less
        {
            return Some(Entry::Side(t));
        }
        self.end(order[1])
    }

    /// The entry of an end's sphere where it is the hull's.
    fn end(&self, end: usize) -> Option<Entry> {
        let t = self.sphere(end)?;
        let position = self.sweep(&t);
        let owned = if end == 0 { position.sign() <= 0 } else { position.compare(&self.g) != Ordering::Less };
        let entry = |t| if self.has_apex && end == 1 { Entry::Apex(t) } else { Entry::Cap(end, t) };
        owned.then(|| entry(t))
    }

    fn sphere(&self, end: usize) -> Option<Surd> {
        if end == 0 {
            sphere::entry_exactly(&self.w, &self.d, &self.r0)
        } else {
            sphere::entry_exactly(&exact::sub(&self.w, &self.axis), &self.d, &self.r1)
        }
    }

    /// Where the cone's quadratic falls through 0; `None` where it never does.
    fn cone(&self) -> Option<Surd> {
        let (a, b) = self.line();
        let dd = exact::dot(&self.d, &self.d);
        let wd = exact::dot(&self.w, &self.d);
        let ww = &exact::dot(&self.w, &self.w) - &self.r0.square();
        let qa = &(&self.g * &dd) - &b.square();
        let qb = &(&self.g * &wd) - &(&a * &b);
        let qc = &(&self.g * &ww) - &a.square();
        if qa.is_zero() {
            return (qb.sign() < 0).then(|| Surd::ratio(-&qc, &qb * &Dyadic::integer(2)));
        }
        let discriminant = &qb.square() - &(&qa * &qc);
        (discriminant.sign() >= 0).then(|| Surd::new(-&qb, Dyadic::integer(-1), discriminant, qa))
    }

    /// a and b of u* g = a + b t.
    fn line(&self) -> (Dyadic, Dyadic) {
        let a = &exact::dot(&self.w, &self.axis) + &(&self.r0 * &self.delta);
        (a, exact::dot(&self.d, &self.axis))
    }

    /// a + b t.
    fn sweep(&self, t: &Surd) -> Surd {
        let (a, b) = self.line();
        t.affine(&a, &b, &Dyadic::integer(1))
    }

    /// u of the uncut shape at a point of the side.
    fn parameter(&self, t: &Surd) -> Surd {
        let (a, b) = self.line();
        t.affine(&(&a * &self.end_numerator), &(&b * &self.end_numerator), &(&self.g * &self.end_denominator))
    }
}
