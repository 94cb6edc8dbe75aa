//! Images as plain data: their shape, and texels that threads may share.

use std::fmt;
use std::ops::Range;
use std::sync::{Arc, OnceLock};

use smallvec::SmallVec;

use crate::machine::format::Format;
use crate::machine::image_words::{ImageWords, texel};
use crate::machine::lazy_words::{LazyWords, ReadTexels};
use crate::math::array;
use anyhit_base::error::{Error, ErrorKind, Result};

#[doc(hidden)]
pub use crate::machine::image_words::ImageState;

/// `VkImageViewType`, and texel buffers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Dimension {
    /// A one-dimensional image.
    D1,
    /// A two-dimensional image.
    D2,
    /// A three-dimensional image.
    D3,
    /// A cube map of six two-dimensional faces.
    Cube,
    /// An array of one-dimensional images.
    D1Array,
    /// An array of two-dimensional images.
    D2Array,
    /// An array of cube maps.
    CubeArray,
    /// A buffer whose elements are texels.
    Buffer,
}

impl Dimension {
    /// How many coordinates name a texel within a layer.
    #[doc(hidden)]
    pub fn axes(self) -> usize {
        match self {
            Self::D1 | Self::D1Array | Self::Buffer => 1,
            Self::D2 | Self::D2Array | Self::Cube | Self::CubeArray => 2,
            Self::D3 => 3,
        }
    }

    /// Whether it has several layers, or cubes, that an array index chooses from.
    #[doc(hidden)]
    pub fn is_arrayed(self) -> bool {
        matches!(self, Self::D1Array | Self::D2Array | Self::CubeArray)
    }

    /// Whether its layers are faces of cubes.
    #[doc(hidden)]
    pub fn is_cube(self) -> bool {
        matches!(self, Self::Cube | Self::CubeArray)
    }
}

/// The shape of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[must_use]
pub struct ImageShape {
    /// The dimension: what its coordinates are.
    pub dimension: Dimension,
    /// Width, height, depth of level 0; 1 where the dimension has none.
    pub extent: [u32; 3],
    /// Array layers: 6 for a cube, a multiple of 6 for an array of cubes.
    pub layers: u32,
    /// Mip levels.
    pub levels: u32,
    /// Samples of each texel: 1, 2, 4, 8, 16, 32 or 64.
    pub samples: u32,
}

impl ImageShape {
    /// A plane of one level.
    #[must_use]
    pub fn plane(width: u32, height: u32) -> Self {
        Self { dimension: Dimension::D2, extent: [width, height, 1], layers: 1, levels: 1, samples: 1 }
    }

    /// Width, height and depth of a mip level: halved each time, at least 1 (Vulkan, "Image
    /// Miplevel Sizing").
    #[doc(hidden)]
    pub fn level_extent(&self, level: u32) -> [u32; 3] {
        array::map(self.extent, |side| side.checked_shr(level).unwrap_or(0).max(1))
    }

    /// Texels of a level: of all layers, each sample by itself.
    #[doc(hidden)]
    pub fn level_texels(&self, level: u32) -> u64 {
        let [width, height, depth] = array::map(self.level_extent(level), u64::from);
        let plane = width.saturating_mul(height).saturating_mul(depth);
        plane.saturating_mul(u64::from(self.layers)).saturating_mul(u64::from(self.samples))
    }

    /// Texels of all levels.
    #[doc(hidden)]
    pub fn texels(&self) -> u64 {
        (0..self.levels).fold(0, |sum: u64, level| sum.saturating_add(self.level_texels(level)))
    }

    /// The number of levels down to a single texel.
    #[must_use]
    pub fn max_levels(&self) -> u32 {
        self.extent.iter().max().map_or(1, |&side| side.max(1).ilog2() + 1)
    }

