//! The families of adversarial cases.

mod moving;
mod neighbours;
mod trees;

use crate::case::{Shape, StressCase};
use crate::draw::{Draw, TransformedRay};
use anyhit_engine::geometry::Ray;
use anyhit_engine::math::array;
pub use neighbours::add_neighbours;

/// A generator of cases.
#[derive(Debug)]
pub struct Family {
    /// Its name.
    pub name: &'static str,
    /// What makes its cases difficult.
    pub about: &'static str,
    /// Generates one case of the family.
    pub draw: fn(&mut Draw) -> StressCase,
}

/// All families. Case n is of family n modulo their number, so that a new family changes the cases
/// of every seed.
pub const FAMILIES: &[Family] = &[
    Family {
        name: "spheres",
        about: "boundary cases of the sphere test, lattices, all scales",
        draw: spheres,
    },
    Family { name: "swept", about: "the same for linear swept spheres, with negative radii", draw: swept },
    Family {
        name: "triangles",
        about: "rays through vertices, edges and interiors, all scales",
        draw: triangles,
    },
    Family { name: "boxes", about: "flat, infinite and touched boxes, origins inside", draw: boxes },
    Family {
        name: "grazing",
        about: "rays that pass the surface at 10^-k of the radius, k = 1 to 16",
        draw: grazing,
    },
    Family {
        name: "axis-parallel",
        about: "directions with one or two components of 0",
        draw: axis_parallel,
    },
    Family { name: "enclosing", about: "one end sphere contains the other, or nearly", draw: enclosing },
    Family { name: "needles", about: "pointed cones, lengths of 10^6 radii, slivers", draw: needles },
    Family { name: "zero-length", about: "coincident ends, vanishing directions", draw: zero_length },
    Family { name: "radii", about: "radii from 10^-30 to 10^30, at any length", draw: radii },
    Family { name: "far", about: "origins at 10^3 to 10^12 radii", draw: far },
    Family {
        name: "leaving",
        about: "origins on the surface; directions outwards, inwards and along it",
        draw: leaving,
    },
    Family { name: "directions", about: "huge and denormal directions, and mixtures", draw: directions },
    Family {
        name: "degenerate",
        about: "triangles without area, or with area only in the last bit",
        draw: degenerate,
    },
    Family { name: "fans", about: "rays exactly through shared edges and vertices", draw: fans },
    Family { name: "instances", about: "sheared, near-singular, tiny and huge instances", draw: instances },
    Family {
        name: "chains",
        about: "joints of segments, two of which are entered at the same t",
        draw: chains,
    },
    Family { name: "ties", about: "many copies of the same primitive", draw: ties },
    Family { name: "fields", about: "a dozen primitives in a BVH, all scales", draw: fields },
    Family { name: "bits", about: "numbers with random bits", draw: bits },
    Family {
        name: "meshes",
        about: "sheets of triangles with shared edges and vertices, far away and flat",
        draw: trees::meshes,
    },
    Family { name: "grids", about: "boxes that touch, overlap or nearly touch", draw: trees::grids },
    Family {
        name: "strands",
        about: "long chains of swept spheres, some so dense that they are split in half",
        draw: trees::strands,
    },
    Family { name: "swarms", about: "many spheres, in lattices where they touch", draw: trees::swarms },
    Family { name: "soups", about: "many primitives of all scales together", draw: trees::soups },
    Family {
        name: "places",
        about: "adjacent and overlapping instances, flags and masks",
        draw: trees::places,
    },
    Family {
        name: "moving",
        about: "vertices that move between two keys, next to static ones",
        draw: moving::moving_triangles,
    },
    Family {
        name: "moved",
        about: "instances that move between two matrices or decompositions",
        draw: moving::moving_instances,
    },
];

fn spheres(draw: &mut Draw) -> StressCase {
    let (center, radius) = draw.sphere();
    StressCase::new(vec![Shape::Sphere { center, radius }], draw.ray_near([center; 2], [radius; 2]))
}

fn swept(draw: &mut Draw) -> StressCase {
    let (positions, radii, caps) = draw.linear_swept_sphere();
    let transformed = draw.ray_near(positions, radii);
    StressCase::new(vec![Shape::LinearSweptSphere { positions, radii, caps }], transformed)
}

