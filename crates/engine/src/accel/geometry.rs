//! A geometry of a BLAS: primitives of one kind with their flags, micromap and motion.

use std::fmt;
use std::sync::Arc;

use crate::accel::flags::GeometryFlags;
use crate::accel::geometry_data::GeometryData;
use crate::accel::micromap::OpacityMicromap;
use crate::accel::motion::interpolate;
use crate::accel::primitive::{Primitive, triangle};
use crate::math::array;

/// One geometry of a BLAS.
#[derive(Clone, PartialEq)]
pub struct Geometry {
    /// The primitives of the geometry.
    pub data: GeometryData,
    /// The flags of the geometry.
    pub flags: GeometryFlags,
    /// Opacity of the triangles' parts, which then stands in place of [`GeometryFlags::OPAQUE`].
    pub opacity_micromap: Option<Arc<OpacityMicromap>>,
    /// `ClusterIDNV` of its triangles; without it they belong to no cluster.
    pub cluster_id: Option<u32>,
    /// Positions at time 1 of triangles whose own vertices are those of time 0, one for each
    /// (`VkAccelerationStructureGeometryMotionTrianglesDataNV`); without it they are at rest.
    pub vertices_t1: Option<Arc<[[f32; 3]]>>,
}

/// Data and flags; of what may be large only whether it is there.
impl fmt::Debug for Geometry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { data, flags, opacity_micromap, cluster_id, vertices_t1 } = self;
        f.debug_struct("Geometry")
            .field("data", data)
            .field("flags", flags)
            .field("has_opacity_micromap", &opacity_micromap.is_some())
            .field("cluster_id", cluster_id)
            .field("moves", &vertices_t1.is_some())
            .finish()
    }
}

/// How many primitives geometries hold together, inactive ones included.
pub fn primitive_count(geometries: &[Geometry]) -> usize {
    geometries.iter().map(|geometry| geometry.data.primitive_count()).sum()
}

/// Whether vertices of any of them move.
pub(super) fn moves(geometries: &[Geometry]) -> bool {
    geometries.iter().any(|geometry| geometry.vertices_t1.is_some())
}

impl Geometry {
    /// Primitives at rest, without micromap or cluster.
    pub fn new(data: GeometryData, flags: GeometryFlags) -> Self {
        Self { data, flags, opacity_micromap: None, cluster_id: None, vertices_t1: None }
    }

    /// The data of primitive `PrimitiveId` at a time within 0 and 1: the vertices of a triangle
    /// that moves are interpolated, after the geometry transform.
    ///
    /// # Panics
    /// As [`GeometryData::primitive`].
    pub fn primitive_at(&self, primitive: u32, time: f32) -> Primitive {
        match self.motion_keys(primitive) {
            Some(motion_keys) => Primitive::Triangle(interpolate_triangle(&motion_keys, time)),
            None => self.data.primitive(primitive),
        }
    }

    /// The vertices of a triangle at time 0 and at time 1, which are the same where it is at rest.
    pub(super) fn keys(&self, primitive: u32) -> Option<[[[f32; 3]; 3]; 2]> {
        self.motion_keys(primitive).or_else(|| match self.data.primitive(primitive) {
            Primitive::Triangle(vertices) => Some([vertices; 2]),
            _ => None,
        })
    }

    /// The vertices of a triangle that moves, at time 0 and at time 1 (its motion keys).
    pub(super) fn motion_keys(&self, primitive: u32) -> Option<[[[f32; 3]; 3]; 2]> {
        let (GeometryData::Triangles { vertices, indices, transform }, Some(later)) =
            (&self.data, &self.vertices_t1)
        else {
            return None;
        };
        Some(array::map([&vertices[..], &later[..]], |all| triangle(all, indices, transform, primitive)))
    }
}

/// Interpolates the vertices of a triangle between its two motion keys.
pub(super) fn interpolate_triangle([first, second]: &[[[f32; 3]; 3]; 2], time: f32) -> [[f32; 3]; 3] {
    array::from_fn(|corner| {
        array::from_fn(|axis| interpolate(first[corner][axis], second[corner][axis], time))
    })
}
