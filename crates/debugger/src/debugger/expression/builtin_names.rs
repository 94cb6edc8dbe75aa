//! The names of builtins in SPIR-V, GLSL, HLSL and Slang.

use anyhit_engine::ops::builtin::{BUILTINS, Builtin};

/// Names that are not SPIR-V's with another suffix, in small letters and without `gl_`.
const OTHER_NAMES: &[(&str, &str)] = &[
    // GLSL
    ("hitt", "RayTmaxKHR"),
    ("geometryindex", "RayGeometryIndexKHR"),
    ("workgroupsize", "WorkgroupSize"),
    ("numworkgroups", "NumWorkgroups"),
    ("subgroupinvocationid", "SubgroupLocalInvocationId"),
    // HLSL and Slang
    ("dispatchraysindex", "LaunchIdKHR"),
    ("dispatchraysdimensions", "LaunchSizeKHR"),
    ("raytcurrent", "RayTmaxKHR"),
    ("rayflags", "IncomingRayFlagsKHR"),
    ("instanceindex", "InstanceId"),
    ("primitiveindex", "PrimitiveId"),
    ("objecttoworld3x4", "ObjectToWorldKHR"),
    ("worldtoobject3x4", "WorldToObjectKHR"),
];

/// The builtin that a name means.
pub(super) fn builtin_of_name(name: &str) -> Option<&'static Builtin> {
    if let Some(exact) = BUILTINS.iter().find(|builtin| builtin.name == name) {
        return Some(exact);
    }
    let bare = bare(name.strip_prefix("gl_").unwrap_or(name));
    let other = OTHER_NAMES.iter().find(|(other, _)| *other == bare).map(|(_, name)| *name);
    BUILTINS.iter().find(|builtin| match other {
        Some(other) => builtin.name == other,
        None => self::bare(builtin.name) == bare,
    })
}

/// The builtin that a call without arguments means in HLSL and Slang: `WorldRayDirection()`.
pub(super) fn builtin_of_call(name: &str) -> Option<&'static Builtin> {
    match name {
        // GLSL and SPIR-V call something else so.
        "InstanceID" => builtin_of_name("InstanceCustomIndexKHR"),
        _ => builtin_of_name(name),
    }
}

/// Whether the builtin of a name is of type `int`, as GLSL has some that SPIR-V has with either
/// sign (GLSL_EXT_ray_tracing, GLSL_NV_cluster_acceleration_structure).
pub(super) fn is_signed(name: &str) -> bool {
    ["gl_InstanceID", "gl_InstanceCustomIndexEXT", "gl_PrimitiveID", "gl_GeometryIndexEXT", "gl_ClusterIDNV"]
        .contains(&name)
}

/// A name in small letters, without the suffix of its extension.
fn bare(name: &str) -> String {
    let suffixes = ["KHR", "EXT", "NV", "ARM"];
    let name = suffixes.iter().find_map(|suffix| name.strip_suffix(suffix)).unwrap_or(name);
    name.to_lowercase()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn builtins_are_found_by_the_names_of_each_language() {
        let cases = [
            ("gl_HitLSSPositionsNV", "HitLSSPositionsNV"),
            ("HitLSSPositionsNV", "HitLSSPositionsNV"),
            ("gl_WorldRayDirectionEXT", "WorldRayDirectionKHR"),
            ("gl_LaunchIDEXT", "LaunchIdKHR"),
            ("gl_HitTEXT", "RayTmaxKHR"),
            ("gl_RayTmaxEXT", "RayTmaxKHR"),
            ("gl_GeometryIndexEXT", "RayGeometryIndexKHR"),
            ("gl_InstanceCustomIndexEXT", "InstanceCustomIndexKHR"),
            ("gl_PrimitiveID", "PrimitiveId"),
            ("gl_GlobalInvocationID", "GlobalInvocationId"),
            ("HitTNV", "HitTNV"),
        ];
        for (name, expected) in cases {
            assert_eq!(builtin_of_name(name).map(|builtin| builtin.name), Some(expected), "{name}");
        }
        let calls = [
            ("WorldRayDirection", "WorldRayDirectionKHR"),
            ("DispatchRaysIndex", "LaunchIdKHR"),
            ("InstanceID", "InstanceCustomIndexKHR"),
            ("InstanceIndex", "InstanceId"),
            ("RayTCurrent", "RayTmaxKHR"),
        ];
        for (name, expected) in calls {
            assert_eq!(builtin_of_call(name).map(|builtin| builtin.name), Some(expected), "{name}");
        }
        assert_eq!(builtin_of_name("gl_Position"), None);
    }
}
