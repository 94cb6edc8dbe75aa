//! Makes the geometries of a BLAS from the primitives of a case.

use std::sync::Arc;

use crate::case::{Shape, StressCase};
use anyhit_engine::accel::{EndCaps, Geometry, GeometryData, GeometryFlags, Indexing};

/// The most primitives in a geometry of a case, so that cases with many have several geometries.
const MAX_PRIMITIVES: usize = 48;

/// The kinds of primitives, each of which can share a geometry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Triangles,
    MovingTriangles,
    Aabbs,
    Spheres,
    /// Linear swept spheres, with no caps or with those of a chain.
    LinearSweptSpheres(EndCaps),
}

impl Shape {
    /// `None` for a swept sphere of which only the first cap can be hit.
    fn kind(&self) -> Option<Kind> {
        Some(match self {
            Self::Triangle(_) => Kind::Triangles,
            Self::MovingTriangle(_) => Kind::MovingTriangles,
            Self::Aabb(_) => Kind::Aabbs,
            Self::Sphere { .. } => Kind::Spheres,
            Self::LinearSweptSphere { caps: [false, false], .. } => Kind::LinearSweptSpheres(EndCaps::None),
            Self::LinearSweptSphere { caps: [_, true], .. } => Kind::LinearSweptSpheres(EndCaps::Chained),
            Self::LinearSweptSphere { caps: [true, false], .. } => return None,
        })
    }

    /// Whether it continues from the end of the one before it, without a cap of its own there.
    fn follows(&self) -> bool {
        matches!(self, Self::LinearSweptSphere { caps: [false, true], .. })
    }
}

impl StressCase {
    /// The primitives as opaque geometries, and of each how many primitives it has: in their order,
    /// so that (geometry, primitive) keeps their order. `None` if Vulkan cannot express them: a
    /// swept sphere has both caps or none, or only the second if it begins with the end of the one
    /// before it.
    pub fn geometries(&self) -> Option<(Vec<Geometry>, Vec<usize>)> {
        let (mut geometries, mut counts) = (Vec::new(), Vec::new());
        let mut rest = &self.shapes[..];
        while let Some(first) = rest.first() {
            let kind = first.kind()?;
            let fits =
                |at: usize| rest[at].kind() == Some(kind) && (at < MAX_PRIMITIVES || rest[at].follows());
            let count = (0..rest.len()).find(|&at| !fits(at)).unwrap_or(rest.len());
            geometries.push(geometry(kind, &rest[..count])?);
            counts.push(count);
            rest = &rest[count..];
        }
        (!geometries.is_empty()).then_some((geometries, counts))
    }
}

fn geometry(kind: Kind, shapes: &[Shape]) -> Option<Geometry> {
    let opaque = |data: GeometryData| Geometry::new(data, GeometryFlags::OPAQUE);
    let triangles = |vertices: Vec<[f32; 3]>| {
        opaque(GeometryData::Triangles { vertices, indices: None, transform: None })
    };
    Some(match kind {
        Kind::Triangles => triangles(
            shapes
                .iter()
                .filter_map(|shape| match shape {
                    Shape::Triangle(vertices) => Some(*vertices),
                    _ => None,
                })
                .flatten()
                .collect(),
        ),
        Kind::MovingTriangles => {
            let key = |key: usize| {
                let vertices = shapes.iter().filter_map(move |shape| match shape {
                    Shape::MovingTriangle(keys) => Some(keys[key]),
                    _ => None,
                });
                vertices.flatten().collect::<Vec<_>>()
            };
            Geometry { vertices_t1: Some(Arc::from(key(1))), ..triangles(key(0)) }
        }
        Kind::Aabbs => {
            let boxes = shapes.iter().filter_map(|shape| match *shape {
                Shape::Aabb([[x0, y0, z0], [x1, y1, z1]]) => Some([x0, y0, z0, x1, y1, z1]),
                _ => None,
            });
            opaque(GeometryData::Aabbs(boxes.collect()))
        }
        Kind::Spheres => {
            let spheres = shapes.iter().filter_map(|shape| match *shape {
                Shape::Sphere { center, radius } => Some((center, radius)),
                _ => None,
            });
            let (positions, radii) = spheres.unzip();
            opaque(GeometryData::Spheres { positions, radii, indices: None })
        }
        Kind::LinearSweptSpheres(end_caps) => opaque(swept(end_caps, shapes)?),
    })
}

