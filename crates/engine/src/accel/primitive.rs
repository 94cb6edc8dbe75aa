//! One primitive of a geometry: its vertices, corners, or centres and radii.

use crate::accel::geometry_data::{EndCaps, GeometryData, Indexing};
use crate::accel::transform::transform_point;
use crate::math::array;

/// The data of one primitive in object space, as the intersectors and the hit builtins take it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Primitive {
    /// Three vertices, the geometry transform applied.
    Triangle([[f32; 3]; 3]),
    /// Minimum, then maximum.
    Aabb([f32; 6]),
    /// A sphere.
    Sphere {
        /// Its centre.
        position: [f32; 3],
        /// Its radius.
        radius: f32,
    },
    /// A linear swept sphere.
    LinearSweptSphere {
        /// Both centres, in primitive order.
        positions: [[f32; 3]; 2],
        /// Both radii.
        radii: [f32; 2],
        /// Which of the two caps can be hit.
        caps: [bool; 2],
    },
}

/// Visits the primitives of a geometry. (A closure would not be compiled for each kind.)
pub(super) trait PrimitiveVisitor {
    /// Visits primitive `PrimitiveId`. Implementations must be `#[inline(always)]`.
    fn visit(&mut self, primitive: u32, data: Primitive);
}

impl GeometryData {
    /// The data of primitive `PrimitiveId`.
    ///
    /// # Panics
    /// Where the primitive or a vertex that it names does not exist: `Blas::new` has checked that.
    #[doc(hidden)]
    #[inline]
    pub fn primitive(&self, primitive: u32) -> Primitive {
        let at = primitive as usize;
        match self {
            Self::Triangles { vertices, indices, transform } => {
                Primitive::Triangle(triangle(vertices, indices, transform, primitive))
            }
            Self::Aabbs(boxes) => Primitive::Aabb(boxes[at]),
            Self::Spheres { positions, radii, indices } => sphere(positions, radii, indices, at),
            Self::LinearSweptSpheres { positions, radii, indices, indexing, end_caps } => {
                linear_swept_sphere(positions, radii, indices, *indexing, *end_caps, at)
            }
        }
    }

    /// Visits all primitives in turn, and matches on their kind only once.
    ///
    /// # Panics
    /// As [`GeometryData::primitive`].
    #[inline(always)]
    pub(super) fn visit_primitives(&self, to: &mut impl PrimitiveVisitor) {
        let all = 0..self.primitive_count() as u32;
        match self {
            Self::Triangles { vertices, indices, transform } => {
                all.for_each(|at| {
                    to.visit(at, Primitive::Triangle(triangle(vertices, indices, transform, at)))
                });
            }
            Self::Aabbs(boxes) => all.for_each(|at| to.visit(at, Primitive::Aabb(boxes[at as usize]))),
            Self::Spheres { positions, radii, indices } => {
                all.for_each(|at| to.visit(at, sphere(positions, radii, indices, at as usize)));
            }
            Self::LinearSweptSpheres { positions, radii, indices, indexing, end_caps } => {
                let (indexing, end_caps) = (*indexing, *end_caps);
                all.for_each(|at| {
                    let index = at as usize;
                    to.visit(at, linear_swept_sphere(positions, radii, indices, indexing, end_caps, index))
                });
            }
        }
    }
}

/// The centre and the radius of a sphere.
#[inline(always)]
pub(super) fn sphere(
    positions: &[[f32; 3]],
    radii: &[f32],
    indices: &Option<Vec<u32>>,
    at: usize,
) -> Primitive {
    let entry = vertex_index(indices, at);
    Primitive::Sphere { position: positions[entry], radius: radii[entry] }
}

#[inline(always)]
fn linear_swept_sphere(
    positions: &[[f32; 3]],
    radii: &[f32],
    indices: &Option<Vec<u32>>,
    indexing: Indexing,
    end_caps: EndCaps,
    at: usize,
) -> Primitive {
    let end_vertices = end_vertices(indices, indexing, at);
    Primitive::LinearSweptSphere {
        positions: array::map(end_vertices, |end| positions[end]),
        radii: array::map(end_vertices, |end| radii[end]),
        caps: caps(indices.as_deref(), indexing, end_caps, at),
    }
}

/// The indices of the two vertices that a linear swept sphere spans.
#[inline(always)]
pub(super) fn end_vertices(indices: &Option<Vec<u32>>, indexing: Indexing, at: usize) -> [usize; 2] {
    match indexing {
        Indexing::List => [vertex_index(indices, 2 * at), vertex_index(indices, 2 * at + 1)],
        Indexing::Successive => {
            let entry = vertex_index(indices, at);
            [entry, entry + 1]
        }
    }
}

