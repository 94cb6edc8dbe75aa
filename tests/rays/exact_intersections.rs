//! Exact intersections against an independent reference in rational numbers, over drawn rays and
//! shapes that lie on, or within a hair of, every edge that a decision has.
//!
//! The reference (`anyhit_stress::reference`) has its own formulation: the object-space
//! ray comes from Gaussian elimination, a swept sphere's entry is the least point of the union of
//! its three pieces, a triangle is a linear system. The draws (`anyhit_stress::draw`)
//! are seeded; a failure prints its case.

mod boxes;
mod normals;

use anyhit_engine::geometry::block::{self, BoxRay, CullRay, LANES, ShearedRay};
use anyhit_engine::geometry::{
    Bounds, Intersection, ObjectRay, Precision, Ray, Surface, aabb, linear_swept_sphere, sphere, triangle,
    world_to_object,
};
use anyhit_engine::math::baseline_simd::BaselineSimd;
use anyhit_stress::draw::{Draw, TransformedRay};
use anyhit_stress::reference::{self, Expected, ObjectLine, Root};

/// How many cases to draw: that many, times the environment's `ANYHIT_CASES`.
fn cases(count: usize) -> usize {
    count * std::env::var("ANYHIT_CASES").map_or(1, |times| times.parse().expect("a number"))
}

/// Runs one drawn case and, where it hits, the same ray with the interval's ends at and around t.
fn around_the_interval(ray: Ray, mut check: impl FnMut(Ray) -> Option<Intersection>) -> bool {
    let Some(hit) = check(ray) else { return false };
    if hit.t.is_finite() {
        for end in [hit.t.next_down(), hit.t, hit.t.next_up()] {
            if end >= 0.0 && end.is_finite() {
                check(ray.with_interval(end, f32::INFINITY));
                check(ray.with_interval(0.0, end));
            }
        }
    }
    true
}

/// Compares one answer with the reference's, which knows no interval.
fn agree(
    found: Option<Intersection>,
    expected: Option<Expected>,
    ray: &Ray,
    is_open: bool,
    case: &dyn std::fmt::Debug,
) -> Option<Intersection> {
    let expected = expected.filter(|e| e.t.is_within(ray.t_min, ray.t_max, is_open));
    match (found, expected) {
        (None, None) => None,
        (Some(found), Some(expected)) => {
            assert!(expected.t.rounds_to(found.t), "t {} of {case:?} {ray:?}", found.t);
            assert_eq!(found.surface, expected.surface, "{case:?} {ray:?}");
            for (value, exact) in found.attributes.iter().zip(&expected.attributes) {
                let on_side = found.surface == Surface::Side;
                let clamped = on_side && [f32::MIN_POSITIVE, 1.0f32.next_down()].contains(value);
                assert!(clamped || exact.rounds_to(*value), "attribute {value} of {case:?} {ray:?}");
            }
            Some(found)
        }
        (found, expected) => panic!("{found:?}, not {expected:?}, for {case:?} {ray:?}"),
    }
}

/// What the block test must keep: all lanes, where the line meets the primitive that is in each.
fn assert_kept(met: u32, expected: bool, ray: &Ray, case: &dyn std::fmt::Debug) {
    assert!(!expected || met == (1 << LANES) - 1, "{met:#b} of {case:?} {ray:?}");
}

#[test]
fn spheres() {
    let mut draw = Draw::new(1);
    let mut hits = 0;
    for _ in 0..cases(6000) {
        let (center, radius) = draw.sphere();
        let TransformedRay { ray, matrix } = draw.ray_near([center; 2], [radius; 2]);
        hits += usize::from(around_the_interval(ray, |ray| {
            let case = (center, radius, matrix);
            let line = ObjectLine::new(&ray, matrix.as_ref());
            let object = ObjectRay::new(&ray, matrix.as_ref());
            assert_eq!(object.is_some(), line.is_some(), "{case:?} {ray:?}");
            let (object, expected) = (object?, line?.sphere(center, radius));
            if let Some(bounds) = sphere::bounds(center, radius) {
                let mut block = block::Sphere4::EMPTY;
                (0..LANES).for_each(|lane| block.set(lane, center, radius));
                let met = block.maybe_hit_mask(BaselineSimd, &CullRay::new(&object, &bounds));
                assert_kept(met, expected.is_some(), &ray, &case);
            }
            let found = sphere::intersect(&object, center, radius, Precision::Exact);
            agree(found, expected, &ray, false, &case)
        }));
    }
    assert!(hits > 1000, "only {hits} hits");
}