fn triangles(draw: &mut Draw) -> StressCase {
    let vertices = draw.triangle();
    StressCase::new(vec![Shape::Triangle(vertices)], draw.ray_through(vertices))
}

fn boxes(draw: &mut Draw) -> StressCase {
    let (min, max) = draw.aabb();
    StressCase::new(vec![Shape::Aabb([min, max])], draw.ray_near([min, max], [0.0; 2]))
}

/// A sphere or swept sphere of radius about 1, and its ends.
fn round_shape(draw: &mut Draw) -> (Shape, [[f32; 3]; 2], [f32; 2]) {
    let s = draw.scale();
    let p = draw.anywhere(s);
    let r = (0.25 + 0.75 * draw.unit().abs()) * s;
    if draw.one_in(2) {
        return (Shape::Sphere { center: p, radius: r }, [p; 2], [r; 2]);
    }
    let axis = draw.direction();
    let q = array::from_fn(|i| p[i] + axis[i] * 2.0 * s);
    let radii = [r, if draw.one_in(3) { r } else { r * draw.unit().abs() }];
    let caps = [!draw.one_in(4), !draw.one_in(4)];
    (Shape::LinearSweptSphere { positions: [p, q], radii, caps }, [p, q], radii)
}

/// A power of two near a power of ten.
fn ten_to(k: i32) -> f64 {
    10f64.powi(k)
}

/// A ray that passes the axis at (1 + off) radii, from `distance` radii before it; computed in f64,
/// then rounded.
fn passing(draw: &mut Draw, [p, q]: [[f32; 3]; 2], radii: [f32; 2], off: f64, distance: f64) -> Ray {
    let u = f64::from([0.0, 0.25, 0.5, 0.75, 1.0, draw.unit().abs()][draw.below(6)]);
    let normal = draw.direction().map(f64::from);
    let length = normal.iter().map(|x| x * x).sum::<f64>().sqrt();
    let normal = normal.map(|x| x / length);
    let r = f64::from(radii[0]) + (f64::from(radii[1]) - f64::from(radii[0])) * u;
    let free = draw.direction().map(f64::from);
    let along: f64 = (0..3).map(|i| free[i] * normal[i]).sum();
    let direction: [f64; 3] = array::from_fn(|i| free[i] - along * normal[i]);
    let at = |i: usize| {
        let (p, q) = (f64::from(p[i]), f64::from(q[i]));
        p + (q - p) * u + normal[i] * r * (1.0 + off)
    };
    let origin = array::from_fn(|i| clamp(at(i) - direction[i] * distance * r));
    Ray::new(origin, direction.map(|x| x as f32))
}

fn clamp(x: f64) -> f32 {
    x.clamp(-3e38, 3e38) as f32
}

fn grazing(draw: &mut Draw) -> StressCase {
    let (shape, ends, radii) = round_shape(draw);
    let off = ten_to(-(1 + draw.below(16) as i32)) * if draw.one_in(2) { 1.0 } else { -1.0 };
    let distance = ten_to(draw.below(4) as i32);
    let ray = passing(draw, ends, radii, off, distance);
    let transformed = draw.transformed(ray.origin, ray.direction);
    StressCase::new(vec![shape], transformed)
}

fn axis_parallel(draw: &mut Draw) -> StressCase {
    let s = draw.scale();
    let mut direction = [0.0; 3];
    direction[draw.below(3)] = if draw.one_in(2) { s } else { -s };
    if draw.one_in(3) {
        direction[draw.below(3)] = draw.small() * s;
    }
    let origin: [f32; 3] = array::from_fn(|_| draw.small() * s * if draw.one_in(2) { 1.0 } else { 0.5 });
    let shape = match draw.below(4) {
        0 => Shape::Sphere { center: draw.lattice(s), radius: (1 + draw.below(3)) as f32 * s },
        1 => Shape::LinearSweptSphere {
            positions: [draw.lattice(s), draw.lattice(s)],
            radii: [draw.below(3) as f32 * s, (1 + draw.below(2)) as f32 * s],
            caps: [true; 2],
        },
        2 => Shape::Triangle([draw.lattice(s), draw.lattice(s), draw.lattice(s)]),
        _ => {
            let (a, b) = (draw.lattice(s), draw.lattice(s));
            Shape::Aabb([array::from_fn(|i| a[i].min(b[i])), array::from_fn(|i| a[i].max(b[i]))])
        }
    };
    let transformed = draw.transformed(origin, direction);
    StressCase::new(vec![shape], transformed)
}

