//! Cases with many primitives: wide nodes, leaves of several blocks, split swept spheres, BVHs over
//! instances.

use crate::case::{Placement, Shape, StressCase};
use crate::draw::Draw;
use crate::family::any;
use anyhit_engine::geometry::{Ray, Transform};
use anyhit_engine::math::array;

/// Triangles that share edges and vertices.
pub(super) struct Sheet {
    /// Its triangles, neighbours with the same vertices bit for bit.
    pub triangles: Vec<[[f32; 3]; 3]>,
    pub scale: f32,
}

/// `side` by `side` squares of two triangles, flat or not, anywhere.
pub(super) fn sheet(draw: &mut Draw, side: usize) -> Sheet {
    let scale = draw.scale();
    let axes = [[0, 1, 2], [1, 2, 0], [2, 1, 0], [0, 2, 1]][draw.below(4)];
    let (hills, noise) = (draw.below(4), draw.one_in(3));
    // Far from the origin coordinates have few bits left.
    let away: [f32; 3] = match draw.below(4) {
        0 => draw.lattice(1.0),
        1 => {
            let far = [1e3, 1e6][draw.below(2)];
            draw.anywhere(far)
        }
        _ => [0.0; 3],
    };
    let mut points = Vec::new();
    for k in 0..(side + 1) * (side + 1) {
        let place = [k % (side + 1), k / (side + 1)].map(|x| x as f32 - (side / 2) as f32);
        let mut point = [0.0; 3];
        point[axes[0]] = place[0] + if noise { 0.3 * draw.unit() } else { 0.0 };
        point[axes[1]] = place[1] + if noise { 0.3 * draw.unit() } else { 0.0 };
        point[axes[2]] = match hills {
            0 | 1 => 0.0,
            2 => (draw.below(3) as f32 - 1.0) * 0.5,
            _ => draw.unit(),
        };
        points.push(array::from_fn(|i| (point[i] + away[i]) * scale));
    }
    let mut triangles = Vec::new();
    for square in 0..side * side {
        let first = square / side * (side + 1) + square % side;
        let [a, b, c, d]: [[f32; 3]; 4] = [0, 1, side + 2, side + 1].map(|k| points[first + k]);
        let pair = if draw.one_in(2) { [[a, b, c], [a, c, d]] } else { [[a, b, d], [d, b, c]] };
        triangles.extend(pair);
    }
    Sheet { triangles, scale }
}

impl Sheet {
    /// A vertex, the middle of an edge, or a point inside of one triangle.
    pub(super) fn target(&self, draw: &mut Draw) -> [f32; 3] {
        let [a, b, c] = self.triangles[draw.below(self.triangles.len())];
        let [v, w] = match draw.below(5) {
            0 => [0.0, 0.0],
            1 => [0.5, 0.5],
            2 => [0.5, 0.0],
            3 => [0.25, 0.25],
            _ => [draw.unit().abs() * 0.5, draw.unit().abs() * 0.5],
        };
        array::from_fn(|i| a[i] + v * (b[i] - a[i]) + w * (c[i] - a[i]))
    }
}

/// A case with a ray at a target.
fn case_aimed_at(draw: &mut Draw, shapes: Vec<Shape>, target: [f32; 3], scale: f32) -> StressCase {
    let (origin, direction) = draw.aim(target, scale);
    StressCase::new(shapes, draw.transformed(origin, direction))
}

pub(super) fn meshes(draw: &mut Draw) -> StressCase {
    // With more than 512 primitives the first few rays search a list.
    let side = if draw.one_in(60) { 17 } else { 2 + draw.below(6) };
    let sheet = sheet(draw, side);
    let target = sheet.target(draw);
    let scale = sheet.scale;
    let shapes = sheet.triangles.into_iter().map(Shape::Triangle).collect();
    case_aimed_at(draw, shapes, target, scale)
}

pub(super) fn grids(draw: &mut Draw) -> StressCase {
    let scale = draw.scale();
    let side = 2 + draw.below(3);
    // Side by side, flat, overlapping, or with a gap of one bit.
    let kind = draw.below(5);
    let shapes = (0..side * side * side).map(|k| {
        let min = [k % side, k / side % side, k / side / side].map(|x| (x as f32 - 1.0) * scale);
        let mut max = min.map(|x| x + if kind == 3 { 2.0 * scale } else { scale });
        match kind {
            1 => max[2] = min[2],
            2 => max = max.map(f32::next_down),
            _ => {}
        }
        Shape::Aabb([min, max])
    });
    let shapes = shapes.collect();
    let target = array::from_fn(|_| (draw.below(2 * side + 1) as f32 * 0.5 - 1.0) * scale);
    case_aimed_at(draw, shapes, target, scale)
}

