//! Images and texel buffers as a scene writes them: from files, typed data or one colour.

use std::borrow::Cow;
use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;

use crate::data::DataPieces;
use crate::data_sources::DataSources;
use crate::deferred_file::DeferredFile;
use crate::descriptor_kind::DescriptorKind;
use crate::image::{format_name, texel_bytes, texel_numbers};
use crate::mesh::material::PictureSource;
use crate::mesh_piece::TextureReference;
use crate::mip;
use crate::read::{Named, OneOrMore, Parse, Span, Spanned, Table, TomlValue};
use crate::read_file::file_error;
use crate::sampler::SamplerReference;
use crate::tree::Toml;
use crate::unread_image::{UnreadImage, UnreadPicture};
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::input::InputLimit;
use anyhit_engine::machine::format::{Class, Component, Format};
use anyhit_engine::machine::image::{Dimension, ImageShape};

/// An image's content.
#[derive(Clone, PartialEq)]
pub struct ImageContent {
    /// Its texels' format.
    pub format: Format,
    /// Its shape.
    pub shape: ImageShape,
    /// Its texels.
    pub texels: TexelSource,
    /// Whether only its size is given, so that a host leaves the texels undefined. Here they are
    /// zeros.
    pub unfilled: bool,
}

/// The texels of an image.
#[derive(Clone, Debug)]
pub enum TexelSource {
    /// The bytes of all, in the order of [`Image`](anyhit_engine::machine::image::Image), or those
    /// of a single one that all are equal to.
    Given(Vec<u8>),
    /// Those of files that are decoded when something reads them.
    Late(Arc<UnreadImage>),
}

/// Texels that are not read are equal if they are of one image.
impl PartialEq for TexelSource {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Given(own), Self::Given(other)) => own == other,
            (Self::Late(own), Self::Late(other)) => Arc::ptr_eq(own, other),
            _ => false,
        }
    }
}

impl TexelSource {
    /// Whether all are known to be equal, so that only one is given.
    pub fn are_equal(&self, format: Format) -> bool {
        matches!(self, Self::Given(bytes) if bytes.len() == format.texel_size() as usize)
    }

    /// The bytes, decoded where they are not.
    ///
    /// # Errors
    /// As [`UnreadImage::texels`].
    pub fn bytes(&self) -> Result<Cow<'_, [u8]>> {
        match self {
            Self::Given(bytes) => Ok(bytes.into()),
            Self::Late(unread) => unread.texels().map(Cow::Owned),
        }
    }
}

/// Format and shape; of the texels the number of bytes.
impl fmt::Debug for ImageContent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ImageContent")
            .field("format", &self.format.name())
            .field("shape", &self.shape)
            .field("bytes", &self.size())
            .field("unfilled", &self.unfilled)
            .finish()
    }
}

impl ImageContent {
    /// The bytes of all its texels.
    pub fn size(&self) -> u64 {
        self.shape.texels().saturating_mul(u64::from(self.format.texel_size()))
    }

    /// The error message if it does not fit into memory.
    pub fn too_large(&self) -> String {
        let ImageShape { extent, layers, .. } = self.shape;
        format!("{extent:?} texels in {layers} layers are too large for an image: {} bytes", self.size())
    }
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

/// The number of mip levels.
#[derive(Clone, Copy, Debug)]
enum Levels {
    Count(u32),
    /// Down to a single texel.
    All,
}

impl Parse for Levels {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        match value.text() {
            Some("all") => Some(Self::All),
            Some(_) => {
                value.wrong("`levels` must be a number, or `\"all\"` for levels down to a single texel")
            }
            None => u32::parse(value).map(Self::Count),
        }
    }
}

/// A picture: a file, or a texture of a mesh.
#[derive(Clone, Debug)]
enum PictureEntry {
    File(Spanned<String>),
    Texture(TextureReference),
}

impl Parse for PictureEntry {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        if matches!(value.toml(), Toml::Table(_)) {
            return TextureReference::parse(value).map(Self::Texture);
        }
        Spanned::parse(value).map(Self::File)
    }
}

