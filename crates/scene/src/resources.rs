//! `[resources.NAME]`: the resources that shaders access through descriptor sets.

use std::sync::Arc;

use crate::address_entry::AddressChoice;
use crate::data::DataPieces;
use crate::data_sources::DataSources;
use crate::descriptor_kind::DescriptorKind;
use crate::encoding::Data;
use crate::image_entry::{ImageContent, ImageEntry};
use crate::pass_entry::PassKey;
use crate::read::{Named, OneOrMore, Parse, Span, Spanned, Table, TomlValue};
use crate::sampler::SamplerReference;
use crate::struct_data::ShaderModules;
use crate::view_entry::ViewEntry;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::input::InputLimit;
use anyhit_engine::machine::Binding;
use anyhit_engine::machine::resource::ELEMENT_BITS;
use anyhit_engine::machine::sampler::Sampler;
use anyhit_engine::module::heap::DESCRIPTOR_BYTES;
use anyhit_engine::reflect::lookup::DataBlock;

/// The content of one descriptor. Images with one content, in the sense of [`Arc::ptr_eq`], are one
/// image at several bindings.
#[derive(Clone, Debug, PartialEq)]
pub enum Resource {
    /// `VK_DESCRIPTOR_TYPE_STORAGE_BUFFER`
    StorageBuffer(Data),
    /// `VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER`
    UniformBuffer(Data),
    /// `VK_DESCRIPTOR_TYPE_STORAGE_IMAGE`
    StorageImage(Arc<ImageContent>),
    /// `VK_DESCRIPTOR_TYPE_SAMPLED_IMAGE`
    SampledImage(Arc<ImageContent>),
    /// `VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER` and `VK_DESCRIPTOR_TYPE_STORAGE_TEXEL_BUFFER`
    TexelBuffer(Arc<ImageContent>),
    /// `VK_DESCRIPTOR_TYPE_SAMPLER`
    Sampler(Sampler),
    /// `VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER`
    CombinedImageSampler(Arc<ImageContent>, Sampler),
    /// `VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR`: index into `ResolvedScene::tlas`.
    AccelerationStructure(usize),
    /// A range of a buffer that another resource holds.
    BufferView(BufferView),
    /// A null buffer of either kind.
    NullBuffer,
    /// A null acceleration structure.
    NullAccelerationStructure,
}

impl Resource {
    /// The data of a buffer.
    pub fn data(&self) -> Option<&Data> {
        match self {
            Self::StorageBuffer(data) | Self::UniformBuffer(data) => Some(data),
            _ => None,
        }
    }

    /// How many bytes of a buffer the descriptor refers to.
    ///
    /// # Errors
    /// As [`Data::size`].
    pub fn buffer_size(&self) -> Result<Option<u64>> {
        match self {
            Self::BufferView(view) => Ok(Some(view.range)),
            other => other.data().map(Data::size).transpose(),
        }
    }

    /// The texels of an image or texel buffer.
    pub fn image(&self) -> Option<&Arc<ImageContent>> {
        match self {
            Self::StorageImage(image)
            | Self::SampledImage(image)
            | Self::TexelBuffer(image)
            | Self::CombinedImageSampler(image, _) => Some(image),
            _ => None,
        }
    }
}

/// A range of a buffer (`VkDescriptorBufferInfo`), which lies inside it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BufferView {
    /// The descriptor's type.
    pub kind: DescriptorKind,
    /// The name of the resource that holds the buffer.
    pub buffer: String,
    /// Bytes from the beginning of the buffer.
    pub offset: u64,
    /// Bytes of the range.
    pub range: u64,
    /// What is added to the offset (`pDynamicOffsets`); of a descriptor that is not dynamic 0.
    pub dynamic_offset: u64,
}

impl BufferView {
    /// Where the range begins in the buffer.
    pub fn start(&self) -> u64 {
        self.offset + self.dynamic_offset
    }
}

/// How the picture of a render is saved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Output {
    /// The image has colours for a screen: its numbers are saved unchanged.
    AsIs,
    /// The image has linear colours: they are encoded as sRGB.
    Linear,
}

impl Named for Output {
    const WHAT: &'static str = "kind of output";
    const NAMES: &'static [(&'static str, Self)] = &[("as_is", Self::AsIs), ("linear", Self::Linear)];
}

