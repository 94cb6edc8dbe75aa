//! `[resources.NAME]` and `[samplers.NAME]`: what shaders reach through descriptor sets.

use crate::error::Result;
use crate::scene::data::{Data, MAX_DATA_SIZE, read};
use crate::scene::files::Files;
use crate::scene::image::{Format, MAX_EXTENT, MAX_IMAGE_SIZE, Picture};
use crate::scene::read::{At, Named, OneOrMore, Parse, Span, Table, Value};

/// The content of one descriptor.
#[derive(Clone, Debug, PartialEq)]
pub enum Resource {
    /// `VK_DESCRIPTOR_TYPE_STORAGE_BUFFER`
    StorageBuffer(Vec<u8>),
    /// `VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER`
    UniformBuffer(Vec<u8>),
    /// `VK_DESCRIPTOR_TYPE_STORAGE_IMAGE`
    StorageImage(Image),
    /// `VK_DESCRIPTOR_TYPE_SAMPLED_IMAGE`
    SampledImage(Image),
    /// `VK_DESCRIPTOR_TYPE_SAMPLER`
    Sampler(Sampler),
    /// `VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER`
    CombinedImageSampler(Image, Sampler),
    /// `VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR`: index into `ResolvedScene::tlas`.
    AccelerationStructure(usize),
}

/// The shape of an image, as of its `OpTypeImage`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Dimension {
    /// A line.
    D1,
    /// A plane.
    D2,
    /// A volume.
    D3,
    /// Six planes.
    Cube,
    /// Several lines.
    D1Array,
    /// Several planes.
    D2Array,
    /// Several times six planes.
    CubeArray,
}

impl Named for Dimension {
    const WHAT: &'static str = "image dimension";
    const NAMES: &'static [(&'static str, Self)] = &[
        ("1d", Self::D1),
        ("2d", Self::D2),
        ("3d", Self::D3),
        ("cube", Self::Cube),
        ("1d_array", Self::D1Array),
        ("2d_array", Self::D2Array),
        ("cube_array", Self::CubeArray),
    ];
}

/// An image with one mip level.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Its texels' format.
    pub format: Format,
    /// Its shape.
    pub dimension: Dimension,
    /// Width, height, depth.
    pub extent: [u32; 3],
    /// Array layers; 6 for a cube.
    pub layers: u32,
    /// Texels: x fastest, then y, z, layer. Row 0 is a file's top row.
    pub texels: Vec<u8>,
}

/// `VkFilter`, `VkSamplerMipmapMode`
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Filter {
    /// The nearest texel or level.
    Nearest,
    /// A weighted mean of neighbours.
    Linear,
}

impl Named for Filter {
    const WHAT: &'static str = "filter";
    const NAMES: &'static [(&'static str, Self)] = &[("nearest", Self::Nearest), ("linear", Self::Linear)];
}

/// `VkSamplerAddressMode`
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum AddressMode {
    /// Repeats.
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

impl Named for BorderColor {
    const WHAT: &'static str = "border colour";
    const NAMES: &'static [(&'static str, Self)] = &[
        ("transparent_black", Self::TransparentBlack),
        ("opaque_black", Self::OpaqueBlack),
        ("opaque_white", Self::OpaqueWhite),
    ];
}

/// `VkCompareOp`, in its order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CompareOp {
    /// 0
    Never,
    /// 1
    Less,
    /// 2
    Equal,
    /// 3
    LessOrEqual,
    /// 4
    Greater,
    /// 5
    NotEqual,
    /// 6
    GreaterOrEqual,
    /// 7
    Always,
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

/// `VkSamplerCreateInfo`
#[derive(Clone, Debug, PartialEq)]
pub struct Sampler {
    /// Magnification.
    pub mag_filter: Filter,
    /// Minification.
    pub min_filter: Filter,
    /// Between mip levels.
    pub mipmap_mode: Filter,
    /// Outside the image, along u, v and w.
    pub address_mode: [AddressMode; 3],
    /// For `ClampToBorder`.
    pub border_color: BorderColor,
    /// For depth comparisons.
    pub compare_op: Option<CompareOp>,
    /// Least level of detail.
    pub min_lod: f32,
    /// Greatest level of detail.
    pub max_lod: f32,
    /// Added to the level of detail.
    pub lod_bias: f32,
    /// Coordinates in texels.
    pub unnormalized_coordinates: bool,
}