fn enclosing(draw: &mut Draw) -> StressCase {
    let s = draw.scale();
    // Pythagorean quadruples, whose lengths are exact.
    let (axis, length) =
        [([1.0, 2.0, 2.0], 3.0), ([2.0, 3.0, 6.0], 7.0), ([0.0, 3.0, 4.0], 5.0), ([0.0, 0.0, 1.0], 1.0f32)]
            [draw.below(4)];
    let p = draw.lattice(s);
    let q = array::from_fn(|i| p[i] + axis[i] * s);
    let small = if draw.one_in(4) { 0.0 } else { draw.below(4) as f32 * 0.5 * s };
    let mut great = small + length * s;
    for _ in 0..draw.below(3) {
        great = if draw.one_in(2) { great.next_up() } else { great.next_down() };
    }
    if draw.one_in(4) {
        great = small + length * s * (1.0 + draw.unit() * 1e-3);
    }
    let (positions, radii) = if draw.one_in(2) { ([p, q], [small, great]) } else { ([q, p], [great, small]) };
    let caps = [!draw.one_in(3), !draw.one_in(3)];
    let transformed = draw.ray_near(positions, radii);
    StressCase::new(vec![Shape::LinearSweptSphere { positions, radii, caps }], transformed)
}

fn needles(draw: &mut Draw) -> StressCase {
    let s = draw.scale();
    let thin = ten_to(-(2 + draw.below(6) as i32)) as f32;
    let (p, q) = (draw.anywhere(s), draw.anywhere(s));
    if draw.one_in(3) {
        // A sliver: the third vertex is close to the edge.
        let u = draw.unit().abs();
        let r: [f32; 3] = array::from_fn(|i| p[i] + (q[i] - p[i]) * u + draw.unit() * thin * s);
        return StressCase::new(vec![Shape::Triangle([p, q, r])], draw.ray_through([p, q, r]));
    }
    let r = draw.unit().abs() * s * thin;
    let radii = [r, [0.0, r, r * thin, r * 0.5][draw.below(4)]];
    let radii = if draw.one_in(2) { radii } else { [radii[1], radii[0]] };
    let off = [0.0, 1e-7, -1e-7, -0.5, -0.99, 1e-3][draw.below(6)];
    let distance = ten_to(draw.below(7) as i32);
    let ray = if draw.one_in(4) {
        // Along the axis, or nearly.
        let origin = array::from_fn(|i| p[i] - (q[i] - p[i]) + draw.unit() * r);
        Ray::new(origin, array::from_fn(|i| q[i] - p[i]))
    } else {
        passing(draw, [p, q], radii, off, distance)
    };
    let caps = [!draw.one_in(4), !draw.one_in(4)];
    let transformed = draw.transformed(ray.origin, ray.direction);
    StressCase::new(vec![Shape::LinearSweptSphere { positions: [p, q], radii, caps }], transformed)
}

fn zero_length(draw: &mut Draw) -> StressCase {
    let s = draw.scale();
    let p = draw.lattice(s);
    let mut q = p;
    if draw.one_in(2) {
        let axis = draw.below(3);
        q[axis] = if draw.one_in(2) { q[axis].next_up() } else { q[axis].next_down() };
    }
    let r = draw.below(3) as f32 * s;
    let other = [r, 0.0, r.next_up(), r * 2.0][draw.below(4)];
    let shape = match draw.below(4) {
        0 => Shape::Sphere { center: p, radius: f32::from_bits(draw.below(5) as u32) },
        1 => Shape::Aabb([p, array::from_fn(|i| p[i].max(q[i]))]),
        _ => Shape::LinearSweptSphere { positions: [p, q], radii: [r, other], caps: [true; 2] },
    };
    let mut transformed = draw.ray_near([p, q], [r, other]);
    if draw.one_in(6) {
        transformed.ray.direction = [0.0; 3];
    }
    StressCase::new(vec![shape], transformed)
}

/// A random size from 10^-30 to 10^30.
fn any_size(draw: &mut Draw) -> f32 {
    2f32.powi(draw.below(200) as i32 - 100) * (1.0 + draw.unit().abs())
}