/// The value of the key `output`: `true`, `false` or an [`Output`].
struct OutputKey(Option<Output>);

impl Parse for OutputKey {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        if value.text().is_some() {
            return Output::parse(value).map(|output| Self(Some(output)));
        }
        bool::parse(value).map(|marked| Self(marked.then_some(Output::AsIs)))
    }
}

/// A resource as a scene writes it.
#[derive(Clone, Debug)]
pub struct ResourceEntry {
    /// The span of its table.
    pub span: Span,
    /// Descriptor set.
    pub set: u32,
    /// The binding number in the set.
    pub binding: u32,
    /// Element of an array of descriptors.
    pub element: u32,
    /// Marks the image that a render saves.
    pub output: Option<Output>,
    /// True if a PNG of the image has its alpha.
    pub keeps_alpha: bool,
    /// The passes that find it, where others at its set and binding find another.
    pub passes: Option<Vec<Spanned<PassKey>>>,
    /// The named pipelines whose launches find it.
    pub pipelines: Option<Vec<Spanned<String>>>,
    /// Its content, or those of the elements of an array from `element` on.
    pub contents: Vec<Content>,
}

/// The content of a [`ResourceEntry`].
#[derive(Clone, Debug)]
pub enum Content {
    /// A buffer of either kind.
    Buffer(DescriptorKind, BufferEntry),
    /// An image of either kind, or with a sampler.
    Image(DescriptorKind, ImageEntry),
    /// A view of what another resource holds.
    View(ViewEntry),
    /// A sampler without an image.
    Sampler(SamplerReference),
    /// A TLAS by its name.
    AccelerationStructure(Spanned<String>),
    /// `VK_NULL_HANDLE` in place of a buffer or a TLAS.
    Null(DescriptorKind),
}

impl Parse for ResourceEntry {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        let Some(kind) = table.value("type") else {
            return value.wrong("a resource needs its `type`: `storage_buffer`, `storage_image`, ...");
        };
        let kind = DescriptorKind::parse(kind)?;
        let unbound = kind == DescriptorKind::Unbound;
        for key in ["set", "binding", "element", "elements", "heap", "heap_offset", "passes", "pipelines"]
            .into_iter()
            .filter(|key| unbound && table.has(key))
        {
            let found = table.refused(key);
            found.and_then(|found| {
                found.wrong::<()>(format!(
                    "a `buffer` is not bound to a descriptor and has no `{key}`: use `storage_buffer` to \
                     bind it"
                ))
            });
        }
        let place = match kind {
            DescriptorKind::PushConstantBank => bank_place(&table),
            _ => heap_place(&table, kind),
        };
        let (set, binding, element) = match (unbound, place) {
            (true, _) => (0, Some(0), 0),
            (false, Some((heap, index))) => (heap.set, Some(heap.binding), index),
            (false, None) => (table.or("set", 0), table.required("binding"), element(&table)),
        };
        let (passes, pipelines) = match unbound {
            true => (None, None),
            false => (
                table.optional::<OneOrMore<_>>("passes").map(|all| all.0),
                table.optional::<OneOrMore<_>>("pipelines").map(|all| all.0),
            ),
        };
        let (output, keeps_alpha) = match kind {
            DescriptorKind::StorageImage => {
                (table.optional::<OutputKey>("output").and_then(|marked| marked.0), table.or("alpha", false))
            }
            _ => (None, false),
        };
        let contents = match table.value("elements").filter(|_| !unbound) {
            Some(value) => elements_of(value, kind),
            None => Content::parse(&table, kind).map(|content| vec![content]),
        };
        table.finish();
        Some(Self {
            span: value.span(),
            set,
            binding: binding?,
            element,
            output,
            keeps_alpha,
            passes,
            pipelines,
            contents: contents?,
        })
    }
}

/// Reads the elements of an array, each with the keys of a resource of its type.
fn elements_of(value: TomlValue<'_>, kind: DescriptorKind) -> Option<Vec<Content>> {
    let Some(elements) = value.elements() else {
        return value.expected("an array of tables, one for each element: `[{ file = \"a.png\" }, ...]`");
    };
    let mut contents = Some(Vec::new());
    for element in elements {
        let content = Table::new(element).and_then(|table| {
            let content = Content::parse(&table, kind);
            table.finish();
            content
        });
        contents = contents.zip(content).map(|(mut all, content)| {
            all.push(content);
            all
        });
    }
    if contents.as_ref().is_some_and(Vec::is_empty) {
        return value.wrong("an array of descriptors must have at least one element");
    }
    contents
}

