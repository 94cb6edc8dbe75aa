//! Shader groups.

use crate::machine::ShaderIndex;
use crate::module::interface::Stage;

/// A shader group (`VkRayTracingShaderGroupCreateInfoKHR`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// Ray generation, miss or callable.
    General(ShaderIndex),
    /// The shaders of a hit group.
    Hit(HitGroup),
}

/// A hit group: for triangles, spheres and linear swept spheres without an intersection shader, for
/// boxes with one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HitGroup {
    /// Runs once for the closest hit.
    pub closest_hit: Option<ShaderIndex>,
    /// Runs for each non-opaque candidate.
    pub any_hit: Option<ShaderIndex>,
    /// Runs for each box.
    pub intersection: Option<ShaderIndex>,
}

impl HitGroup {
    /// The member for a stage's shader; `None` for a stage that hit groups do not have.
    pub fn member(&mut self, stage: Stage) -> Option<&mut Option<ShaderIndex>> {
        match stage {
            Stage::ClosestHit => Some(&mut self.closest_hit),
            Stage::AnyHit => Some(&mut self.any_hit),
            Stage::Intersection => Some(&mut self.intersection),
            _ => None,
        }
    }
}

/// The role in which a shader runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    RayGeneration,
    AnyHit,
    /// An any-hit shader that decides on a report of an intersection shader.
    ReportedAnyHit,
    Intersection,
    ClosestHit,
    Miss,
    Callable,
}