fn radii(draw: &mut Draw) -> StressCase {
    let (a, b, s) = (any_size(draw), any_size(draw), any_size(draw));
    let p = draw.anywhere(s);
    let near = any_size(draw);
    let q = if draw.one_in(2) { draw.anywhere(s) } else { array::from_fn(|i| p[i] + draw.unit() * near) };
    let radii = if draw.one_in(2) { [a, b] } else { [a, a * (1.0 + draw.unit().abs())] };
    let off = [0.0, 1e-7, -1e-7, -0.5, 1e-3][draw.below(5)];
    let distance = ten_to(draw.below(4) as i32);
    let ray = passing(draw, [p, q], radii, off, distance);
    let transformed = draw.transformed(ray.origin, ray.direction);
    let shape = if draw.one_in(3) {
        Shape::Sphere { center: p, radius: a }
    } else {
        Shape::LinearSweptSphere { positions: [p, q], radii, caps: [true; 2] }
    };
    StressCase::new(vec![shape], transformed)
}

fn far(draw: &mut Draw) -> StressCase {
    let distance = ten_to(3 + draw.below(10) as i32);
    match draw.below(4) {
        0 => {
            let vertices = draw.triangle();
            let TransformedRay { ray, matrix } = draw.ray_through(vertices);
            let origin =
                array::from_fn(|i| clamp(f64::from(ray.origin[i]) - f64::from(ray.direction[i]) * distance));
            let ray = Ray { origin, ..ray };
            StressCase::new(vec![Shape::Triangle(vertices)], TransformedRay { ray, matrix })
        }
        1 => {
            let (min, max) = draw.aabb();
            let TransformedRay { ray, matrix } = draw.ray_near([min, max], [0.0; 2]);
            let origin =
                array::from_fn(|i| clamp(f64::from(ray.origin[i]) - f64::from(ray.direction[i]) * distance));
            let ray = Ray { origin, ..ray };
            StressCase::new(vec![Shape::Aabb([min, max])], TransformedRay { ray, matrix })
        }
        _ => {
            let (shape, ends, radii) = round_shape(draw);
            let off = [0.0, 1e-7, -1e-7, -0.5, 1e-3, -1e-5][draw.below(6)];
            let ray = passing(draw, ends, radii, off, distance);
            let transformed = draw.transformed(ray.origin, ray.direction);
            StressCase::new(vec![shape], transformed)
        }
    }
}

fn leaving(draw: &mut Draw) -> StressCase {
    let (shape, ends, radii) = round_shape(draw);
    let off = [0.0, 1e-7, -1e-7, 1e-6, -1e-6][draw.below(5)];
    let mut ray = passing(draw, ends, radii, off, 0.0);
    if draw.one_in(2) {
        ray.direction = draw.direction();
    }
    let transformed = draw.transformed(ray.origin, ray.direction);
    StressCase::new(vec![shape], transformed)
}

fn directions(draw: &mut Draw) -> StressCase {
    let mut case = any(draw);
    let long = 2f64.powi(draw.below(276) as i32 - 149);
    for x in &mut case.direction {
        let long = if draw.one_in(4) { 2f64.powi(draw.below(276) as i32 - 149) } else { long };
        *x = clamp(f64::from(*x) * long);
    }
    case
}

/// A case of one of the plain families.
fn any(draw: &mut Draw) -> StressCase {
    [spheres, swept, triangles, boxes, grazing, axis_parallel][draw.below(6)](draw)
}

fn degenerate(draw: &mut Draw) -> StressCase {
    let s = draw.scale();
    let a = if draw.one_in(2) { draw.lattice(s) } else { draw.anywhere(s) };
    let step = draw.lattice(s);
    let mut vertices = match draw.below(4) {
        0 => [a; 3],
        1 => [a, a, draw.lattice(s)],
        // In a line, exactly if the sums are exact.
        _ => [a, array::from_fn(|i| a[i] + step[i]), array::from_fn(|i| a[i] + 2.0 * step[i])],
    };
    if draw.one_in(2) {
        let (corner, axis) = (draw.below(3), draw.below(3));
        let x = &mut vertices[corner][axis];
        *x = if draw.one_in(2) { x.next_up() } else { x.next_down() };
    }
    let turn = draw.below(3);
    vertices.rotate_left(turn);
    StressCase::new(vec![Shape::Triangle(vertices)], draw.ray_through(vertices))
}

