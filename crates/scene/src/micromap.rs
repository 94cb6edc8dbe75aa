//! `[geometry.NAME.opacity_micromap]` of a scene file.

use std::sync::Arc;

use crate::read::{Named, Parse, Spanned, Table, TomlValue};
use crate::tree::Toml;
use anyhit_engine::accel::OpacityMicromap;
use anyhit_engine::accel::micromap::{MicromapIndex, MicromapTriangle, Opacity, OpacityFormat};

impl Named for OpacityFormat {
    const WHAT: &'static str = "format of an opacity micromap";
    const NAMES: &'static [(&'static str, Self)] =
        &[("2_state", Self::TwoState), ("4_state", Self::FourState)];
}

impl Named for Opacity {
    const WHAT: &'static str = "opacity";
    const NAMES: &'static [(&'static str, Self)] = &[
        ("transparent", Self::Transparent),
        ("opaque", Self::Opaque),
        ("unknown_transparent", Self::UnknownTransparent),
        ("unknown_opaque", Self::UnknownOpaque),
    ];
}

/// `VkOpacityMicromapSpecialIndexKHR`
#[derive(Clone, Copy)]
struct Special(Opacity);

impl Named for Special {
    const WHAT: &'static str = "special index";
    const NAMES: &'static [(&'static str, Self)] = &[
        ("fully_transparent", Self(Opacity::Transparent)),
        ("fully_opaque", Self(Opacity::Opaque)),
        ("fully_unknown_transparent", Self(Opacity::UnknownTransparent)),
        ("fully_unknown_opaque", Self(Opacity::UnknownOpaque)),
    ];
}

impl Parse for MicromapIndex {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        match value.toml() {
            Toml::String(_) => Special::parse(value).map(|special| Self::Special(special.0)),
            _ => u32::parse(value).map(Self::Triangle),
        }
    }
}

/// A state by name or number.
struct State(Spanned<Opacity>);

impl Parse for State {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let opacity = match value.toml() {
            Toml::String(_) => Opacity::parse(value)?,
            _ => match u8::parse(value)? {
                number @ 0..=3 => Opacity::from_bits(number),
                _ => return value.wrong("a state must be 0 to 3, or a name such as \"unknown_opaque\""),
            },
        };
        Some(Self(Spanned { value: opacity, span: value.span() }))
    }
}

/// The states of a triangle, whose number determines the subdivision level.
struct States(MicromapTriangle);

impl States {
    fn parse(value: TomlValue<'_>, format: OpacityFormat) -> Option<Self> {
        let states = Vec::<State>::parse(value)?;
        let subdivision_level = states.len().checked_ilog2().unwrap_or(0) / 2;
        let mut triangle = MicromapTriangle { format, subdivision_level, states: Vec::new() };
        if states.len() != triangle.len() {
            return value.wrong(format!(
                "the number of states must be a power of four (1, 4, 16, 64, ...), found {}",
                states.len()
            ));
        }
        triangle.states.resize(triangle.byte_len(), 0);
        let (per_byte, bits) = match format {
            OpacityFormat::TwoState => (8, 1),
            OpacityFormat::FourState => (4, 2),
        };
        for (at, State(state)) in states.iter().enumerate() {
            let number = state.value as u8;
            if number >> bits != 0 {
                value.report().push(
                    state.span.error("the states of a 2_state micromap are transparent (0) and opaque (1)"),
                );
                return None;
            }
            triangle.states[at / per_byte] |= number << (at % per_byte * bits);
        }
        Some(Self(triangle))
    }
}

/// Reads the table `opacity_micromap` of a geometry.
pub(super) fn opacity_micromap(geometry: &Table<'_>) -> Option<Arc<OpacityMicromap>> {
    let value = geometry.value("opacity_micromap")?;
    let table = Table::new(value)?;
    let format = table.or("format", OpacityFormat::FourState);
    let indices = table.optional("indices");
    let triangles = match table.value("triangles") {
        None => Some(Vec::new()),
        Some(list) => match list.elements() {
            None => list.expected("an array with the states of each triangle"),
            Some(elements) => {
                let read: Vec<_> = elements.map(|states| States::parse(states, format)).collect();
                read.into_iter().map(|states| states.map(|states| states.0)).collect()
            }
        },
    };
    table.finish();
    Some(Arc::new(OpacityMicromap { triangles: triangles?, indices }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::{Diagnostics, Document};

    fn read(text: &str) -> anyhit_base::error::Result<Option<Arc<OpacityMicromap>>> {
        let report = Diagnostics::default();
        let document = Document::parse("scene.toml", text)?;
        let root = document.root(&report);
        let micromap = opacity_micromap(&root);
        root.finish();
        report.finish()?;
        Ok(micromap)
    }

    #[test]
    fn states_are_packed_from_the_lowest_bits_up() {
        let four = r#"opacity_micromap = { triangles = [[0, "opaque", 2, 3], ["opaque"]], indices = [1, "fully_opaque"] }"#;
        let map = read(four).unwrap().unwrap();
        assert_eq!(map.triangles[0].states, [0b11_10_01_00]);
        assert_eq!([map.triangles[0].subdivision_level, map.triangles[1].subdivision_level], [1, 0]);
        let indices = [MicromapIndex::Triangle(1), MicromapIndex::Special(Opacity::Opaque)];
        assert_eq!(map.indices.as_deref(), Some(&indices[..]));
        let two = "opacity_micromap = { format = \"2_state\", triangles = [[0, 1, 1, 0]] }";
        assert_eq!(read(two).unwrap().unwrap().triangles[0].states, [0b0110]);
    }

    #[test]
    fn mistakes_are_reported_at_their_place() {
        let said = |text: &str| read(text).unwrap_err().render();
        assert!(said("opacity_micromap = { triangles = [[0, 1, 1]] }").contains("found 3"));
        assert!(said("opacity_micromap = { triangles = [[4]] }").contains("0 to 3"));
        let two = said("opacity_micromap = { format = \"2_state\", triangles = [[2]] }");
        assert!(two.contains("transparent (0) and opaque (1)"), "{two}");
        assert!(said("opacity_micromap = { indices = [\"fully\"] }").contains("special index"));
        assert!(said("opacity_micromap = { levels = 3 }").contains("unknown key"));
    }
}