    /// # Errors
    /// `InvalidImage` where the parts do not suit each other.
    #[doc(hidden)]
    pub fn check(&self) -> Result<()> {
        let [_, height, depth] = self.extent;
        let dimension = self.dimension;
        let wrong = if self.extent.contains(&0) || self.layers == 0 || self.levels == 0 {
            "the image has no texels"
        } else if dimension.axes() < 3 && depth != 1 || dimension.axes() < 2 && height != 1 {
            "the extent has more axes than the dimension"
        } else if dimension.is_cube() && (!self.layers.is_multiple_of(6) || self.extent[0] != height) {
            "a cube needs six square layers (VUID-VkImageCreateInfo-flags-08865 and 08866)"
        } else if !dimension.is_arrayed() && self.layers != if dimension.is_cube() { 6 } else { 1 } {
            "an image that is not an array has layers"
        } else if self.levels > self.max_levels() || dimension == Dimension::Buffer && self.levels > 1 {
            "more levels than the extent allows (VUID-VkImageCreateInfo-mipLevels-00958)"
        } else if !self.samples.is_power_of_two() || self.samples > 64 {
            "the number of samples must be 1, 2, 4, 8, 16, 32 or 64"
        } else if self.samples > 1
            && (self.levels > 1 || !matches!(dimension, Dimension::D2 | Dimension::D2Array))
        {
            "only 2D images with one level can have several samples (VUID-VkImageCreateInfo-samples-02257)"
        } else {
            return Ok(());
        };
        Err(Error::new(ErrorKind::InvalidImage, wrong))
    }
}

/// The position of a texel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Position {
    /// Column, row, slice; may be outside.
    pub at: [i64; 3],
    /// Array layer or cube face; may be outside.
    pub layer: i64,
    /// The number of the sample within the texel.
    pub sample: u32,
    /// Mip level.
    pub level: u32,
}

/// A mip level.
#[derive(Clone, Copy, Debug)]
struct Level {
    extent: [u32; 3],
    /// The index of its first texel.
    first: usize,
}

/// How an image's texels weight those of another (`VkImageViewSampleWeightCreateInfoQCOM`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SampleWeight {
    /// `filterCenter`
    pub center: [u32; 2],
    /// `filterSize`
    pub size: [u32; 2],
    /// `numPhases`
    pub phases: u32,
}

/// An image.
///
/// Texels follow each other by level, then layer, slice, row (the top one first), column, sample,
/// each [`Format::texel_size`] bytes. They lie in relaxed atomics: plain loads and stores on every
/// machine, and no undefined behaviour where a shader races.
pub struct Image {
    format: Format,
    shape: ImageShape,
    levels: SmallVec<[Level; 1]>,
    /// The resident texels: all of them, except in a band.
    resident: Range<usize>,
    words: LazyWords,
    sample_weight: OnceLock<SampleWeight>,
    null: bool,
}

impl Image {
    /// The image of a null descriptor: all texels are zeros, those outside included, and what is
    /// stored is dropped, whatever the policy.
    ///
    /// # Errors
    /// As [`Image::zeroed`].
    pub fn null(format: Format, shape: ImageShape) -> Result<Arc<Self>> {
        let mut image = Self::zeroed(format, shape)?;
        Arc::get_mut(&mut image).expect("bug in anyhit: a new image is shared").null = true;
        Ok(image)
    }

    /// Whether it is [`Image::null`].
    #[must_use]
    pub fn is_null(&self) -> bool {
        self.null
    }

    /// An image of zeros.
    ///
    /// # Errors
    /// `InvalidImage` where the parts of the shape do not suit each other, and where there is no
    /// memory for so many texels; `InvalidArgument` for a format that no texel has, such as one of
    /// seven channels, or an sRGB-encoded one of another component than `Unorm8`.
    pub fn zeroed(format: Format, shape: ImageShape) -> Result<Arc<Self>> {
        format.check()?;
        Self::filled(format, shape, &[0; 16][..format.texel_size() as usize])
    }

    /// A plane of zeros, to bind as a storage image.
    ///
    /// # Errors
    /// As [`Image::zeroed`].
    pub fn plane(format: Format, width: u32, height: u32) -> Result<Arc<Self>> {
        Self::zeroed(format, ImageShape::plane(width, height))
    }

    /// An image of these bytes.
    ///
    /// # Errors
    /// As [`Image::zeroed`], and `InvalidImage` for another number of bytes than the shape has.
    pub fn new(format: Format, shape: ImageShape, bytes: &[u8]) -> Result<Arc<Self>> {
        format.check()?;
        shape.check()?;
        let size = shape.texels().saturating_mul(u64::from(format.texel_size()));
        if bytes.len() as u64 != size {
            let message = format!("found {} bytes for an image of {size}", bytes.len());
            return Err(Error::new(ErrorKind::InvalidImage, message));
        }
        Self::from_words(format, shape, whole(&shape), || ImageWords::of_bytes(bytes).map(LazyWords::from))
    }

