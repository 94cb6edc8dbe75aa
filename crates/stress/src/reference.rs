//! Intersections in rational numbers and square roots of these, an independent implementation of
//! SEMANTICS: slow, with divisions, and in each step formulated differently from the code under
//! test.

pub mod motion;

use std::cmp::Ordering;

use dashu_ratio::RBig;

use anyhit_engine::geometry::{Bounds, Ray, Surface};

/// What a ray hits, before any interval is considered.
#[derive(Debug)]
pub struct Expected {
    /// The parameter of the ray.
    pub t: Root,
    /// The attributes, as in `Intersection`, for the surface that is hit.
    pub attributes: Vec<Root>,
    /// Which surface is entered.
    pub surface: Surface,
}

/// `p + s sqrt(r)` with s -1, 0 or 1.
#[derive(Clone, Debug)]
pub struct Root {
    p: RBig,
    s: i32,
    r: RBig,
}

impl From<RBig> for Root {
    fn from(p: RBig) -> Self {
        Self { p, s: 0, r: RBig::ZERO }
    }
}

impl Root {
    /// p, s and r of `p + s sqrt(r)`.
    pub fn parts(&self) -> (&RBig, i32, &RBig) {
        (&self.p, self.s, &self.r)
    }

    /// `a + b self`.
    fn affine(&self, a: &RBig, b: &RBig) -> Self {
        Self { p: a + b * &self.p, s: self.s * sign(b), r: &self.r * b * b }
    }

    /// Compares two values.
    pub fn compare(&self, other: &Self) -> Ordering {
        let a = &self.p - &other.p;
        let (s1, s2) = (self.s * sign(&self.r), -other.s * sign(&other.r));
        // The sign of the two roots' sum S, then of a + S.
        let roots = match (s1, s2) {
            (0, s) | (s, 0) => s,
            (s, z) if s == z => s,
            _ => s1 * self.r.cmp(&other.r) as i32,
        };
        let total = if sign(&a) * roots >= 0 {
            if roots == 0 { sign(&a) } else { roots }
        } else {
            // a^2 - S^2 = (a^2 - r1 - r2) - 2 s1 s2 sqrt(r1 r2).
            let rest = &a * &a - &self.r * rational((s1 * s1) as f32) - &other.r * rational((s2 * s2) as f32);
            sign(&a) * sign_with_root(&rest, -s1 * s2, &(&self.r * &other.r * rational(4.0)))
        };
        total.cmp(&0)
    }

    fn compare_rational(&self, other: &RBig) -> Ordering {
        sign_with_root(&(&self.p - other), self.s, &self.r).cmp(&0)
    }

    /// Whether it is in the interval of a ray, and within the range of f32.
    pub fn is_within(&self, t_min: f32, t_max: f32, is_open: bool) -> bool {
        let low = self.compare_rational(&rational(t_min));
        let high = if t_max.is_infinite() { Ordering::Less } else { self.compare_rational(&rational(t_max)) };
        let inside = if is_open { low.is_gt() && high.is_lt() } else { low.is_ge() && high.is_le() };
        inside && !self.rounds_to(f32::INFINITY)
    }

    /// Its value to a relative error of about 2^-50; only used to print how far off another value
    /// is.
    pub fn to_f64(&self) -> f64 {
        let p = self.p.to_f64().value();
        let root = f64::from(self.s) * self.r.to_f64().value().sqrt();
        if p * root >= 0.0 {
            return p + root;
        }
        // p + q = (p^2 - q^2) / (p - q), without cancellation.
        let product = (&self.p * &self.p - &self.r).to_f64().value();
        product / (p - root)
    }

    /// Whether `value` is its nearest f32, ties to even.
    pub fn rounds_to(&self, value: f32) -> bool {
        // The number half-way to a neighbour; 2^128 stands for the neighbour of MAX.
        let half = |neighbour: f32| {
            let extended = |x: f32| {
                if x.is_finite() {
                    rational(x)
                } else {
                    rational(x.signum()) * rational(2f32.powi(64)) * rational(2f32.powi(64))
                }
            };
            (extended(value) + extended(neighbour)) / rational(2.0)
        };
        let even = value.to_bits() & 1 == 0;
        let above = value == f32::NEG_INFINITY || {
            let order = self.compare_rational(&half(value.next_down()));
            order.is_gt() || (even && order.is_eq())
        };
        let below = value == f32::INFINITY || {
            let order = self.compare_rational(&half(value.next_up()));
            order.is_lt() || (even && order.is_eq())
        };
        !value.is_nan() && above && below
    }
}

