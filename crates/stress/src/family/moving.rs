//! Cases with motion: moving vertices and instances, at random times.

use crate::case::{MotionKeys, Placement, Shape, StressCase};
use crate::draw::Draw;
use crate::family::trees::{few_shapes, is_invertible, sheet};
use anyhit_engine::accel::motion::interpolate;
use anyhit_engine::geometry::Ray;
use anyhit_engine::math::array;

/// A time from 0 to 1: often an end, or next to one.
fn time(draw: &mut Draw) -> f32 {
    match draw.below(8) {
        0 => [0.0, 1.0][draw.below(2)],
        1 => [2f32.powi(-24), 1.0 - 2f32.powi(-24), f32::from_bits(1), 1.0 / 3.0][draw.below(4)],
        2 | 3 => [0.5, 0.25, 0.75][draw.below(3)],
        _ => draw.unit().abs(),
    }
}

pub(super) fn moving_triangles(draw: &mut Draw) -> StressCase {
    let side = 1 + draw.below(5);
    let sheet = sheet(draw, side);
    let (time, scale) = (time(draw), sheet.scale);
    let kind = draw.below(5);
    let by = if draw.one_in(2) { draw.lattice(scale) } else { draw.anywhere(scale) };
    let later = |vertex: [f32; 3]| -> [f32; 3] {
        array::from_fn(|i| match kind {
            // No motion; a common translation; towards the origin; through it to the other side.
            0 => vertex[i],
            1 | 2 => vertex[i] + by[i],
            3 => vertex[i] * 0.25,
            _ => -vertex[i],
        })
    };
    // Some stay: in a geometry of their own.
    let still = if draw.one_in(3) { draw.below(sheet.triangles.len() + 1) } else { 0 };
    let mut shapes = Vec::new();
    for (at, &vertices) in sheet.triangles.iter().enumerate() {
        shapes.push(if at < still {
            Shape::Triangle(vertices)
        } else {
            Shape::MovingTriangle([vertices, vertices.map(later)])
        });
    }
    let target = sheet.target(draw);
    let there = later(target);
    let target = array::from_fn(|i| interpolate(target[i], there[i], time));
    let (origin, direction) = draw.aim(target, scale);
    let transformed = draw.transformed(origin, direction);
    StressCase { time, ..StressCase::new(shapes, transformed) }
}

/// How an instance moves, with an inverse at both ends.
fn moves(draw: &mut Draw, scale: f32) -> MotionKeys {
    loop {
        let moves = if draw.one_in(2) { matrices(draw, scale) } else { decompositions(draw, scale) };
        let motion = moves.motion();
        let is_valid = motion.is_finite()
            && [0.0, 1.0].iter().all(|&time| motion.at(time).is_some_and(|matrix| is_invertible(&matrix)));
        if is_valid {
            return moves;
        }
    }
}

fn matrices(draw: &mut Draw, scale: f32) -> MotionKeys {
    let mut first = draw.matrix();
    (0..3).for_each(|i| first[i][3] *= scale);
    let mut second = first;
    match draw.below(5) {
        // A translation, a rotation of the axes, a mirror image (half way it has no inverse), a
        // slight change, any matrix.
        0 | 1 => {
            let by = draw.lattice(scale);
            (0..3).for_each(|i| second[i][3] += by[i]);
        }
        2 => second.rotate_left(1),
        3 if draw.one_in(2) => second[draw.below(3)].iter_mut().for_each(|x| *x = -*x),
        3 => second.as_flattened_mut().iter_mut().for_each(|x| *x = x.next_up()),
        _ => second = draw.matrix(),
    }
    MotionKeys::Matrix([first, second])
}

