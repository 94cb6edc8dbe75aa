//! The flags of a pipeline.

use crate::accel::{GeometryKind, Tlas};
use crate::machine::OpIndex;
use crate::module::Opcode;
use crate::ops::ray_tracing::MotionInstruction;
use crate::pipeline::Pipeline;
use crate::pipeline::group::{Group, HitGroup};
use crate::program::Program;
use anyhit_base::error::{Error, ErrorKind, Result};

/// `VkPipelineCreateFlags2` that change traversal or what shaders a ray may call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PipelineFlags {
    /// `VK_PIPELINE_CREATE_2_RAY_TRACING_SKIP_TRIANGLES_BIT_KHR`, alias
    /// `..._SKIP_BUILT_IN_PRIMITIVES_BIT_KHR`: rays skip triangles, spheres and linear swept
    /// spheres.
    pub skip_triangles: bool,
    /// `VK_PIPELINE_CREATE_2_RAY_TRACING_SKIP_AABBS_BIT_KHR`: rays skip boxes.
    pub skip_aabbs: bool,
    /// `VK_PIPELINE_CREATE_2_RAY_TRACING_ALLOW_SPHERES_AND_LINEAR_SWEPT_SPHERES_BIT_NV`. Vulkan
    /// requires it for such geometry. It is on by default, so that only tests that clear it see the
    /// difference.
    pub allow_spheres_and_linear_swept_spheres: bool,
    /// `VK_PIPELINE_CREATE_2_RAY_TRACING_ALLOW_MOTION_BIT_NV`, which Vulkan requires if
    /// something moves or a ray has a time. It is on by default, too.
    pub allow_motion: bool,
    /// `VK_PIPELINE_CREATE_2_RAY_TRACING_OPACITY_MICROMAP_BIT_KHR`, which Vulkan requires if a
    /// ray's acceleration structure has opacity micromaps. It is on by default; without it such a
    /// ray goes on, and only the sanitizer tells.
    pub opacity_micromap: bool,
    /// `VK_PIPELINE_CREATE_2_RAY_TRACING_NO_NULL_ANY_HIT_SHADERS_BIT_KHR`: a candidate whose
    /// any-hit shader is null traps.
    pub no_null_any_hit_shaders: bool,
    /// `VK_PIPELINE_CREATE_2_RAY_TRACING_NO_NULL_CLOSEST_HIT_SHADERS_BIT_KHR`: a hit
    /// whose closest-hit shader is null traps.
    pub no_null_closest_hit_shaders: bool,
    /// `VK_PIPELINE_CREATE_2_RAY_TRACING_NO_NULL_MISS_SHADERS_BIT_KHR`: a miss whose miss
    /// shader is null traps.
    pub no_null_miss_shaders: bool,
    /// `VK_PIPELINE_CREATE_2_RAY_TRACING_NO_NULL_INTERSECTION_SHADERS_BIT_KHR`: a box whose
    /// intersection shader is null traps.
    pub no_null_intersection_shaders: bool,
}

impl Default for PipelineFlags {
    fn default() -> Self {
        Self {
            skip_triangles: false,
            skip_aabbs: false,
            allow_spheres_and_linear_swept_spheres: true,
            allow_motion: true,
            opacity_micromap: true,
            no_null_any_hit_shaders: false,
            no_null_closest_hit_shaders: false,
            no_null_miss_shaders: false,
            no_null_intersection_shaders: false,
        }
    }
}

impl PipelineFlags {
    /// The ray flags that the pipeline adds to those of every ray. Shaders do not see them.
    #[doc(hidden)]
    pub fn ray_flags(self) -> u32 {
        let skip_triangles = if self.skip_triangles { 0x100 } else { 0 };
        skip_triangles | if self.skip_aabbs { 0x200 } else { 0 }
    }