/// Makes the data of swept spheres: pairs of vertices, or successive indices if some continue
/// others.
fn swept(end_caps: EndCaps, shapes: &[Shape]) -> Option<GeometryData> {
    let (mut all_positions, mut all_radii) = (Vec::<[f32; 3]>::new(), Vec::<f32>::new());
    let mut indices = Vec::new();
    for shape in shapes {
        let Shape::LinearSweptSphere { positions, radii, .. } = shape else { return None };
        let bits = |position: [f32; 3], radius: f32| (position.map(f32::to_bits), radius.to_bits());
        if shape.follows() {
            let (position, radius) = (*all_positions.last()?, *all_radii.last()?);
            if bits(position, radius) != bits(positions[0], radii[0]) {
                return None;
            }
            indices.push(all_positions.len() as u32 - 1);
        } else {
            indices.push(all_positions.len() as u32);
            all_positions.push(positions[0]);
            all_radii.push(radii[0]);
        }
        all_positions.push(positions[1]);
        all_radii.push(radii[1]);
    }
    let chained = shapes.iter().any(Shape::follows);
    Some(GeometryData::LinearSweptSpheres {
        positions: all_positions,
        radii: all_radii,
        indices: chained.then_some(indices),
        indexing: if chained { Indexing::Successive } else { Indexing::List },
        end_caps,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhit_engine::accel::Primitive;
    use anyhit_engine::geometry::Ray;

    /// Checks that the primitives of a BLAS are those of the case.
    fn check(shapes: Vec<Shape>, counts: &[usize]) {
        let case = StressCase::new(shapes, Ray::new([0.0; 3], [1.0; 3]).into());
        let (geometries, found) = case.geometries().expect("one of the forms");
        assert_eq!(found, counts);
        let mut shapes = case.shapes.iter();
        for (geometry, &count) in geometries.iter().zip(&found) {
            assert_eq!(geometry.data.primitive_count(), count);
            for primitive in 0..count as u32 {
                let there = [0.0, 1.0].map(|time| geometry.primitive_at(primitive, time));
                let wanted = match *shapes.next().expect("as many") {
                    Shape::Triangle(vertices) => [Primitive::Triangle(vertices); 2],
                    Shape::MovingTriangle(keys) => keys.map(Primitive::Triangle),
                    Shape::Aabb([[a, b, c], [d, e, f]]) => [Primitive::Aabb([a, b, c, d, e, f]); 2],
                    Shape::Sphere { center, radius } => [Primitive::Sphere { position: center, radius }; 2],
                    Shape::LinearSweptSphere { positions, radii, caps } => {
                        [Primitive::LinearSweptSphere { positions, radii, caps }; 2]
                    }
                };
                assert_eq!(there, wanted);
            }
        }
        assert!(shapes.next().is_none());
    }

    #[test]
    fn every_shape_stands_in_its_geometry() {
        let at = |k: usize| [k as f32, 0.5, 0.0];
        check((0..100).map(|k| Shape::Sphere { center: at(k), radius: 1.0 }).collect(), &[48, 48, 4]);
        let still = |k: usize| Shape::Triangle([at(k), at(k + 1), [0.0; 3]]);
        let moving = |k: usize| Shape::MovingTriangle([[at(k); 3], [at(k + 1); 3]]);
        check(vec![still(0), still(1), moving(2), still(3)], &[2, 1, 1]);
        check(vec![Shape::Aabb([at(0), at(1)])], &[1]);
    }

    #[test]
    fn chains_of_swept_spheres_share_their_joints() {
        let link = |k: usize, caps: [bool; 2]| Shape::LinearSweptSphere {
            positions: [[k as f32; 3], [k as f32 + 1.0; 3]],
            radii: [k as f32, k as f32 + 1.0],
            caps,
        };
        let chain = vec![
            link(0, [true, true]),
            link(1, [false, true]),
            link(2, [false, true]),
            link(3, [true, true]),
            link(4, [false, false]),
        ];
        check(chain, &[4, 1]);
        // A chain is not cut where a geometry would be full.
        let long = (0..70).map(|k| link(k, [k == 0, true])).collect();
        check(long, &[70]);
        let refused = |shapes: Vec<Shape>| {
            StressCase::new(shapes, Ray::new([0.0; 3], [1.0; 3]).into()).geometries().is_none()
        };
        assert!(refused(vec![link(0, [false, true])]), "it follows nothing");
        assert!(refused(vec![link(0, [true, true]), link(5, [false, true])]), "another end");
        assert!(refused(vec![link(0, [true, false])]));
        assert!(refused(vec![]));
    }
}
