//! What readers of picture files share: the numbers of a file, and the check of what it says of
//! itself.

use crate::image::invalid;
use anyhit_base::error::{ErrorKind, Result};
use anyhit_base::input::{InputLimit, InputLimits};
use anyhit_engine::machine::format::{Component, Format};

/// A file's numbers before they are texels of a format.
pub(super) struct Decoded {
    pub extent: [u32; 2],
    /// How many numbers each texel has: grey, grey and alpha, red, green and blue, or these and
    /// alpha.
    pub channels: usize,
    pub numbers: Numbers,
}

#[cfg_attr(not(feature = "images"), allow(dead_code, reason = "Radiance files hold floats alone"))]
pub(super) enum Numbers {
    Bytes(Vec<u8>),
    /// 16 bits, the high byte first, as PNG has them.
    BigEndian(Vec<u8>),
    Floats(Vec<f32>),
}

/// What a file's header says of its texels.
#[derive(Clone, Copy)]
pub(super) struct Header {
    pub extent: [u32; 2],
    pub channels: usize,
    /// The bytes of each number.
    pub width: usize,
    /// The greatest number of texels, or of rows, that the file's bytes can stand for.
    pub plausible: u64,
    /// How many times what is decoded is held while it is decoded.
    pub copies: u64,
}

impl Header {
    /// The format of the texels where none is wanted.
    pub(super) fn stored(&self) -> Format {
        match self.width {
            1 => Format::RGBA8_SRGB,
            2 => Format::new(Component::Unorm16, 4),
            _ => Format::new(Component::Float32, 4),
        }
    }

    /// Compares what decoding takes with the limits, and with what the file's bytes can hold.
    pub(super) fn check(&self, held: u64, wanted: Option<Format>, limits: &InputLimits) -> Result<()> {
        let [width, height] = self.extent;
        limits.check(InputLimit::ImageSide, u64::from(width.max(height)), ErrorKind::InvalidImage)?;
        let texels = u64::from(width) * u64::from(height);
        let needed = texels.saturating_mul(self.bytes_a_texel(wanted));
        limits.check(InputLimit::ImageBytes, needed, ErrorKind::InvalidImage)?;
        if texels == 0 {
            return Err(invalid("the image has no texels"));
        }
        if texels > self.plausible {
            return Err(invalid(format!("{held} bytes cannot hold {width} x {height} texels")));
        }
        Ok(())
    }

    /// The most bytes that decoding holds at one time for each texel: what the decoder makes, what
    /// is stored of it as four channels, and what is wanted.
    fn bytes_a_texel(&self, wanted: Option<Format>) -> u64 {
        let (channel, channels) = (self.width as u64, self.channels as u64);
        let decoded = channel * channels;
        let stored = 4 * channel;
        let result = wanted.map_or(stored, |format| u64::from(format.texel_size()));
        (self.copies * decoded).max(decoded + stored).max(2 * stored).max(stored + result)
    }
}