#[test]
fn linear_swept_spheres() {
    let mut draw = Draw::new(2);
    let mut surfaces = [0; 3];
    for _ in 0..cases(8000) {
        let (positions, radii, caps) = draw.linear_swept_sphere();
        let TransformedRay { ray, matrix } = draw.ray_near(positions, radii);
        around_the_interval(ray, |ray| {
            let case = (positions, radii, caps, matrix);
            let line = ObjectLine::new(&ray, matrix.as_ref())?;
            let object = ObjectRay::new(&ray, matrix.as_ref())?;
            let found = linear_swept_sphere::intersect(&object, positions, radii, caps, Precision::Exact);
            let expected = line.linear_swept_sphere(positions, radii, caps);
            if let Some(bounds) = linear_swept_sphere::bounds(positions, radii) {
                let mut block = block::LinearSweptSphere4::EMPTY;
                (0..LANES).for_each(|lane| block.set(lane, positions, radii));
                let cull_ray = CullRay::new(&object, &bounds);
                let met = block.maybe_hit_mask(BaselineSimd, &cull_ray)
                    & block.maybe_hit_mask_tight(BaselineSimd, &cull_ray);
                assert_kept(met, expected.is_some(), &ray, &case);
            }
            let found = agree(found, expected, &ray, false, &case)?;
            surfaces[match found.surface {
                Surface::Cap0 => 0,
                Surface::Cap1 => 1,
                _ => 2,
            }] += 1;
            assert_eq!(found.surface == Surface::Cap0, found.attributes[0] == 0.0, "{case:?} {ray:?}");
            assert_eq!(found.surface == Surface::Cap1, found.attributes[0] == 1.0, "{case:?} {ray:?}");
            Some(found)
        });
    }
    assert!(surfaces.iter().all(|&count| count > 1000), "{surfaces:?}");
}

#[test]
fn triangles() {
    let mut draw = Draw::new(3);
    let (mut hits, mut ties) = (0, 0);
    for _ in 0..cases(8000) {
        let vertices = draw.triangle();
        let TransformedRay { ray, matrix } = draw.ray_through(vertices);
        hits += usize::from(around_the_interval(ray, |ray| {
            let case = (vertices, matrix);
            let line = ObjectLine::new(&ray, matrix.as_ref())?;
            let object = ObjectRay::new(&ray, matrix.as_ref())?;
            let found = triangle::intersect(&object, vertices, Precision::Exact);
            let expected = line.triangle(vertices);
            if let Some(bounds) = triangle::bounds(vertices) {
                let mut block = block::Triangle4::EMPTY;
                (0..LANES).for_each(|lane| block.set(lane, vertices));
                let sheared = ShearedRay::of(&CullRay::new(&object, &bounds));
                let met = block.maybe_hit_mask(BaselineSimd, &sheared);
                assert_kept(met, expected.is_some(), &ray, &case);
            }
            let found = agree(found, expected, &ray, true, &case)?;
            let [b, c] = found.attributes;
            ties += usize::from(b == 0.0 || c == 0.0 || b + c == 1.0);
            Some(found)
        }));
    }
    assert!(hits > 2000 && ties > 500, "{hits} {ties}");
}

#[test]
fn boxes() {
    let mut draw = Draw::new(4);
    let (mut hits, mut inside) = (0, 0);
    for _ in 0..cases(8000) {
        let (min, max) = draw.aabb();
        let TransformedRay { ray, matrix } = draw.ray_near([min, max], [0.0; 2]);
        hits += usize::from(around_the_interval(ray, |ray| {
            let case = (min, max, matrix);
            let line = ObjectLine::new(&ray, matrix.as_ref())?;
            let object = ObjectRay::new(&ray, matrix.as_ref())?;
            let found = aabb::intersect(&object, min, max, Precision::Exact);
            let expected = line.aabb(min, max, ray.t_min, ray.t_max);
            if let Some(bounds) = aabb::bounds(min, max) {
                let mut block = block::Aabb4::EMPTY;
                (0..LANES).for_each(|lane| block.set(lane, min, max));
                let met = block.maybe_hit_mask(&BoxRay::new(&object, &bounds));
                assert_kept(met, expected.is_some(), &ray, &case);
            }
            match (found, expected) {
                (None, None) => None,
                (Some(found), Some(t)) => {
                    assert!(t.rounds_to(found.t), "t {} of {case:?} {ray:?}", found.t);
                    inside += usize::from(found.t == ray.t_min);
                    Some(found)
                }
                (found, expected) => panic!("{found:?}, not {expected:?}, for {case:?} {ray:?}"),
            }
        }));
    }
    assert!(hits > 2000 && inside > 200, "{hits} {inside}");
}