    /// Checks that hit groups have the shaders that the `NO_NULL` flags promise.
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
                    let message = format!("hit group {at} has no {what} shader, but the pipeline has {flag}");
                    let rule = format!("VUID-VkRayTracingPipelineCreateInfoKHR-flags-{number}");
                    return Err(Error::new(ErrorKind::InvalidScene, message).note(rule));
                }
            }
        }
        Ok(())
    }

    /// Checks that shaders trace rays with a time only if the pipeline allows motion.
    ///
    /// # Errors
    /// `InvalidScene` at the first instruction of a shader that does.
    pub(super) fn check_times(self, program: &Program) -> Result<()> {
        let timed = trace_ops(program).find_map(|op| Some((op, timed(program, op)?)));
        match timed {
            Some((op, timed)) if !self.allow_motion => {
                let message = format!("{} specifies a time, which the pipeline does not allow", timed.name);
                let error = Error::new(ErrorKind::InvalidScene, message).note(MOTION_MISSING);
                let error = timed.rule.into_iter().fold(error, Error::note);
                Err(program.place(op).into_iter().fold(error, Error::at))
            }
            _ => Ok(()),
        }
    }

    /// Checks that the pipeline allows the geometry of an acceleration structure.
    ///
    /// # Errors
    /// `InvalidScene` where a structure holds spheres or linear swept spheres and the pipeline does
    /// not allow them.
    #[doc(hidden)]
    pub fn check_structure(self, tlas: &Tlas) -> Result<()> {
        let swept = |kind| matches!(kind, GeometryKind::Spheres | GeometryKind::LinearSweptSpheres);
        let kinds = tlas.instances().iter().filter_map(|instance| instance.blas.kind());
        match kinds.enumerate().find(|(_, kind)| swept(*kind)) {
            Some((at, kind)) if !self.allow_spheres_and_linear_swept_spheres => {
                let message = format!("instance {at} contains {kind}, which the pipeline does not allow");
                let flag = "VK_PIPELINE_CREATE_2_RAY_TRACING_ALLOW_SPHERES_AND_LINEAR_SWEPT_SPHERES_BIT_NV is missing";
                Err(Error::new(ErrorKind::InvalidScene, message).note(flag))
            }
            _ => Ok(()),
        }
    }
}

impl Pipeline {
    /// Checks that nothing moves in an acceleration structure if the pipeline traces rays and does
    /// not allow motion.
    ///
    /// # Errors
    /// `InvalidScene` with the first instance that moves.
    #[doc(hidden)]
    pub fn check_motion(&self, tlas: &Tlas) -> Result<()> {
        let traces_rays = || self.programs.iter().any(|program| trace_ops(program).next().is_some());
        match first_moving(tlas) {
            Some(at) if !self.flags.allow_motion && traces_rays() => {
                let message = format!("instance {at} moves, which the pipeline does not allow");
                let error = Error::new(ErrorKind::InvalidScene, message).note(MOTION_MISSING);
                Err(error.note("VUID-RuntimeSpirv-OpTraceRayKHR-06360"))
            }
            _ => Ok(()),
        }
    }
}

const MOTION_MISSING: &str = "VK_PIPELINE_CREATE_2_RAY_TRACING_ALLOW_MOTION_BIT_NV is missing";

/// The first instance that moves or whose geometry moves.
pub(super) fn first_moving(tlas: &Tlas) -> Option<usize> {
    tlas.instances().iter().position(|instance| instance.motion.is_some() || instance.blas.moves())
}

/// The operations that trace rays.
fn trace_ops(program: &Program) -> impl Iterator<Item = OpIndex> {
    (0..).map(OpIndex).zip(&program.ops).filter(|(_, op)| op.traces()).map(|(at, _)| at)
}

/// The instruction of an operation, if one of its operands is a time.
fn timed(program: &Program, op: OpIndex) -> Option<MotionInstruction> {
    let offset = program.origins.get(op.index())?.offset;
    MotionInstruction::of(Opcode::of_word(*program.module.words.get(offset as usize)?))
}
