//! Bottom-level acceleration structures.

use std::sync::Arc;

use crate::accel::geometry_data::GeometryData;
use crate::error::Result;

/// `VkGeometryFlagsKHR`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct GeometryFlags(pub u32);

impl GeometryFlags {
    /// `VK_GEOMETRY_OPAQUE_BIT_KHR`
    pub const OPAQUE: Self = Self(1);
    /// `VK_GEOMETRY_NO_DUPLICATE_ANY_HIT_INVOCATION_BIT_KHR`
    pub const NO_DUPLICATE_ANY_HIT: Self = Self(2);
}

/// One geometry of a BLAS.
#[derive(Clone, Debug, PartialEq)]
pub struct Geometry {
    /// Its primitives.
    pub data: GeometryData,
    /// Its flags.
    pub flags: GeometryFlags,
}

/// A bottom-level acceleration structure: geometries of one kind over one tree.
#[derive(Debug)]
pub struct Blas {
    geometries: Vec<Geometry>,
}

impl Blas {
    /// Takes the geometries; the tree is built on first use.
    ///
    /// # Errors
    /// `InvalidScene` where kinds are mixed (VUID-VkAccelerationStructureBuildGeometryInfoKHR-type-03792),
    /// an index is out of range or a count does not fit.
    pub fn new(geometries: Vec<Geometry>) -> Result<Arc<Self>> {
        Ok(Arc::new(Self { geometries }))
    }

    /// The geometries in the order of their `RayGeometryIndexKHR`.
    pub fn geometries(&self) -> &[Geometry] {
        &self.geometries
    }
}
