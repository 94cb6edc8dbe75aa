//! Resources that are views of others: ranges of a buffer, and descriptors of an image that another
//! resource holds.

use crate::descriptor_kind::DescriptorKind;
use crate::read::{Spanned, Table};
use crate::sampler::SamplerReference;
use anyhit_engine::machine::format::Format;

/// A view as a scene writes it.
#[derive(Clone, Debug)]
pub struct ViewEntry {
    /// The descriptor's type.
    pub kind: DescriptorKind,
    /// The resource that holds the memory.
    pub of: Spanned<String>,
    /// What a view of a buffer begins at and how far it goes.
    pub range: RangeEntry,
    /// The format of an image, which is the image's own.
    pub format: Option<Spanned<Format>>,
    /// The sampler of a combined image sampler.
    pub sampler: Option<SamplerReference>,
}

/// The other keys of `VkDescriptorBufferInfo`, and what is added when the set is bound.
#[derive(Clone, Debug, Default)]
pub struct RangeEntry {
    /// Bytes from the beginning of the buffer.
    pub offset: Option<Spanned<u64>>,
    /// Bytes; without it the rest of the buffer (`VK_WHOLE_SIZE`).
    pub range: Option<Spanned<u64>>,
    /// An element of `pDynamicOffsets`, in bytes.
    pub dynamic_offset: Option<Spanned<u64>>,
}

impl ViewEntry {
    /// The keys of ranges.
    pub const RANGE_KEYS: [&str; 3] = ["offset", "range", "dynamic_offset"];

    /// Whether a resource of this type says that it is a view of another one.
    pub fn is_one(table: &Table<'_>, kind: DescriptorKind) -> bool {
        (kind.is_buffer() || kind.is_texel_buffer()) && table.value("buffer").is_some()
            || kind.is_image() && table.value("image").is_some()
    }

    /// Reads the keys of a view out of its resource's table.
    pub fn parse(table: &Table<'_>, kind: DescriptorKind) -> Option<Self> {
        let of = table.required(if kind.is_image() { "image" } else { "buffer" });
        for key in ["data", "size", "fill", "file"] {
            if let Some(value) = table.refused(key) {
                value.wrong::<()>(format!(
                    "a view has no `{key}`: it shares the memory of the resource that it names"
                ));
            }
        }
        let range = match kind.is_buffer() {
            true => RangeEntry::parse(table, kind),
            false => RangeEntry::default(),
        };
        let format = if kind.is_buffer() { None } else { table.optional("format") };
        let sampler = match kind {
            DescriptorKind::CombinedImageSampler => table.optional("sampler"),
            _ => None,
        };
        Some(Self { kind, of: of?, range, format, sampler })
    }

    /// Reports keys of a range where there is none.
    pub fn check_no_range(table: &Table<'_>, kind: DescriptorKind) {
        for key in
            Self::RANGE_KEYS.into_iter().filter(|_| kind.is_buffer() || kind == DescriptorKind::Unbound)
        {
            if let Some(value) = table.refused(key) {
                value.wrong::<()>(format!(
                    "`{key}` applies to a range of another resource: name it with `buffer = \"NAME\"`; \
                     memory that is bound only in ranges has `type = \"buffer\"`"
                ));
            }
        }
    }
}

impl RangeEntry {
    fn parse(table: &Table<'_>, kind: DescriptorKind) -> Self {
        let (offset, range) = (table.optional("offset"), table.optional("range"));
        let dynamic_offset: Option<Spanned<u64>> = table.optional("dynamic_offset");
        if let Some(given) = dynamic_offset.as_ref().filter(|_| !kind.is_dynamic()) {
            let name =
                if kind == DescriptorKind::UniformBuffer { "uniform_buffer" } else { "storage_buffer" };
            table.report().push(given.span.error(format!(
                "only a `{name}_dynamic` has a `dynamic_offset`: set `offset` for a `{name}`"
            )));
        }
        let dynamic_offset = dynamic_offset.filter(|_| kind.is_dynamic());
        Self { offset, range, dynamic_offset }
    }
}
