//! The boxes around primitives, the boxes around instances, the nodes over both and the node test
//! together: of all primitives of several instances, each under a matrix of its own, traversal must
//! hand out exactly those that rational arithmetic meets, whatever the scale and wherever the ray
//! comes from.

use std::collections::BTreeSet;

use anyhit::Ray;
use anyhit_engine::accel::{Blas, Cursor, Geometry, GeometryFlags, RayFlags, Tlas, TlasInstance, TraceRay};
use anyhit_engine::geometry::linear_swept_sphere;
use anyhit_stress::draw::Draw;
use anyhit_stress::reference::ObjectLine;
use anyhit_stress::{Shape, StressCase};

use crate::rays::exact_intersections::cases;

type Matrix = [[f32; 4]; 3];

const IDENTITY: Matrix = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

/// More instances than are looked at without a tree.
const INSTANCES: usize = 6;
/// More primitives than are looked at without a tree, in leaves that are not full.
const PRIMITIVES: usize = 9;

/// A power of ten between 1e-30 and 1e30, mostly moderate.
fn scale(draw: &mut Draw) -> f32 {
    let exponent = match draw.below(3) {
        0 => draw.below(61) as i32 - 30,
        1 => [-30, -20, 20, 30][draw.below(4)],
        _ => draw.below(7) as i32 - 3,
    };
    10f32.powi(exponent)
}

fn shape(draw: &mut Draw, kind: usize, s: f32) -> Shape {
    let center = if draw.one_in(2) { draw.lattice(s) } else { draw.anywhere(8.0 * s) };
    let other = if draw.one_in(4) { center } else { draw.anywhere(8.0 * s) };
    let radius = |draw: &mut Draw| match draw.below(3) {
        0 => s,
        1 => draw.unit().abs() * s,
        _ => draw.unit().abs() * s * 1e-6,
    };
    match kind {
        0 => Shape::Triangle([center, other, draw.lattice(s)]),
        1 => {
            // Often flat in some direction.
            let flat = draw.below(8);
            let sides: [[f32; 2]; 3] = std::array::from_fn(|axis| {
                let end = if flat >> axis & 1 == 1 { center[axis] } else { other[axis] };
                [center[axis].min(end), center[axis].max(end)]
            });
            Shape::Aabb([sides.map(|side| side[0]), sides.map(|side| side[1])])
        }
        2 => Shape::Sphere { center, radius: radius(draw) },
        _ => Shape::LinearSweptSphere {
            positions: [center, other],
            radii: [radius(draw), radius(draw)],
            caps: [true; 2],
        },
    }
}

/// A point of a shape, or one a hair beside it.
fn point_of(draw: &mut Draw, shape: &Shape) -> [f32; 3] {
    match *shape {
        Shape::Triangle(vertices) => match draw.below(3) {
            0 => vertices[draw.below(3)],
            1 => std::array::from_fn(|axis| (vertices[0][axis] + vertices[1][axis]) * 0.5),
            _ => std::array::from_fn(|axis| {
                vertices[0][axis] * 0.5 + vertices[1][axis] * 0.25 + vertices[2][axis] * 0.25
            }),
        },
        Shape::MovingTriangle(_) => unreachable!("none is drawn"),
        Shape::Aabb([min, max]) => std::array::from_fn(|axis| match draw.below(3) {
            0 => min[axis],
            1 => max[axis],
            _ => min[axis] * 0.5 + max[axis] * 0.5,
        }),
        Shape::Sphere { center, radius } => beside(draw, center, radius),
        Shape::LinearSweptSphere { positions, radii, .. } => {
            let end = draw.below(2);
            beside(draw, positions[end], radii[end])
        }
    }
}

fn beside(draw: &mut Draw, center: [f32; 3], radius: f32) -> [f32; 3] {
    let along = draw.direction();
    let reach = radius * [0.0, 0.5, 1.0, 1.0 - f32::EPSILON][draw.below(4)];
    std::array::from_fn(|axis| center[axis] + along[axis] * reach)
}

/// A direction with zeros, of one axis, with denormals, huge, tiny, or any.
fn direction(draw: &mut Draw) -> [f32; 3] {
    let mut along = draw.direction();
    match draw.below(6) {
        0 => along[draw.below(3)] = 0.0,
        1 => along[draw.below(3)] = f32::from_bits(1 + draw.below(1000) as u32),
        2 => along[draw.below(3)] = -0.0,
        3 => along = along.map(|x| x * 1e30),
        4 => along = along.map(|x| x * 1e-30),
        _ => {}
    }
    if along.iter().all(|&x| x == 0.0) { [0.0, 0.0, 1.0] } else { along }
}

/// A matrix that neither leaves f32 nor is singular: turned, stretched, sheared, moved.
fn matrix(draw: &mut Draw, s: f32) -> Matrix {
    if draw.one_in(4) {
        return IDENTITY;
    }
    let mut m: Matrix = std::array::from_fn(|_| std::array::from_fn(|_| draw.small()));
    if draw.one_in(2) {
        m = std::array::from_fn(|_| std::array::from_fn(|_| draw.unit()));
    }
    for row in &mut m {
        row[3] = if draw.one_in(2) { 0.0 } else { draw.unit() * 8.0 * s };
    }
    m
}