/// The sign of p + s sqrt(r).
fn sign_with_root(p: &RBig, s: i32, r: &RBig) -> i32 {
    let s = s * sign(r);
    if s == 0 || sign(p) == s {
        return sign(p);
    }
    if sign(p) == 0 { s } else { sign(p) * (p * p).cmp(r) as i32 }
}

fn sign(x: &RBig) -> i32 {
    x.cmp(&RBig::ZERO) as i32
}

fn rational(x: f32) -> RBig {
    RBig::try_from(x).expect("finite")
}

fn vector(v: [f32; 3]) -> [RBig; 3] {
    v.map(rational)
}

fn dot(a: &[RBig; 3], b: &[RBig; 3]) -> RBig {
    &a[0] * &b[0] + &a[1] * &b[1] + &a[2] * &b[2]
}

fn combine(a: &[RBig; 3], s: &RBig, b: &[RBig; 3]) -> [RBig; 3] {
    std::array::from_fn(|i| &a[i] + s * &b[i])
}

fn difference(a: &[RBig; 3], b: &[RBig; 3]) -> [RBig; 3] {
    std::array::from_fn(|i| &a[i] - &b[i])
}

/// Solves a 3x3 system by elimination with row exchange; `None` where it is singular.
fn solve(mut rows: [[RBig; 4]; 3]) -> Option<[RBig; 3]> {
    for column in 0..3 {
        let pivot = (column..3).find(|&row| sign(&rows[row][column]) != 0)?;
        rows.swap(column, pivot);
        let lead = rows[column].clone();
        for row in (0..3).filter(|&row| row != column) {
            let factor = &rows[row][column] / &lead[column];
            rows[row] = std::array::from_fn(|k| &rows[row][k] - &factor * &lead[k]);
        }
    }
    Some(std::array::from_fn(|i| &rows[i][3] / &rows[i][i]))
}

/// The roots of `a t^2 + 2 b t + c`, ascending: two, one if it is linear, none if it has no zeros
/// or is zero everywhere.
fn roots(a: &RBig, b: &RBig, c: &RBig) -> Vec<Root> {
    if sign(a) == 0 {
        return if sign(b) == 0 { vec![] } else { vec![Root::from(-c / (b + b))] };
    }
    let p = -(b / a);
    let r = &p * &p - c / a;
    if sign(&r) < 0 {
        return vec![];
    }
    [-1, 1].map(|s| Root { p: p.clone(), s, r: r.clone() }).to_vec()
}

/// A ray's line in object space.
#[derive(Debug)]
pub struct ObjectLine {
    /// The point at t = 0.
    pub origin: [RBig; 3],
    /// The vector per unit of t.
    pub direction: [RBig; 3],
}

impl ObjectLine {
    /// `None` where the matrix is singular.
    pub fn new(ray: &Ray, matrix: Option<&[[f32; 4]; 3]>) -> Option<Self> {
        let (origin, direction) = (vector(ray.origin), vector(ray.direction));
        let Some(m) = matrix else { return Some(Self { origin, direction }) };
        let solve_for = |v: &[RBig; 3]| {
            solve(std::array::from_fn(|i| {
                std::array::from_fn(|j| if j < 3 { rational(m[i][j]) } else { v[i].clone() })
            }))
        };
        let translation: [RBig; 3] = std::array::from_fn(|i| rational(m[i][3]));
        Some(Self {
            origin: solve_for(&difference(&origin, &translation))?,
            direction: solve_for(&direction)?,
        })
    }

    /// Origin and direction in f64, only used to skip shapes that are far away.
    pub fn to_f64(&self) -> ([f64; 3], [f64; 3]) {
        let near = |v: &[RBig; 3]| std::array::from_fn(|i| v[i].to_f64().value());
        (near(&self.origin), near(&self.direction))
    }

    fn has_zero_direction(&self) -> bool {
        self.direction.iter().all(|x| sign(x) == 0)
    }

    /// The parameter at which the line enters a ball.
    fn ball_entry(&self, center: &[RBig; 3], radius: &RBig) -> Option<Root> {
        let m = difference(&self.origin, center);
        let (a, b) = (dot(&self.direction, &self.direction), dot(&self.direction, &m));
        roots(&a, &b, &(dot(&m, &m) - radius * radius)).into_iter().next()
    }