impl Default for Sampler {
    /// Linear filters, repeating.
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
            unnormalized_coordinates: false,
        }
    }
}

impl Parse for Sampler {
    fn parse(value: Value<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        let default = Self::default();
        let filter = table.or("filter", Filter::Linear);
        let address_mode = match table.optional::<At<OneOrMore<AddressMode>>>("address_mode") {
            None => default.address_mode,
            Some(At { value: OneOrMore(modes), span }) => match modes[..] {
                [all] => [all; 3],
                [u, v] => [u, v, AddressMode::Repeat],
                [u, v, w] => [u, v, w],
                _ => {
                    value.report().push(span.error("`address_mode` is one mode, or one for each of u, v, w"));
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
            unnormalized_coordinates: table.or("unnormalized_coordinates", false),
        };
        table.finish();
        Some(sampler)
    }
}

/// How the picture of a render is saved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Output {
    /// The image holds what a screen shows: its numbers are saved as they are.
    AsIs,
    /// The image holds linear colours: they are encoded as sRGB.
    Linear,
}

impl Named for Output {
    const WHAT: &'static str = "kind of output";
    const NAMES: &'static [(&'static str, Self)] = &[("as_is", Self::AsIs), ("linear", Self::Linear)];
}

/// `true`, `false` or an [`Output`].
struct Marked(Option<Output>);

impl Parse for Marked {
    fn parse(value: Value<'_>) -> Option<Self> {
        if value.text().is_some() {
            return Output::parse(value).map(|output| Self(Some(output)));
        }
        bool::parse(value).map(|marked| Self(marked.then_some(Output::AsIs)))
    }
}

/// A resource as a scene writes it.
#[derive(Clone, Debug)]
pub struct ResourceEntry {
    /// Where its table begins.
    pub span: Span,
    /// Descriptor set.
    pub set: u32,
    /// Binding.
    pub binding: u32,
    /// Element of an array of descriptors.
    pub element: u32,
    /// Marks the image that a render saves.
    pub output: Option<Output>,
    /// Its content.
    pub content: Content,
}

/// What a [`ResourceEntry`] is made of.
#[derive(Clone, Debug)]
pub enum Content {
    /// A buffer of either kind.
    Buffer(Kind, BufferEntry),
    /// An image of either kind, or with a sampler.
    Image(Kind, ImageEntry),
    /// A sampler by itself.
    Sampler(SamplerReference),
    /// A TLAS by its name.
    AccelerationStructure(At<String>),
}

/// A descriptor's type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A storage buffer.
    StorageBuffer,
    /// A uniform buffer.
    UniformBuffer,
    /// A storage image.
    StorageImage,
    /// A sampled image.
    SampledImage,
    /// A sampler.
    Sampler,
    /// An image with its sampler.
    CombinedImageSampler,
    /// A TLAS.
    AccelerationStructure,
}

impl Named for Kind {
    const WHAT: &'static str = "type of resource";
    const NAMES: &'static [(&'static str, Self)] = &[
        ("storage_buffer", Self::StorageBuffer),
        ("uniform_buffer", Self::UniformBuffer),
        ("storage_image", Self::StorageImage),
        ("sampled_image", Self::SampledImage),
        ("sampler", Self::Sampler),
        ("combined_image_sampler", Self::CombinedImageSampler),
        ("acceleration_structure", Self::AccelerationStructure),
    ];
}

/// A sampler by name or by its keys.
#[derive(Clone, Debug)]
pub enum SamplerReference {
    /// `[samplers.NAME]`
    Named(At<String>),
    /// Written in place.
    Inline(Sampler),
}