fn decompositions(draw: &mut Draw, scale: f32) -> MotionKeys {
    let mut key = [0.0; 16];
    let small = draw.one_in(2);
    for at in [0, 4, 7] {
        key[at] = if small { [1.0, 1.0, -1.0, 2.0][draw.below(4)] } else { draw.unit() * draw.scale() };
    }
    for at in [1, 2, 5] {
        key[at] = if draw.one_in(2) { 0.0 } else { draw.unit() };
    }
    for at in [3, 6, 8, 13, 14, 15] {
        key[at] = if draw.one_in(2) { draw.small() * scale } else { draw.unit() * scale };
    }
    let quaternion = |draw: &mut Draw| -> [f32; 4] {
        match draw.below(3) {
            0 => [0.0, 0.0, 0.0, 1.0],
            1 => array::from_fn(|_| draw.small()),
            _ => array::from_fn(|_| draw.unit()),
        }
    };
    key[9..13].copy_from_slice(&quaternion(draw));
    let mut other = key;
    match draw.below(5) {
        0 => {
            let next = quaternion(draw);
            other[9..13].copy_from_slice(&next);
        }
        // The inverse rotation: near the middle time almost no rotation is left.
        1 => {
            for x in &mut other[9..13] {
                *x = -*x * if draw.one_in(4) { 0.75 } else { 1.0 };
            }
        }
        2 => [13, 14, 15].iter().for_each(|&at| other[at] += draw.small() * scale),
        3 => {
            let next = quaternion(draw);
            other[9..13].copy_from_slice(&next);
            [0, 4, 7, 3].iter().for_each(|&at| other[at] *= 0.5);
        }
        _ => other.iter_mut().for_each(|x| *x = if *x == 0.0 { 0.0 } else { x.next_up() }),
    }
    MotionKeys::Srt([key, other])
}

/// A box whose corner stays fixed while the elements of its matrix are exchanged, and rounding
/// moves it by a bit; the ray runs along an axis past that corner.
fn still_corner(draw: &mut Draw) -> StressCase {
    let s = draw.scale();
    let time = time(draw);
    let all: Vec<_> = (0..6)
        .map(|_| {
            let row = |draw: &mut Draw| [draw.unit(), draw.unit(), draw.unit(), draw.unit() * s];
            let first = [row(draw), row(draw), row(draw)];
            let second = first.map(|[a, b, c, d]| [[b, a, c, d], [c, b, a, d], [b, c, a, d]][draw.below(3)]);
            MotionKeys::Matrix([first, second])
        })
        .filter(|moves| {
            let motion = moves.motion();
            [0.0, 1.0].iter().all(|&time| motion.at(time).is_some_and(|matrix| is_invertible(&matrix)))
        })
        .collect();
    let shape = Shape::Aabb([[0.0; 3], [s; 3]]);
    let Some(visible) = all.first().and_then(|moves| moves.motion().at(time)) else {
        return StressCase::new(vec![shape], draw.transformed([0.0; 3], [s; 3]));
    };
    let corner = visible.map(|[a, b, c, d]| {
        let wide = [a, b, c].iter().map(|&x| f64::from(x) * f64::from(s)).sum::<f64>() + f64::from(d);
        let near = wide as f32;
        [near, near, near.next_up(), near.next_down()][draw.below(4)]
    });
    let (along, far) = (draw.below(3), 16.0 * s);
    let (mut origin, mut direction) = (corner, [0.0; 3]);
    (origin[along], direction[along]) = (origin[along] - far, far);
    let mut case = StressCase { time, ..StressCase::new(vec![shape], Ray::new(origin, direction).into()) };
    case.motion = Some(all[0]);
    case.others = all[1..].iter().map(|&moves| Placement::new(None, Some(moves))).collect();
    case
}

pub(super) fn moving_instances(draw: &mut Draw) -> StressCase {
    if draw.one_in(6) {
        return still_corner(draw);
    }
    let (shapes, target, scale) = few_shapes(draw);
    let time = time(draw);
    let (origin, direction) = draw.aim(target, scale);
    let all: Vec<_> = (0..[1, 3, 9][draw.below(3)])
        .map(|k| {
            // Some stay.
            if k > 0 && draw.one_in(4) {
                return Placement::new(None, None);
            }
            Placement { flags: [0, 0, 0, 2][draw.below(4)], ..Placement::new(None, Some(moves(draw, scale))) }
        })
        .collect();
    // The ray is aimed in the space of one of them.
    let visible = draw.below(all.len());
    let matrix = all[visible].motion.and_then(|moves| moves.motion().at(time));
    let ray = match matrix.filter(is_invertible) {
        Some(matrix) => draw.image(matrix, origin, direction).ray,
        None => Ray::new(origin, direction),
    };
    let mut case = StressCase { time, ..StressCase::new(shapes, ray.into()) };
    case.motion = all[0].motion;
    case.others = all[1..].to_vec();
    case.hidden = if draw.one_in(2) { 4 } else { 0 };
    // And its vertices move as well.
    if draw.one_in(4) {
        let by = draw.lattice(scale);
        for shape in &mut case.shapes {
            if let Shape::Triangle(vertices) = *shape {
                let later = vertices.map(|vertex| array::from_fn(|i| vertex[i] + by[i]));
                *shape = Shape::MovingTriangle([vertices, later]);
            }
        }
    }
    case
}
