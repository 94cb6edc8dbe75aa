//! The flags of a pipeline.

use crate::accel::{GeometryKind, Tlas};
use crate::error::{Error, ErrorKind, Result};
use crate::pipeline::group::{Group, HitGroup};

/// `VkPipelineCreateFlags2` that change what rays meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PipelineFlags {
    /// `VK_PIPELINE_CREATE_2_RAY_TRACING_SKIP_TRIANGLES_BIT_KHR`, alias
    /// `..._SKIP_BUILT_IN_PRIMITIVES_BIT_KHR`: no ray meets triangles, spheres or linear swept spheres.
    pub skip_triangles: bool,
    /// `VK_PIPELINE_CREATE_2_RAY_TRACING_SKIP_AABBS_BIT_KHR`: no ray meets boxes.
    pub skip_aabbs: bool,
    /// `VK_PIPELINE_CREATE_2_RAY_TRACING_ALLOW_SPHERES_AND_LINEAR_SWEPT_SPHERES_BIT_NV`. Vulkan asks for
    /// it; on by default, so that only a test which takes it away meets the difference.
    pub allow_spheres_and_linear_swept_spheres: bool,
    /// `VK_PIPELINE_CREATE_2_RAY_TRACING_NO_NULL_ANY_HIT_SHADERS_BIT_KHR`: a candidate whose any-hit shader
    /// is null traps.
    pub no_null_any_hit_shaders: bool,
    /// `VK_PIPELINE_CREATE_2_RAY_TRACING_NO_NULL_CLOSEST_HIT_SHADERS_BIT_KHR`: so does a hit.
    pub no_null_closest_hit_shaders: bool,
    /// `VK_PIPELINE_CREATE_2_RAY_TRACING_NO_NULL_MISS_SHADERS_BIT_KHR`: so does a miss.
    pub no_null_miss_shaders: bool,
    /// `VK_PIPELINE_CREATE_2_RAY_TRACING_NO_NULL_INTERSECTION_SHADERS_BIT_KHR`: so does a box.
    pub no_null_intersection_shaders: bool,
}

impl Default for PipelineFlags {
    fn default() -> Self {
        Self {
            skip_triangles: false,
            skip_aabbs: false,
            allow_spheres_and_linear_swept_spheres: true,
            no_null_any_hit_shaders: false,
            no_null_closest_hit_shaders: false,
            no_null_miss_shaders: false,
            no_null_intersection_shaders: false,
        }
    }
}

impl PipelineFlags {
    /// The ray flags that every ray of the pipeline has besides its own. No shader sees them.
    pub fn ray_flags(self) -> u32 {
        let skip_triangles = if self.skip_triangles { 0x100 } else { 0 };
        skip_triangles | if self.skip_aabbs { 0x200 } else { 0 }
    }

    /// Checks that hit groups name the shaders that the pipeline promises.
    ///
    /// # Errors
    /// `InvalidScene` where one does not.
    pub(super) fn check_groups(self, groups: &[Group]) -> Result<()> {
        let rules = [
            (self.no_null_any_hit_shaders, "any-hit", "NO_NULL_ANY_HIT_SHADERS", "03470"),
            (self.no_null_closest_hit_shaders, "closest-hit", "NO_NULL_CLOSEST_HIT_SHADERS", "03471"),
        ];
        for (at, group) in groups.iter().enumerate() {
            let Group::Hit(HitGroup { any_hit, closest_hit, .. }) = group else { continue };
            for ((promised, what, flag, number), shader) in rules.into_iter().zip([any_hit, closest_hit]) {
                if promised && shader.is_none() {
                    let message = format!("hit group {at} has no {what} shader, and the pipeline has {flag}");
                    let rule = format!("VUID-VkRayTracingPipelineCreateInfoKHR-flags-{number}");
                    return Err(Error::new(ErrorKind::InvalidScene, message).note(rule));
                }
            }
        }
        Ok(())
    }

    /// Checks that what a pipeline will meet is allowed.
    ///
    /// # Errors
    /// `InvalidScene` where a structure holds spheres or linear swept spheres and the pipeline does not
    /// allow them.
    pub fn check_structure(self, tlas: &Tlas) -> Result<()> {
        let swept = |kind| matches!(kind, GeometryKind::Spheres | GeometryKind::LinearSweptSpheres);
        let kinds = tlas.instances().iter().filter_map(|instance| instance.blas.kind());
        match kinds.enumerate().find(|(_, kind)| swept(*kind)) {
            Some((at, kind)) if !self.allow_spheres_and_linear_swept_spheres => {
                let message = format!("instance {at} holds {kind}, which the pipeline does not allow");
                let flag = "VK_PIPELINE_CREATE_2_RAY_TRACING_ALLOW_SPHERES_AND_LINEAR_SWEPT_SPHERES_BIT_NV is missing";
                Err(Error::new(ErrorKind::InvalidScene, message).note(flag))
            }
            _ => Ok(()),
        }
    }
}
