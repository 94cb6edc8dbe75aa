//! A test case: rays and their scene, as numbers that can be written to a file.

mod geometries;

use serde::{Deserialize, Serialize};

use crate::draw::TransformedRay;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_engine::accel::{Motion, RayFlags, Srt, TraceRay};
use anyhit_engine::geometry::Ray;

type Matrix = [[f32; 4]; 3];

/// A ray, other rays that are traced in the same packet, and primitives of one kind in one or
/// several instances.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StressCase {
    /// The family that generated it.
    pub family: String,
    /// The point at t = 0.
    pub origin: [f32; 3],
    /// The vector per unit of t.
    pub direction: [f32; 3],
    /// The lower end of the interval.
    pub t_min: f32,
    /// The upper end of the interval.
    pub t_max: f32,
    /// The ray time, from 0 to 1.
    #[serde(default, skip_serializing_if = "is_default")]
    pub time: f32,
    /// The ray's flags. All primitives are opaque.
    #[serde(default, skip_serializing_if = "is_default")]
    pub flags: u32,
    /// Object to world, row-major 3x4; none is the identity.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub transform: Option<Matrix>,
    /// How the instance moves, in place of the transform.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion: Option<MotionKeys>,
    /// The number of copies of the instance that the ray's mask excludes: above four instances, a
    /// BVH is built over them.
    #[serde(default = "four", skip_serializing_if = "is_four")]
    pub hidden: usize,
    /// Primitives, all of one kind.
    pub shapes: Vec<Shape>,
    /// More instances of the same primitives.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub others: Vec<Placement>,
    /// More rays.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub neighbours: Vec<Neighbour>,
}

fn four() -> usize {
    4
}

fn is_four(count: &usize) -> bool {
    *count == four()
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

fn one<T: From<u8>>() -> T {
    T::from(1)
}

fn is_one<T: From<u8> + PartialEq>(value: &T) -> bool {
    *value == one()
}

/// The mask of instances that rays exclude.
const HIDDEN: u8 = 0x80;

/// An instance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Placement {
    /// Object to world; none is the identity.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub transform: Option<Matrix>,
    /// How it moves, in place of the transform.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion: Option<MotionKeys>,
    /// Its mask.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub mask: u8,
    /// Its flags.
    #[serde(default, skip_serializing_if = "is_default")]
    pub flags: u32,
}

impl Placement {
    /// An instance of mask 1 without flags.
    pub fn new(transform: Option<Matrix>, motion: Option<MotionKeys>) -> Self {
        Self { transform, motion, mask: one(), flags: 0 }
    }
}

/// How an instance moves: its keys at time 0 and at time 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum MotionKeys {
    /// Two matrices, at time 0 and at time 1.
    Matrix([Matrix; 2]),
    /// Decompositions, in the order of `VkSRTDataNV`.
    Srt([[f32; 16]; 2]),
}

impl MotionKeys {
    /// The motion of an instance.
    pub fn motion(&self) -> Motion {
        let srt = |&[sx, a, b, pvx, sy, c, pvy, sz, pvz, qx, qy, qz, qw, tx, ty, tz]: &[f32; 16]| Srt {
            scale: [sx, sy, sz],
            shear: [a, b, c],
            pivot: [pvx, pvy, pvz],
            quaternion: [qx, qy, qz, qw],
            translation: [tx, ty, tz],
        };
        match self {
            Self::Matrix(keys) => Motion::Matrix(*keys),
            Self::Srt([first, second]) => Motion::Srt(Box::new([srt(first), srt(second)])),
        }
    }
}

/// A ray that is traced in a packet with that of the case.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Neighbour {
    /// The point at t = 0.
    pub origin: [f32; 3],
    /// The vector per unit of t.
    pub direction: [f32; 3],
    /// The least t.
    pub t_min: f32,
    /// The greatest t.
    pub t_max: f32,
    /// The ray time, from 0 to 1.
    #[serde(default, skip_serializing_if = "is_default")]
    pub time: f32,
    /// Its flags.
    #[serde(default, skip_serializing_if = "is_default")]
    pub flags: u32,
    /// Its cull mask.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub cull_mask: u32,
}

impl Neighbour {
    /// The operands of its trace.
    pub fn trace(&self) -> TraceRay {
        let Self { origin, direction, t_min, t_max, time, flags, cull_mask } = *self;
        let ray = Ray { origin, direction, t_min, t_max };
        TraceRay { ray, flags: RayFlags(flags), cull_mask, time }
    }
}

/// A primitive.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Shape {
    /// Three vertices.
    Triangle([[f32; 3]; 3]),
    /// The vertices of a triangle at time 0 and at time 1.
    MovingTriangle([[[f32; 3]; 3]; 2]),
    /// Least and greatest coordinates.
    Aabb([[f32; 3]; 2]),
    /// A sphere.
    Sphere {
        /// Its centre.
        center: [f32; 3],
        /// Its radius.
        radius: f32,
    },
    /// A linear swept sphere.
    LinearSweptSphere {
        /// Both centres.
        positions: [[f32; 3]; 2],
        /// Both radii.
        radii: [f32; 2],
        /// Which caps can be hit.
        caps: [bool; 2],
    },
}