#[test]
fn object_rays_and_inverses() {
    let mut draw = Draw::new(5);
    let (mut regular, mut singular) = (0, 0);
    for _ in 0..cases(4000) {
        let matrix = draw.matrix();
        let ray = Ray::new(draw.point(), draw.point());
        let line = ObjectLine::new(&ray, Some(&matrix));
        let object = ObjectRay::new(&ray, Some(&matrix));
        assert_eq!(object.is_some(), line.is_some(), "{matrix:?}");
        let (Some(object), Some(line)) = (object, line) else {
            singular += 1;
            continue;
        };
        regular += 1;
        let (origin, direction) = (object.object_origin_f32(), object.object_direction_f32());
        for (i, (o, d)) in origin.into_iter().zip(direction).enumerate() {
            assert!(Root::from(line.origin[i].clone()).rounds_to(o), "origin {i} of {matrix:?} {ray:?}");
            assert!(
                Root::from(line.direction[i].clone()).rounds_to(d),
                "direction {i} of {matrix:?} {ray:?}"
            );
        }
        // Column j of the inverse is the image of the unit vector j, its translation that of 0.
        let inverse = world_to_object(&matrix).unwrap();
        for column in 0..4 {
            let unit: [f32; 3] = std::array::from_fn(|i| f32::from(i == column));
            let image = ObjectLine::new(&Ray::new([0.0; 3], unit), Some(&matrix)).unwrap();
            let exact = if column < 3 { image.direction } else { image.origin };
            for (row, exact) in inverse.iter().zip(exact) {
                assert!(Root::from(exact).rounds_to(row[column]), "inverse, column {column} of {matrix:?}");
            }
        }
    }
    assert!(regular > 1000 && singular > 100, "{regular} {singular}");
}

#[test]
fn bounds_hold_their_shapes() {
    let mut draw = Draw::new(6);
    for _ in 0..cases(4000) {
        let (positions, radii, _) = draw.linear_swept_sphere();
        if let Some(bounds) = linear_swept_sphere::bounds(positions, radii) {
            for (position, radius) in positions.into_iter().zip(radii) {
                assert!(
                    reference::contains_ball(&bounds, position, radius.max(0.0)),
                    "{positions:?} {radii:?}"
                );
            }
        }
        let matrix = draw.matrix();
        let (a, b) = (draw.point(), draw.point());
        let bounds = Bounds::of_points(&[a, b]);
        let image = bounds.transformed(&matrix);
        for corner in 0..8 {
            let corner =
                std::array::from_fn(|i| if corner >> i & 1 == 0 { bounds.min[i] } else { bounds.max[i] });
            assert!(reference::contains_image(&image, &matrix, corner), "{bounds:?} {matrix:?}");
        }
    }
}

/// A ray parallel to the cone's far side, from 4 million radii: the cone's quadratic is linear, its
/// constant loses ten digits in f64, and neither cap is near.
#[test]
fn a_side_that_f64_cannot_place_is_not_a_miss() {
    let matrix = [[0.0, 1.0, 2.0, -0.8669907], [2.0, -2.0, -1.0, -2.0], [1.0, 0.0, 1.0, -4.0]];
    let ray = Ray::new([-500000.47, 999997.94, -3.7005835], [4.0, -8.0, 0.0]);
    let (positions, radii) = ([[0.125, 0.0, 0.25], [0.125, 0.5, 0.0]], [0.125, 0.375]);
    let object = ObjectRay::new(&ray, Some(&matrix)).unwrap();
    let found = linear_swept_sphere::intersect(&object, positions, radii, [false; 2], Precision::Exact);
    let expected =
        ObjectLine::new(&ray, Some(&matrix)).unwrap().linear_swept_sphere(positions, radii, [false; 2]);
    assert_eq!(expected.as_ref().map(|e| e.surface), Some(Surface::Side));
    agree(found, expected, &ray, false, &"the case above");
}