/// An image as a scene writes it.
#[derive(Clone, Debug)]
pub struct ImageEntry {
    span: Span,
    files: Vec<PictureEntry>,
    data: Option<DataPieces>,
    format: Option<Format>,
    dimension: Dimension,
    extent: Option<[u32; 3]>,
    layers: u32,
    levels: Levels,
    samples: u32,
    fill: Option<[f64; 4]>,
    /// The sampler of a combined image sampler.
    pub sampler: Option<SamplerReference>,
}

impl ImageEntry {
    /// Reads the keys of an image out of its resource's table.
    pub fn parse(table: &Table<'_>, kind: DescriptorKind) -> Option<Self> {
        let buffer = matches!(kind, DescriptorKind::UniformTexelBuffer | DescriptorKind::StorageTexelBuffer);
        let format = table.optional("format");
        let extent = extent(table);
        let fill = fill(table);
        let data = table.optional("data");
        let mut entry = Self {
            span: table.span(),
            files: Vec::new(),
            data,
            format,
            dimension: Dimension::Buffer,
            extent: extent.flatten(),
            layers: 1,
            levels: Levels::Count(1),
            samples: 1,
            fill,
            sampler: None,
        };
        if !buffer {
            entry.files =
                table.optional::<OneOrMore<PictureEntry>>("file").map_or(Vec::new(), |files| files.0);
            entry.dimension = table.or("dimension", Dimension::D2);
            let arrayed = entry.dimension.is_arrayed() && !entry.files.is_empty();
            let least = if entry.dimension.is_cube() { 6 } else { 1 };
            entry.layers = table.or("layers", if arrayed { entry.files.len() as u32 } else { least });
            entry.levels = table.or("levels", Levels::Count(1));
            entry.samples = table.or("samples", 1);
        }
        if kind == DescriptorKind::CombinedImageSampler {
            entry.sampler = table.optional("sampler");
        }
        extent?;
        let wrong = |message: &str| {
            table.report().push(table.span().error(message));
            None
        };
        if buffer && !table.has("size") && !table.has("data") {
            return wrong("a texel buffer needs its `size` in texels, or `data`");
        }
        if table.has("file") {
            if table.has("size") || table.has("fill") || table.has("data") {
                return wrong(
                    "`file` excludes `size`, `fill` and `data`: the image has the size and \
                    texels of the file",
                );
            }
            if entry.dimension == Dimension::D3 || entry.samples != 1 {
                return wrong("a file cannot fill a `3d` or multisampled image");
            }
        }
        if table.has("fill") && table.has("data") {
            return wrong("`fill` and `data` exclude each other");
        }
        Some(entry)
    }

    /// The files that its texels are read from; not those that hold textures of meshes.
    pub(super) fn named_files(&self) -> Vec<Spanned<String>> {
        let pictures = self.files.iter().filter_map(|entry| match entry {
            PictureEntry::File(file) => Some(file.clone()),
            PictureEntry::Texture(_) => None,
        });
        pictures.chain(self.data.iter().flat_map(DataPieces::named_files)).collect()
    }

    /// The textures of a mesh file that are elements of an array, where they are all of it.
    pub fn all_textures(&self) -> Option<&TextureReference> {
        match self.files.as_slice() {
            [PictureEntry::Texture(texture)] if texture.is_all() => Some(texture),
            _ => None,
        }
    }

    /// The entry of one of them, whose sampler is the texture's own if a combined image sampler
    /// names no other.
    pub fn of_texture(&self, texture: TextureReference, kind: DescriptorKind) -> Self {
        let own =
            (kind == DescriptorKind::CombinedImageSampler).then(|| SamplerReference::Mesh(texture.clone()));
        let sampler = self.sampler.clone().or(own);
        Self { files: vec![PictureEntry::Texture(texture)], sampler, ..self.clone() }
    }

    /// What stands for the textures of a file that has none: one white texel.
    pub fn white(&self) -> Self {
        let format = self.format.or(Some(Format { srgb: false, ..Format::RGBA8_SRGB }));
        let (extent, fill) = (Some([1; 3]), Some([1.0; 4]));
        Self { files: Vec::new(), format, extent, fill, levels: Levels::All, ..self.clone() }
    }

