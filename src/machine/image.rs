//! Images and samplers as plain data.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

/// How a texel is stored; names as in SPIR-V's `Image Format`, with sRGB beside.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the names are the specification's")]
pub enum Format {
    Rgba32f,
    R32f,
    Rgba8,
    Rgba8Srgb,
    R32ui,
    R32i,
    Rgba32ui,
    Rgba32i,
}

impl Format {
    /// 32-bit words of a texel.
    pub fn words(self) -> usize {
        match self {
            Self::Rgba32f | Self::Rgba32ui | Self::Rgba32i => 4,
            Self::R32f | Self::Rgba8 | Self::Rgba8Srgb | Self::R32ui | Self::R32i => 1,
        }
    }

    /// Whether a texel reads as integers.
    pub fn is_integer(self) -> bool {
        matches!(self, Self::R32ui | Self::R32i | Self::Rgba32ui | Self::Rgba32i)
    }
}

/// A two-dimensional image; rows from the top, texels from the left.
#[derive(Debug)]
pub struct Image {
    format: Format,
    extent: [u32; 2],
    words: Box<[AtomicU32]>,
}

impl Image {
    /// An image of zeros.
    pub fn zeroed(format: Format, extent: [u32; 2]) -> Arc<Self> {
        let count = extent[0] as usize * extent[1] as usize * format.words();
        Arc::new(Self { format, extent, words: (0..count).map(|_| AtomicU32::new(0)).collect() })
    }

    /// An image of these words, row by row.
    pub fn new(format: Format, extent: [u32; 2], words: &[u32]) -> Option<Arc<Self>> {
        let count = extent[0] as usize * extent[1] as usize * format.words();
        let words = words.iter().copied().map(AtomicU32::new).collect::<Box<[_]>>();
        (words.len() == count).then(|| Arc::new(Self { format, extent, words }))
    }

    /// How texels are stored.
    pub fn format(&self) -> Format {
        self.format
    }

    /// Width and height.
    pub fn extent(&self) -> [u32; 2] {
        self.extent
    }

    /// The stored words of a texel; `None` outside the image.
    pub fn texel(&self, at: [u32; 2]) -> Option<[u32; 4]> {
        let first = self.index(at)?;
        let mut texel = [0; 4];
        for (to, from) in texel.iter_mut().zip(&self.words[first..first + self.format.words()]) {
            *to = from.load(Relaxed);
        }
        Some(texel)
    }

    /// Overwrites the stored words of a texel; `None` outside the image.
    pub fn set_texel(&self, at: [u32; 2], texel: [u32; 4]) -> Option<()> {
        let first = self.index(at)?;
        for (to, from) in self.words[first..first + self.format.words()].iter().zip(texel) {
            to.store(from, Relaxed);
        }
        Some(())
    }

    fn index(&self, at: [u32; 2]) -> Option<usize> {
        let inside = at[0] < self.extent[0] && at[1] < self.extent[1];
        inside.then(|| (at[1] as usize * self.extent[0] as usize + at[0] as usize) * self.format.words())
    }
}

/// How coordinates outside [0, 1] are treated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
#[allow(missing_docs, reason = "the names are the specification's")]
pub enum AddressMode {
    #[default]
    Repeat,
    MirroredRepeat,
    ClampToEdge,
}

/// Nearest or linear.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
#[allow(missing_docs, reason = "the names are the specification's")]
pub enum Filter {
    Nearest,
    #[default]
    Linear,
}

/// A sampler's state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Sampler {
    /// Filter between texels.
    pub filter: Filter,
    /// Address mode of each coordinate.
    pub address: [AddressMode; 2],
}