    /// The hit where the line enters a sphere.
    pub fn sphere(&self, center: [f32; 3], radius: f32) -> Option<Expected> {
        if self.has_zero_direction() || radius <= 0.0 {
            return None;
        }
        let t = self.ball_entry(&vector(center), &rational(radius))?;
        Some(Expected { t, attributes: vec![], surface: Surface::Sphere })
    }

    /// The hull is the union of the two balls and of the cone between its circles of contact; the
    /// entry is the least parameter of the three, and its surface follows from u*.
    pub fn linear_swept_sphere(
        &self,
        positions: [[f32; 3]; 2],
        radii: [f32; 2],
        caps: [bool; 2],
    ) -> Option<Expected> {
        if self.has_zero_direction() || radii.iter().all(|&r| r <= 0.0) {
            return None;
        }
        let [mut p0, mut p1] = positions.map(vector);
        let [mut r0, mut r1] = radii.map(rational);
        // u of the given shape, from u' of the shape that ends in its apex: first + u' rate.
        let (mut first, mut rate) = (RBig::ZERO, RBig::ONE);
        let mut is_apex = [false; 2];
        let axis = difference(&p1, &p0);
        let apex = || &r0 / (&r0 - &r1);
        if sign(&r1) < 0 {
            let u = apex();
            p1 = combine(&p0, &u, &axis);
            r1 = RBig::ZERO;
            rate = u;
            is_apex[1] = true;
        } else if sign(&r0) < 0 {
            let u = apex();
            p0 = combine(&p0, &u, &axis);
            r0 = RBig::ZERO;
            rate = RBig::ONE - &u;
            first = u;
            is_apex[0] = true;
        }
        let on_cap = |t: Root, end: usize| {
            let surface = [Surface::Cap0, Surface::Cap1][end];
            let u = Root::from(rational(end as f32));
            caps[end].then(|| Expected { t, attributes: vec![u], surface })
        };

        let axis = difference(&p1, &p0);
        let slope = &r1 - &r0;
        let g = dot(&axis, &axis) - &slope * &slope;
        if sign(&g) <= 0 {
            let end = usize::from(r1 > r0);
            let t = if end == 0 { self.ball_entry(&p0, &r0) } else { self.ball_entry(&p1, &r1) };
            return on_cap(t?, end);
        }

        // u* = at + by t; F(u*) = x.x - r0^2 - g u*^2.
        let w = difference(&self.origin, &p0);
        let at = (dot(&w, &axis) + &r0 * &slope) / &g;
        let by = dot(&self.direction, &axis) / &g;
        let a = dot(&self.direction, &self.direction) - &g * &by * &by;
        let b = dot(&self.direction, &w) - &g * &at * &by;
        let c = dot(&w, &w) - &r0 * &r0 - &g * &at * &at;
        let mut least: Vec<Root> =
            self.ball_entry(&p0, &r0).into_iter().chain(self.ball_entry(&p1, &r1)).collect();
        if sign(&by) == 0 {
            if sign(&at) >= 0 && at <= RBig::ONE {
                least.extend(roots(&a, &b, &c).into_iter().next());
            }
        } else {
            let mut slab = [-&at / &by, (RBig::ONE - &at) / &by];
            slab.sort();
            let [start, end] = slab;
            if sign(&((&a * &start + &b + &b) * &start + &c)) <= 0 {
                least.push(Root::from(start));
            } else {
                let within =
                    |t: &Root| t.compare_rational(&start).is_ge() && t.compare_rational(&end).is_le();
                least.extend(roots(&a, &b, &c).into_iter().find(within));
            }
        }
        let t = least.into_iter().min_by(Root::compare)?;
        let u = t.affine(&at, &by);
        let end = if u.compare_rational(&RBig::ZERO).is_le() {
            Some(0)
        } else if u.compare_rational(&RBig::ONE).is_ge() {
            Some(1)
        } else {
            None
        };
        match end {
            Some(end) if !is_apex[end] => on_cap(t, end),
            Some(end) => {
                // The apex of a shape with a negative radius belongs to no sphere.
                let u = Root::from(&first + &rate * rational(end as f32));
                Some(Expected { t, attributes: vec![u], surface: Surface::Side })
            }
            None => Some(Expected { t, attributes: vec![u.affine(&first, &rate)], surface: Surface::Side }),
        }
    }

