//! Strategies of proptest for rays, primitives, transforms and small scenes (feature `proptest`).
//!
//! Numbers are mostly sixteenths, sometimes any float of their range, and shrink towards small
//! sixteenths: a law that fails is shown on numbers that can be worked out by hand. Rays shrink
//! towards the z axis, transforms towards the identity, scenes towards fewer instances.
//!
//! ```
//! # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).unwrap();
//! use anyhit::strategies::lss_hit;
//! use anyhit::{Module, ShaderTest};
//! use proptest::prelude::*;
//!
//! let module = Module::open("spirv-fixtures/pass/lss/normal-angle/main.rchit.spv").unwrap();
//! let test = ShaderTest::new(&module, "main").unwrap();
//! proptest!(|(aimed in lss_hit())| {
//!     let outcome = test.clone().hit(aimed.hit()).run()?;
//!     let normal = outcome.payload["exact"].vec3();
//!     let length = normal.iter().map(|x| x * x).sum::<f32>().sqrt();
//!     prop_assert!((length - 1.0).abs() < 1e-4, "the normal's length is {length}");
//! });
//! ```

use std::ops::RangeInclusive;

use proptest::prelude::*;

use crate::hit::Hit;
use crate::instance::Instance;
use anyhit_engine::geometry::Ray;
use anyhit_engine::math::array;

/// A number of a range: a sixteenth, sometimes any float.
pub fn number(range: RangeInclusive<f32>) -> impl Strategy<Value = f32> + Clone {
    let (start, end) = (*range.start(), *range.end());
    // Sixteenths within the range; where it is too narrow for one, only floats.
    let sixteenths = (start * 16.0).ceil() as i32..=(end * 16.0).floor() as i32;
    let whole = if sixteenths.is_empty() {
        (start..=end).boxed()
    } else {
        sixteenths.prop_map(|sixteenths| sixteenths as f32 / 16.0).boxed()
    };
    prop_oneof![3 => whole, 1 => start..=end]
}

/// A point of the cube from -4 to 4.
pub fn point() -> impl Strategy<Value = [f32; 3]> + Clone {
    [number(-4.0..=4.0), number(-4.0..=4.0), number(-4.0..=4.0)]
}

/// A direction of a length from 1/4 to about 2; along -z at the end of shrinking.
pub fn direction() -> impl Strategy<Value = [f32; 3]> + Clone {
    // z is -1 plus what is drawn, so that zeros give the axis.
    let parts = [number(-1.0..=1.0), number(-1.0..=1.0), number(0.0..=2.0)];
    parts
        .prop_map(|[x, y, z]| [x, y, z - 1.0])
        .prop_filter("a direction", |direction| direction.iter().map(|x| x * x).sum::<f32>() >= 1.0 / 16.0)
}

/// A ray from a point in a direction.
pub fn ray() -> impl Strategy<Value = Ray> + Clone {
    (point(), direction()).prop_map(|(origin, direction)| Ray::new(origin, direction))
}

/// A sphere: centre and radius.
pub fn sphere() -> impl Strategy<Value = ([f32; 3], f32)> + Clone {
    (point(), number(0.0625..=2.0))
}

/// A linear swept sphere: centres and radii. Neither of its spheres lies within the other.
pub fn lss() -> impl Strategy<Value = ([[f32; 3]; 2], [f32; 2])> + Clone {
    ([point(), point()], [number(0.0625..=1.0), number(0.0625..=1.0)])
        .prop_filter("spheres that lie apart", |([from, to], radii)| {
            distance(*from, *to) > (radii[0] - radii[1]).abs() + 0.0625
        })
}

/// A triangle with an area of at least 1/32.
pub fn triangle() -> impl Strategy<Value = [[f32; 3]; 3]> + Clone {
    [point(), point(), point()].prop_filter("an area", |[a, b, c]| {
        let cross = cross(minus(*b, *a), minus(*c, *a));
        cross.iter().map(|x| x * x).sum::<f32>().sqrt() >= 0.0625
    })
}

/// An invertible transform, row-major 3x4: a turn, a scale for each axis, a move.
pub fn transform() -> impl Strategy<Value = [[f32; 4]; 3]> + Clone {
    let turn = (-8i8..=8, -8i8..=8, -8i8..=8);
    let scale = [number(0.0..=3.0), number(0.0..=3.0), number(0.0..=3.0)];
    (turn, scale, point()).prop_map(|((x, y, z), scale, offset)| {
        // The rotation of the quaternion (8, x, y, z) / its length; (8, 0, 0, 0) turns nothing.
        let q = [8.0, f64::from(x), f64::from(y), f64::from(z)];
        let n = q.iter().map(|part| part * part).sum::<f64>();
        let [w, x, y, z] = q;
        let turn = [
            [n - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
            [2.0 * (x * y + z * w), n - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), n - 2.0 * (x * x + y * y)],
        ];
        array::from_fn(|row| {
            array::from_fn(|column| match column {
                3 => offset[row],
                // 1/4 to 4, and 1 where nothing is drawn.
                _ => (turn[row][column] / n * f64::from(1.0 + scale[column])) as f32,
            })
        })
    })
}

/// A primitive with a ray that is aimed at it from outside.
#[derive(Clone, Debug)]
pub struct Aimed {
    /// The primitive.
    pub instance: Instance,
    /// The ray.
    pub ray: Ray,
}