pub(super) fn strands(draw: &mut Draw) -> StressCase {
    if draw.one_in(4) {
        return coplanar_ends(draw);
    }
    let (shapes, scale) = strand(draw);
    let Shape::LinearSweptSphere { positions, radii, .. } = shapes[draw.below(shapes.len())] else {
        unreachable!("bug in anyhit: a strand of other shapes")
    };
    if draw.one_in(3) {
        let target = positions[draw.below(2)];
        return case_aimed_at(draw, shapes, target, scale);
    }
    let transformed = draw.ray_near(positions, radii);
    StressCase::new(shapes, transformed)
}

/// Swept spheres whose ends touch one plane, with different heights and radii, and a ray in that
/// plane: boxes around their halves end there, too, where the middle of the axis is rounded.
fn coplanar_ends(draw: &mut Draw) -> StressCase {
    let scale = draw.scale();
    let [up, along, across] = [[0, 1, 2], [1, 2, 0], [2, 0, 1]][draw.below(3)];
    let top = draw.unit() * scale;
    let thin = [0.25, 1e-1, 1e-2][draw.below(3)] * scale;
    let ball = |draw: &mut Draw| {
        let mut center = draw.anywhere(8.0 * scale);
        let radius = draw.unit().abs() * thin;
        center[up] = top - radius;
        (center, radius)
    };
    let shapes: Vec<_> = (0..5 + draw.below(20))
        .map(|_| {
            let [(p, r), (q, s)] = [ball(draw), ball(draw)];
            Shape::LinearSweptSphere { positions: [p, q], radii: [r, s], caps: [true; 2] }
        })
        .collect();
    let Shape::LinearSweptSphere { positions: [p, q], .. } = shapes[draw.below(shapes.len())] else {
        unreachable!("bug in anyhit: a strand of other shapes")
    };
    // The ray passes near the middle, across or along.
    let u = [0.5, 0.5, draw.unit().abs()][draw.below(3)];
    let mut target: [f32; 3] = array::from_fn(|i| p[i] + (q[i] - p[i]) * u);
    target[up] = [top, top.next_up(), top.next_down()][draw.below(3)];
    let mut direction = [0.0; 3];
    direction[across] = 1.0;
    if draw.one_in(2) {
        direction[along] = draw.unit();
    }
    let origin = array::from_fn(|i| target[i] - 16.0 * scale * direction[i]);
    StressCase::new(shapes, Ray::new(origin, direction).into())
}

/// A chain of swept spheres: hair, tubes, or from point to point of the lattice.
fn strand(draw: &mut Draw) -> (Vec<Shape>, f32) {
    let scale = draw.scale();
    let count = 6 + draw.below(40);
    let thin = [0.25, 0.25, 1e-2, 1e-4][draw.below(4)] * scale;
    let (is_lattice, tapers) = (draw.one_in(3), draw.one_in(3));
    // Long links are halved for the tree if they lie close together.
    let step = if draw.one_in(2) { 4.0 * scale } else { scale };
    let mut points = vec![draw.lattice(scale)];
    let mut heading = draw.direction();
    for _ in 0..count {
        let from = points[points.len() - 1];
        let way = if is_lattice { draw.lattice(1.0) } else { heading };
        points.push(array::from_fn(|i| from[i] + way[i] * step));
        let turn = draw.anywhere(0.5);
        heading = array::from_fn(|i| (heading[i] + turn[i]).clamp(-1.0, 1.0));
    }
    let radii: Vec<f32> =
        (0..=count).map(|k| if tapers { thin * (count - k) as f32 / count as f32 } else { thin }).collect();
    let caps = draw.below(3);
    let links = (0..count).map(|k| Shape::LinearSweptSphere {
        positions: [points[k], points[k + 1]],
        radii: [radii[k], radii[k + 1]],
        caps: [[k == 0, true], [true, true], [false, false]][caps],
    });
    (links.collect(), scale)
}

pub(super) fn swarms(draw: &mut Draw) -> StressCase {
    let scale = draw.scale();
    let shapes: Vec<Shape> = if draw.one_in(2) {
        // A lattice of spheres that touch, or nearly.
        let side = 2 + draw.below(3);
        let radius = [0.5, 0.5f32.next_up(), 0.5f32.next_down(), 0.25][draw.below(4)] * scale;
        let at = |k: usize| [k % side, k / side % side, k / side / side].map(|x| (x as f32 - 1.0) * scale);
        (0..side * side * side).map(|k| Shape::Sphere { center: at(k), radius }).collect()
    } else {
        let count = 6 + draw.below(90);
        let far = [1.0, 8.0, 1e3][draw.below(3)] * scale;
        (0..count)
            .map(|_| {
                let radius = draw.unit().abs() * [scale, scale, scale * 1e-3][draw.below(3)];
                Shape::Sphere { center: draw.anywhere(far), radius }
            })
            .collect()
    };
    let Shape::Sphere { center, radius } = shapes[draw.below(shapes.len())] else {
        unreachable!("bug in anyhit: a swarm of other shapes")
    };
    if draw.one_in(3) {
        // Where two of a lattice touch, or close to it.
        let mut target = center;
        target[draw.below(3)] += radius;
        return case_aimed_at(draw, shapes, target, scale);
    }
    let transformed = draw.ray_near([center; 2], [radius; 2]);
    StressCase::new(shapes, transformed)
}

