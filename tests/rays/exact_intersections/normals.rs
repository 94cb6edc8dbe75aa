//! The exact normals against the gradients of the implicit surfaces, in numbers a + b sqrt(r) with
//! rational a, b and r. A gradient is a central difference of the surface's function, which is
//! exact for a polynomial of degree 2, at the exact point of the hit; in world space the function
//! takes the point through the inverse of the matrix first.

use std::cmp::Ordering;

use anyhit_engine::geometry::{ObjectRay, Ray, Surface, SurfaceNormal};
use anyhit_stress::draw::{Draw, TransformedRay};
use anyhit_stress::reference::{Expected, ObjectLine};
use dashu_ratio::RBig;

use crate::rays::exact_intersections::cases;

type Matrix = [[f32; 4]; 3];

/// a + b sqrt(r), of an r that all numbers of a case have in common.
#[derive(Clone, Debug)]
struct Number {
    a: RBig,
    b: RBig,
}

/// The r of a case.
struct Field(RBig);

fn rational(x: f32) -> RBig {
    RBig::try_from(x).expect("finite")
}

fn sign(x: &RBig) -> i32 {
    x.cmp(&RBig::ZERO) as i32
}

impl Number {
    fn of(a: RBig) -> Self {
        Self { a, b: RBig::ZERO }
    }

    fn plus(&self, other: &Self) -> Self {
        Self { a: &self.a + &other.a, b: &self.b + &other.b }
    }

    fn minus(&self, other: &Self) -> Self {
        Self { a: &self.a - &other.a, b: &self.b - &other.b }
    }

    fn times(&self, factor: &RBig) -> Self {
        Self { a: &self.a * factor, b: &self.b * factor }
    }
}

impl Field {
    fn product(&self, x: &Number, y: &Number) -> Number {
        Number { a: &x.a * &y.a + &x.b * &y.b * &self.0, b: &x.a * &y.b + &x.b * &y.a }
    }

    fn dot(&self, x: &[Number; 3], y: &[Number; 3]) -> Number {
        let products = [0, 1, 2].map(|i| self.product(&x[i], &y[i]));
        products[0].plus(&products[1]).plus(&products[2])
    }

    fn sign(&self, x: &Number) -> i32 {
        let root = sign(&x.b) * sign(&self.0);
        if root == 0 || sign(&x.a) == root {
            return sign(&x.a);
        }
        if sign(&x.a) == 0 {
            return root;
        }
        sign(&x.a) * sign(&(&x.a * &x.a - &x.b * &x.b * &self.0))
    }
}

/// A function whose zeros are a surface, greater outside.
type Implicit<'a> = dyn Fn(&Field, &[Number; 3]) -> Number + 'a;

/// The gradient of a polynomial of degree 2.
fn gradient(field: &Field, function: &Implicit<'_>, at: &[Number; 3]) -> [Number; 3] {
    [0, 1, 2].map(|axis| {
        let beside = |step: i32| {
            let mut point = at.clone();
            point[axis] = point[axis].plus(&Number::of(RBig::from(step)));
            function(field, &point)
        };
        beside(1).minus(&beside(-1)).times(&(RBig::ONE / RBig::from(2)))
    })
}

/// Whether `found` is the nearest f32 of a component divided by a length, ties to even.
fn is_rounded(field: &Field, found: f32, component: &Number, length_squared: &Number) -> bool {
    // The order of the component and m times the length.
    let compare = |m: &RBig| {
        let own = field.sign(component);
        if own != sign(m) {
            return own.cmp(&sign(m));
        }
        let square = field.product(component, component);
        let order = field.sign(&square.minus(&length_squared.times(&(m * m)))).cmp(&0);
        if own < 0 { order.reverse() } else { order }
    };
    let half = |neighbour: f32| (rational(found) + rational(neighbour)) / RBig::from(2);
    let is_even = found.to_bits() & 1 == 0;
    let fits = |order: Ordering, wanted: Ordering| order == wanted || is_even && order == Ordering::Equal;
    fits(compare(&half(found.next_down())), Ordering::Greater)
        && fits(compare(&half(found.next_up())), Ordering::Less)
}

/// A point of a line.
fn point_at(origin: &[RBig; 3], direction: &[RBig; 3], t: &Number) -> [Number; 3] {
    [0, 1, 2].map(|i| t.times(&direction[i]).plus(&Number::of(origin[i].clone())))
}

