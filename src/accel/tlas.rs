//! Top-level acceleration structures and instances.

use std::sync::Arc;

use crate::accel::blas::Blas;
use crate::error::Result;

/// `VkGeometryInstanceFlagsKHR`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct InstanceFlags(pub u32);

/// An instance of a BLAS.
#[derive(Clone, Debug)]
pub struct Instance {
    /// What is placed.
    pub blas: Arc<Blas>,
    /// Object to world, row-major 3x4 (`VkTransformMatrixKHR`).
    pub transform: [[f32; 4]; 3],
    /// `InstanceCustomIndexKHR`, 24 bits.
    pub custom_index: u32,
    /// Visibility mask, compared with the ray's cull mask.
    pub mask: u8,
    /// `instanceShaderBindingTableRecordOffset`, 24 bits.
    pub sbt_record_offset: u32,
    /// Flags.
    pub flags: InstanceFlags,
}

/// A top-level acceleration structure.
#[derive(Debug)]
pub struct Tlas {
    instances: Vec<Instance>,
}

impl Tlas {
    /// Takes the instances in the order of their `InstanceId`.
    ///
    /// # Errors
    /// `InvalidScene` where a field has too many bits.
    pub fn new(instances: Vec<Instance>) -> Result<Arc<Self>> {
        Ok(Arc::new(Self { instances }))
    }

    /// The instances in the order of their `InstanceId`.
    pub fn instances(&self) -> &[Instance] {
        &self.instances
    }
}