    /// Loads, fills or generates its texels; without a size it is as large as the launch.
    ///
    /// # Errors
    /// `Io` or `InvalidImage` about its files; `InvalidScene` where sizes do not fit.
    pub fn load(
        &self,
        sources: &DataSources<'_>,
        launch: [u32; 3],
        loading: ImageLoading,
    ) -> Result<ImageContent> {
        let files = sources.files;
        let pictures = self.pictures(sources)?;
        let format = match pictures.first() {
            Some(picture) => picture.header.format,
            None => self.format.unwrap_or(Format::RGBA32F),
        };
        let data = match &self.data {
            Some(data) => Some(data.encode(sources)?),
            None => None,
        };
        let mut extent = self.extent.unwrap_or(launch);
        if let Some(picture) = pictures.first() {
            let [width, height] = picture.header.extent;
            extent = [width, height, 1];
        } else if let (Dimension::Buffer, None, Some(data)) = (self.dimension, self.extent, &data) {
            let texels = data.len() / format.texel_size() as usize;
            extent = [u32::try_from(texels).unwrap_or(u32::MAX), 1, 1];
        }
        let axes = self.dimension.axes();
        if self.extent.is_none() {
            extent[axes..].fill(1);
        }
        let Self { dimension, layers, samples, .. } = *self;
        let mut shape = ImageShape { dimension, extent, layers, levels: 1, samples };
        shape.levels = match self.levels {
            Levels::Count(count) => count,
            Levels::All => shape.max_levels(),
        };
        shape.check().map_err(|error| self.span.error(error.message()))?;
        let limits = files.limits();
        if let Some(wrong) = self.fill.and_then(|fill| lost_channel(format, fill)) {
            let message = format!("`fill`: the format {} has no value {wrong}", format_name(format));
            return Err(self.span.error(message));
        }
        let texels = texel_bytes(format, self.fill.unwrap_or_default());
        let image =
            ImageContent { format, shape, texels: TexelSource::Given(texels), unfilled: self.fill.is_none() };
        let streams = loading == ImageLoading::Streamed && data.is_none() && pictures.is_empty();
        let size = image.size();
        // The texels of a buffer are one line, which only its bytes limit.
        let longest = extent.into_iter().max().filter(|_| dimension != Dimension::Buffer);
        let checked =
            limits.check(InputLimit::ImageSide, longest.unwrap_or(0).into(), ErrorKind::InvalidScene);
        checked.map_err(|error| error.context(image.too_large()).at(self.span.place()))?;
        if !streams {
            let checked = limits.check(InputLimit::ImageBytes, size, ErrorKind::InvalidScene);
            checked.map_err(|error| error.context(image.too_large()).at(self.span.place()))?;
        }
        if !pictures.is_empty() {
            let unread = Arc::new(UnreadImage::new(pictures, shape, format, &self.span)?);
            let texels = match loading {
                ImageLoading::Late => TexelSource::Late(unread),
                _ => TexelSource::Given(unread.texels()?),
            };
            return Ok(ImageContent { format, shape, texels, unfilled: false });
        }
        if !streams {
            files.reserve(size).map_err(|error| error.at(self.span.place()))?;
        }
        match data {
            Some(texels) => self.with_levels(format, shape, texels),
            None => Ok(image),
        }
    }

    fn pictures(&self, sources: &DataSources<'_>) -> Result<Vec<UnreadPicture>> {
        let (files, limits) = (sources.files, sources.files.limits());
        let picture = |entry: &PictureEntry| match entry {
            PictureEntry::File(file) => {
                let path = file.span.source.sibling(&file.value);
                let deferred = files.deferred(&path).map_err(|error| file_error(error, &file.span, &path))?;
                UnreadPicture::new(deferred, path, &file.span, self.format, false, limits)
            }
            PictureEntry::Texture(reference) => {
                let Some(meshes) = &sources.meshes else {
                    return Err(reference.span.error("textures of meshes are not allowed here"));
                };
                let named = |error: Error| error.at_with(reference.span.place(), "named here");
                let (texture, is_color) = reference.find(meshes).map_err(named)?;
                let (file, path) = match &texture.picture {
                    PictureSource::File(path) => (files.deferred(path).map_err(named)?, path.clone()),
                    PictureSource::Bytes(bytes) => {
                        let held = DeferredFile::held(bytes.clone()).within(&files.budget());
                        (held, PathBuf::from("a texture of the mesh"))
                    }
                    PictureSource::Missing(reason) => {
                        let error = reference.span.error(format!("the texture has no picture: {reason}"));
                        return Err(error.note("help: name a picture with `file = \"...\"`"));
                    }
                };
                // Numbers that are no colours are not encoded as sRGB.
                let linear = is_color == Some(false);
                UnreadPicture::new(file, path, &reference.span, self.format, linear, limits)
            }
        };
        self.files.iter().map(picture).collect()
    }

