//! An instance: what a TLAS says of a BLAS that it places.

use std::sync::Arc;

use crate::accel::blas::Blas;
use crate::accel::flags::{InstanceFlags, RayFlags};
use crate::accel::motion::{Motion, or_identity};
use crate::accel::rules::{is_culled_by_opacity, is_skipped, is_visible, skips_any};
use crate::accel::transform::IDENTITY;

/// An instance of a BLAS.
#[derive(Clone, Debug)]
pub struct TlasInstance {
    /// The BLAS that the instance places.
    pub blas: Arc<Blas>,
    /// Object to world, row-major 3x4 (`VkTransformMatrixKHR`); counts where `motion` is `None`.
    pub transform: [[f32; 4]; 3],
    /// How it moves; `None` for an instance at rest.
    pub motion: Option<Motion>,
    /// `InstanceCustomIndexKHR`, 24 bits.
    pub custom_index: u32,
    /// Visibility mask, compared with the ray's cull mask.
    pub mask: u8,
    /// `instanceShaderBindingTableRecordOffset`, 24 bits.
    pub sbt_record_offset: u32,
    /// The flags of the instance.
    pub flags: InstanceFlags,
}

impl TlasInstance {
    /// An instance at rest that is visible to every ray (mask 0xFF), with custom index, offset and
    /// flags 0; `transform` is object to world.
    pub fn of(blas: Arc<Blas>, transform: [[f32; 4]; 3]) -> Self {
        let (custom_index, sbt_record_offset, flags) = (0, 0, InstanceFlags::default());
        Self { blas, transform, motion: None, custom_index, mask: 0xFF, sbt_record_offset, flags }
    }

    /// Whether object space is world space at any time.
    #[inline]
    pub fn is_identity(&self) -> bool {
        self.motion.is_none() && self.transform == IDENTITY
    }

    /// Whether the masks or the flags of a ray let it pass all of the instance, whose primitives
    /// are opaque to it.
    #[inline(always)]
    pub(super) fn is_passed_by(&self, flags: RayFlags, cull_mask: u32) -> bool {
        !is_visible(self.mask, cull_mask)
            || is_culled_by_opacity(flags, true)
            || skips_any(flags) && self.blas.kind().is_some_and(|kind| is_skipped(flags, kind))
    }

    /// Object to world at a time within 0 and 1 (`ObjectToWorldKHR`, row-major). The identity where
    /// there is none: no ray hits such an instance.
    pub fn object_to_world(&self, time: f32) -> [[f32; 4]; 3] {
        match &self.motion {
            None => self.transform,
            Some(motion) => or_identity(motion.at(time)),
        }
    }
}