    /// An image whose texels are read when something first needs them; see [`Image::failure`].
    ///
    /// # Errors
    /// As [`Image::zeroed`].
    #[doc(hidden)]
    pub fn later(format: Format, shape: ImageShape, read: Arc<ReadTexels>) -> Result<Arc<Self>> {
        format.check()?;
        shape.check()?;
        let size = shape.texels().saturating_mul(u64::from(format.texel_size()));
        Self::from_words(format, shape, whole(&shape), || Some(LazyWords::later(size, read)))
    }

    /// An image whose texels are all the same, given its bytes.
    ///
    /// # Errors
    /// As [`Image::new`].
    pub fn filled(format: Format, shape: ImageShape, texel: &[u8]) -> Result<Arc<Self>> {
        shape.check()?;
        Self::filled_with(format, shape, whole(&shape), texel)
    }

    /// A band: some rows of a plane with one level and sample, whose texels are all the same. No
    /// other row of the shape is resident: an access to one traps, robust or not.
    ///
    /// # Errors
    /// As [`Image::filled`], and `InvalidImage` for another shape, or rows that it does not have.
    pub(crate) fn band(
        width: u32,
        height: u32,
        rows: Range<u32>,
        format: Format,
        texel: &[u8],
    ) -> Result<Arc<Self>> {
        if rows.start > rows.end || rows.end > height {
            let message = format!("rows {} to {} are outside an image with {height}", rows.start, rows.end);
            return Err(Error::new(ErrorKind::InvalidImage, message));
        }
        let [first, end] = array::map([rows.start, rows.end], |row| row as usize * width as usize);
        Self::filled_with(format, ImageShape::plane(width, height), first..end, texel)
    }

    fn filled_with(
        format: Format,
        shape: ImageShape,
        resident: Range<usize>,
        texel: &[u8],
    ) -> Result<Arc<Self>> {
        format.check()?;
        shape.check()?;
        let each = format.texel_size() as usize;
        if texel.len() != each {
            let message = format!("found {} bytes for a texel of {each}", texel.len());
            return Err(Error::new(ErrorKind::InvalidImage, message));
        }
        // Two words hold a whole number of texels of every size.
        let pattern = texel.repeat(16 / each);
        let pattern = array::map([0, 8], |first: usize| {
            pattern[first..first + 8].iter().rev().fold(0, |word, &byte| word << 8 | u64::from(byte))
        });
        let size = (resident.end - resident.start).saturating_mul(each);
        let words = || ImageWords::filled(size.div_ceil(8), pattern).map(LazyWords::from);
        Self::from_words(format, shape, resident, words)
    }

    fn from_words(
        format: Format,
        shape: ImageShape,
        resident: Range<usize>,
        words: impl FnOnce() -> Option<LazyWords>,
    ) -> Result<Arc<Self>> {
        let words = words().ok_or_else(|| {
            let message = format!("not enough memory for an image of {} texels", shape.texels());
            Error::new(ErrorKind::InvalidImage, message)
        })?;
        let mut levels = SmallVec::new();
        let mut first = 0;
        for level in 0..shape.levels {
            levels.push(Level { extent: shape.level_extent(level), first });
            first += shape.level_texels(level) as usize;
        }
        let sample_weight = OnceLock::new();
        Ok(Arc::new(Self { format, shape, levels, resident, words, sample_weight, null: false }))
    }

    /// Whether its texels are in memory: those of a file are read when something needs them.
    #[doc(hidden)]
    pub fn is_read(&self) -> bool {
        self.words.are_read()
    }

    /// Why its texels, which are zeros then, cannot be read. They are read first.
    #[doc(hidden)]
    #[inline]
    pub fn failure(&self) -> Option<&Arc<Error>> {
        self.words.failure()
    }

    /// Reads the texels where nothing has.
    ///
    /// # Errors
    /// Why the file of the image cannot be read.
    #[doc(hidden)]
    pub fn read(&self) -> Result<()> {
        self.failure().map_or(Ok(()), |failure| Err(Error::clone(failure)))
    }

    /// How texels are stored.
    #[must_use]
    pub fn format(&self) -> Format {
        self.format
    }

    /// Sets how its texels weight those of another image; only the first call has an effect.
    #[doc(hidden)]
    pub fn set_sample_weight(&self, filter: SampleWeight) {
        let _ = self.sample_weight.set(filter);
    }