    /// Makes the content from texels of all levels, or of level 0, from which the other levels are
    /// generated.
    fn with_levels(&self, format: Format, shape: ImageShape, mut texels: Vec<u8>) -> Result<ImageContent> {
        let size = u64::from(format.texel_size());
        let (first, all) = (shape.level_texels(0) * size, shape.texels() * size);
        let found = texels.len() as u64;
        if found == first && found != all {
            let more = mip::generate(format, &shape, &texels).map_err(|message| self.span.error(message))?;
            texels.extend(more);
        } else if found != all {
            let message =
                format!("found {found} bytes of texels, expected {first} (level 0) or {all} (all levels)");
            return Err(self.span.error(message));
        }
        Ok(ImageContent { format, shape, texels: TexelSource::Given(texels), unfilled: false })
    }
}

/// When the texels of an image are loaded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageLoading {
    /// With the scene.
    Now,
    /// With the scene; an image that is only filled may have more texels than fit into memory.
    Streamed,
    /// Those of files when something reads them.
    Late,
}

/// Reads `size`; `Some(None)` if there is none.
fn extent(table: &Table<'_>) -> Option<Option<[u32; 3]>> {
    let Some(value) = table.value("size") else { return Some(None) };
    let OneOrMore(given) = OneOrMore::<u32>::parse(value)?;
    let most = table.report().limits().get(InputLimit::ImageSide);
    let fits = |side: &u32| *side > 0 && u64::from(*side) <= most;
    if given.is_empty() || given.len() > 3 || !given.iter().all(fits) {
        return value.wrong(format!(
            "`size` must be `[width, height, depth]`, each from 1 to {most} (the limit `image-side`)"
        ));
    }
    let mut extent = [1; 3];
    extent[..given.len()].copy_from_slice(&given);
    Some(Some(extent))
}

/// Reads `fill`, the colour of every texel; missing channels are 0.
fn fill(table: &Table<'_>) -> Option<[f64; 4]> {
    let Spanned { value: OneOrMore(given), span } = table.optional::<Spanned<OneOrMore<f64>>>("fill")?;
    let mut color = [0.0; 4];
    match color.get_mut(..given.len()) {
        Some(channels) => channels.copy_from_slice(&given),
        None => table.report().push(span.error("`fill` must have at most four channels")),
    }
    Some(color)
}

