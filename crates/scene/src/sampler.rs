//! `[samplers.NAME]`: samplers as a scene writes them.

use crate::mesh_piece::TextureReference;
use crate::read::{Named, OneOrMore, Parse, Spanned, Table, TomlValue};
use anyhit_engine::machine::sampler::{AddressMode, BorderColor, CompareOp, Filter, ReductionMode, Sampler};

/// A sampler by name or by its keys.
#[derive(Clone, Debug)]
pub enum SamplerReference {
    /// `[samplers.NAME]`
    Named(Spanned<String>),
    /// A sampler with its keys, in place.
    Inline(Sampler),
    /// That of a texture of a mesh.
    Mesh(TextureReference),
}

impl Parse for SamplerReference {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        if value.text().is_some() {
            return Spanned::parse(value).map(Self::Named);
        }
        if Table::new(value)?.has("mesh") {
            return TextureReference::parse(value).map(Self::Mesh);
        }
        Sampler::parse(value).map(Self::Inline)
    }
}

impl Named for Filter {
    const WHAT: &'static str = "filter";
    const NAMES: &'static [(&'static str, Self)] = &[("nearest", Self::Nearest), ("linear", Self::Linear)];
}

impl Named for AddressMode {
    const WHAT: &'static str = "address mode";
    const NAMES: &'static [(&'static str, Self)] = &[
        ("repeat", Self::Repeat),
        ("mirrored_repeat", Self::MirroredRepeat),
        ("clamp_to_edge", Self::ClampToEdge),
        ("clamp_to_border", Self::ClampToBorder),
        ("mirror_clamp_to_edge", Self::MirrorClampToEdge),
    ];
}

impl Named for BorderColor {
    const WHAT: &'static str = "border colour";
    const NAMES: &'static [(&'static str, Self)] = &[
        ("transparent_black", Self::TransparentBlack),
        ("opaque_black", Self::OpaqueBlack),
        ("opaque_white", Self::OpaqueWhite),
    ];
}

impl Named for CompareOp {
    const WHAT: &'static str = "comparison";
    const NAMES: &'static [(&'static str, Self)] = &[
        ("never", Self::Never),
        ("less", Self::Less),
        ("equal", Self::Equal),
        ("less_or_equal", Self::LessOrEqual),
        ("greater", Self::Greater),
        ("not_equal", Self::NotEqual),
        ("greater_or_equal", Self::GreaterOrEqual),
        ("always", Self::Always),
    ];
}

impl Named for ReductionMode {
    const WHAT: &'static str = "reduction mode";
    const NAMES: &'static [(&'static str, Self)] =
        &[("weighted_average", Self::WeightedAverage), ("min", Self::Min), ("max", Self::Max)];
}

impl Parse for Sampler {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        let default = Self::default();
        let filter = table.or("filter", Filter::Linear);
        let address_mode = match table.optional::<Spanned<OneOrMore<AddressMode>>>("address_mode") {
            None => default.address_mode,
            Some(Spanned { value: OneOrMore(modes), span }) => match modes[..] {
                [all] => [all; 3],
                [u, v] => [u, v, AddressMode::Repeat],
                [u, v, w] => [u, v, w],
                _ => {
                    value
                        .report()
                        .push(span.error("`address_mode` must be one mode, or one for each of u, v, w"));
                    default.address_mode
                }
            },
        };
        let sampler = Self {
            mag_filter: table.or("mag_filter", filter),
            min_filter: table.or("min_filter", filter),
            mipmap_mode: table.or("mipmap_mode", filter),
            address_mode,
            border_color: table.or("border_color", default.border_color),
            compare_op: table.optional("compare_op"),
            min_lod: table.or("min_lod", default.min_lod),
            max_lod: table.or("max_lod", default.max_lod),
            lod_bias: table.or("lod_bias", default.lod_bias),
            max_anisotropy: table.or("max_anisotropy", default.max_anisotropy),
            reduction_mode: table.or("reduction_mode", default.reduction_mode),
            unnormalized_coordinates: table.or("unnormalized_coordinates", false),
            block_match_window: None,
        };
        table.finish();
        Some(sampler)
    }
}
