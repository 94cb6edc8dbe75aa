//! The operands of a trace or of a ray query, and the rules that they keep.

use crate::accel::flags::RayFlags;
use crate::geometry::Ray;

/// The operands of a trace or ray query that traversal needs.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct TraceRay {
    /// The ray in world space, with its interval.
    pub ray: Ray,
    /// The flags of the ray.
    pub flags: RayFlags,
    /// Only the low 8 bits are used.
    pub cull_mask: u32,
    /// `CurrentRayTimeNV`, from 0 to 1: the time for moving geometry. 0 for instructions without
    /// one.
    pub time: f32,
}

impl TraceRay {
    /// Whether the operands keep the rules.
    ///
    /// # Errors
    /// The first rule that they break.
    #[doc(hidden)]
    #[inline]
    pub fn check(&self) -> Result<(), RayRule> {
        let Ray { origin, direction, t_min, t_max } = self.ray;
        let finite = [origin, direction].as_flattened().iter().all(|value| value.is_finite());
        let interval = t_min >= 0.0 && t_min <= t_max;
        let time = (0.0..=1.0).contains(&self.time);
        let exclusive = |bits: u32| (self.flags.0 & bits).count_ones() <= 1;
        let flags = exclusive(1 | 2 | 64 | 128) && exclusive(256 | 16 | 32) && exclusive(256 | 512);
        if finite && interval && flags && time { Ok(()) } else { Err(self.broken_rule()) }
    }

    #[cold]
    fn broken_rule(&self) -> RayRule {
        let Ray { origin, direction, t_min, t_max } = self.ray;
        let exclusive = |bits: u32| (self.flags.0 & bits).count_ones() <= 1;
        let components = || origin.iter().chain(&direction);
        match () {
            () if components().any(|x| x.is_nan()) || t_min.is_nan() || t_max.is_nan() => RayRule::NotNan,
            () if !components().all(|x| x.is_finite()) => RayRule::Finite,
            () if t_min < 0.0 || t_max < 0.0 => RayRule::NotNegative,
            () if t_min > t_max => RayRule::InOrder,
            () if !exclusive(1 | 2 | 64 | 128) => RayRule::OpacityFlags,
            () if !exclusive(256 | 512) => RayRule::SkipFlags,
            () if !exclusive(256 | 16 | 32) => RayRule::TriangleFlags,
            () => RayRule::Time,
        }
    }
}

/// A valid-usage rule for the operands of a ray. Its VUID depends on the instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum RayRule {
    /// No component of the ray or its interval is NaN.
    NotNan,
    /// Origin and direction are finite.
    Finite,
    /// t_min and t_max are not negative.
    NotNegative,
    /// t_min is at most t_max.
    InOrder,
    /// At most one of the four flags about opacity is set.
    OpacityFlags,
    /// At most one of the flags that skip triangles or cull one of their sides is set.
    TriangleFlags,
    /// At most one of the two flags that skip primitives is set.
    SkipFlags,
    /// The ray does not skip triangles where the pipeline skips boxes.
    SkipTrianglesWithPipelineSkipAabbs,
    /// The ray does not skip boxes where the pipeline skips triangles.
    SkipAabbsWithPipelineSkipTriangles,
    /// The time is from 0 to 1.
    Time,
}

impl RayRule {
    /// All rules, in the order of their declaration.
    pub const ALL: [Self; 10] = [
        Self::NotNan,
        Self::Finite,
        Self::NotNegative,
        Self::InOrder,
        Self::OpacityFlags,
        Self::TriangleFlags,
        Self::SkipFlags,
        Self::SkipTrianglesWithPipelineSkipAabbs,
        Self::SkipAabbsWithPipelineSkipTriangles,
        Self::Time,
    ];

    /// Says what is wrong with a ray that breaks the rule.
    pub fn describe(self) -> &'static str {
        match self {
            Self::NotNan => "origin, direction, t_min or t_max is NaN",
            Self::Finite => "origin or direction is not finite",
            Self::NotNegative => "t_min or t_max is negative",
            Self::InOrder => "t_min is above t_max",
            Self::OpacityFlags => {
                "the ray flags contain more than one of OpaqueKHR, NoOpaqueKHR, CullOpaqueKHR and \
                 CullNoOpaqueKHR"
            }
            Self::TriangleFlags => {
                "the ray flags contain more than one of SkipTrianglesKHR, CullBackFacingTrianglesKHR and \
                 CullFrontFacingTrianglesKHR"
            }
            Self::SkipFlags => "the ray flags contain both SkipTrianglesKHR and SkipAABBsKHR",
            Self::SkipTrianglesWithPipelineSkipAabbs => {
                "the ray flags contain SkipTrianglesKHR, and the pipeline skips AABBs"
            }
            Self::SkipAabbsWithPipelineSkipTriangles => {
                "the ray flags contain SkipAABBsKHR, and the pipeline skips triangles"
            }
            Self::Time => "the time is not between 0 and 1",
        }
    }
}
