//! `[device]`: the features and limits of a scene's device; and the flags of `[pipeline]`.

use crate::read::{Named, OneOrMore, Parse, Table, TomlValue};
use anyhit_engine::pipeline::{DeviceFeatures, DeviceLimits, DeviceProfile, PipelineFlags};

/// The name of a preset.
#[derive(Clone, Copy)]
pub(crate) struct Preset(&'static str);

impl Named for Preset {
    const WHAT: &'static str = "device";
    const NAMES: &'static [(&'static str, Self)] = &[
        ("permissive", Self("permissive")),
        ("without_swept_spheres", Self("without_swept_spheres")),
        ("khr_only", Self("khr_only")),
        ("vulkan_minimum", Self("vulkan_minimum")),
    ];
}

impl Parse for DeviceProfile {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        let preset = table.optional::<Preset>("preset");
        let mut device = preset.and_then(|preset| Self::preset(preset.0)).unwrap_or_else(Self::default);
        if let Some(features) = table.value("features").and_then(Table::new) {
            for &name in DeviceFeatures::NAMES {
                if let Some(on) = features.optional(name) {
                    device.features.set(name, on);
                }
            }
            features.finish();
        }
        if let Some(limits) = table.value("limits").and_then(Table::new) {
            for &name in DeviceLimits::NAMES {
                if let Some(limit) = limits.optional(name) {
                    device.limits.set(name, limit);
                }
            }
            limits.finish();
        }
        table.finish();
        Some(device)
    }
}

#[derive(Clone, Copy)]
pub(crate) enum PipelineFlag {
    SkipTriangles,
    SkipAabbs,
    AllowSpheresAndLinearSweptSpheres,
    AllowMotion,
    OpacityMicromap,
    NoNullAnyHitShaders,
    NoNullClosestHitShaders,
    NoNullMissShaders,
    NoNullIntersectionShaders,
}

/// `VkPipelineCreateFlagBits2`
impl Named for PipelineFlag {
    const WHAT: &'static str = "flag of a pipeline";
    const NAMES: &'static [(&'static str, Self)] = &[
        ("skip_triangles", Self::SkipTriangles),
        ("skip_built_in_primitives", Self::SkipTriangles),
        ("skip_aabbs", Self::SkipAabbs),
        ("allow_spheres_and_linear_swept_spheres", Self::AllowSpheresAndLinearSweptSpheres),
        ("allow_motion", Self::AllowMotion),
        ("opacity_micromap", Self::OpacityMicromap),
        ("no_null_any_hit_shaders", Self::NoNullAnyHitShaders),
        ("no_null_closest_hit_shaders", Self::NoNullClosestHitShaders),
        ("no_null_miss_shaders", Self::NoNullMissShaders),
        ("no_null_intersection_shaders", Self::NoNullIntersectionShaders),
    ];
}

/// Reads `flags`: a list sets exactly these flags; without one, the default flags are set.
pub(super) fn flags(table: &Table<'_>) -> PipelineFlags {
    let Some(OneOrMore(list)) = table.optional::<OneOrMore<PipelineFlag>>("flags") else {
        return PipelineFlags::default();
    };
    let mut flags = PipelineFlags {
        allow_spheres_and_linear_swept_spheres: false,
        allow_motion: false,
        opacity_micromap: false,
        ..PipelineFlags::default()
    };
    for flag in list {
        match flag {
            PipelineFlag::SkipTriangles => flags.skip_triangles = true,
            PipelineFlag::SkipAabbs => flags.skip_aabbs = true,
            PipelineFlag::AllowSpheresAndLinearSweptSpheres => {
                flags.allow_spheres_and_linear_swept_spheres = true;
            }
            PipelineFlag::AllowMotion => flags.allow_motion = true,
            PipelineFlag::OpacityMicromap => flags.opacity_micromap = true,
            PipelineFlag::NoNullAnyHitShaders => flags.no_null_any_hit_shaders = true,
            PipelineFlag::NoNullClosestHitShaders => flags.no_null_closest_hit_shaders = true,
            PipelineFlag::NoNullMissShaders => flags.no_null_miss_shaders = true,
            PipelineFlag::NoNullIntersectionShaders => flags.no_null_intersection_shaders = true,
        }
    }
    flags
}