/// Takes world space to object space: the images of the origin and of the axes.
fn to_object(matrix: &Matrix) -> ([RBig; 3], [[RBig; 3]; 3]) {
    let axis = |i: usize| {
        let mut direction = [0.0; 3];
        direction[i] = 1.0;
        ObjectLine::new(&Ray::new([0.0; 3], direction), Some(matrix)).expect("a regular matrix")
    };
    let axes = [0, 1, 2].map(axis);
    let origin = axes[0].origin.clone();
    (origin, axes.map(|line| line.direction))
}

/// Compares a normal with the gradients; returns whether there is one.
fn check(
    found: Option<SurfaceNormal>,
    function: &Implicit<'_>,
    expected: &Expected,
    ray: &Ray,
    matrix: Option<&Matrix>,
    case: &dyn std::fmt::Debug,
) -> bool {
    let line = ObjectLine::new(ray, matrix).expect("a ray that hits");
    let (p, s, r) = expected.t.parts();
    let (field, t) = (Field(r.clone()), Number { a: p.clone(), b: RBig::from(s) });
    let object = gradient(&field, function, &point_at(&line.origin, &line.direction, &t));
    let length = field.dot(&object, &object);
    if field.sign(&length) == 0 {
        assert_eq!(found, None, "{case:?} {ray:?}");
        return false;
    }
    let found = found.unwrap_or_else(|| panic!("no normal of {case:?} {ray:?}"));
    let against = |normal: &[Number; 3], direction: &[RBig; 3]| {
        let direction = direction.clone().map(Number::of);
        field.sign(&field.dot(normal, &direction))
    };
    let facing = against(&object, &line.direction);
    assert!(facing <= 0, "{case:?} {ray:?}");
    let is_right = |found: [f32; 3], exact: &[Number; 3]| {
        let length = field.dot(exact, exact);
        found.iter().zip(exact).all(|(&found, exact)| is_rounded(&field, found, exact, &length))
    };
    assert!(is_right(found.object, &object), "{:?} of {case:?} {ray:?}", found.object);
    let world = match matrix {
        None => object,
        Some(matrix) => {
            let (origin, axes) = to_object(matrix);
            let of_world = |field: &Field, point: &[Number; 3]| {
                let image = [0, 1, 2].map(|i| {
                    let along = [0, 1, 2].map(|axis| point[axis].times(&axes[axis][i]));
                    along[0].plus(&along[1]).plus(&along[2]).plus(&Number::of(origin[i].clone()))
                });
                function(field, &image)
            };
            let own = [ray.origin, ray.direction].map(|vector| vector.map(rational));
            gradient(&field, &of_world, &point_at(&own[0], &own[1], &t))
        }
    };
    assert!(is_right(found.world, &world), "{:?} of {case:?} {ray:?}, {matrix:?}", found.world);
    true
}

/// |x - center|^2 - radius^2
fn of_sphere(center: [f32; 3], radius: f32) -> impl Fn(&Field, &[Number; 3]) -> Number {
    move |field, point| {
        let from = [0, 1, 2].map(|i| point[i].minus(&Number::of(rational(center[i]))));
        field.dot(&from, &from).minus(&Number::of(rational(radius) * rational(radius)))
    }
}

/// The least over u of |x - P0 - u D|^2 - (r0 + u δ)^2.
fn of_cone(positions: [[f32; 3]; 2], radii: [f32; 2]) -> impl Fn(&Field, &[Number; 3]) -> Number {
    let [p0, p1] = positions.map(|position| position.map(rational));
    let [r0, r1] = radii.map(rational);
    let axis: [RBig; 3] = [0, 1, 2].map(|i| &p1[i] - &p0[i]);
    let slope = r1 - &r0;
    let g = axis.iter().map(|x| x * x).fold(RBig::ZERO, |sum, x| sum + x) - &slope * &slope;
    move |field, point| {
        let from = [0, 1, 2].map(|i| point[i].minus(&Number::of(p0[i].clone())));
        let axis = axis.clone().map(Number::of);
        let along = field.dot(&from, &axis).plus(&Number::of(&r0 * &slope));
        let square = field.product(&along, &along).times(&(RBig::ONE / &g));
        field.dot(&from, &from).minus(&Number::of(&r0 * &r0)).minus(&square)
    }
}