impl Content {
    /// Reads the keys of one descriptor.
    fn parse(table: &Table<'_>, kind: DescriptorKind) -> Option<Self> {
        let wrong = |message: &str| {
            table.report().push(table.span().error(message));
            None
        };
        let nullable = matches!(
            kind,
            DescriptorKind::StorageBuffer
                | DescriptorKind::UniformBuffer
                | DescriptorKind::AccelerationStructure
        );
        if let Some(null) = table.value("null").filter(|_| !nullable) {
            return null
                .wrong("only buffers and acceleration structures can be null, not images or samplers");
        }
        let is_view = ViewEntry::is_one(table, kind);
        if kind.is_dynamic() && !is_view {
            // One mistake: what a buffer of its own would say is none beside it.
            for key in BufferEntry::KEYS.into_iter().chain(ViewEntry::RANGE_KEYS) {
                table.refused(key);
            }
            return wrong(
                "a dynamic descriptor refers to a range of another buffer: set `buffer` to its name and \
                 `range` to its size",
            );
        }
        if !is_view {
            ViewEntry::check_no_range(table, kind);
        }
        match kind {
            _ if is_view => ViewEntry::parse(table, kind).map(Self::View),
            _ if nullable && table.or("null", false) => Some(Self::Null(kind)),
            DescriptorKind::StorageBuffer
            | DescriptorKind::UniformBuffer
            | DescriptorKind::StorageBufferDynamic
            | DescriptorKind::UniformBufferDynamic
            | DescriptorKind::HeapData
            | DescriptorKind::PushConstantBank
            | DescriptorKind::Unbound => BufferEntry::parse(table).map(|entry| Self::Buffer(kind, entry)),
            DescriptorKind::StorageImage
            | DescriptorKind::SampledImage
            | DescriptorKind::CombinedImageSampler
            | DescriptorKind::UniformTexelBuffer
            | DescriptorKind::StorageTexelBuffer => {
                ImageEntry::parse(table, kind).map(|entry| Self::Image(kind, entry))
            }
            DescriptorKind::Sampler => Some(Self::Sampler(
                table.optional("sampler").unwrap_or(SamplerReference::Inline(Sampler::default())),
            )),
            DescriptorKind::AccelerationStructure => {
                let main = Spanned { value: "main".to_string(), span: table.span() };
                Some(Self::AccelerationStructure(table.or("tlas", main)))
            }
        }
    }
}

/// Reads the number of a bank of push constants.
fn bank_place(table: &Table<'_>) -> Option<(Binding, u32)> {
    for key in ["set", "binding", "element", "elements", "heap", "heap_offset"] {
        if let Some(found) = table.refused(key) {
            found.wrong::<()>(format!("a bank of push constants has no `{key}`: `bank` is its number"));
        }
    }
    let Spanned { value: bank, span } = table.required::<Spanned<u32>>("bank")?;
    if bank == 0 {
        let message = "bank 0 is given by `push_constants`: a `push_constant_bank` has a number from 1 on";
        table.report().push(span.error(message));
    }
    Some((Binding::push_constant_bank(bank), 0))
}

