//! Barycentrics, the length of the direction, and watertightness at every scale.

use anyhit_engine::accel::GeometryData;
use anyhit_unit_test::scene::Instance;

use crate::rays::conformance::rig::{AnyHit, BOX, Kind, MISS, Plan, Rig, Shot, TRIANGLE, facing};

/// Numbers in 0..1, the same on every machine (a linear congruential generator's upper bits).
fn numbers(seed: u64) -> impl Iterator<Item = f32> {
    let mut state = seed;
    std::iter::from_fn(move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        Some((state >> 40) as f32 / (1u64 << 24) as f32)
    })
}

/// Rays at (1 - b - c) v0 + b v1 + c v2 find the attributes (b, c), in closest-hit and any-hit.
#[test]
fn barycentrics() {
    let corners = [[0.0, -1.0, 5.0], [-1.0, 1.0, 5.0], [1.0, 1.0, 5.0]];
    let mut random = numbers(1);
    let mut wanted = Vec::new();
    let mut shots = Vec::new();
    while shots.len() < 200 {
        let (b, c) = (random.next().unwrap(), random.next().unwrap());
        if b + c > 0.99 {
            continue;
        }
        let point =
            |axis: usize| (1.0 - b - c) * corners[0][axis] + b * corners[1][axis] + c * corners[2][axis];
        shots.push(Shot { direction: [0, 1, 2].map(point), ..Shot::down([0.0; 3]) });
        wanted.push([b, c]);
    }
    for any_hit in [AnyHit::ACCEPT, AnyHit::TERMINATE] {
        let plan = Plan { any_hit, ..Plan::default() };
        let probes = Rig::with([(Kind::Triangle, plan)]).run([Instance::triangles(corners)], &shots);
        for (probe, [b, c]) in probes.iter().zip(&wanted) {
            assert_eq!((probe.stage, probe.any_hits, probe.never), (TRIANGLE, 1, 0));
            let found = [probe.attribute[0], probe.attribute[1]];
            // The point itself is rounded: a few units of 2^-24 in coordinates of up to 5.
            assert!((found[0] - b).abs() < 1e-6 && (found[1] - c).abs() < 1e-6, "{found:?}, {b} {c}");
            assert_eq!(probe.seen_attribute, found);
        }
    }
}

/// t counts lengths of the direction: 4 / scale, for a triangle and a box's face at distance 4,
/// under rotations that the instance and the ray share.
#[test]
fn the_direction_is_not_normalised() {
    let mut random = numbers(2);
    let mut scales = vec![1.0];
    scales.extend((0..5).map(|_| 0.5 + 9.5 * random.next().unwrap()));
    let mut turns = vec![(0.0, 0.0)];
    turns.extend((0..4).map(|_| (6.0 * random.next().unwrap(), 6.0 * random.next().unwrap())));
    for scale in scales {
        for (x, y) in &turns {
            // About x, then about y.
            let ((sx, cx), (sy, cy)) = (f32::sin_cos(*x), f32::sin_cos(*y));
            let matrix = [[cy, sy * sx, sy * cx, 0.0], [0.0, cx, -sx, 0.0], [-sy, cy * sx, cy * cx, 0.0]];
            let turned = |v: [f32; 3]| matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2]);
            let shot = Shot { direction: turned([0.0, 0.0, -scale]), ..Shot::down([0.0; 3]) };
            for (kind, stage) in [(Kind::Triangle, TRIANGLE), (Kind::Box, BOX)] {
                let plan = Plan { reports: 1, t: [4.0 / scale, 0.0], ..Plan::default() };
                let one = match kind {
                    Kind::Box => Instance::aabbs([[[-1.0, -1.0, -4.5], [1.0, 1.0, -4.0]]]),
                    _ => Instance::triangles(facing([0.0, 0.0, -4.0], 1.0, true)),
                };
                let probe = Rig::with([(kind, plan)]).run([one.transform(matrix)], &[shot])[0];
                assert_eq!(probe.stage, stage);
                assert!((probe.t_max * scale / 4.0 - 1.0).abs() < 1e-5, "{} at scale {scale}", probe.t_max);
            }
        }
    }
}

