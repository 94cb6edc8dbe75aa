//! A ray and what it is shot at, as plain numbers that can be written to a file.

use serde::{Deserialize, Serialize};

use crate::accel::{EndCaps, GeometryData, Indexing};
use crate::error::{Error, ErrorKind, Result};
use crate::geometry::Ray;

/// A ray and a few primitives of one kind in one instance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Case {
    /// The family that drew it.
    pub family: String,
    /// Where t is 0.
    pub origin: [f32; 3],
    /// The way per unit of t.
    pub direction: [f32; 3],
    /// The least t.
    pub t_min: f32,
    /// The greatest t.
    pub t_max: f32,
    /// Object to world, row-major 3x4; none is the identity.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub transform: Option<[[f32; 4]; 3]>,
    /// Primitives, all of one kind.
    pub shapes: Vec<Shape>,
}

/// A primitive.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Shape {
    /// Three vertices.
    Triangle([[f32; 3]; 3]),
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

impl Case {
    /// Shapes and a ray over the whole half-line.
    pub fn new(shapes: Vec<Shape>, (ray, transform): (Ray, Option<[[f32; 4]; 3]>)) -> Self {
        let Ray { origin, direction, t_min, t_max } = ray;
        Self { family: String::new(), origin, direction, t_min, t_max, transform, shapes }
    }

    /// The same, of a family.
    #[must_use]
    pub fn named(self, family: &str) -> Self {
        Self { family: family.to_owned(), ..self }
    }

    /// The ray.
    pub fn ray(&self) -> Ray {
        Ray { origin: self.origin, direction: self.direction, t_min: self.t_min, t_max: self.t_max }
    }

    /// All its numbers, for changing them one by one.
    pub fn numbers(&mut self) -> Vec<&mut f32> {
        let mut out: Vec<&mut f32> = self.origin.iter_mut().chain(&mut self.direction).collect();
        out.extend([&mut self.t_min, &mut self.t_max]);
        out.extend(self.transform.iter_mut().flatten().flatten());
        for shape in &mut self.shapes {
            match shape {
                Shape::Triangle(vertices) => out.extend(vertices.as_flattened_mut()),
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

    /// The primitives as a geometry, where one of Vulkan's forms can hold them: swept spheres need
    /// both caps, or none, on all.
    pub fn geometry(&self) -> Option<GeometryData> {
        let first = self.shapes.first()?;
        Some(match first {
            Shape::Triangle(_) => {
                let vertices = self.shapes.iter().filter_map(|shape| match shape {
                    Shape::Triangle(vertices) => Some(*vertices),
                    _ => None,
                });
                GeometryData::Triangles {
                    vertices: vertices.flatten().collect(),
                    indices: None,
                    transform: None,
                }
            }
            Shape::Aabb(_) => {
                let boxes = self.shapes.iter().filter_map(|shape| match *shape {
                    Shape::Aabb([[x0, y0, z0], [x1, y1, z1]]) => Some([x0, y0, z0, x1, y1, z1]),
                    _ => None,
                });
                GeometryData::Aabbs(boxes.collect())
            }
            Shape::Sphere { .. } => {
                let spheres = self.shapes.iter().filter_map(|shape| match *shape {
                    Shape::Sphere { center, radius } => Some((center, radius)),
                    _ => None,
                });
                let (positions, radii) = spheres.unzip();
                GeometryData::Spheres { positions, radii, indices: None }
            }
            Shape::LinearSweptSphere { caps: wanted, .. } => {
                let end_caps = match wanted {
                    [true, true] => EndCaps::Chained,
                    [false, false] => EndCaps::None,
                    _ => return None,
                };
                let (mut all_positions, mut all_radii) = (Vec::new(), Vec::new());
                for shape in &self.shapes {
                    let Shape::LinearSweptSphere { positions, radii, caps } = shape else { continue };
                    if caps != wanted {
                        return None;
                    }
                    all_positions.extend(*positions);
                    all_radii.extend(*radii);
                }
                GeometryData::LinearSweptSpheres {
                    positions: all_positions,
                    radii: all_radii,
                    indices: None,
                    indexing: Indexing::List,
                    end_caps,
                }
            }
        })
    }

    /// The case as a file.
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("bug in anyhit: plain numbers are TOML")
    }

    /// Reads what [`Case::to_toml`] wrote.
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
        let mut case = Case::new(shapes, (ray, Some([[0.1; 4]; 3]))).named("test");
        let mut again = Case::from_toml(&case.to_toml()).unwrap();
        assert_eq!(case, again);
        let bits = |case: &mut Case| case.numbers().iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&mut case), bits(&mut again));
        assert!(Case::from_toml("family = 1").is_err());
    }
}