    /// The solution of origin + t d = v0 + b e1 + c e2.
    pub fn triangle(&self, vertices: [[f32; 3]; 3]) -> Option<Expected> {
        let [v0, v1, v2] = vertices.map(vector);
        let (e1, e2) = (difference(&v1, &v0), difference(&v2, &v0));
        let intersect = |origin: &[RBig; 3]| {
            solve(std::array::from_fn(|i| {
                [-&self.direction[i], e1[i].clone(), e2[i].clone(), &origin[i] - &v0[i]]
            }))
        };
        let [t, b, c] = intersect(&self.origin)?;
        // An exact hit of an edge is decided as if the origin were moved by 2^-4800, which is less
        // than any quantity of 4,000 bits (simulation of simplicity).
        let a = RBig::ONE - &b - &c;
        if [&a, &b, &c].iter().any(|x| sign(x) == 0) {
            let size = |i: usize| {
                if sign(&self.direction[i]) < 0 { -&self.direction[i] } else { self.direction[i].clone() }
            };
            let greatest = (0..3).fold(0, |best, i| if size(i) > size(best) { i } else { best });
            let epsilon = (0..40).fold(RBig::ONE, |x, _| x * rational(2f32.powi(-120)));
            let mut moved = self.origin.clone();
            moved[(greatest + 1) % 3] += &epsilon;
            moved[(greatest + 2) % 3] += &epsilon * &epsilon;
            let [_, b, c] = intersect(&moved)?;
            let a = RBig::ONE - &b - &c;
            if [a, b, c].iter().any(|x| sign(x) < 0) {
                return None;
            }
        } else if [&a, &b, &c].iter().any(|x| sign(x) < 0) {
            return None;
        }
        // SEMANTICS 4.2: front if e1 x e2 points against the ray.
        let normal = [(1, 2), (2, 0), (0, 1)].map(|(i, j)| &e1[i] * &e2[j] - &e1[j] * &e2[i]);
        let front = sign(&dot(&normal, &self.direction)) < 0;
        Some(Expected {
            t: t.into(),
            attributes: vec![b.into(), c.into()],
            surface: if front { Surface::TriangleFront } else { Surface::TriangleBack },
        })
    }

    /// Clips the interval to each slab; returns its start if it is not empty.
    pub fn aabb(&self, min: [f32; 3], max: [f32; 3], t_min: f32, t_max: f32) -> Option<Root> {
        let mut start = rational(t_min);
        let mut end = t_max.is_finite().then(|| rational(t_max));
        for i in 0..3 {
            let (o, d) = (&self.origin[i], &self.direction[i]);
            let mut low = min[i].is_finite().then(|| rational(min[i]) - o);
            let mut high = max[i].is_finite().then(|| rational(max[i]) - o);
            if sign(d) == 0 {
                if low.is_some_and(|x| sign(&x) > 0) || high.is_some_and(|x| sign(&x) < 0) {
                    return None;
                }
                continue;
            }
            if sign(d) < 0 {
                std::mem::swap(&mut low, &mut high);
            }
            if let Some(low) = low {
                start = start.max(low / d);
            }
            if let Some(high) = high {
                let high = high / d;
                end = Some(end.map_or(high.clone(), |end| end.min(high)));
            }
        }
        let start = end.is_none_or(|end| start <= end).then(|| Root::from(start))?;
        (!start.rounds_to(f32::INFINITY)).then_some(start)
    }
}

/// Whether a box contains the whole ball.
pub fn contains_ball(bounds: &Bounds, center: [f32; 3], radius: f32) -> bool {
    (0..3).all(|i| {
        let (c, r) = (rational(center[i]), rational(radius));
        contains(bounds, i, &(&c - &r)) && contains(bounds, i, &(c + r))
    })
}

/// Whether a box contains the image of a point.
pub fn contains_image(bounds: &Bounds, matrix: &[[f32; 4]; 3], point: [f32; 3]) -> bool {
    let point = vector(point);
    (0..3).all(|i| {
        let row: [RBig; 3] = std::array::from_fn(|j| rational(matrix[i][j]));
        contains(bounds, i, &(dot(&row, &point) + rational(matrix[i][3])))
    })
}

fn contains(bounds: &Bounds, i: usize, x: &RBig) -> bool {
    let (min, max) = (bounds.min[i], bounds.max[i]);
    (min == f32::NEG_INFINITY || rational(min) <= *x) && (max == f32::INFINITY || rational(max) >= *x)
}