impl StressCase {
    /// Shapes and a ray over the whole half-line.
    pub fn new(shapes: Vec<Shape>, ray: TransformedRay) -> Self {
        let TransformedRay { ray: Ray { origin, direction, t_min, t_max }, matrix: transform } = ray;
        Self {
            family: String::new(),
            origin,
            direction,
            t_min,
            t_max,
            time: 0.0,
            flags: 0,
            transform,
            motion: None,
            hidden: four(),
            shapes,
            others: Vec::new(),
            neighbours: Vec::new(),
        }
    }

    /// Sets the name of the family that generated the case.
    #[must_use]
    pub fn named(self, family: &str) -> Self {
        Self { family: family.to_owned(), ..self }
    }

    /// The ray.
    pub fn ray(&self) -> Ray {
        Ray { origin: self.origin, direction: self.direction, t_min: self.t_min, t_max: self.t_max }
    }

    /// The operands of the ray's trace.
    pub fn trace(&self) -> TraceRay {
        TraceRay { ray: self.ray(), flags: RayFlags(self.flags), cull_mask: 1, time: self.time }
    }

    /// All instances in their order.
    pub fn placements(&self) -> Vec<Placement> {
        let first = Placement::new(self.transform, self.motion);
        let hidden = std::iter::repeat_n(Placement { mask: HIDDEN, ..first.clone() }, self.hidden);
        std::iter::once(first).chain(self.others.iter().cloned()).chain(hidden).collect()
    }

    /// All its numbers, to be changed one by one.
    pub fn numbers(&mut self) -> Vec<&mut f32> {
        let mut out: Vec<&mut f32> = self.origin.iter_mut().chain(&mut self.direction).collect();
        out.extend([&mut self.t_min, &mut self.t_max, &mut self.time]);
        let first = (&mut self.transform, &mut self.motion);
        let others = self.others.iter_mut().map(|other| (&mut other.transform, &mut other.motion));
        for (transform, motion) in std::iter::once(first).chain(others) {
            out.extend(transform.iter_mut().flatten().flatten());
            match motion {
                None => {}
                Some(MotionKeys::Matrix(keys)) => out.extend(keys.as_flattened_mut().as_flattened_mut()),
                Some(MotionKeys::Srt(keys)) => out.extend(keys.as_flattened_mut()),
            }
        }
        for neighbour in &mut self.neighbours {
            out.extend(neighbour.origin.iter_mut().chain(&mut neighbour.direction));
            out.extend([&mut neighbour.t_min, &mut neighbour.t_max, &mut neighbour.time]);
        }
        for shape in &mut self.shapes {
            match shape {
                Shape::Triangle(vertices) => out.extend(vertices.as_flattened_mut()),
                Shape::MovingTriangle(keys) => out.extend(keys.as_flattened_mut().as_flattened_mut()),
                Shape::Aabb(corners) => out.extend(corners.as_flattened_mut()),
                Shape::Sphere { center, radius } => {
                    out.extend(center);
                    out.push(radius);
                }
                Shape::LinearSweptSphere { positions, radii, .. } => {
                    out.extend(positions.as_flattened_mut());
                    out.extend(radii);
                }
            }
        }
        out
    }

    /// The case as the text of a file.
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("bug in anyhit: plain numbers are TOML")
    }

    /// Reads what [`StressCase::to_toml`] wrote.
    ///
    /// # Errors
    /// `InvalidArgument` with the parser's message.
    pub fn from_toml(text: &str) -> Result<Self> {
        toml::from_str(text).map_err(|error| Error::new(ErrorKind::InvalidArgument, error.to_string()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_keep_every_bit() {
        let shapes = vec![
            Shape::LinearSweptSphere {
                positions: [[1.0e-45, f32::MAX, -0.0], [0.1, 1.0 / 3.0, 1e-30]],
                radii: [f32::MIN_POSITIVE, 16_777_217.0],
                caps: [true, false],
            },
            Shape::Aabb([[f32::NEG_INFINITY; 3], [f32::INFINITY, 0.0, 0.0]]),
            Shape::Triangle([[0.3; 3]; 3]),
            Shape::Sphere { center: [0.7; 3], radius: 0.1 },
        ];
        let ray = Ray::new([0.1, 0.2, 0.3], [1e-40, 0.0, -1.0]).with_interval(0.1, f32::INFINITY);
        let mut case =
            StressCase::new(shapes, TransformedRay { ray, matrix: Some([[0.1; 4]; 3]) }).named("test");
        case.shapes.push(Shape::MovingTriangle([[[0.7; 3]; 3], [[1e-45; 3]; 3]]));
        (case.time, case.flags, case.hidden) = (0.1, 16, 0);
        case.motion = Some(MotionKeys::Srt([[0.1; 16], [1e30; 16]]));
        let motion = Some(MotionKeys::Matrix([[[0.3; 4]; 3], [[-0.0; 4]; 3]]));
        case.others = vec![Placement::new(None, motion), Placement::new(None, None)];
        case.others.push(Placement { transform: Some([[0.9; 4]; 3]), mask: 6, flags: 2, motion: None });
        let StressCase { origin, direction, t_min, t_max, .. } = case;
        let neighbour = Neighbour { origin, direction, t_min, t_max, time: 0.3, flags: 32, cull_mask: 8 };
        case.neighbours = vec![neighbour; 3];
        let mut again = StressCase::from_toml(&case.to_toml()).unwrap();
        assert_eq!(case, again);
        let bits = |case: &mut StressCase| case.numbers().iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&mut case), bits(&mut again));
        assert!(StressCase::from_toml("family = 1").is_err());
    }
}