/// Reads the place of a resource in a descriptor heap: the heap, and the index of its descriptor.
/// `None` where the resource is in none.
fn heap_place(table: &Table<'_>, kind: DescriptorKind) -> Option<(Binding, u32)> {
    if kind == DescriptorKind::HeapData {
        for key in ["set", "binding", "element", "elements", "heap", "heap_offset", "passes", "pipelines"] {
            if let Some(found) = table.refused(key) {
                found.wrong::<()>(format!("the data of a heap has no `{key}`: it begins with the heap"));
            }
        }
        return Some((Binding::RESOURCE_HEAP.heap_data(), 0));
    }
    let keys: Vec<&str> = ["heap", "heap_offset"].into_iter().filter(|key| table.has(key)).collect();
    let first = *keys.first()?;
    let heap = match kind {
        DescriptorKind::Sampler => Binding::SAMPLER_HEAP,
        _ => Binding::RESOURCE_HEAP,
    };
    let given = table.optional::<Spanned<u32>>(first).unwrap_or(Spanned { value: 0, span: table.span() });
    let refuse = |message: String| table.report().push(given.span.error(message));
    if keys.len() > 1 {
        table.refused("heap_offset");
        refuse("a descriptor has one place in a heap: `heap`, an index, or `heap_offset` in bytes".into());
    }
    for key in ["set", "binding", "element", "passes", "pipelines"] {
        if table.has(key) {
            table.refused(key);
            refuse(format!("a descriptor in a heap has no `{key}`: all passes use the same heaps"));
        }
    }
    if kind == DescriptorKind::CombinedImageSampler || kind.is_dynamic() {
        refuse(
            "a heap has no descriptors of this type: use a `sampled_image` and a `sampler`, or a \
                `storage_buffer` or `uniform_buffer`"
                .into(),
        );
    }
    let index = match first {
        "heap" => given.value,
        _ if given.value.is_multiple_of(DESCRIPTOR_BYTES) => given.value / DESCRIPTOR_BYTES,
        _ => {
            refuse(format!("an offset in a heap must be a multiple of {DESCRIPTOR_BYTES} bytes"));
            0
        }
    };
    if index >> ELEMENT_BITS != 0 {
        refuse(format!("a heap must have at most {} descriptors", 1 << ELEMENT_BITS));
        return Some((heap, 0));
    }
    Some((heap, index))
}

/// Reads the index of an element in an array of descriptors, which is limited by what shaders can
/// address.
fn element(table: &Table<'_>) -> u32 {
    let Some(Spanned { value, span }) = table.optional::<Spanned<u32>>("element") else { return 0 };
    if value >> ELEMENT_BITS == 0 {
        return value;
    }
    table.report().push(too_many_elements(&span));
    0
}

/// The error of an element that no shader can address.
pub(super) fn too_many_elements(span: &Span) -> Error {
    span.error(format!("an array of descriptors must have at most {} elements", 1 << ELEMENT_BITS))
}

/// A buffer as a scene writes it.
#[derive(Clone, Debug)]
pub struct BufferEntry {
    data: Option<DataPieces>,
    size: Option<Spanned<u64>>,
    /// What it says of its device address.
    pub address: AddressChoice,
}

impl BufferEntry {
    /// The keys of a buffer that holds its own bytes.
    const KEYS: [&str; 3] = ["data", "size", "address"];

    fn parse(table: &Table<'_>) -> Option<Self> {
        let (data, size) = (table.optional("data"), table.optional::<Spanned<u64>>("size"));
        let address = table.or("address", AddressChoice::Unsaid);
        if let Some(Spanned { value, span }) = &size {
            let limits = table.report().limits();
            if let Err(error) = limits.check(InputLimit::BufferBytes, *value, ErrorKind::InvalidScene) {
                table.report().push(error.at(span.place()));
                return None;
            }
        }
        if !table.has("data") && !table.has("size") {
            table.report().push(table.span().error("a buffer needs `data`, or a `size` in bytes"));
            return None;
        }
        Some(Self { data, size, address })
    }

    /// The files that its data are read from.
    pub(super) fn named_files(&self) -> Vec<Spanned<String>> {
        self.data.iter().flat_map(DataPieces::named_files).collect()
    }

    /// Its data, padded with zeros to its size.
    ///
    /// # Errors
    /// If the data is longer than the size, and those of [`DataPieces::resolve_for`].
    pub fn load(
        &self,
        sources: &DataSources<'_>,
        modules: &dyn ShaderModules,
        block: Option<DataBlock>,
    ) -> Result<Data> {
        let files = sources.files;
        let mut data = match &self.data {
            Some(data) => data.resolve_for(sources, modules, block)?,
            None => Data::unfilled(),
        };
        let Some(Spanned { value: size, span }) = &self.size else { return Ok(data) };
        let found = data.bytes().map_or(0, |bytes| bytes.len() as u64);
        if found > *size {
            return Err(span.error(format!("the data has {found} bytes, more than the `size` of {size}")));
        }
        files.reserve(size - found).map_err(|error| error.at(span.place()))?;
        data.pad_to(*size, span.place());
        Ok(data)
    }
}