pub(super) fn soups(draw: &mut Draw) -> StressCase {
    let mut case = any(draw);
    let kind = std::mem::discriminant(&case.shapes[0]);
    let count = 16 + draw.below(64);
    while case.shapes.len() < count {
        let other = any(draw).shapes[0];
        if std::mem::discriminant(&other) == kind {
            case.shapes.push(other);
        }
    }
    let caps = draw.one_in(4);
    for shape in &mut case.shapes {
        match shape {
            Shape::LinearSweptSphere { caps: all, radii, .. } => {
                (*all, *radii) = ([!caps; 2], radii.map(f32::abs));
            }
            Shape::Sphere { radius, .. } => *radius = radius.abs(),
            _ => {}
        }
    }
    case
}

/// A few shapes of a kind, a target for a ray, and their scale.
pub(super) fn few_shapes(draw: &mut Draw) -> (Vec<Shape>, [f32; 3], f32) {
    match draw.below(4) {
        0 => {
            let side = 1 + draw.below(3);
            let sheet = sheet(draw, side);
            let target = sheet.target(draw);
            (sheet.triangles.into_iter().map(Shape::Triangle).collect(), target, sheet.scale)
        }
        1 => {
            let (mut shapes, scale) = strand(draw);
            shapes.truncate(1 + draw.below(8));
            let Shape::LinearSweptSphere { positions, .. } = shapes[shapes.len() - 1] else {
                unreachable!("bug in anyhit: a strand of other shapes")
            };
            (shapes, positions[0], scale)
        }
        2 => {
            let scale = draw.scale();
            let count = 1 + draw.below(7);
            let radius = 0.5 * scale;
            let shapes: Vec<_> =
                (0..count).map(|_| Shape::Sphere { center: draw.lattice(scale), radius }).collect();
            let Shape::Sphere { center, .. } = shapes[0] else {
                unreachable!("bug in anyhit: a swarm of other shapes")
            };
            (shapes, [center[0] + radius, center[1], center[2]], scale)
        }
        _ => {
            let scale = draw.scale();
            let count = 1 + draw.below(7);
            let shapes: Vec<_> = (0..count)
                .map(|_| {
                    let min = draw.lattice(scale);
                    Shape::Aabb([min, min.map(|x| x + scale)])
                })
                .collect();
            (shapes, [0.0; 3], scale)
        }
    }
}

pub(super) fn places(draw: &mut Draw) -> StressCase {
    let (shapes, target, scale) = few_shapes(draw);
    let count = 2 + draw.below(20);
    let kind = draw.below(4);
    let matrix = |draw: &mut Draw, k: usize| {
        let mut m = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
        match kind {
            // Copies in a row or in a lattice, which touch.
            0 => m[0][3] = k as f32 * scale,
            1 => {
                let by = draw.lattice(scale);
                (0..3).for_each(|i| m[i][3] = by[i]);
            }
            // Axes exchanged, scaled by powers of two, mirrored.
            2 => {
                let turn = draw.below(3);
                let by = draw.lattice(scale);
                for (i, row) in m.iter_mut().enumerate() {
                    *row = [0.0, 0.0, 0.0, by[i]];
                    row[(i + turn) % 3] = [1.0, -1.0, 2.0, 0.5][draw.below(4)];
                }
            }
            _ => {
                m = draw.matrix();
                (0..3).for_each(|i| m[i][3] *= scale);
            }
        }
        m
    };
    let matrices: Vec<_> = (0..count).map(|k| matrix(draw, k)).collect();
    let matrices: Vec<_> = matrices.into_iter().filter(is_invertible).collect();
    let (origin, direction) = draw.aim(target, scale);
    if matrices.is_empty() {
        return StressCase::new(shapes, draw.transformed(origin, direction));
    }
    let visible = matrices[draw.below(matrices.len())];
    let mut case = StressCase::new(shapes, draw.image(visible, origin, direction));
    case.hidden = 0;
    case.others = matrices
        .into_iter()
        .map(|matrix| Placement {
            mask: [1, 1, 1, 3, 2][draw.below(5)],
            flags: [0, 0, 1, 2, 3][draw.below(5)],
            ..Placement::new(Some(matrix), None)
        })
        .collect();
    case
}

/// Whether a matrix has an inverse.
pub(super) fn is_invertible(m: &[[f32; 4]; 3]) -> bool {
    Transform::new(m).is_some()
}