/// The first channel of a colour that a format can only store as another number: an integer out of
/// range, a part of one, a number outside of what is normalized, or a float that overflows or
/// vanishes.
fn lost_channel(format: Format, fill: [f64; 4]) -> Option<f64> {
    use Component::{SharedExponent, Snorm8, Snorm16, Unorm8, Unorm10A2, Unorm16};
    let stored = texel_numbers(format, &texel_bytes(format, fill));
    let is_kept = |given: f64, stored: f64| match (format.component, format.class()) {
        (Unorm8 | Unorm16 | Unorm10A2, _) => (0.0..=1.0).contains(&given),
        (Snorm8 | Snorm16, _) => (-1.0..=1.0).contains(&given),
        // Of one exponent for all, small channels may round to 0; 511/512 times 2^16 is the most.
        (SharedExponent, _) => (0.0..=65_408.0).contains(&given),
        (_, Class::Float) if given.is_nan() => stored.is_nan(),
        (_, Class::Float) => given.is_finite() == stored.is_finite() && (given == 0.0) == (stored == 0.0),
        _ => given == stored,
    };
    let mut channels = fill.into_iter().zip(stored).take(usize::from(format.channels));
    channels.find(|(given, stored)| !is_kept(*given, *stored)).map(|(given, _)| given)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::files::LimitedFiles;
    use crate::image::Picture;
    use crate::{EmbeddedFiles, LoadOptions, load_text};
    use anyhit_base::input::InputLimits;

    fn load(keys: &str, limits: InputLimits) -> Result<(), Error> {
        let format = Format { srgb: false, ..Format::RGBA8_SRGB };
        let picture = Picture { format, extent: [2, 2], texels: vec![0; 16] }
            .encode_png(crate::image::PixelEncoding::STORED)?;
        let files = [("a.png", picture.as_slice())];
        let text = format!("version = 1\nlaunch = [40000, 1]\n[resources.a]\nbinding = 0\n{keys}\n");
        let files = LimitedFiles(EmbeddedFiles(&files), limits);
        load_text(Path::new("s.toml"), &text, &files, &LoadOptions::default()).map(drop)
    }

    #[test]
    fn layers_times_levels_may_be_more_than_32_bits() {
        // Two levels of 2^31 + 1 layers are 2^32 + 2 planes, which are 2 in 32 bits.
        let keys = "type = 'sampled_image'\ndimension = '2d_array'\nlayers = 2147483649\nlevels = 2\n\
                    file = ['a.png', 'a.png']";
        let limits = InputLimits::default()
            .with(InputLimit::ImageBytes, 1 << 40)
            .with(InputLimit::SceneMemory, 1 << 40);
        let error = load(keys, limits).unwrap_err();
        assert!(error.message().starts_with("2 files for 2147483649 layers"), "{error}");
    }

    #[test]
    fn a_colour_is_a_value_of_the_format() {
        let fill = |format: &str, fill: &str| {
            let keys = format!("type = 'storage_image'\nsize = [1, 1]\nformat = '{format}'\nfill = {fill}");
            load(&keys, InputLimits::default()).map_err(|error| error.message().to_owned())
        };
        for (format, kept) in [
            ("r8ui", "255"),
            ("r8i", "-128"),
            ("rgba8", "[1, 0, 0.5, 0]"),
            ("rgba8_snorm", "[-1, 1, 0, 0.25]"),
            ("r16f", "[65504]"),
            ("r32f", "[nan]"),
            ("r11f_g11f_b10f", "[1, 0.5, 64]"),
            ("rgb9_e5", "[65408, 1e-9, 0]"),
        ] {
            assert_eq!(fill(format, kept), Ok(()), "{format} {kept}");
        }
        for (format, lost, channel) in [
            ("r8ui", "256", "256"),
            ("r8ui", "-1", "-1"),
            ("r32i", "0.5", "0.5"),
            ("r32ui", "[nan]", "NaN"),
            ("rgba8", "[0, 2, 0, 0]", "2"),
            ("rgba8_snorm", "[-1.5]", "-1.5"),
            ("r16f", "[65520]", "65520"),
            ("r16f", "[1e-9]", "0.000000001"),
            ("r11f_g11f_b10f", "[1, -1, 1]", "-1"),
            ("rgb9_e5", "[65409, 0, 0]", "65409"),
        ] {
            let wanted = format!("`fill`: the format {format} has no value {channel}");
            assert_eq!(fill(format, lost), Err(wanted), "{format} {lost}");
        }
    }

    #[test]
    fn the_side_of_an_image_has_a_named_limit_and_a_line_of_texels_none() {
        // Without a size the image is as wide as the launch.
        let error = load("type = 'storage_image'", InputLimits::default()).unwrap_err();
        let wanted = "40000 texels along a side of an image exceed the limit `image-side` of 32768";
        assert!(error.render().contains(wanted), "{}", error.render());
        assert!(error.notes().iter().any(|note| note.contains("--limit image-side=N")), "{error}");
        // Texels of a buffer may be as many as its bytes are within `image-bytes`.
        let keys = "type = 'uniform_texel_buffer'\nformat = 'r8'\ndata = { zeros = 134217729 }";
        load(keys, InputLimits::default()).unwrap();
        let limits = InputLimits::default().with(InputLimit::ImageBytes, 1 << 27);
        let error = load(keys, limits).unwrap_err();
        assert!(error.render().contains("the limit `image-bytes` of 134217728"), "{}", error.render());
    }
}
