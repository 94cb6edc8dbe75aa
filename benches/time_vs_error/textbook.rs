//! Published intersection formulas of textbooks and articles, in f32. None has an error bound.
#![allow(clippy::needless_range_loop, reason = "an axis numbers several arrays")]

use anyhit_engine::geometry::{Bounds, Ray};
use anyhit_engine::math::f32x4::F32x4;
use anyhit_engine::math::lane_ops::LaneOps;

use crate::contender::{Contender, PlacedInstance};
use crate::shape::Shape;

type PerLane = [f32; 4];
type Vec3x4 = [F32x4; 3];

/// An f32 ray in object space, and the divisors of the formulas.
#[derive(Clone, Copy)]
pub struct PlainRay {
    pub origin: [f32; 3],
    pub direction: [f32; 3],
    /// d.d and its inverse.
    dd: f32,
    inverse: f32,
    t_min: f32,
    t_max: f32,
}

/// A formula over blocks and rays that others share.
pub trait Textbook {
    type Block: PrimitiveBlock;
    type Ray: TextbookRay;

    /// See [`Contender::maybe_hit_mask`].
    fn maybe_hit_mask(block: &Self::Block, ray: &Self::Ray) -> u32;
    /// See [`Contender::hit`].
    fn hit(block: &Self::Block, lane: usize, ray: &Self::Ray) -> Option<f32>;
}

/// Four primitives.
pub trait PrimitiveBlock {
    fn new(shapes: &[Shape]) -> Self;
}

/// A ray in object space.
pub trait TextbookRay: Copy {
    const EMPTY: Self;
    fn new(ray: &Ray, placed: &PlacedInstance) -> Self;
}

impl<T: Textbook> Contender for T {
    type Block = T::Block;
    type PreparedRay = T::Ray;
    const EMPTY: T::Ray = T::Ray::EMPTY;

    fn block(shapes: &[Shape]) -> Self::Block {
        T::Block::new(shapes)
    }

    #[inline(always)]
    fn prepare(out: &mut T::Ray, ray: &Ray, placed: &PlacedInstance, _: &Bounds) {
        *out = T::Ray::new(ray, placed);
    }

    #[inline(always)]
    fn maybe_hit_mask<V: LaneOps>(_: V, block: &Self::Block, ray: &T::Ray) -> u32 {
        T::maybe_hit_mask(block, ray)
    }

    #[inline(always)]
    fn hit<V: LaneOps>(
        _: V,
        (block, lane): (&Self::Block, usize),
        ray: &mut T::Ray,
        _: (&Ray, &PlacedInstance),
    ) -> Option<f32> {
        T::hit(block, lane, ray)
    }
}

impl TextbookRay for PlainRay {
    const EMPTY: Self =
        Self { origin: [0.0; 3], direction: [0.0; 3], dd: 0.0, inverse: 0.0, t_min: 0.0, t_max: 0.0 };

    #[inline(always)]
    fn new(ray: &Ray, placed: &PlacedInstance) -> Self {
        let (mut origin, mut direction) = (ray.origin, ray.direction);
        if placed.transform.is_some() {
            let m = &placed.inverse;
            origin = m
                .map(|row| row[0] * ray.origin[0] + row[1] * ray.origin[1] + row[2] * ray.origin[2] + row[3]);
            direction = m
                .map(|row| row[0] * ray.direction[0] + row[1] * ray.direction[1] + row[2] * ray.direction[2]);
        }
        let dd = dot1(direction, direction);
        PlainRay { origin, direction, dd, inverse: 1.0 / dd, t_min: ray.t_min, t_max: ray.t_max }
    }
}

impl PlainRay {
    #[inline(always)]
    fn within(&self, t: f32) -> Option<f32> {
        (t >= self.t_min && t <= self.t_max).then_some(t)
    }
}