impl Parse for SamplerReference {
    fn parse(value: Value<'_>) -> Option<Self> {
        if value.text().is_some() {
            return At::parse(value).map(Self::Named);
        }
        Sampler::parse(value).map(Self::Inline)
    }
}

impl Parse for ResourceEntry {
    fn parse(value: Value<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        let Some(kind) = table.value("type") else {
            return value.wrong("a resource needs its `type`: `storage_buffer`, `storage_image`, ...");
        };
        let kind = Kind::parse(kind)?;
        let set = table.or("set", 0);
        let binding = table.required("binding");
        let element = table.or("element", 0);
        let output = match kind {
            Kind::StorageImage => table.optional::<Marked>("output").and_then(|marked| marked.0),
            _ => None,
        };
        let content = match kind {
            Kind::StorageBuffer | Kind::UniformBuffer => {
                BufferEntry::parse(&table).map(|entry| Content::Buffer(kind, entry))
            }
            Kind::StorageImage | Kind::SampledImage | Kind::CombinedImageSampler => {
                ImageEntry::parse(&table, kind).map(|entry| Content::Image(kind, entry))
            }
            Kind::Sampler => Some(Content::Sampler(
                table.optional("sampler").unwrap_or(SamplerReference::Inline(Sampler::default())),
            )),
            Kind::AccelerationStructure => {
                let main = At { value: "main".to_string(), span: value.span() };
                Some(Content::AccelerationStructure(table.or("tlas", main)))
            }
        };
        table.finish();
        Some(Self { span: value.span(), set, binding: binding?, element, output, content: content? })
    }
}

/// A buffer as a scene writes it.
#[derive(Clone, Debug)]
pub struct BufferEntry {
    data: Option<Data>,
    size: Option<At<u64>>,
}

impl BufferEntry {
    fn parse(table: &Table<'_>) -> Option<Self> {
        let (data, size) = (table.optional("data"), table.optional::<At<u64>>("size"));
        if let Some(size) = size.as_ref().filter(|size| size.value > MAX_DATA_SIZE) {
            table.report().push(size.span.error(format!("a buffer has at most {MAX_DATA_SIZE} bytes")));
            return None;
        }
        if !table.has("data") && !table.has("size") {
            table.report().push(table.span().error("a buffer needs `data`, or its `size` in bytes"));
            return None;
        }
        Some(Self { data, size })
    }

    /// Its bytes, filled up with zeros to its size.
    ///
    /// # Errors
    /// Where the data is longer than the size, or as [`Data::encode`] says.
    pub fn load(&self, files: &dyn Files, aspect: f32) -> Result<Vec<u8>> {
        let mut bytes = match &self.data {
            Some(data) => data.encode(files, aspect)?,
            None => Vec::new(),
        };
        if let Some(At { value: size, span }) = &self.size {
            if bytes.len() as u64 > *size {
                let message = format!("the data has {} bytes, more than the `size` of {size}", bytes.len());
                return Err(span.error(message));
            }
            bytes.resize(*size as usize, 0);
        }
        Ok(bytes)
    }
}

/// An image as a scene writes it.
#[derive(Clone, Debug)]
pub struct ImageEntry {
    span: Span,
    files: Vec<At<String>>,
    format: Option<Format>,
    dimension: Dimension,
    extent: Option<[u32; 3]>,
    layers: u32,
    fill: [f64; 4],
    /// The sampler of a combined image sampler.
    pub sampler: Option<SamplerReference>,
}