/// The vertices of a triangle, the geometry transform applied.
#[inline(always)]
pub(super) fn triangle(
    vertices: &[[f32; 3]],
    indices: &Option<Vec<u32>>,
    transform: &Option<[[f32; 4]; 3]>,
    primitive: u32,
) -> [[f32; 3]; 3] {
    let first = 3 * primitive as usize;
    let mut corners = match indices {
        Some(indices) => {
            let [a, b, c] = [indices[first], indices[first + 1], indices[first + 2]];
            [vertices[a as usize], vertices[b as usize], vertices[c as usize]]
        }
        None => [vertices[first], vertices[first + 1], vertices[first + 2]],
    };
    if let Some(matrix) = transform {
        for corner in &mut corners {
            *corner = transform_point(matrix, *corner);
        }
    }
    corners
}

/// The vertex that an entry of the (perhaps absent) index buffer names.
#[inline(always)]
fn vertex_index(indices: &Option<Vec<u32>>, entry: usize) -> usize {
    indices.as_ref().map_or(entry, |indices| indices[entry] as usize)
}

/// Which caps of LSS primitive `at` can be hit.
///
/// Vulkan's rule (accelstructures, "LSS end caps"): under `Chained` the first primitive of a chain
/// has both, each following one only its trailing cap. A chain goes on where an index is its
/// predecessor plus one; that rule and the ownership of the joint were measured on NVIDIA's driver.
/// In `List` mode there are no chains: every primitive has both.
#[inline(always)]
pub(super) fn caps(indices: Option<&[u32]>, indexing: Indexing, end_caps: EndCaps, at: usize) -> [bool; 2] {
    match (end_caps, indexing) {
        (EndCaps::None, _) => [false, false],
        (EndCaps::Chained, Indexing::List) => [true, true],
        (EndCaps::Chained, Indexing::Successive) => {
            let follows =
                indices.is_some_and(|indices| at > 0 && indices[at - 1].checked_add(1) == Some(indices[at]));
            [!follows, true]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chain(indices: Vec<u32>, indexing: Indexing, end_caps: EndCaps) -> Vec<[bool; 2]> {
        let count = 16;
        let data = GeometryData::LinearSweptSpheres {
            positions: vec![[0.0; 3]; count],
            radii: vec![1.0; count],
            indices: Some(indices),
            indexing,
            end_caps,
        };
        (0..data.primitive_count() as u32)
            .map(|i| match data.primitive(i) {
                Primitive::LinearSweptSphere { caps, .. } => caps,
                other => panic!("{other:?}"),
            })
            .collect()
    }

    #[test]
    fn a_chain_ends_where_the_index_jumps() {
        const FIRST: [bool; 2] = [true, true];
        const NEXT: [bool; 2] = [false, true];
        // The Vulkan example: [0, 1, 2, 4] leaves vertex 3 unconnected to vertex 4.
        assert_eq!(
            chain(vec![0, 1, 2, 4], Indexing::Successive, EndCaps::Chained),
            [FIRST, NEXT, NEXT, FIRST]
        );
        // Repeats and descents start anew.
        assert_eq!(
            chain(vec![5, 5, 4, 5, 6], Indexing::Successive, EndCaps::Chained),
            [FIRST, FIRST, FIRST, NEXT, NEXT]
        );
        assert_eq!(chain(vec![0, 1], Indexing::Successive, EndCaps::None), [[false; 2]; 2]);
        // In list mode shared vertices do not make a chain.
        assert_eq!(chain(vec![0, 1, 1, 2], Indexing::List, EndCaps::Chained), [FIRST, FIRST]);
    }

    #[test]
    fn indices_choose_position_and_radius() {
        let data = GeometryData::LinearSweptSpheres {
            positions: vec![[0.0; 3], [1.0; 3], [2.0; 3], [3.0; 3]],
            radii: vec![0.5, 1.5, 2.5, 3.5],
            indices: Some(vec![2, 0]),
            indexing: Indexing::Successive,
            end_caps: EndCaps::Chained,
        };
        assert_eq!(
            data.primitive(0),
            Primitive::LinearSweptSphere {
                positions: [[2.0; 3], [3.0; 3]],
                radii: [2.5, 3.5],
                caps: [true; 2]
            }
        );
        let spheres = GeometryData::Spheres {
            positions: vec![[0.0; 3], [1.0; 3]],
            radii: vec![0.5, 1.5],
            indices: Some(vec![1]),
        };
        assert_eq!(spheres.primitive(0), Primitive::Sphere { position: [1.0; 3], radius: 1.5 });
    }

    #[test]
    fn without_indices_entries_are_taken_in_turn() {
        let positions = (0..5).map(|i| [i as f32; 3]).collect();
        let data = GeometryData::LinearSweptSpheres {
            positions,
            radii: vec![1.0; 5],
            indices: None,
            indexing: Indexing::List,
            end_caps: EndCaps::None,
        };
        // The trailing odd vertex is ignored.
        assert_eq!(data.primitive_count(), 2);
        assert_eq!(
            data.primitive(1),
            Primitive::LinearSweptSphere {
                positions: [[2.0; 3], [3.0; 3]],
                radii: [1.0; 2],
                caps: [false; 2]
            }
        );
    }
}