#[inline(always)]
fn dot1(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn sub1(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn cross1(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline(always)]
fn splat(v: [f32; 3]) -> Vec3x4 {
    v.map(F32x4::splat)
}

#[inline(always)]
fn load(rows: &[PerLane; 3]) -> Vec3x4 {
    rows.map(F32x4::new)
}

#[inline(always)]
fn sub(a: Vec3x4, b: Vec3x4) -> Vec3x4 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn dot(a: Vec3x4, b: Vec3x4) -> F32x4 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn cross(a: Vec3x4, b: Vec3x4) -> Vec3x4 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline(always)]
fn not_negative(x: F32x4) -> u32 {
    x.cmp_ge(F32x4::splat(0.0))
}

pub struct SphereBlock {
    center: [PerLane; 3],
    radius: PerLane,
}

impl PrimitiveBlock for SphereBlock {
    fn new(shapes: &[Shape]) -> Self {
        // An empty lane is far away from everything.
        let mut out = Self { center: [[1e9; 4]; 3], radius: [0.0; 4] };
        for (lane, shape) in shapes.iter().enumerate() {
            let Shape::Sphere(center, radius) = *shape else { panic!("a BLAS of two kinds") };
            (0..3).for_each(|i| out.center[i][lane] = center[i]);
            out.radius[lane] = radius;
        }
        out
    }
}

impl SphereBlock {
    #[inline(always)]
    fn lane(&self, lane: usize) -> ([f32; 3], f32) {
        (self.center.map(|row| row[lane]), self.radius[lane])
    }
}

/// The quadratic formula of textbooks.
pub struct NaiveSphere;

impl Textbook for NaiveSphere {
    type Block = SphereBlock;
    type Ray = PlainRay;

    #[inline(always)]
    fn maybe_hit_mask(block: &SphereBlock, ray: &PlainRay) -> u32 {
        let m = sub(splat(ray.origin), load(&block.center));
        let b = dot(m, splat(ray.direction));
        let r = F32x4::new(block.radius);
        let c = dot(m, m) - r * r;
        not_negative(b * b - F32x4::splat(ray.dd) * c)
    }

    #[inline(always)]
    fn hit(block: &SphereBlock, lane: usize, ray: &PlainRay) -> Option<f32> {
        let (center, radius) = block.lane(lane);
        let m = sub1(ray.origin, center);
        let b = dot1(m, ray.direction);
        let c = dot1(m, m) - radius * radius;
        let discriminant = b * b - ray.dd * c;
        ray.within((-b - discriminant.sqrt()) * ray.inverse)
    }
}

/// The origin moved to the point of the line that is closest to the centre (Haines, Günther and
/// Akenine-Möller, *Precision improvements for ray/sphere intersection*, 2019).
pub struct RecentredSphere;

impl Textbook for RecentredSphere {
    type Block = SphereBlock;
    type Ray = PlainRay;

    #[inline(always)]
    fn maybe_hit_mask(block: &SphereBlock, ray: &PlainRay) -> u32 {
        let d = splat(ray.direction);
        let m = sub(splat(ray.origin), load(&block.center));
        let s = dot(m, d) * F32x4::splat(ray.inverse);
        let l = sub(m, [s * d[0], s * d[1], s * d[2]]);
        let r = F32x4::new(block.radius);
        not_negative(r * r - dot(l, l))
    }

    #[inline(always)]
    fn hit(block: &SphereBlock, lane: usize, ray: &PlainRay) -> Option<f32> {
        let (center, radius) = block.lane(lane);
        let m = sub1(ray.origin, center);
        let b = dot1(m, ray.direction);
        let s = b * ray.inverse;
        let l = sub1(m, ray.direction.map(|x| s * x));
        let root = (ray.dd * (radius * radius - dot1(l, l))).sqrt();
        let c = dot1(m, m) - radius * radius;
        let t = if b <= 0.0 { c / (root - b) } else { (-b - root) * ray.inverse };
        ray.within(t)
    }
}

pub struct SweptBlock {
    positions: [[PerLane; 3]; 2],
    radii: [PerLane; 2],
}

impl PrimitiveBlock for SweptBlock {
    fn new(shapes: &[Shape]) -> Self {
        let mut out =
            Self { positions: [[[1e9; 4]; 3], [[1e9; 4], [1e9; 4], [2e9; 4]]], radii: [[0.0; 4]; 2] };
        for (lane, shape) in shapes.iter().enumerate() {
            let Shape::Swept(positions, radii) = *shape else { panic!("a BLAS of two kinds") };
            for end in 0..2 {
                (0..3).for_each(|i| out.positions[end][i][lane] = positions[end][i]);
                out.radii[end][lane] = radii[end];
            }
        }
        out
    }
}

impl SweptBlock {
    #[inline(always)]
    fn lane(&self, lane: usize) -> ([[f32; 3]; 2], [f32; 2]) {
        (self.positions.map(|rows| rows.map(|row| row[lane])), self.radii.map(|row| row[lane]))
    }
}

/// The round cone as commonly published: the cone's quadratic, its root where that lies between the
/// ends, otherwise the nearer of the two spheres.
pub struct RoundCone<const RECENTRED: bool>;

impl<const RECENTRED: bool> Textbook for RoundCone<RECENTRED> {
    type Block = SweptBlock;
    type Ray = PlainRay;

    #[inline(always)]
    fn maybe_hit_mask(block: &SweptBlock, ray: &PlainRay) -> u32 {
        let [p, q] = [load(&block.positions[0]), load(&block.positions[1])];
        let [r0, r1] = block.radii.map(F32x4::new);
        let d = splat(ray.direction);
        let axis = sub(q, p);
        let mut w = sub(splat(ray.origin), p);
        if RECENTRED {
            let s = dot(w, d) * F32x4::splat(ray.inverse);
            w = sub(w, [s * d[0], s * d[1], s * d[2]]);
        }
        let slope = r0 - r1;
        let dd = F32x4::splat(ray.dd);
        let (m0, m1, m2) = (dot(axis, axis), dot(axis, w), dot(axis, d));
        let (m3, m5) = (dot(d, w), dot(w, w));
        let g = m0 - slope * slope;
        let k2 = g * dd - m2 * m2;
        let y0 = m1 - slope * r0;
        let k1 = g * m3 - y0 * m2;
        let k0 = g * (m5 - r0 * r0) - y0 * y0;
        not_negative(k1 * k1 - k0 * k2)
    }

    #[inline(always)]
    fn hit(block: &SweptBlock, lane: usize, ray: &PlainRay) -> Option<f32> {
        let ([p, q], [r0, r1]) = block.lane(lane);
        let d = ray.direction;
        let axis = sub1(q, p);
        let mut w = sub1(ray.origin, p);
        let mut moved = 0.0;
        if RECENTRED {
            moved = -dot1(w, d) * ray.inverse;
            w = sub1(w, d.map(|x| -moved * x));
        }
        let slope = r0 - r1;
        let (m0, m1, m2) = (dot1(axis, axis), dot1(axis, w), dot1(axis, d));
        let (m3, m5) = (dot1(d, w), dot1(w, w));
        let g = m0 - slope * slope;
        let k2 = g * ray.dd - m2 * m2;
        let y0 = m1 - slope * r0;
        let k1 = g * m3 - y0 * m2;
        let k0 = g * (m5 - r0 * r0) - y0 * y0;
        let h = k1 * k1 - k0 * k2;
        if h < 0.0 {
            return None;
        }
        let t = (-h.sqrt() - k1) / k2;
        let y = y0 + t * m2;
        if y > 0.0 && y < g {
            return ray.within(t + moved);
        }
        let v = sub1(w, axis);
        let (m6, m7) = (dot1(v, d), dot1(v, v));
        let h0 = m3 * m3 - ray.dd * (m5 - r0 * r0);
        let h1 = m6 * m6 - ray.dd * (m7 - r1 * r1);
        let enter = |b: f32, h: f32| if h > 0.0 { (-b - h.sqrt()) * ray.inverse } else { f32::INFINITY };
        let t = enter(m3, h0).min(enter(m6, h1));
        if t.is_finite() { ray.within(t + moved) } else { None }
    }
}

/// A capsule by the distance of two lines, its caps by their spheres; of the greater radius where
/// the two differ, which is wrong there.
pub struct CapsuleByDistance;

impl Textbook for CapsuleByDistance {
    type Block = SweptBlock;
    type Ray = PlainRay;

    #[inline(always)]
    fn maybe_hit_mask(block: &SweptBlock, ray: &PlainRay) -> u32 {
        let [p, q] = [load(&block.positions[0]), load(&block.positions[1])];
        let [r0, r1] = block.radii.map(F32x4::new);
        let r = r0.relaxed_max(r1);
        let n = cross(splat(ray.direction), sub(q, p));
        let volume = dot(sub(splat(ray.origin), p), n);
        (r * r * dot(n, n)).cmp_ge(volume * volume)
    }

    #[inline(always)]
    fn hit(block: &SweptBlock, lane: usize, ray: &PlainRay) -> Option<f32> {
        let ([p, q], radii) = block.lane(lane);
        let r = radii[0].max(radii[1]);
        let d = ray.direction;
        let (axis, w) = (sub1(q, p), sub1(ray.origin, p));
        let (aa, ad, aw) = (dot1(axis, axis), dot1(axis, d), dot1(axis, w));
        let (dw, ww) = (dot1(d, w), dot1(w, w));
        let a = aa * ray.dd - ad * ad;
        let b = aa * dw - aw * ad;
        let c = aa * ww - aw * aw - r * r * aa;
        let h = b * b - a * c;
        if h < 0.0 {
            return None;
        }
        let t = (-b - h.sqrt()) / a;
        let y = aw + t * ad;
        if y > 0.0 && y < aa {
            return ray.within(t);
        }
        let m = if y <= 0.0 { w } else { sub1(ray.origin, q) };
        let b = dot1(d, m);
        let h = b * b - ray.dd * (dot1(m, m) - r * r);
        if h > 0.0 { ray.within((-b - h.sqrt()) * ray.inverse) } else { None }
    }
}

pub struct TriangleBlock {
    vertices: [[PerLane; 3]; 3],
}

impl PrimitiveBlock for TriangleBlock {
    fn new(shapes: &[Shape]) -> Self {
        let mut out = Self { vertices: [[[1e9; 4]; 3]; 3] };
        for (lane, shape) in shapes.iter().enumerate() {
            let Shape::Triangle(vertices) = *shape else { panic!("a BLAS of two kinds") };
            for (rows, vertex) in out.vertices.iter_mut().zip(vertices) {
                (0..3).for_each(|i| rows[i][lane] = vertex[i]);
            }
        }
        out
    }
}

impl TriangleBlock {
    #[inline(always)]
    fn vertex(&self, number: usize, lane: usize) -> [f32; 3] {
        let [x, y, z] = &self.vertices[number];
        [x[lane], y[lane], z[lane]]
    }
}

/// Möller and Trumbore 1997.
pub struct MoellerTrumbore;

impl Textbook for MoellerTrumbore {
    type Block = TriangleBlock;
    type Ray = PlainRay;

    #[inline(always)]
    fn maybe_hit_mask(block: &TriangleBlock, ray: &PlainRay) -> u32 {
        let [a, b, c] = &block.vertices;
        let (v0, v1, v2) = (load(a), load(b), load(c));
        let d = splat(ray.direction);
        let (e1, e2, w) = (sub(v1, v0), sub(v2, v0), sub(splat(ray.origin), v0));
        let p = cross(d, e2);
        let det = dot(e1, p);
        let inverse = F32x4::splat(1.0) / det;
        let u = dot(w, p) * inverse;
        let v = dot(d, cross(w, e1)) * inverse;
        let zero = F32x4::splat(0.0);
        u.cmp_ge(zero) & v.cmp_ge(zero) & F32x4::splat(1.0).cmp_ge(u + v)
    }

    #[inline(always)]
    fn hit(block: &TriangleBlock, lane: usize, ray: &PlainRay) -> Option<f32> {
        let (v0, v1, v2) = (block.vertex(0, lane), block.vertex(1, lane), block.vertex(2, lane));
        let (e1, e2, w) = (sub1(v1, v0), sub1(v2, v0), sub1(ray.origin, v0));
        let p = cross1(ray.direction, e2);
        let inverse = 1.0 / dot1(e1, p);
        let q = cross1(w, e1);
        let (u, v) = (dot1(w, p) * inverse, dot1(ray.direction, q) * inverse);
        std::hint::black_box((u, v));
        ray.within(dot1(e2, q) * inverse)
    }
}

/// The watertight test in ray space (Woop, Benthin and Wald 2013).
pub struct Woop;

#[derive(Clone, Copy)]
pub struct WoopRay {
    plain: PlainRay,
    axes: [usize; 3],
    shear: [f32; 3],
}

impl TextbookRay for WoopRay {
    const EMPTY: Self = Self { plain: PlainRay::EMPTY, axes: [0; 3], shear: [0.0; 3] };

    #[inline(always)]
    fn new(ray: &Ray, placed: &PlacedInstance) -> Self {
        let plain = PlainRay::new(ray, placed);
        let d = plain.direction;
        let first = if d[1].abs() > d[0].abs() { 1 } else { 0 };
        let z = if d[2].abs() > d[first].abs() { 2 } else { first };
        let (x, y) = ((z + 1) % 3, (z + 2) % 3);
        let inverse = 1.0 / d[z];
        Self { plain, axes: [x, y, z], shear: [d[x] * inverse, d[y] * inverse, inverse] }
    }
}

impl Textbook for Woop {
    type Block = TriangleBlock;
    type Ray = WoopRay;

    #[inline(always)]
    fn maybe_hit_mask(block: &TriangleBlock, ray: &WoopRay) -> u32 {
        let [x, y, z] = ray.axes;
        let origin = [x, y, z].map(|axis| F32x4::splat(ray.plain.origin[axis]));
        let [sx, sy] = [ray.shear[0], ray.shear[1]].map(F32x4::splat);
        let sheared = |rows: &[PerLane; 3]| {
            let depth = F32x4::new(rows[z]) - origin[2];
            let at = (F32x4::new(rows[x]) - origin[0]) - sx * depth;
            (at, (F32x4::new(rows[y]) - origin[1]) - sy * depth)
        };
        let [a, b, c] = &block.vertices;
        let (a, b, c) = (sheared(a), sheared(b), sheared(c));
        let (u, v, w) = (c.0 * b.1 - c.1 * b.0, a.0 * c.1 - a.1 * c.0, b.0 * a.1 - b.1 * a.0);
        let zero = F32x4::splat(0.0);
        let least = u.relaxed_min(v).relaxed_min(w);
        let most = u.relaxed_max(v).relaxed_max(w);
        least.cmp_ge(zero) | zero.cmp_ge(most)
    }

    #[inline(always)]
    fn hit(block: &TriangleBlock, lane: usize, ray: &WoopRay) -> Option<f32> {
        let [x, y, z] = ray.axes;
        let o = ray.plain.origin;
        let sheared = |k: usize| {
            let v = block.vertex(k, lane);
            let depth = v[z] - o[z];
            (v[x] - o[x] - ray.shear[0] * depth, v[y] - o[y] - ray.shear[1] * depth, ray.shear[2] * depth)
        };
        let (a, b, c) = (sheared(0), sheared(1), sheared(2));
        let (u, v, w) = (c.0 * b.1 - c.1 * b.0, a.0 * c.1 - a.1 * c.0, b.0 * a.1 - b.1 * a.0);
        let det = u + v + w;
        if det == 0.0 {
            return None;
        }
        let inverse = 1.0 / det;
        std::hint::black_box((v * inverse, w * inverse));
        ray.plain.within((u * a.2 + v * b.2 + w * c.2) * inverse)
    }
}

pub struct BoxBlock {
    sides: [[PerLane; 3]; 2],
}

impl PrimitiveBlock for BoxBlock {
    fn new(shapes: &[Shape]) -> Self {
        let mut out = Self { sides: [[[1e9; 4]; 3]; 2] };
        for (lane, shape) in shapes.iter().enumerate() {
            let Shape::Aabb(corners) = *shape else { panic!("a BLAS of two kinds") };
            for (rows, corner) in out.sides.iter_mut().zip(corners) {
                (0..3).for_each(|i| rows[i][lane] = corner[i]);
            }
        }
        out
    }
}

/// A ray and the reciprocals of its direction.
impl TextbookRay for (PlainRay, [f32; 3]) {
    const EMPTY: Self = (PlainRay::EMPTY, [0.0; 3]);

    #[inline(always)]
    fn new(ray: &Ray, placed: &PlacedInstance) -> Self {
        let plain = PlainRay::new(ray, placed);
        (plain, plain.direction.map(|x| 1.0 / x))
    }
}

/// The slab test of boxes.
pub struct Slabs;

impl Textbook for Slabs {
    type Block = BoxBlock;
    type Ray = (PlainRay, [f32; 3]);

    #[inline(always)]
    fn maybe_hit_mask(block: &BoxBlock, (ray, inverse): &Self::Ray) -> u32 {
        let mut near = F32x4::splat(ray.t_min);
        let mut far = F32x4::splat(ray.t_max);
        for i in 0..3 {
            let [a, b] = [0, 1].map(|side: usize| {
                (F32x4::new(block.sides[side][i]) - F32x4::splat(ray.origin[i])) * F32x4::splat(inverse[i])
            });
            near = near.relaxed_max(a.relaxed_min(b));
            far = far.relaxed_min(a.relaxed_max(b));
        }
        far.cmp_ge(near)
    }

    #[inline(always)]
    fn hit(block: &BoxBlock, lane: usize, (ray, inverse): &Self::Ray) -> Option<f32> {
        let mut near = ray.t_min;
        for i in 0..3 {
            let [a, b] = [0, 1].map(|side: usize| (block.sides[side][i][lane] - ray.origin[i]) * inverse[i]);
            near = near.max(a.min(b));
        }
        Some(near)
    }
}