impl ImageEntry {
    fn parse(table: &Table<'_>, kind: Kind) -> Option<Self> {
        let files = table.optional::<OneOrMore<At<String>>>("file").map_or(Vec::new(), |files| files.0);
        let format = table.optional("format");
        let dimension = table.or("dimension", Dimension::D2);
        let extent = extent(table);
        let cube = matches!(dimension, Dimension::Cube | Dimension::CubeArray);
        let least = if cube { 6 } else { 1 };
        let layers = table.or("layers", if files.is_empty() { least } else { files.len() as u32 });
        let fill = fill(table);
        let sampler = if kind == Kind::CombinedImageSampler { table.optional("sampler") } else { None };
        let wrong = |message: &str| {
            table.report().push(table.span().error(message));
            None
        };
        let arrayed = matches!(dimension, Dimension::D1Array | Dimension::D2Array | Dimension::CubeArray);
        if (cube && !layers.is_multiple_of(6)) || (!arrayed && layers != least) || layers == 0 {
            return wrong("`layers` (or the number of files) does not suit the `dimension`");
        }
        if table.has("file") {
            if !files.is_empty() && files.len() != layers as usize {
                return wrong("one file for each layer");
            }
            if table.has("size") || table.has("fill") {
                return wrong("an image from a file has the file's `size` and no `fill`");
            }
            if dimension == Dimension::D3 {
                return wrong("a file gives a plane, not a `3d` image");
            }
        }
        let span = table.span();
        Some(Self { span, files, format, dimension, extent: extent?, layers, fill, sampler })
    }

    /// Loads or fills its texels; without a size it is as large as the launch.
    ///
    /// # Errors
    /// `Io`, `InvalidImage` or `UnsupportedFile` about its files.
    pub fn load(&self, files: &dyn Files, launch: [u32; 3]) -> Result<Image> {
        let Self { format, dimension, layers, .. } = *self;
        if self.files.is_empty() {
            let format = format.unwrap_or(Format::RGBA32F);
            let mut extent = self.extent.unwrap_or(launch);
            match dimension {
                Dimension::D1 | Dimension::D1Array => extent[1..].fill(1),
                Dimension::D3 => {}
                _ => extent[2] = 1,
            }
            let count = extent.iter().fold(u64::from(layers), |n, side| n.saturating_mul(u64::from(*side)));
            let size = count.saturating_mul(u64::from(format.texel_size()));
            if size > MAX_IMAGE_SIZE || extent.iter().any(|side| *side > MAX_EXTENT) {
                let message = format!("{extent:?} texels in {layers} layers are too many for an image");
                return Err(self.span.error(message));
            }
            let texels = format.encode(self.fill).repeat(count as usize);
            return Ok(Image { format, dimension, extent, layers, texels });
        }
        let mut pictures = Vec::new();
        for file in &self.files {
            let bytes = read(files, &file.value, &file.span)?;
            let path = file.span.source.sibling(&file.value);
            let picture = Picture::decode(&path, &bytes, format);
            let picture = picture.map_err(|error| error.at_with(file.span.place(), "named here"))?;
            pictures.push((picture, &file.span));
        }
        let (Picture { format, extent, .. }, _) = pictures[0];
        let mut texels = Vec::new();
        for (picture, span) in pictures {
            if picture.extent != extent || picture.format != format {
                return Err(span.error("all layers of an image have one size and format"));
            }
            texels.extend(picture.texels);
        }
        Ok(Image { format, dimension, extent: [extent[0], extent[1], 1], layers, texels })
    }
}

/// `Some(None)` where no size is given.
fn extent(table: &Table<'_>) -> Option<Option<[u32; 3]>> {
    let Some(value) = table.value("size") else { return Some(None) };
    let OneOrMore(given) = OneOrMore::<u32>::parse(value)?;
    if given.is_empty() || given.len() > 3 || given.contains(&0) || given.iter().any(|x| *x > MAX_EXTENT) {
        return value.wrong(format!("`size` is `[width, height, depth]`, each from 1 to {MAX_EXTENT}"));
    }
    let mut extent = [1; 3];
    extent[..given.len()].copy_from_slice(&given);
    Some(Some(extent))
}

/// The colour of every texel; missing channels are 0.
fn fill(table: &Table<'_>) -> [f64; 4] {
    let mut color = [0.0; 4];
    let Some(At { value: OneOrMore(given), span }) = table.optional::<At<OneOrMore<f64>>>("fill") else {
        return color;
    };
    if given.len() > 4 {
        table.report().push(span.error("`fill` has at most four channels"));
        return color;
    }
    color[..given.len()].copy_from_slice(&given);
    color
}