fn fans(draw: &mut Draw) -> StressCase {
    let count = 4 + draw.below(5);
    let (fan, transformed) = draw.fan(count);
    let shapes = (0..count).map(|i| {
        let (a, b) = (fan[1 + i], fan[1 + (i + 1) % count]);
        Shape::Triangle(if i % 2 == 0 { [fan[0], a, b] } else { [b, a, fan[0]] })
    });
    StressCase::new(shapes.collect(), transformed)
}

fn instances(draw: &mut Draw) -> StressCase {
    let case = any(draw);
    // The object-space ray of the case becomes the world ray of its image.
    let (origin, direction) = (case.origin, case.direction);
    let transformed = match draw.below(3) {
        0 => {
            // A shear of up to 10^6, exactly regular.
            let shear = ten_to(draw.below(7) as i32) as f32;
            let mut m = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
            m[draw.below(3)][draw.below(3)] = shear * draw.unit();
            draw.image(m, origin, direction)
        }
        1 => {
            let (a, b) = (any_size(draw).sqrt(), any_size(draw).sqrt());
            let m = [[a, 0.0, 0.0, draw.unit()], [0.0, b, 0.0, 0.0], [0.0, b * draw.unit(), a, draw.unit()]];
            draw.image(m, origin, direction)
        }
        _ => {
            let m = draw.matrix();
            draw.image(m, origin, direction)
        }
    };
    StressCase::new(case.shapes, transformed)
}

fn chains(draw: &mut Draw) -> StressCase {
    let s = draw.scale();
    let points: [[f32; 3]; 4] =
        array::from_fn(|_| if draw.one_in(2) { draw.lattice(s) } else { draw.anywhere(s) });
    let radii: [f32; 4] = array::from_fn(|_| (1 + draw.below(3)) as f32 * 0.25 * s);
    let shapes = (0..3).map(|k| Shape::LinearSweptSphere {
        positions: [points[k], points[k + 1]],
        radii: [radii[k], radii[k + 1]],
        caps: [true; 2],
    });
    let shapes: Vec<Shape> = shapes.collect();
    let joint = draw.below(4);
    let transformed = draw.ray_near([points[joint]; 2], [radii[joint]; 2]);
    StressCase::new(shapes, transformed)
}

fn ties(draw: &mut Draw) -> StressCase {
    let mut case = any(draw);
    let count = 2 + draw.below(7);
    case.shapes = vec![case.shapes[0]; count];
    case
}

fn fields(draw: &mut Draw) -> StressCase {
    let mut case = any(draw);
    let kind = std::mem::discriminant(&case.shapes[0]);
    // Others of the kind, at their own scales.
    for _ in 0..400 {
        if case.shapes.len() == 12 {
            break;
        }
        let other = any(draw).shapes[0];
        if std::mem::discriminant(&other) == kind {
            case.shapes.push(other);
        }
    }
    if let Some(Shape::LinearSweptSphere { .. }) = case.shapes.first() {
        for shape in &mut case.shapes {
            if let Shape::LinearSweptSphere { caps, .. } = shape {
                *caps = [true; 2];
            }
        }
    }
    case
}

fn bits(draw: &mut Draw) -> StressCase {
    let mut case = any(draw);
    let mut number = || loop {
        let x = f32::from_bits(draw.word());
        if x.is_finite() {
            return x;
        }
    };
    case.transform = None;
    for x in case.numbers() {
        *x = number();
    }
    (case.t_min, case.t_max) = (0.0, f32::INFINITY);
    for shape in &mut case.shapes {
        if let Shape::Aabb([min, max]) = shape {
            (*min, *max) = (array::from_fn(|i| min[i].min(max[i])), array::from_fn(|i| min[i].max(max[i])));
        }
    }
    case
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_distinct_and_cases_finite() {
        for (i, family) in FAMILIES.iter().enumerate() {
            assert!(FAMILIES[..i].iter().all(|other| other.name != family.name));
            for seed in 0..50 {
                let case = (family.draw)(&mut Draw::new(seed));
                let finite = case.origin.iter().chain(&case.direction).all(|x| x.is_finite());
                assert!(finite, "{}: {case:?}", family.name);
            }
        }
    }
}