/// A closed fan: `edges` triangles around one shared vertex, at a scale.
fn fan(edges: usize, scale: f32) -> Instance {
    let around = |at: usize| {
        let angle = std::f64::consts::TAU * (at % edges) as f64 / edges as f64;
        [(angle.cos() as f32) * scale, (angle.sin() as f32) * scale, 0.0]
    };
    let vertices = std::iter::once([0.0; 3]).chain((0..edges).map(around)).collect();
    let triangle = |at: usize| [0, 1 + at as u32, 1 + ((at + 1) % edges) as u32];
    let indices = Some((0..edges).flat_map(triangle).collect());
    Instance::of(GeometryData::Triangles { vertices, indices, transform: None })
}

/// Rays at the shared vertex and at the inner edges of closed fans, from 10^-12 to 10^12: each
/// meets one triangle, and one only.
#[test]
fn closed_fans_neither_leak_nor_double() {
    for edges in [4, 16, 64, 256, 1024] {
        for scale in [1e-12f32, 1e-6, 1e-3, 1.0, 1e3, 1e6, 1e12] {
            let mut shots = Vec::new();
            for at in 0..32 {
                let angle = std::f64::consts::TAU * (at * edges / 32) as f64 / edges as f64;
                let edge = [(angle.cos() as f32) * scale, (angle.sin() as f32) * scale];
                for part in [0.0, 0.25, 0.5] {
                    // A multiple of the edge's own vertex by a power of two lies on it exactly.
                    let target = [edge[0] * part, edge[1] * part];
                    let straight = Shot { t_max: f32::MAX, ..Shot::down([target[0], target[1], scale]) };
                    shots.push(straight);
                    // From the side, through the vertex: origin + 1 * direction is the vertex
                    // exactly.
                    let side = [edge[0] * 0.5, edge[1] * -0.25, scale];
                    shots.push(Shot { origin: side, direction: side.map(|x| -x), ..straight });
                }
            }
            let ignores = Plan { any_hit: AnyHit::IGNORE, ..Plan::default() };
            let probes = Rig::with([(Kind::Triangle, ignores)]).run([fan(edges, scale)], &shots);
            for (probe, shot) in probes.iter().zip(&shots) {
                assert_eq!((probe.stage, probe.any_hits), (MISS, 1), "{edges} edges at {scale:e}: {shot:?}");
            }
        }
    }
}