/// The volume of a point over a triangle, of this sign.
fn of_triangle(vertices: [[f32; 3]; 3], sign: i32) -> impl Fn(&Field, &[Number; 3]) -> Number {
    let [v0, v1, v2] = vertices.map(|vertex| vertex.map(rational));
    let [e1, e2] = [v1, v2].map(|v| -> [RBig; 3] { [0, 1, 2].map(|i| &v[i] - &v0[i]) });
    move |_, point| {
        let from = [0, 1, 2].map(|i| point[i].minus(&Number::of(v0[i].clone())));
        let minor = |i: usize, j: usize| &e1[i] * &e2[j] - &e1[j] * &e2[i];
        let terms = [from[0].times(&minor(1, 2)), from[1].times(&minor(2, 0)), from[2].times(&minor(0, 1))];
        terms[0].plus(&terms[1]).plus(&terms[2]).times(&RBig::from(sign))
    }
}

#[test]
fn normals_of_spheres_are_gradients() {
    let mut draw = Draw::new(61);
    let mut count = 0;
    for _ in 0..cases(1500) {
        let (center, radius) = draw.sphere();
        let TransformedRay { ray, matrix } = draw.ray_near([center; 2], [radius; 2]);
        let (Some(line), Some(object)) =
            (ObjectLine::new(&ray, matrix.as_ref()), ObjectRay::new(&ray, matrix.as_ref()))
        else {
            continue;
        };
        let found = SurfaceNormal::of_sphere(&object, center, radius);
        let Some(expected) = line.sphere(center, radius) else {
            assert_eq!(found, None, "{center:?} {radius} {ray:?} {matrix:?}");
            continue;
        };
        let function = of_sphere(center, radius);
        count += usize::from(check(found, &function, &expected, &ray, matrix.as_ref(), &(center, radius)));
    }
    assert!(count > 500, "{count}");
}

#[test]
fn normals_of_swept_spheres_are_gradients() {
    let mut draw = Draw::new(62);
    let mut counts = [0; 3];
    for _ in 0..cases(2500) {
        let (positions, radii, _) = draw.linear_swept_sphere();
        let TransformedRay { ray, matrix } = draw.ray_near(positions, radii);
        let (Some(line), Some(object)) =
            (ObjectLine::new(&ray, matrix.as_ref()), ObjectRay::new(&ray, matrix.as_ref()))
        else {
            continue;
        };
        let found = SurfaceNormal::of_linear_swept_sphere(&object, positions, radii);
        let Some(expected) = line.linear_swept_sphere(positions, radii, [true; 2]) else {
            assert_eq!(found, None, "{positions:?} {radii:?} {ray:?} {matrix:?}");
            continue;
        };
        let case = (positions, radii);
        let has_normal = match expected.surface {
            Surface::Cap0 => {
                let function = of_sphere(positions[0], radii[0]);
                check(found, &function, &expected, &ray, matrix.as_ref(), &case)
            }
            Surface::Cap1 => {
                let function = of_sphere(positions[1], radii[1]);
                check(found, &function, &expected, &ray, matrix.as_ref(), &case)
            }
            _ => check(found, &of_cone(positions, radii), &expected, &ray, matrix.as_ref(), &case),
        };
        let place = match expected.surface {
            Surface::Cap0 => 0,
            Surface::Cap1 => 1,
            _ => 2,
        };
        counts[place] += usize::from(has_normal);
    }
    assert!(counts.iter().all(|&count| count > 150), "{counts:?}");
}

#[test]
fn normals_of_triangles_are_gradients() {
    let mut draw = Draw::new(63);
    let mut count = 0;
    for _ in 0..cases(2500) {
        let vertices = draw.triangle();
        let TransformedRay { ray, matrix } = draw.ray_through(vertices);
        let (Some(line), Some(object)) =
            (ObjectLine::new(&ray, matrix.as_ref()), ObjectRay::new(&ray, matrix.as_ref()))
        else {
            continue;
        };
        let Some(expected) = line.triangle(vertices) else { continue };
        let found = SurfaceNormal::of_triangle(&object, vertices);
        // Front: e1 x e2 points against the ray.
        let sign = if expected.surface == Surface::TriangleFront { 1 } else { -1 };
        let function = of_triangle(vertices, sign);
        count += usize::from(check(found, &function, &expected, &ray, matrix.as_ref(), &vertices));
    }
    assert!(count > 800, "{count}");
}
