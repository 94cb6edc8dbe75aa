//! What a device supports: features, limits and flags of pipelines.
//!
//! With a [`DeviceProfile`] a test checks what happens on a device without a feature or with a
//! smaller limit. The default supports everything; presets and single keys turn support off.

use crate::accel::{GeometryKind, Tlas};
use crate::machine::OpIndex;
use crate::module::Module;
use crate::module::names::capability_name;
use crate::module::validate::explicit_layout::LayoutFeatures;
use crate::ops::layout_check;
use crate::pipeline::{PipelineFlags, flags};
use crate::program::Program;
use anyhit_base::error::{Error, ErrorKind, Result};

/// Bytes of a shader group's handle (`shaderGroupHandleSize`), the same on every device.
const HANDLE_SIZE: u64 = 32;

macro_rules! features {
    ($($(#[$doc:meta])* $name:ident $vulkan:literal [$($capability:literal)*];)*) => {
        /// DeviceFeatures of a device that ray-tracing shaders and scenes need, all on by default.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub struct DeviceFeatures {
            $($(#[$doc])* pub $name: bool,)*
        }

        impl DeviceFeatures {
            /// Every feature.
            pub const ALL: Self = Self { $($name: true,)* };
            /// No feature but what ray-tracing pipelines themselves need.
            pub const NONE: Self = Self { $($name: false,)* };
            /// The names, as scenes write them.
            pub const NAMES: &'static [&'static str] = &[$(stringify!($name)),*];

            /// Turns a feature on or off by its name in scenes; returns `false` for an unknown
            /// name.
            pub fn set(&mut self, name: &str, on: bool) -> bool {
                match name {
                    $(stringify!($name) => self.$name = on,)*
                    _ => return false,
                }
                true
            }

            /// The Vulkan name of the feature that a capability needs, if it is off.
            fn lacking(&self, capability: u32) -> Option<&'static str> {
                $(if !self.$name && [$($capability),*].contains(&capability) {
                    return Some($vulkan);
                })*
                None
            }
        }
    };
}

features! {
    /// `VkPhysicalDeviceRayQueryFeaturesKHR::rayQuery`
    ray_query "rayQuery" [4471u32 4472];
    /// `VkPhysicalDeviceRayTracingPipelineFeaturesKHR::rayTraversalPrimitiveCulling`: the flags
    /// that skip triangles or boxes, of rays and of pipelines.
    ray_traversal_primitive_culling "rayTraversalPrimitiveCulling" [4478u32];
    /// `VkPhysicalDeviceRayTracingMaintenance1FeaturesKHR::rayTracingMaintenance1`: `CullMaskKHR`.
    ray_tracing_maintenance1 "rayTracingMaintenance1" [6020u32];
    /// `VkPhysicalDeviceRayTracingPositionFetchFeaturesKHR::rayTracingPositionFetch`
    ray_tracing_position_fetch "rayTracingPositionFetch" [5336u32 5391];
    /// `VkPhysicalDeviceRayTracingInvocationReorderFeatures*::rayTracingInvocationReorder`: hit
    /// objects.
    ray_tracing_invocation_reorder "rayTracingInvocationReorder" [5383u32 5388];
    /// `VkPhysicalDeviceRayTracingMotionBlurFeaturesNV::rayTracingMotionBlur`
    ray_tracing_motion_blur "rayTracingMotionBlur" [5341u32];
    /// `VkPhysicalDeviceOpacityMicromapFeatures*::micromap`
    opacity_micromap "micromap" [5381u32 6032];
    /// `VkPhysicalDeviceClusterAccelerationStructureFeaturesNV::clusterAccelerationStructure`
    cluster_acceleration_structure "clusterAccelerationStructure" [5437u32];
    /// `VkPhysicalDeviceRayTracingLinearSweptSpheresFeaturesNV::spheres`
    spheres "spheres" [5418u32];
    /// `VkPhysicalDeviceRayTracingLinearSweptSpheresFeaturesNV::linearSweptSpheres`
    linear_swept_spheres "linearSweptSpheres" [5419u32];
    /// `VkPhysicalDeviceShaderFloat16Int8Features::shaderFloat16`
    shader_float16 "shaderFloat16" [9u32];
    /// `VkPhysicalDeviceFeatures::shaderFloat64`
    shader_float64 "shaderFloat64" [10u32];
    /// `VkPhysicalDeviceShaderFloat16Int8Features::shaderInt8`
    shader_int8 "shaderInt8" [39u32];
    /// `VkPhysicalDeviceFeatures::shaderInt16`
    shader_int16 "shaderInt16" [22u32];
    /// `VkPhysicalDeviceFeatures::shaderInt64`
    shader_int64 "shaderInt64" [11u32];
    /// `VkPhysicalDeviceShaderAtomicInt64Features::shaderBufferInt64Atomics`
    shader_buffer_int64_atomics "shaderBufferInt64Atomics" [12u32];
    /// `VkPhysicalDeviceBufferDeviceAddressFeatures::bufferDeviceAddress`
    buffer_device_address "bufferDeviceAddress" [5347u32];
    /// `VkPhysicalDeviceDescriptorIndexingFeatures::runtimeDescriptorArray`
    runtime_descriptor_array "runtimeDescriptorArray" [5302u32];
    /// `VkPhysicalDeviceRobustness2FeaturesKHR::nullDescriptor`
    null_descriptor "nullDescriptor" [];
    /// `VkPhysicalDeviceSubgroupProperties::supportedStages` has the ray-tracing stages, whose
    /// shaders may then execute group operations.
    ray_tracing_subgroups "subgroupSupportedStages" [];
    /// `VkPhysicalDeviceShaderClockFeaturesKHR::shaderSubgroupClock`
    shader_clock "shaderSubgroupClock" [5055u32];
    /// `VkPhysicalDeviceScalarBlockLayoutFeatures::scalarBlockLayout`: blocks are aligned as their
    /// scalars are.
    scalar_block_layout "scalarBlockLayout" [];
    /// `VkPhysicalDeviceUniformBufferStandardLayoutFeatures::uniformBufferStandardLayout`: uniform
    /// buffers are aligned as storage buffers are.
    uniform_buffer_standard_layout "uniformBufferStandardLayout" [];
}

impl Default for DeviceFeatures {
    fn default() -> Self {
        Self::ALL
    }
}

macro_rules! limits {
    ($($(#[$doc:meta])* $name:ident $greatest:expr, $least:expr;)*) => {
        /// DeviceLimits of a device.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub struct DeviceLimits {
            $($(#[$doc])* pub $name: u64,)*
        }

        impl DeviceLimits {
            /// The greatest that this crate runs.
            pub const GREATEST: Self = Self { $($name: $greatest,)* };
            /// The least that Vulkan allows (chapter "DeviceLimits").
            pub const LEAST: Self = Self { $($name: $least,)* };
            /// The names, as scenes write them.
            pub const NAMES: &'static [&'static str] = &[$(stringify!($name)),*];

            /// Sets a limit by its name in scenes; returns `false` for an unknown name.
            pub fn set(&mut self, name: &str, limit: u64) -> bool {
                match name {
                    $(stringify!($name) => self.$name = limit,)*
                    _ => return false,
                }
                true
            }
        }
    };
}

limits! {
    /// `maxRayRecursionDepth`
    /// Hardware has 31 at most; every level takes the registers of a batch.
    max_ray_recursion_depth 1024, 1;
    /// `maxRayHitAttributeSize`, in bytes.
    max_ray_hit_attribute_size u64::MAX, 32;
    /// `maxShaderGroupStride`, in bytes.
    max_shader_group_stride u64::MAX, 4096;
    /// `maxRayDispatchInvocationCount`
    max_ray_dispatch_invocation_count 1 << 40, 1 << 30;
    /// `maxShaderBindingTableRecordIndex`, which a shader may set in a hit object. Presets leave it
    /// at the greatest.
    max_shader_binding_table_record_index u32::MAX as u64, u32::MAX as u64;
    /// `maxGeometryCount`, of one BLAS.
    max_geometry_count (1 << 24) - 1, (1 << 24) - 1;
    /// `maxInstanceCount`, of one TLAS.
    max_instance_count (1 << 24) - 1, (1 << 24) - 1;
    /// `maxPrimitiveCount`, of one geometry.
    max_primitive_count (1 << 29) - 1, (1 << 29) - 1;
}

impl Default for DeviceLimits {
    fn default() -> Self {
        Self::GREATEST
    }
}

/// A device, as far as pipelines and scenes depend on it.
#[derive(Clone, Debug, PartialEq, Eq)]
#[must_use]
pub struct DeviceProfile {
    /// What errors call it.
    pub name: String,
    /// Its features.
    #[doc(hidden)]
    pub features: DeviceFeatures,
    /// Its limits.
    #[doc(hidden)]
    pub limits: DeviceLimits,
}

impl Default for DeviceProfile {
    /// Everything that this crate runs.
    fn default() -> Self {
        Self { name: "permissive".into(), features: DeviceFeatures::ALL, limits: DeviceLimits::GREATEST }
    }
}

impl DeviceProfile {
    /// The names of the presets.
    pub const PRESETS: &'static [&'static str] =
        &["permissive", "without_swept_spheres", "khr_only", "vulkan_minimum"];

    /// The preset of a name; `None` for an unknown name.
    ///
    /// * `permissive`: all features, the greatest limits.
    /// * `vulkan_minimum`: ray-tracing pipelines with the least limits and no optional feature.
    /// * `without_swept_spheres`: all features but `VK_NV_ray_tracing_linear_swept_spheres` and
    ///   clusters, with the least limits.
    /// * `khr_only`: the features of KHR extensions, with the least limits.
    ///
    /// There is no preset for devices of a vendor, as their support changes with the driver: take
    /// it from the driver's own report.
    #[must_use]
    pub fn preset(name: &str) -> Option<Self> {
        let without_swept_spheres = DeviceFeatures {
            spheres: false,
            linear_swept_spheres: false,
            cluster_acceleration_structure: false,
            ..DeviceFeatures::ALL
        };
        let khr_only = DeviceFeatures {
            ray_tracing_invocation_reorder: false,
            ray_tracing_motion_blur: false,
            ..without_swept_spheres
        };
        let (features, limits) = match name {
            "permissive" => (DeviceFeatures::ALL, DeviceLimits::GREATEST),
            "vulkan_minimum" => (DeviceFeatures::NONE, DeviceLimits::LEAST),
            "without_swept_spheres" => (without_swept_spheres, DeviceLimits::LEAST),
            "khr_only" => (khr_only, DeviceLimits::LEAST),
            _ => return None,
        };
        Some(Self { name: name.to_owned(), features, limits })
    }

    /// Turns a feature on or off by its name in scenes: `"ray_query"`.
    ///
    /// ```
    /// use anyhit::DeviceProfile;
    ///
    /// let device = DeviceProfile::default().with_feature("ray_query", false)?;
    /// let device = device.with_limit("max_ray_recursion_depth", 1)?;
    /// assert!(device.with_feature("ray_tracing", false).is_err());
    /// # Ok::<(), anyhit::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`ErrorKind::InvalidArgument`] for an unknown name; it lists those that are known.
    pub fn with_feature(mut self, name: &str, on: bool) -> Result<Self> {
        if self.features.set(name, on) {
            Ok(self)
        } else {
            Err(unknown("feature", name, DeviceFeatures::NAMES))
        }
    }

    /// Sets a limit by its name in scenes: `"max_ray_recursion_depth"`.
    ///
    /// # Errors
    /// [`ErrorKind::InvalidArgument`] for an unknown name; it lists those that are known.
    pub fn with_limit(mut self, name: &str, limit: u64) -> Result<Self> {
        if self.limits.set(name, limit) { Ok(self) } else { Err(unknown("limit", name, DeviceLimits::NAMES)) }
    }

    /// Checks the capabilities that a module declares, and the layouts of its blocks.
    ///
    /// # Errors
    /// `InvalidModule`, naming capability and feature, for each that the device does not support;
    /// with the rule, for each block whose alignment needs a feature that the device does not have.
    #[doc(hidden)]
    pub fn check_module(&self, module: &Module) -> Result<()> {
        let lacking = module.capabilities.iter().filter_map(|&capability| {
            let feature = self.features.lacking(capability)?;
            let message = format!(
                "{} requires the feature `{feature}`, which the device `{}` does not have",
                capability_name(capability),
                self.name
            );
            let error = Error::new(ErrorKind::InvalidModule, message);
            Some(error.note("VUID-VkShaderModuleCreateInfo-pCode-08740"))
        });
        let mut errors: Vec<Error> = lacking.collect();
        let layouts = LayoutFeatures {
            scalar_block_layout: self.features.scalar_block_layout,
            uniform_buffer_standard_layout: self.features.uniform_buffer_standard_layout,
        };
        if let Err(error) = layout_check::check_with(module, layouts) {
            errors.push(error.context(format!("on the device `{}`", self.name)));
        }
        if errors.is_empty() { Ok(()) } else { Err(Error::several(errors)) }
    }

    /// Checks the geometries and counts of an acceleration structure.
    ///
    /// # Errors
    /// `InvalidScene` for spheres or linear swept spheres on a device without them, and for counts
    /// above its limits.
    #[doc(hidden)]
    pub fn check_structure(&self, tlas: &Tlas) -> Result<()> {
        let invalid = |message: String| Error::new(ErrorKind::InvalidScene, message);
        let mut errors = Vec::new();
        let mut count = |what: String, count: usize, limit: u64, name: &str| {
            if count as u64 > limit {
                errors.push(invalid(format!("{what} exceed the limit {limit} of `{}` ({name})", self.name)));
            }
        };
        let instances = tlas.instances();
        let number = instances.len();
        count(format!("{number} instances"), number, self.limits.max_instance_count, "maxInstanceCount");
        for (at, instance) in instances.iter().enumerate() {
            let geometries = instance.blas.geometries();
            let (number, limits) = (geometries.len(), &self.limits);
            let what = format!("instance {at}: {number} geometries");
            count(what, number, limits.max_geometry_count, "maxGeometryCount");
            for (index, geometry) in geometries.iter().enumerate() {
                let number = geometry.data.primitive_count();
                let what = format!("instance {at}, geometry {index}: {number} primitives");
                count(what, number, limits.max_primitive_count, "maxPrimitiveCount");
            }
        }
        for (kind, on, feature, vuid) in [
            (
                GeometryKind::Spheres,
                self.features.spheres,
                "spheres",
                "VUID-VkAccelerationStructureGeometrySpheresDataNV-None-10429",
            ),
            (
                GeometryKind::LinearSweptSpheres,
                self.features.linear_swept_spheres,
                "linearSweptSpheres",
                "VUID-VkAccelerationStructureGeometryLinearSweptSpheresDataNV-None-10419",
            ),
        ] {
            let first = instances.iter().position(|instance| instance.blas.kind() == Some(kind));
            if let Some(at) = first.filter(|_| !on) {
                let message = format!(
                    "instance {at} contains {kind}: they require the feature `{feature}`, which the \
                     device `{}` does not have",
                    self.name
                );
                errors.push(invalid(message).note(vuid));
            }
        }
        if let Some(at) = flags::first_moving(tlas)
            && !self.features.ray_tracing_motion_blur
        {
            let message = format!(
                "instance {at} moves: motion requires the feature `rayTracingMotionBlur`, which the \
                 device `{}` does not have",
                self.name
            );
            errors.push(invalid(message));
        }
        if errors.is_empty() { Ok(()) } else { Err(Error::several(errors)) }
    }

    /// Checks that a descriptor may be null; `rule` forbids it on other devices.
    ///
    /// # Errors
    /// `InvalidScene` with the rule.
    #[doc(hidden)]
    pub fn check_null_descriptor(&self, rule: &str) -> Result<()> {
        if self.features.null_descriptor {
            return Ok(());
        }
        let message = format!(
            "a null descriptor requires the feature `nullDescriptor`, which the device `{}` does not have",
            self.name
        );
        Err(Error::new(ErrorKind::InvalidScene, message).note(rule))
    }

    /// Checks the size of the hit attributes that a shader declares, in bytes.
    pub(super) fn check_attributes(&self, shader: &str, size: u64) -> Result<()> {
        let limit = self.limits.max_ray_hit_attribute_size;
        if size <= limit {
            return Ok(());
        }
        let message = format!(
            "`{shader}` has hit attributes of {size} bytes, more than the limit {limit} of `{}`",
            self.name
        );
        Err(Error::new(ErrorKind::InvalidModule, message).note("maxRayHitAttributeSize"))
    }

    /// Checks that a shader of a pipeline may execute its group operations.
    pub(super) fn check_subgroups(&self, program: &Program) -> Result<()> {
        let group_operation = (0..).map(OpIndex).zip(&program.ops).find(|(_, op)| op.needs_subgroup());
        match group_operation {
            Some((op, _)) if !self.features.ray_tracing_subgroups => {
                let message = format!(
                    "{} executes a group operation, but `subgroupSupportedStages` of the device `{}` \
                     does not contain the stage",
                    program.stage.name(),
                    self.name
                );
                let error = Error::new(ErrorKind::InvalidModule, message);
                let error = error.note("VUID-RuntimeSpirv-None-06343");
                Err(program.place(op).into_iter().fold(error, Error::at))
            }
            _ => Ok(()),
        }
    }

    /// Checks the data behind a record's handle, in bytes.
    pub(super) fn check_record(&self, table: &str, at: usize, size: u64) -> Result<()> {
        let (stride, limit) = (HANDLE_SIZE + size, self.limits.max_shader_group_stride);
        if stride <= limit {
            return Ok(());
        }
        let message =
            format!("{table} record {at} has {stride} bytes, more than the limit {limit} of `{}`", self.name);
        Err(Error::new(ErrorKind::InvalidScene, message).note("maxShaderGroupStride"))
    }

    /// Checks `maxPipelineRayRecursionDepth` and the flags of a pipeline.
    pub(super) fn check_pipeline(&self, recursion: u32, flags: PipelineFlags) -> Result<()> {
        let invalid = |message: String| Error::new(ErrorKind::InvalidScene, message);
        let limit = self.limits.max_ray_recursion_depth;
        if u64::from(recursion) > limit {
            let message =
                format!("the recursion depth {recursion} exceeds the limit {limit} of `{}`", self.name);
            let rule = "VUID-VkRayTracingPipelineCreateInfoKHR-maxPipelineRayRecursionDepth-03589";
            return Err(invalid(message).note(rule));
        }
        if flags.skip_triangles && flags.skip_aabbs {
            return Err(invalid(
                "the pipeline skips both triangles and AABBs, and thus all primitives".into(),
            )
            .note("VUID-VkRayTracingPipelineCreateInfoKHR-flags-06546"));
        }
        if (flags.skip_triangles || flags.skip_aabbs) && !self.features.ray_traversal_primitive_culling {
            let message = format!(
                "the pipeline's flags require the feature `rayTraversalPrimitiveCulling`, which the \
                 device `{}` does not have",
                self.name
            );
            let number = if flags.skip_aabbs { "03596" } else { "03597" };
            let rule =
                format!("VUID-VkRayTracingPipelineCreateInfoKHR-rayTraversalPrimitiveCulling-{number}");
            return Err(invalid(message).note(rule));
        }
        Ok(())
    }
}

fn unknown(what: &str, name: &str, names: &[&str]) -> Error {
    Error::new(ErrorKind::InvalidArgument, format!("no {what} of devices is named `{name}`"))
        .note(format!("available {what}s: {}", names.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn features_and_limits_are_switched_by_name() {
        let mut features = DeviceFeatures::ALL;
        for name in DeviceFeatures::NAMES {
            assert!(features.set(name, false), "{name}");
        }
        assert_eq!(features, DeviceFeatures::NONE);
        assert!(!features.set("rayQuery", true), "scenes write ray_query");
        let mut limits = DeviceLimits::GREATEST;
        assert!(limits.set("max_ray_recursion_depth", 3) && limits.max_ray_recursion_depth == 3);
        assert!(!limits.set("depth", 1));
    }

    #[test]
    fn presets_exist_and_the_default_refuses_nothing() {
        for name in DeviceProfile::PRESETS {
            assert_eq!(DeviceProfile::preset(name).unwrap().name, *name);
        }
        assert!(DeviceProfile::preset("voodoo").is_none());
        let default = DeviceProfile::default();
        assert_eq!(default, DeviceProfile::preset("permissive").unwrap());
        assert!(default.check_pipeline(31, PipelineFlags::default()).is_ok());
        assert!((0..=u16::MAX).all(|capability| default.features.lacking(capability.into()).is_none()));
    }

    #[test]
    fn pipelines_are_checked_against_the_device() {
        let least = DeviceProfile::preset("vulkan_minimum").unwrap();
        let none = PipelineFlags::default();
        let rule = |result: Result<()>| result.unwrap_err().notes()[0].clone();
        assert!(least.check_pipeline(1, none).is_ok());
        assert!(rule(least.check_pipeline(2, none)).ends_with("maxPipelineRayRecursionDepth-03589"));
        let skips = PipelineFlags { skip_aabbs: true, ..none };
        assert!(rule(least.check_pipeline(1, skips)).ends_with("rayTraversalPrimitiveCulling-03596"));
        let triangles = PipelineFlags { skip_triangles: true, ..none };
        assert!(rule(least.check_pipeline(1, triangles)).ends_with("rayTraversalPrimitiveCulling-03597"));
        let both = PipelineFlags { skip_triangles: true, ..skips };
        assert!(rule(DeviceProfile::default().check_pipeline(1, both)).ends_with("flags-06546"));
        assert_eq!(rule(least.check_attributes("a", 33)), "maxRayHitAttributeSize");
        assert!(least.check_attributes("a", 32).is_ok());
        assert_eq!(rule(least.check_record("hit", 0, 4096 - 31)), "maxShaderGroupStride");
        assert!(least.check_record("hit", 0, 4096 - 32).is_ok());
        assert_eq!((none.ray_flags(), skips.ray_flags()), (0, 0x200));
    }
}