    /// How its texels weight others, where they do.
    #[doc(hidden)]
    pub fn sample_weight(&self) -> Option<SampleWeight> {
        self.sample_weight.get().copied()
    }

    /// Its shape.
    #[must_use]
    pub fn shape(&self) -> &ImageShape {
        &self.shape
    }

    /// Width, height and depth of a level; 0 of one that it does not have.
    #[doc(hidden)]
    pub fn level_extent(&self, level: u32) -> [u32; 3] {
        self.levels.get(level as usize).map_or([0; 3], |level| level.extent)
    }

    /// The resident rows of level 0: all of them, except in a band.
    #[doc(hidden)]
    pub fn rows(&self) -> Range<u32> {
        let [width, height, _] = self.shape.extent;
        let texels = self.shape.texels() as usize;
        match self.resident == (0..texels) {
            true => 0..height,
            false => {
                (self.resident.start / width as usize) as u32..(self.resident.end / width as usize) as u32
            }
        }
    }

    /// The index of a resident texel; `None` outside the image, or in a row that is not resident.
    #[doc(hidden)]
    pub fn index(&self, position: &Position) -> Option<usize> {
        let index = self.texel_index(position)?;
        self.resident.contains(&index).then(|| index - self.resident.start)
    }

    /// Whether a texel is inside the image, resident or not.
    #[doc(hidden)]
    pub fn contains(&self, position: &Position) -> bool {
        self.texel_index(position).is_some()
    }

    /// The index of a texel among all of the shape.
    fn texel_index(&self, position: &Position) -> Option<usize> {
        let level = self.levels.get(position.level as usize)?;
        let [width, height, depth] = array::map(level.extent, i64::from);
        let [x, y, z] = position.at;
        let inside = (0..width).contains(&x)
            && (0..height).contains(&y)
            && (0..depth).contains(&z)
            && (0..i64::from(self.shape.layers)).contains(&position.layer)
            && position.sample < self.shape.samples;
        let texel = ((position.layer * depth + z) * height + y) * width + x;
        inside.then(|| level.first + texel as usize * self.shape.samples as usize + position.sample as usize)
    }

    /// The bits of the texel at an index that [`Image::index`] gave.
    #[doc(hidden)]
    #[inline]
    pub fn load(&self, index: usize) -> u128 {
        texel(self.format, index, |at| self.words.get().load(at))
    }

    /// Overwrites the texel at an index that [`Image::index`] gave.
    #[doc(hidden)]
    #[inline]
    pub(crate) fn store(&self, index: usize, bits: u128) {
        match self.format.texel_size() {
            16 => {
                self.words.get().store(2 * index, bits as u64);
                self.words.get().store(2 * index + 1, (bits >> 64) as u64);
            }
            8 => self.words.get().store(index, bits as u64),
            _ => {
                self.update(index, |_| Some(bits as u64));
            }
        }
    }

    /// Atomically replaces a texel of at most eight bytes by a function of it, and returns the old
    /// texel. The texel stays where the function returns `None`; the function may run several
    /// times.
    #[doc(hidden)]
    pub(crate) fn update(&self, index: usize, mut function: impl FnMut(u64) -> Option<u64>) -> u64 {
        let size = self.format.texel_size() as usize;
        assert!(size <= 8, "bug in anyhit: an atomic operation on a texel of {size} bytes");
        let byte = index * size;
        let shift = byte % 8 * 8;
        let mask = u64::MAX >> (64 - 8 * size);
        let replace = |word: u64| {
            let new = function(word >> shift & mask)?;
            Some(word & !(mask << shift) | (new & mask) << shift)
        };
        self.words.get().update(byte / 8, replace) >> shift & mask
    }

    /// A copy of the resident bytes of all levels.
    #[must_use]
    pub fn bytes(&self) -> Vec<u8> {
        (0..self.shape.levels).flat_map(|level| self.level_bytes(level)).collect()
    }

    /// A deep copy of the image.
    #[must_use]
    pub fn copied(&self) -> Arc<Self> {
        let words = self.words.copied();
        let (format, shape, levels) = (self.format, self.shape, self.levels.clone());
        let (resident, sample_weight) = (self.resident.clone(), self.sample_weight.clone());
        Arc::new(Self { format, shape, levels, resident, words, sample_weight, null: self.null })
    }