/// A square cut into random triangles by points inside: every ray meets one.
#[test]
fn a_mesh_without_gaps() {
    for seed in 0..10 {
        let mut random = numbers(100 + seed);
        let mut vertices = vec![[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let mut triangles = vec![[0u32, 1, 2], [0, 2, 3]];
        while triangles.len() < 256 {
            // A point within a triangle cuts it in three.
            let at = (random.next().unwrap() * triangles.len() as f32) as usize;
            let [a, b, c] = triangles[at];
            let (u, v) = (random.next().unwrap() * 0.5 + 0.1, random.next().unwrap() * 0.3 + 0.05);
            let corner = |index: u32| vertices[index as usize];
            let point = std::array::from_fn(|axis| {
                corner(a)[axis] * (1.0 - u - v) + corner(b)[axis] * u + corner(c)[axis] * v
            });
            let new = vertices.len() as u32;
            vertices.push(point);
            triangles[at] = [a, b, new];
            triangles.extend([[b, c, new], [c, a, new]]);
        }
        // At every vertex inside, at midpoints of edges, and at random points.
        let mut targets: Vec<[f32; 3]> = vertices[4..].to_vec();
        for [a, b, _] in &triangles {
            let (a, b) = (vertices[*a as usize], vertices[*b as usize]);
            targets.push(std::array::from_fn(|axis| 0.5 * (a[axis] + b[axis])));
        }
        targets.extend((0..256).map(|_| [random.next().unwrap(), random.next().unwrap(), 0.0]));
        targets.retain(|[x, y, _]| (0.001..0.999).contains(x) && (0.001..0.999).contains(y));
        let shots: Vec<Shot> = targets.iter().map(|[x, y, _]| Shot::down([*x, *y, 1.0])).collect();
        let indices = Some(triangles.concat());
        let data = GeometryData::Triangles { vertices, indices, transform: None };
        let ignores = Plan { any_hit: AnyHit::IGNORE, ..Plan::default() };
        let probes = Rig::with([(Kind::Triangle, ignores)]).run([Instance::of(data)], &shots);
        for (probe, shot) in probes.iter().zip(&shots) {
            // A sliver turned over by rounding may lie over its neighbour: never less than one.
            assert!(probe.any_hits >= 1, "seed {seed}: {shot:?}");
        }
        let doubled = probes.iter().filter(|probe| probe.any_hits > 1).count();
        assert!(doubled * 20 < probes.len(), "{doubled} of {}", probes.len());
    }
}

/// The surface of a cube from -4 to 4, each face of 4 x 4 squares of two triangles, at a scale.
fn cube(scale: f32) -> (Vec<[f32; 3]>, Vec<u32>) {
    let mut vertices: Vec<[i32; 3]> = Vec::new();
    let mut indices = Vec::new();
    for (axis, side) in (0..3).flat_map(|axis| [(axis, -4), (axis, 4)]) {
        let mut corner = |u: i32, v: i32| {
            let mut point = [0; 3];
            (point[axis], point[(axis + 1) % 3], point[(axis + 2) % 3]) = (side, 2 * u - 4, 2 * v - 4);
            let known = vertices.iter().position(|other| *other == point);
            known.unwrap_or_else(|| {
                vertices.push(point);
                vertices.len() - 1
            }) as u32
        };
        for (u, v) in (0..4).flat_map(|u| (0..4).map(move |v| (u, v))) {
            let square = [corner(u, v), corner(u + 1, v), corner(u, v + 1), corner(u + 1, v + 1)];
            indices.extend([square[0], square[1], square[2], square[1], square[3], square[2]]);
        }
    }
    (vertices.iter().map(|point| point.map(|x| x as f32 * scale)).collect(), indices)
}

/// Rays from within a closed mesh exactly at each of its vertices, at the middle of each edge and
/// inside each triangle, from 10^-12 to 10^12: out of it goes every ray, and through one triangle
/// only.
#[test]
fn nothing_leaves_a_closed_mesh_unseen() {
    for scale in
        [1e-12f32, 2f32.powi(-40), 1e-6, 2f32.powi(-20), 1.0, 2f32.powi(20), 1e6, 2f32.powi(40), 1e12]
    {
        let (vertices, indices) = cube(scale);
        let sum = |parts: &[u32]| -> [f32; 3] {
            std::array::from_fn(|axis| parts.iter().map(|&part| vertices[part as usize][axis]).sum())
        };
        // With a power of two for scale all of these sums are exact.
        let mut directions: Vec<[f32; 3]> = vertices.clone();
        for triangle in indices.chunks_exact(3) {
            let [a, b, c] = [triangle[0], triangle[1], triangle[2]];
            directions.extend([sum(&[a, b]), sum(&[b, c]), sum(&[c, a]), sum(&[a, b, c]), sum(&[a, a, b])]);
        }
        let shot = |&direction: &[f32; 3]| Shot { direction, t_max: f32::MAX, ..Shot::down([0.0; 3]) };
        let shots: Vec<Shot> = directions.iter().map(shot).collect();
        let data = GeometryData::Triangles { vertices, indices: Some(indices), transform: None };
        let ignores = Plan { any_hit: AnyHit::IGNORE, ..Plan::default() };
        let probes = Rig::with([(Kind::Triangle, ignores)]).run([Instance::of(data)], &shots);
        assert_eq!(probes.len(), 98 + 5 * 192);
        for (probe, shot) in probes.iter().zip(&shots) {
            assert_eq!((probe.stage, probe.any_hits), (MISS, 1), "at {scale:e}: {shot:?}");
        }
    }
}
