//! What the languages of sources call the builtins of SPIR-V.

use anyhit_engine::module::interface::Stage;

/// Tools of the generator word whose input is GLSL (SPIR-V registry): glslang, shaderc.
const GLSL_TOOLS: [u32; 2] = [8, 13];
/// Tools whose input is HLSL or Slang: dxc, Slang.
const HLSL_TOOLS: [u32; 2] = [14, 40];

/// The names in SPIR-V, GLSL, and HLSL and Slang, where a builtin is a call or a semantic.
const NAMES: &[(&str, &str, &str)] = &[
    ("CurrentRayTimeNV", "gl_CurrentRayTimeNV", "RayCurrentTime()"),
    ("GlobalInvocationId", "gl_GlobalInvocationID", "SV_DispatchThreadID"),
    ("HitKindKHR", "gl_HitKindEXT", "HitKind()"),
    ("HitLSSPositionsNV", "gl_HitLSSPositionsNV", "GetLssPositionsAndRadii()"),
    ("HitLSSRadiiNV", "gl_HitLSSRadiiNV", "GetLssPositionsAndRadii()"),
    ("HitSpherePositionNV", "gl_HitSpherePositionNV", "GetSpherePositionAndRadius()"),
    ("HitSphereRadiusNV", "gl_HitSphereRadiusNV", "GetSpherePositionAndRadius()"),
    ("HitTNV", "gl_HitTEXT", "RayTCurrent()"),
    ("HitTriangleVertexPositionsKHR", "gl_HitTriangleVertexPositionsEXT", "HitTriangleVertexPosition()"),
    ("IncomingRayFlagsKHR", "gl_IncomingRayFlagsEXT", "RayFlags()"),
    ("InstanceCustomIndexKHR", "gl_InstanceCustomIndexEXT", "InstanceID()"),
    ("InstanceId", "gl_InstanceID", "InstanceIndex()"),
    ("LaunchIdKHR", "gl_LaunchIDEXT", "DispatchRaysIndex()"),
    ("LaunchSizeKHR", "gl_LaunchSizeEXT", "DispatchRaysDimensions()"),
    ("LocalInvocationId", "gl_LocalInvocationID", "SV_GroupThreadID"),
    ("LocalInvocationIndex", "gl_LocalInvocationIndex", "SV_GroupIndex"),
    ("NumSubgroups", "gl_NumSubgroups", ""),
    ("NumWorkgroups", "gl_NumWorkGroups", ""),
    ("ObjectRayDirectionKHR", "gl_ObjectRayDirectionEXT", "ObjectRayDirection()"),
    ("ObjectRayOriginKHR", "gl_ObjectRayOriginEXT", "ObjectRayOrigin()"),
    ("ObjectToWorldKHR", "gl_ObjectToWorldEXT", "ObjectToWorld()"),
    ("PrimitiveId", "gl_PrimitiveID", "PrimitiveIndex()"),
    ("RayGeometryIndexKHR", "gl_GeometryIndexEXT", "GeometryIndex()"),
    ("RayTminKHR", "gl_RayTminEXT", "RayTMin()"),
    ("SubgroupId", "gl_SubgroupID", ""),
    ("SubgroupLocalInvocationId", "gl_SubgroupInvocationID", "WaveGetLaneIndex()"),
    ("SubgroupSize", "gl_SubgroupSize", "WaveGetLaneCount()"),
    ("WorkgroupId", "gl_WorkGroupID", "SV_GroupID"),
    ("WorkgroupSize", "gl_WorkGroupSize", ""),
    ("WorldRayDirectionKHR", "gl_WorldRayDirectionEXT", "WorldRayDirection()"),
    ("WorldRayOriginKHR", "gl_WorldRayOriginEXT", "WorldRayOrigin()"),
    ("WorldToObjectKHR", "gl_WorldToObjectEXT", "WorldToObject()"),
];

/// What the source of a module, by its generator word, calls a builtin in a stage; `None` where the
/// language or its name is not known.
pub(super) fn source_name(generator: u32, stage: Stage, builtin: &str) -> Option<&'static str> {
    let tool = generator >> 16;
    let (is_glsl, is_hlsl) = (GLSL_TOOLS.contains(&tool), HLSL_TOOLS.contains(&tool));
    let has_hit = matches!(stage, Stage::AnyHit | Stage::ClosestHit);
    let (_, glsl, hlsl) = match (builtin, has_hit) {
        // One builtin of SPIR-V, which GLSL names twice.
        ("RayTmaxKHR", true) => &("", "gl_HitTEXT", "RayTCurrent()"),
        ("RayTmaxKHR", false) => &("", "gl_RayTmaxEXT", "RayTCurrent()"),
        _ => NAMES.iter().find(|(name, ..)| *name == builtin)?,
    };
    let name = if is_glsl { glsl } else { hlsl };
    ((is_glsl || is_hlsl) && !name.is_empty()).then_some(name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhit_engine::ops::builtin::BUILTINS;

    const GLSLANG: u32 = 8 << 16 | 11;
    const SLANG: u32 = 40 << 16;

    #[test]
    fn a_builtin_has_the_name_of_its_language() {
        // GLSL_EXT_ray_tracing; the HLSL specification of ray tracing.
        assert_eq!(source_name(GLSLANG, Stage::ClosestHit, "RayTmaxKHR"), Some("gl_HitTEXT"));
        assert_eq!(source_name(GLSLANG, Stage::Miss, "RayTmaxKHR"), Some("gl_RayTmaxEXT"));
        assert_eq!(source_name(SLANG, Stage::AnyHit, "RayTmaxKHR"), Some("RayTCurrent()"));
        assert_eq!(source_name(SLANG, Stage::ClosestHit, "InstanceCustomIndexKHR"), Some("InstanceID()"));
        assert_eq!(source_name(0, Stage::ClosestHit, "InstanceCustomIndexKHR"), None);
        assert_eq!(source_name(GLSLANG, Stage::Miss, "CoreIDARM"), None);
    }

    #[test]
    fn the_table_names_builtins_that_there_are() {
        for (name, ..) in NAMES {
            assert!(BUILTINS.iter().any(|builtin| builtin.name == *name), "{name}");
        }
    }
}