    /// Returns true if both have the same format and shape and hold the same texels.
    #[doc(hidden)]
    pub fn has_equal_texels(&self, other: &Self) -> bool {
        std::ptr::eq(self, other)
            || self.format == other.format
                && self.shape == other.shape
                && self.resident == other.resident
                && self.has_equal_words(other)
    }

    fn has_equal_words(&self, other: &Self) -> bool {
        let size = self.resident.len() * self.format.texel_size() as usize;
        self.words.have_one_source(&other.words) || self.words.get().are_equal(other.words.get(), size)
    }

    /// What its texels are now.
    #[doc(hidden)]
    pub fn state(&self) -> ImageState {
        self.words.get().state(self.format)
    }

    /// Whether its texels are what they were.
    #[doc(hidden)]
    pub fn is_like(&self, before: &ImageState) -> bool {
        self.words.get().unlike(before).next().is_none()
    }

    /// Puts back what its texels were.
    #[doc(hidden)]
    pub fn restore(&self, before: &ImageState) {
        let differing = self.words.get().unlike(before).flatten();
        differing.for_each(|at| self.words.get().store(at, before.word(at)));
    }

    /// The resident texels that are not what they were, by [`Image::index`], ascending.
    #[doc(hidden)]
    pub fn texels_unlike(&self, before: &ImageState) -> impl Iterator<Item = usize> {
        let size = self.format.texel_size() as usize;
        let texels = move |words: Range<usize>| words.start * 8 / size..words.end * 8 / size;
        let resident = self.resident.len();
        let differs = move |&at: &usize| at < resident && self.load(at) != before.load(at);
        self.words.get().unlike(before).flat_map(texels).filter(differs)
    }

    /// A copy of the resident bytes of a level; none of one that it does not have.
    #[must_use]
    pub fn level_bytes(&self, level: u32) -> Vec<u8> {
        let Some(&Level { first, .. }) = self.levels.get(level as usize) else { return Vec::new() };
        self.texel_bytes(first..first + self.shape.level_texels(level) as usize, 1)
    }

    /// A copy of the bytes of a resident row of level 0, in its first layer and slice; of several
    /// samples the first.
    #[doc(hidden)]
    pub fn row_bytes(&self, row: u32) -> Vec<u8> {
        let each = self.shape.samples as usize;
        let width = self.shape.extent[0] as usize * each;
        let first = self.levels[0].first + row as usize * width;
        self.texel_bytes(first..first + width, each)
    }

    fn texel_bytes(&self, texels: Range<usize>, each: usize) -> Vec<u8> {
        let size = self.format.texel_size() as usize;
        let texels = texels.start.max(self.resident.start)..texels.end.min(self.resident.end);
        let texels = texels.start - self.resident.start..texels.end - self.resident.start;
        if each == 1 {
            return self.words.get().bytes(texels.start * size..texels.end * size);
        }
        let mut bytes = Vec::with_capacity(texels.len() / each * size);
        for index in texels.step_by(each) {
            bytes.extend_from_slice(&self.load(index).to_le_bytes()[..size]);
        }
        bytes
    }
}

/// Format, shape and the first bytes: an image of any size prints one line.
impl fmt::Debug for Image {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [width, height, depth] = self.shape.extent;
        let ImageShape { dimension, layers, levels, samples, .. } = self.shape;
        let name = self.format.name();
        write!(f, "Image({name}, {dimension:?}, {width} x {height} x {depth}")?;
        for (count, what) in [(layers, "layers"), (levels, "levels"), (samples, "samples")] {
            if count > 1 {
                write!(f, ", {count} {what}")?;
            }
        }
        let null = if self.null { ", null" } else { "" };
        if !self.is_read() {
            return f.write_str(", not read)");
        }
        let shown = self.resident.len().min(SHOWN_TEXELS);
        let texels = self.resident.start..self.resident.start + shown;
        let more = if shown < self.resident.len() { ", ..." } else { "" };
        let bytes: Vec<String> =
            self.texel_bytes(texels, 1).iter().map(|byte| format!("{byte:02x}")).collect();
        write!(f, "{null}, bytes {}{more})", bytes.join(" "))
    }
}

/// Texels that [`Image`] prints.
const SHOWN_TEXELS: usize = 4;

/// All texels.
fn whole(shape: &ImageShape) -> Range<usize> {
    0..usize::try_from(shape.texels()).unwrap_or(usize::MAX)
}

#[cfg(test)]
mod tests;
