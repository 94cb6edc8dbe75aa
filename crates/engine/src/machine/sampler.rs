//! Samplers as plain data; the fields are those of `VkSamplerCreateInfo`.

/// `VkFilter`, `VkSamplerMipmapMode`
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Filter {
    /// The nearest texel or level.
    Nearest,
    /// A weighted mean of neighbours.
    Linear,
}

/// `VkSamplerAddressMode`
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum AddressMode {
    /// The image repeats without end.
    Repeat,
    /// Repeats, every other time mirrored.
    MirroredRepeat,
    /// The texel at the edge.
    ClampToEdge,
    /// The border colour.
    ClampToBorder,
    /// Mirrored once, then the edge.
    MirrorClampToEdge,
}

/// `VkBorderColor`; floats or integers as the image has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum BorderColor {
    /// 0, 0, 0, 0
    TransparentBlack,
    /// 0, 0, 0, 1
    OpaqueBlack,
    /// 1, 1, 1, 1
    OpaqueWhite,
}

/// `VkCompareOp`, in its order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CompareOp {
    /// The result is always false.
    Never,
    /// reference < texel
    Less,
    /// reference = texel
    Equal,
    /// reference <= texel
    LessOrEqual,
    /// reference > texel
    Greater,
    /// reference != texel
    NotEqual,
    /// reference >= texel
    GreaterOrEqual,
    /// The result is always true.
    Always,
}

impl CompareOp {
    /// Compares a reference with the value tested; not a number is unequal to everything.
    #[doc(hidden)]
    pub fn holds(self, reference: f32, test: f32) -> bool {
        match self {
            Self::Never => false,
            Self::Less => reference < test,
            Self::Equal => reference == test,
            Self::LessOrEqual => reference <= test,
            Self::Greater => reference > test,
            Self::NotEqual => reference != test,
            Self::GreaterOrEqual => reference >= test,
            Self::Always => true,
        }
    }
}

/// `VkSamplerReductionMode`
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ReductionMode {
    /// The mean of texels by their weights.
    WeightedAverage,
    /// The least of the texels whose weight is not zero.
    Min,
    /// The greatest of the texels whose weight is not zero.
    Max,
}

/// `VkSamplerBlockMatchWindowCreateInfoQCOM`
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct BlockMatchWindow {
    /// `windowExtent`
    pub extent: [u32; 2],
    /// Whether the greatest difference is sought, not the least (`windowCompareMode`).
    pub greatest: bool,
}

/// A sampler's state.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct Sampler {
    /// The filter for magnification.
    pub mag_filter: Filter,
    /// The filter for minification.
    pub min_filter: Filter,
    /// The filter between mip levels.
    pub mipmap_mode: Filter,
    /// The address modes along u, v and w.
    pub address_mode: [AddressMode; 3],
    /// The color that `ClampToBorder` gives.
    #[doc(hidden)]
    pub border_color: BorderColor,
    /// The operator of depth comparisons.
    pub compare_op: Option<CompareOp>,
    /// Least level of detail.
    pub min_lod: f32,
    /// Greatest level of detail.
    pub max_lod: f32,
    /// Added to the level of detail.
    pub lod_bias: f32,
    /// The most probes along a stretched footprint; 1 and below: none, above 16 counts as 16.
    pub max_anisotropy: f32,
    /// How texels are reduced to one value.
    #[doc(hidden)]
    pub reduction_mode: ReductionMode,
    /// Whether coordinates are in texels.
    pub unnormalized_coordinates: bool,
    /// The search window of block matching.
    #[doc(hidden)]
    pub block_match_window: Option<BlockMatchWindow>,
}

impl Default for Sampler {
    /// A sampler with linear filters that repeats the image.
    fn default() -> Self {
        Self {
            mag_filter: Filter::Linear,
            min_filter: Filter::Linear,
            mipmap_mode: Filter::Linear,
            address_mode: [AddressMode::Repeat; 3],
            border_color: BorderColor::TransparentBlack,
            compare_op: None,
            min_lod: 0.0,
            // VK_LOD_CLAMP_NONE
            max_lod: 1000.0,
            lod_bias: 0.0,
            max_anisotropy: 1.0,
            reduction_mode: ReductionMode::WeightedAverage,
            unnormalized_coordinates: false,
            block_match_window: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::CompareOp::*;

    #[test]
    fn comparisons_are_of_the_reference_with_the_test_value() {
        let all = [Never, Less, Equal, LessOrEqual, Greater, NotEqual, GreaterOrEqual, Always];
        let table = |reference, test| all.map(|op| op.holds(reference, test));
        assert_eq!(table(1.0, 2.0), [false, true, false, true, false, true, false, true]);
        assert_eq!(table(2.0, 2.0), [false, false, true, true, false, false, true, true]);
        assert_eq!(table(3.0, 2.0), [false, false, false, false, true, true, true, true]);
        assert_eq!(table(f32::NAN, 2.0), [false, false, false, false, false, true, false, true]);
    }
}