/// A ray at a point of a shape in an instance, from near or from 1e12 away.
fn ray_at(draw: &mut Draw, point: [f32; 3], m: &Matrix, s: f32) -> Ray {
    let target: [f64; 3] = std::array::from_fn(|row| {
        (0..3).map(|axis| f64::from(m[row][axis]) * f64::from(point[axis])).sum::<f64>()
            + f64::from(m[row][3])
    });
    let along = direction(draw);
    let length = along.iter().map(|&x| f64::from(x).powi(2)).sum::<f64>().sqrt();
    let far = [0.0, 1.0, 64.0, 1e6, 1e12][draw.below(5)] * f64::from(s);
    let origin = std::array::from_fn(|axis| {
        (target[axis] - f64::from(along[axis]) / length * far).clamp(-1e38, 1e38) as f32
    });
    let ray = Ray::new(origin, along);
    if draw.one_in(4) { ray.with_interval(0.0, (far / length) as f32) } else { ray }
}

/// Whether rational arithmetic meets a shape within the ray's interval.
fn is_met(shape: &Shape, line: &ObjectLine, ray: &Ray) -> bool {
    let (expected, is_open) = match *shape {
        Shape::Triangle(vertices) => (line.triangle(vertices), true),
        Shape::MovingTriangle(_) => unreachable!("none is drawn"),
        Shape::Aabb([min, max]) => return line.aabb(min, max, ray.t_min, ray.t_max).is_some(),
        Shape::Sphere { center, radius } => (line.sphere(center, radius), false),
        Shape::LinearSweptSphere { positions, radii, caps } => {
            (line.linear_swept_sphere(positions, radii, caps), false)
        }
    };
    expected.is_some_and(|expected| expected.t.is_within(ray.t_min, ray.t_max, is_open))
}

fn check(seed: u64, kind: usize) {
    let mut draw = Draw::new(seed);
    let (mut met, mut scenes) = (0, 0);
    for _ in 0..cases(120) {
        let s = scale(&mut draw);
        let shapes: Vec<Shape> = (0..PRIMITIVES).map(|_| shape(&mut draw, kind, s)).collect();
        let case = StressCase::new(shapes.clone(), Ray::new([0.0; 3], [0.0, 0.0, 1.0]).into());
        let (geometries, _) = case.geometries().expect("shapes of one kind");
        // Not opaque: every primitive that the ray meets is handed out.
        let flags = GeometryFlags::default();
        let geometries = geometries.into_iter().map(|geometry| Geometry { flags, ..geometry });
        let blas = Blas::new(geometries.collect()).expect("legal primitives");
        let matrices: Vec<Matrix> = (0..INSTANCES).map(|_| matrix(&mut draw, s)).collect();
        let instances = matrices.iter().map(|&transform| TlasInstance::of(blas.clone(), transform));
        // Singular matrices are refused; there are plenty of others.
        let Ok(tlas) = Tlas::new(instances.collect()) else { continue };
        scenes += 1;
        for _ in 0..4 {
            let (instance, primitive) = (draw.below(INSTANCES), draw.below(PRIMITIVES));
            let point = point_of(&mut draw, &shapes[primitive]);
            let ray = ray_at(&mut draw, point, &matrices[instance], s);
            let mut expected = BTreeSet::new();
            for (instance, matrix) in matrices.iter().enumerate() {
                let line = ObjectLine::new(&ray, Some(matrix)).expect("a regular matrix");
                let hits = shapes.iter().enumerate().filter(|(_, shape)| is_met(shape, &line, &ray));
                expected.extend(hits.map(|(primitive, _)| (instance as u32, primitive as u32)));
            }
            let trace = TraceRay { ray, flags: RayFlags::default(), cull_mask: 1, time: 0.0 };
            let mut cursor = Cursor::new(&tlas, trace);
            let mut found = BTreeSet::new();
            while let Some(candidate) = cursor.proceed(&tlas) {
                found.insert((candidate.instance, candidate.primitive));
            }
            met += expected.len();
            assert_eq!(found, expected, "{shapes:?} under {matrices:?}, {ray:?}");
        }
    }
    assert!(scenes > cases(40), "only {scenes} scenes");
    assert!(met > 2 * scenes, "only {met} hits in {scenes} scenes");
}

#[test]
fn no_triangle_is_lost_in_any_box() {
    check(101, 0);
}

#[test]
fn no_box_is_lost_in_any_box() {
    check(102, 1);
}

#[test]
fn no_sphere_is_lost_in_any_box() {
    check(103, 2);
}

#[test]
fn no_linear_swept_sphere_is_lost_in_any_box() {
    check(104, 3);
}

#[test]
fn halves_of_a_swept_sphere_hold_it() {
    let mut draw = Draw::new(11);
    let mut halved = 0;
    for _ in 0..20_000 {
        let s = scale(&mut draw);
        let point = |draw: &mut Draw| -> [f32; 3] { std::array::from_fn(|_| draw.unit() * s) };
        let positions = [point(&mut draw), point(&mut draw)];
        let radii = [0, 1].map(|_| draw.unit().abs() * s * [1e-6, 1e-2, 0.1][draw.below(3)]);
        let Some(halves) = linear_swept_sphere::halves(positions, radii) else { continue };
        halved += 1;
        // A ball at u in each half, at its ends among them; f64 holds its corners but for a part of
        // 2^-52.
        for (half, bounds) in halves.iter().enumerate() {
            for step in 0..=8 {
                let u = (half * 8 + step) as f64 / 16.0;
                let between = |[a, b]: [f32; 2]| f64::from(a) * (1.0 - u) + f64::from(b) * u;
                let radius = between(radii);
                for axis in 0..3 {
                    let center = between(positions.map(|position| position[axis]));
                    let [low, high] = [bounds.min[axis], bounds.max[axis]].map(f64::from);
                    assert!(
                        low <= center - radius && center + radius <= high,
                        "{positions:?} {radii:?} at {u}: {bounds:?}"
                    );
                }
            }
        }
    }
    assert!(halved > 5000, "{halved}");
}