impl Aimed {
    /// The hit, for a [`ShaderTest`](crate::shader_test::ShaderTest).
    pub fn hit(&self) -> Hit {
        Hit::of(self.instance.clone()).ray(self.ray)
    }
}

/// A sphere, and a ray aimed at a point within it.
pub fn sphere_hit() -> impl Strategy<Value = Aimed> + Clone {
    (sphere(), direction()).prop_map(|((centre, radius), direction)| Aimed {
        instance: Instance::sphere(centre, radius),
        ray: from_outside(centre, direction, radius),
    })
}

/// A linear swept sphere, and a ray aimed at a point of its axis: it meets side or caps.
pub fn lss_hit() -> impl Strategy<Value = Aimed> + Clone {
    (lss(), 0u8..=16, direction()).prop_map(|((positions, radii), sixteenths, direction)| {
        let [from, to] = positions;
        let along = f32::from(sixteenths) / 16.0;
        let target = array::from_fn(|axis| from[axis] + along * (to[axis] - from[axis]));
        let reach = distance(from, to) + radii[0].max(radii[1]);
        Aimed { instance: Instance::lss(positions, radii), ray: from_outside(target, direction, reach) }
    })
}

/// A triangle, and a ray that meets it well within its edges and not along its plane.
pub fn triangle_hit() -> impl Strategy<Value = Aimed> + Clone {
    let weights = [1u8..=8, 1u8..=8, 1u8..=8];
    let steep = |(vertices, _, direction): &([[f32; 3]; 3], [u8; 3], [f32; 3])| {
        let [a, b, c] = *vertices;
        let normal = cross(minus(b, a), minus(c, a));
        let along = normal.iter().zip(direction).map(|(n, d)| n * d).sum::<f32>();
        let lengths = [&normal, direction].map(|v| v.iter().map(|x| x * x).sum::<f32>().sqrt());
        along.abs() > 0.125 * lengths[0] * lengths[1]
    };
    (triangle(), weights, direction()).prop_filter("a ray across the plane", steep).prop_map(
        |(vertices, weights, direction)| {
            let weights = weights.map(f32::from);
            let sum: f32 = weights.iter().sum();
            let target = array::from_fn(|axis| {
                (0..3).map(|corner| weights[corner] / sum * vertices[corner][axis]).sum()
            });
            Aimed { instance: Instance::triangle(vertices), ray: from_outside(target, direction, 8.0) }
        },
    )
}

/// An instance of one primitive of any kind that needs no intersection shader, transformed.
pub fn instance() -> impl Strategy<Value = Instance> + Clone {
    let primitive = prop_oneof![
        triangle().prop_map(Instance::triangle),
        sphere().prop_map(|(centre, radius)| Instance::sphere(centre, radius)),
        lss().prop_map(|(positions, radii)| Instance::lss(positions, radii)),
    ];
    let placed = (primitive, transform(), any::<bool>());
    placed.prop_map(|(primitive, transform, opaque)| {
        let primitive = primitive.transform(transform);
        if opaque { primitive.opaque() } else { primitive }
    })
}

/// The instances of a small scene, one to eight, for [`Scene::new`](crate::scene::Scene::new).
pub fn instances() -> impl Strategy<Value = Vec<Instance>> + Clone {
    prop::collection::vec(instance(), 1..=8)
}

/// A ray through a point, in a direction, that begins more than `reach` before it.
fn from_outside(target: [f32; 3], direction: [f32; 3], reach: f32) -> Ray {
    let length = direction.iter().map(|x| x * x).sum::<f32>().sqrt();
    // A whole number of lengths keeps sixteenths.
    let back = ((reach + 1.0) / length).ceil();
    Ray::new(array::from_fn(|axis| target[axis] - back * direction[axis]), direction)
}

fn minus(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    array::from_fn(|axis| a[axis] - b[axis])
}

fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    array::from_fn(|axis| {
        let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
        a[next] * b[last] - a[last] * b[next]
    })
}

fn distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    minus(a, b).iter().map(|x| x * x).sum::<f32>().sqrt()
}

#[cfg(test)]
mod tests {
    use proptest::strategy::ValueTree;
    use proptest::test_runner::TestRunner;

    use super::*;
    use crate::scene::Scene;

    /// The value at the end of shrinking where everything fails.
    fn simplest<T: std::fmt::Debug>(strategy: impl Strategy<Value = T>) -> T {
        let mut runner = TestRunner::deterministic();
        let mut tree = strategy.new_tree(&mut runner).unwrap();
        while tree.simplify() {}
        tree.current()
    }

    #[test]
    fn shrinking_ends_at_simple_values() {
        assert_eq!(simplest(number(-4.0..=4.0)).abs(), 0.0);
        let ray = simplest(ray());
        assert_eq!((ray.origin, ray.direction), ([0.0; 3], [0.0, 0.0, -1.0]));
        let identity = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
        assert_eq!(simplest(transform()), identity);
        assert_eq!(simplest(instances()).len(), 1);
    }

    proptest! {
        #[test]
        fn aimed_rays_hit(spheres in sphere_hit(), lss in lss_hit(), triangles in triangle_hit()) {
            for aimed in [spheres, lss, triangles] {
                prop_assert!(aimed.hit().resolve().is_ok(), "{:?}", aimed);
            }
        }

        #[test]
        fn scenes_are_valid(instances in instances()) {
            prop_assert!(Scene::new(instances).is_ok());
        }
    }
}