/// The object-space direction has a component that is 0 within its error, but not 0.
#[test]
fn a_direction_that_f64_cannot_tell_from_zero_leaves_a_box_undecided() {
    let matrix = [[2.0, 0.0, -1.0, 0.51854527], [2.0, 0.0, -2.0, -0.09811294], [2.0, 2.0, -2.0, -4.0]];
    let origin = [2.0311885e34, 3.3210606e34, 3.3210591e34];
    let ray = Ray::new(origin, [-0.5127436, -0.8383533, -0.8383533]);
    let (min, max) =
        ([-1.3118113e28, f32::NEG_INFINITY, -1.3386091e28], [1.9695069e28, -1.0480065e28, 1.1170274e28]);
    let line = ObjectLine::new(&ray, Some(&matrix)).unwrap();
    assert!(line.aabb(min, max, ray.t_min, ray.t_max).is_none());
    let object = ObjectRay::new(&ray, Some(&matrix)).unwrap();
    assert_eq!(aabb::intersect(&object, min, max, Precision::Exact), None);
}

/// Two triangles with a common edge, or a fan around a common vertex, all facing the ray alike: met
/// once wherever the ray passes through their union's inside.
#[test]
fn shared_edges_and_vertices_are_met_once() {
    let mut draw = Draw::new(7);
    for _ in 0..cases(1500) {
        // With four and more the gaps stay below 180 degrees.
        let count = 4 + draw.below(5);
        let (fan, TransformedRay { ray, matrix }) = draw.fan(count);
        let Some(object) = ObjectRay::new(&ray, matrix.as_ref()) else { continue };
        let met = (0..count)
            .filter(|&i| {
                // Windings differ: neighbours need not agree on one.
                let (a, b) = (fan[1 + i], fan[1 + (i + 1) % count]);
                let vertices = if i % 2 == 0 { [fan[0], a, b] } else { [b, a, fan[0]] };
                triangle::intersect(&object, vertices, Precision::Exact).is_some()
            })
            .count();
        assert_eq!(met, 1, "{fan:?} {ray:?} {matrix:?}");
    }
}

/// Where nothing is delicate the cheaper precisions say the same.
#[test]
fn cheaper_precisions_agree_on_ordinary_rays() {
    let mut draw = Draw::new(8);
    let mut hits = 0;
    for _ in 0..cases(3000) {
        let mut point = || std::array::from_fn(|_| draw.unit());
        let (p0, p1, target): ([f32; 3], [f32; 3], [f32; 3]) = (point(), point(), point());
        let origin = target.map(|x| x * 0.25 - 3.0);
        let ray = Ray::new(origin, std::array::from_fn(|i| target[i] * 0.5 - origin[i]));
        let object = ObjectRay::new(&ray, None).unwrap();
        let lss =
            |precision| linear_swept_sphere::intersect(&object, [p0, p1], [0.5, 0.25], [true; 2], precision);
        let ball = |precision| sphere::intersect(&object, p0, 0.5, precision);
        let flat = |precision| triangle::intersect(&object, [p0, p1, [1.0, 0.0, -1.0]], precision);
        let cube = |precision| aabb::intersect(&object, p0.map(|x| x - 0.5), p0, precision);
        let all: [&dyn Fn(Precision) -> Option<Intersection>; 4] = [&lss, &ball, &flat, &cube];
        for intersect in all {
            let Some(exact) = intersect(Precision::Exact) else { continue };
            hits += 1;
            let double = intersect(Precision::Double).expect("Double misses");
            assert!(anyhit_engine::math::ulps(exact.t, double.t) <= 1, "{exact:?} {double:?} {ray:?}");
            if let Some(float) = intersect(Precision::Float) {
                assert!((float.t - exact.t).abs() <= 1e-3, "{exact:?} {float:?} {ray:?}");
            }
        }
    }
    assert!(hits > 2000, "{hits}");
}
