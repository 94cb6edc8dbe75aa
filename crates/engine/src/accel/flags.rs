//! The flags of geometries, instances and rays.

/// `VkGeometryFlagsKHR`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct GeometryFlags(pub u32);

impl GeometryFlags {
    /// `VK_GEOMETRY_OPAQUE_BIT_KHR`
    pub const OPAQUE: Self = Self(1);
    /// `VK_GEOMETRY_NO_DUPLICATE_ANY_HIT_INVOCATION_BIT_KHR`: any-hit runs twice for a candidate
    /// only where that is drawn (see `drawn_hits`), and then not for this geometry.
    pub const NO_DUPLICATE_ANY_HIT: Self = Self(2);

    /// Whether all of the given bits are set.
    #[must_use]
    pub fn contains(self, bits: Self) -> bool {
        self.0 & bits.0 == bits.0
    }
}

/// `VkGeometryInstanceFlagsKHR`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct InstanceFlags(pub u32);

impl InstanceFlags {
    /// `VK_GEOMETRY_INSTANCE_TRIANGLE_FACING_CULL_DISABLE_BIT_KHR`
    pub const TRIANGLE_FACING_CULL_DISABLE: Self = Self(1);
    /// `VK_GEOMETRY_INSTANCE_TRIANGLE_FLIP_FACING_BIT_KHR`
    pub const TRIANGLE_FLIP_FACING: Self = Self(2);
    /// `VK_GEOMETRY_INSTANCE_FORCE_OPAQUE_BIT_KHR`
    pub const FORCE_OPAQUE: Self = Self(4);
    /// `VK_GEOMETRY_INSTANCE_FORCE_NO_OPAQUE_BIT_KHR`
    pub const FORCE_NO_OPAQUE: Self = Self(8);
    /// `VK_GEOMETRY_INSTANCE_FORCE_OPACITY_MICROMAP_2_STATE_BIT_KHR`
    pub const FORCE_OPACITY_MICROMAP_2_STATE: Self = Self(16);
    /// `VK_GEOMETRY_INSTANCE_DISABLE_OPACITY_MICROMAPS_BIT_KHR`
    pub const DISABLE_OPACITY_MICROMAPS: Self = Self(32);

    /// Whether all of the given bits are set.
    #[must_use]
    pub fn contains(self, bits: Self) -> bool {
        self.0 & bits.0 == bits.0
    }
}

/// Ray flags, numbers as in SPIR-V.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct RayFlags(pub u32);

impl RayFlags {
    /// `OpaqueKHR`: all geometry is opaque.
    pub const OPAQUE: Self = Self(1);
    /// `NoOpaqueKHR`: no geometry is opaque.
    pub const NO_OPAQUE: Self = Self(2);
    /// `TerminateOnFirstHitKHR`
    pub const TERMINATE_ON_FIRST_HIT: Self = Self(4);
    /// `SkipClosestHitShaderKHR`: for the pipeline; traversal does not look at it.
    pub const SKIP_CLOSEST_HIT_SHADER: Self = Self(8);
    /// `CullBackFacingTrianglesKHR`
    pub const CULL_BACK_FACING_TRIANGLES: Self = Self(16);
    /// `CullFrontFacingTrianglesKHR`
    pub const CULL_FRONT_FACING_TRIANGLES: Self = Self(32);
    /// `CullOpaqueKHR`
    pub const CULL_OPAQUE: Self = Self(64);
    /// `CullNoOpaqueKHR`
    pub const CULL_NO_OPAQUE: Self = Self(128);
    /// `SkipTrianglesKHR`, alias `SkipBuiltinPrimitivesNV`: triangles, spheres and LSS.
    pub const SKIP_TRIANGLES: Self = Self(256);
    /// `SkipAABBsKHR`
    pub const SKIP_AABBS: Self = Self(512);
    /// `ForceOpacityMicromap2StateKHR`
    pub const FORCE_OPACITY_MICROMAP_2_STATE: Self = Self(1024);

    /// Checks that every bit is one of the constants above.
    ///
    /// # Errors
    /// A message that names the unknown bits.
    #[doc(hidden)]
    pub fn check_known(self) -> Result<(), String> {
        let unknown = self.0 & !0x7FF;
        let first = unknown.trailing_zeros();
        match unknown {
            0 => Ok(()),
            _ => Err(format!(
                "the ray flags {:#x} contain bit {first}, but ray flags are bits 0 to 10",
                self.0
            )),
        }
    }

    /// Whether all of the given bits are set.
    #[inline]
    #[must_use]
    pub fn contains(self, bits: Self) -> bool {
        self.0 & bits.0 == bits.0
    }
}

impl std::ops::BitOr for RayFlags {
    type Output = Self;

    #[inline]
    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}
