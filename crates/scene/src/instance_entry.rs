//! `[[instance]]`: an instance as a scene writes it.

use std::sync::Arc;

use crate::motion::motion;
use crate::read::{Named, OneOrMore, Parse, Span, Spanned, Table, TomlValue};
use crate::transform_entry::parse_transform;
use anyhit_engine::accel::{Blas, InstanceFlags, Motion, TlasInstance};

/// One instance as a scene writes it.
#[derive(Clone, Debug)]
pub struct InstanceEntry {
    /// The span of its table.
    pub span: Span,
    /// The geometries of its BLAS.
    pub geometry: Arc<[Spanned<String>]>,
    /// The name of its TLAS, if it is not `main`.
    pub tlas: Option<Arc<str>>,
    /// Object to world.
    pub transform: [[f32; 4]; 3],
    /// How it moves.
    pub motion: Option<Box<Motion>>,
    /// `InstanceCustomIndexKHR`
    pub custom_index: u32,
    /// Visibility mask.
    pub mask: u8,
    /// Record offset in the hit records.
    pub sbt_offset: u32,
    /// The geometry's flags.
    pub flags: InstanceFlags,
}

#[derive(Clone, Copy)]
pub(crate) struct InstanceFlag(u32);

/// `VkGeometryInstanceFlagBitsKHR`
impl Named for InstanceFlag {
    const WHAT: &'static str = "flag of an instance";
    const NAMES: &'static [(&'static str, Self)] = &[
        ("triangle_facing_cull_disable", Self(1)),
        ("triangle_flip_facing", Self(2)),
        ("force_opaque", Self(4)),
        ("force_no_opaque", Self(8)),
        ("force_opacity_micromap_2_state", Self(0x10)),
        ("disable_opacity_micromaps", Self(0x20)),
    ];
}

impl Parse for InstanceEntry {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        let geometry = table.required::<OneOrMore<Spanned<String>>>("geometry");
        let tlas = table.optional::<String>("tlas");
        let transform = parse_transform(&table).unwrap_or(IDENTITY);
        let motion = motion(&table, transform);
        let custom_index = bits24(&table, "custom_index");
        let mask = table.or("mask", 0xff);
        let sbt_offset = bits24(&table, "sbt_offset");
        let flags = instance_flags(&table);
        table.finish();
        let entry = Self {
            span: value.span(),
            geometry: geometry?.0.into(),
            tlas: tlas.map(Arc::from),
            transform,
            motion: motion.map(Box::new),
            custom_index: custom_index?,
            mask,
            sbt_offset: sbt_offset?,
            flags,
        };
        Some(entry)
    }
}

impl InstanceEntry {
    /// The name of its TLAS.
    pub fn tlas(&self) -> &str {
        self.tlas.as_deref().unwrap_or("main")
    }

    /// The instance with this BLAS.
    pub fn instance(&self, blas: Arc<Blas>) -> TlasInstance {
        TlasInstance {
            blas,
            transform: self.transform,
            motion: self.motion.as_deref().cloned(),
            custom_index: self.custom_index,
            mask: self.mask,
            sbt_record_offset: self.sbt_offset,
            flags: self.flags,
        }
    }
}

/// Reads `flags`.
pub(super) fn instance_flags(table: &Table<'_>) -> InstanceFlags {
    let flags = table.optional::<OneOrMore<InstanceFlag>>("flags");
    InstanceFlags(flags.map_or(0, |flags| flags.0.iter().fold(0, |all, flag| all | flag.0)))
}

/// Reads a number of 24 bits; without the key it is 0.
pub(super) fn bits24(table: &Table<'_>, key: &'static str) -> Option<u32> {
    let Some(value) = table.value(key) else { return Some(0) };
    let number = u32::parse(value)?;
    if number >= 1 << 24 {
        return value.wrong(format!("`{key}` has 24 bits: at most 16777215"));
    }
    Some(number)
}

pub(super) const IDENTITY: [[f32; 4]; 3] = [[1., 0., 0., 0.], [0., 1., 0., 0.], [0., 0., 1., 0.]];
