//! Picture files as texels, through the crate `image`.
//!
//! What a file says of itself is believed only as far as its bytes can back it: sides, the memory
//! of decoding and the texels are compared with the limits before anything of their size is
//! allocated. Metadata is left out before decoding: a compressed colour profile of a kilobyte may
//! stand for a gigabyte.

use std::borrow::Cow;
use std::io::Cursor;
use std::path::Path;

use image::error::LimitErrorKind;
use image::{ColorType, DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};

use crate::error::{Error, ErrorKind, Place, Result};
use crate::input::{InputLimit, InputLimits, contained};
use crate::machine::format::{Class, Component, Format};
use crate::scene::image::{Picture, exr_support, texel_bytes, texel_numbers};

/// Texels that a byte of a PNG file can stand for: deflate makes at most 1032 bytes of one, and a
/// byte holds at most eight grey texels.
const PNG_TEXELS: u64 = 1032 * 8;
/// Texels that a byte of a JPEG file can stand for: a block of 8 x 8 takes a bit or more.
const JPEG_TEXELS: u64 = 64 * 8;
/// The fewest bytes of a row of a Radiance file: its first texel.
const HDR_ROW: u64 = 4;

impl Picture {
    /// Decodes a PNG, JPEG, Radiance HDR or, with the feature `exr`, OpenEXR file.
    ///
    /// Without a wanted format: 8 bits give `rgba8_srgb`, 16 bits `rgba16`, floats `rgba32f`. A
    /// wanted format of 8 or 16 bits takes the stored numbers as they are when it is as wide as the
    /// file, so that `rgba8` reads a normal map and `rgba8_srgb` a photograph. An integer format
    /// takes the stored numbers, not fractions of them.
    ///
    /// # Errors
    /// `InvalidImage` for a broken file, one beyond the default limits, or another kind of file;
    /// `UnsupportedTool` for OpenEXR without the feature `exr`.
    pub fn decode(path: &Path, bytes: &[u8], wanted: Option<Format>) -> Result<Self> {
        Self::decode_within(path, bytes, wanted, &InputLimits::default())
    }

    /// Decodes a file as [`Picture::decode`] does, with other limits of sides and bytes.
    ///
    /// # Errors
    /// As [`Picture::decode`].
    pub fn decode_within(
        path: &Path,
        bytes: &[u8],
        wanted: Option<Format>,
        limits: &InputLimits,
    ) -> Result<Self> {
        let decoded = contained("image", ErrorKind::InvalidImage, || decode(bytes, wanted, limits));
        decoded.map_err(|error| error.at(Place::File(path.to_path_buf())))
    }
}

fn invalid(message: impl Into<String>) -> Error {
    Error::new(ErrorKind::InvalidImage, message)
}

fn decode(bytes: &[u8], wanted: Option<Format>, limits: &InputLimits) -> Result<Picture> {
    let broken = |error: image::ImageError| invalid(error.to_string());
    limits.check(InputLimit::ImageBytes, bytes.len() as u64, ErrorKind::InvalidImage)?;
    let format = image::guess_format(bytes).ok();
    let read = [ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::Hdr, ImageFormat::OpenExr];
    let Some(format) = format.filter(|format| read.contains(format)) else {
        return Err(invalid("not a PNG, JPEG, HDR or EXR file: these are read"));
    };
    if format == ImageFormat::OpenExr {
        exr_support()?;
    }
    let essential = if format == ImageFormat::Png { png_without_metadata(bytes) } else { bytes.into() };
    let mut reader = ImageReader::with_format(Cursor::new(&*essential), format);
    let mut own = Limits::default();
    let side = u32::try_from(limits.get(InputLimit::ImageSide)).unwrap_or(u32::MAX);
    (own.max_image_width, own.max_image_height) = (Some(side), Some(side));
    own.max_alloc = Some(limits.get(InputLimit::ImageBytes));
    reader.limits(own);
    let decoder = reader.into_decoder().map_err(|error| match error {
        image::ImageError::Limits(limit) => {
            let limit = match limit.kind() {
                LimitErrorKind::DimensionError => InputLimit::ImageSide,
                _ => InputLimit::ImageBytes,
            };
            limits.exceeded(limit, None, ErrorKind::InvalidImage)
        }
        error => broken(error),
    })?;
    let (width, height) = decoder.dimensions();
    limits.check(InputLimit::ImageSide, u64::from(width.max(height)), ErrorKind::InvalidImage)?;
    let texels = u64::from(width) * u64::from(height);
    let needed = texels.saturating_mul(bytes_a_texel(decoder.color_type(), format, wanted));
    limits.check(InputLimit::ImageBytes, needed, ErrorKind::InvalidImage)?;
    let held = bytes.len() as u64;
    let plausible = match format {
        ImageFormat::Png => texels <= held.saturating_mul(PNG_TEXELS),
        ImageFormat::Jpeg => texels <= held.saturating_mul(JPEG_TEXELS),
        ImageFormat::Hdr => u64::from(height) <= held / HDR_ROW,
        _ => true,
    };
    if !plausible {
        return Err(invalid(format!("{held} bytes cannot hold {width} x {height} texels")));
    }
    let image = DynamicImage::from_decoder(decoder).map_err(broken)?;
    Ok(texels_of(image, wanted))
}

/// The most bytes that decoding holds at one time for each texel: what the decoder makes, what is
/// stored of it as four channels, and what is wanted.
fn bytes_a_texel(color: ColorType, file: ImageFormat, wanted: Option<Format>) -> u64 {
    let decoded = u64::from(color.bytes_per_pixel());
    let channel = u64::from(color.bytes_per_pixel() / color.channel_count());
    let stored = 4 * channel;
    let result = wanted.map_or(stored, |format| u64::from(format.texel_size()));
    // A progressive JPEG keeps a coefficient of 16 bits for each number.
    let decoding = if file == ImageFormat::Jpeg { 3 * decoded } else { decoded };
    let taken = if channel == 1 { stored } else { 2 * stored };
    decoding.max(decoded + stored).max(taken).max(stored + result)
}

/// A PNG file's chunks that its texels depend on; all others are marked as ancillary by their
/// names (PNG, 5.4). What is broken stays for the decoder to report.
fn png_without_metadata(bytes: &[u8]) -> Cow<'_, [u8]> {
    const SIGNATURE: usize = 8;
    /// Length, name and checksum.
    const AROUND: usize = 12;
    let mut kept = Vec::new();
    let mut at = SIGNATURE;
    // Up to here, chunks that are kept are not copied yet.
    let mut from = 0;
    while let Some(head) = bytes.get(at..at + 8) {
        let length = u32::from_be_bytes([head[0], head[1], head[2], head[3]]) as usize;
        let name = &head[4..8];
        let Some(end) = at.checked_add(length).and_then(|end| end.checked_add(AROUND)) else { break };
        if name == b"IEND" {
            break;
        }
        if name[0].is_ascii_lowercase() && name != b"tRNS" {
            kept.extend_from_slice(&bytes[from..at]);
            from = end.min(bytes.len());
        }
        at = end;
    }
    if from == 0 {
        return bytes.into();
    }
    kept.extend_from_slice(&bytes[from..]);
    kept.into()
}

fn texels_of(image: DynamicImage, wanted: Option<Format>) -> Picture {
    let extent = [image.width(), image.height()];
    let (stored, texels) = match image {
        DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_) => {
            let numbers = image.into_rgba32f().into_raw();
            let mut bytes = Vec::with_capacity(4 * numbers.len());
            numbers.iter().for_each(|number| bytes.extend_from_slice(&number.to_le_bytes()));
            (Format::new(Component::Float32, 4), bytes)
        }
        DynamicImage::ImageLuma16(_)
        | DynamicImage::ImageLumaA16(_)
        | DynamicImage::ImageRgb16(_)
        | DynamicImage::ImageRgba16(_) => {
            let numbers = image.into_rgba16().into_raw();
            let mut bytes = Vec::with_capacity(2 * numbers.len());
            numbers.iter().for_each(|number| bytes.extend_from_slice(&number.to_le_bytes()));
            (Format::new(Component::Unorm16, 4), bytes)
        }
        _ => (Format::RGBA8_SRGB, image.into_rgba8().into_raw()),
    };
    let format = wanted.unwrap_or(stored);
    let same_bits = format.component == stored.component && format.channels == stored.channels;
    if same_bits {
        return Picture { format, extent, texels };
    }
    // A file's 8-bit numbers mean sRGB only where they are read as sRGB, and fractions only where
    // they are read as floats.
    let component = match stored.component {
        Component::Unorm8 if format.class() != Class::Float => Component::Uint8,
        Component::Unorm16 if format.class() != Class::Float => Component::Uint16,
        other => other,
    };
    let stored = Format { component, srgb: stored.srgb && format.srgb, ..stored };
    let each = texels.chunks_exact(stored.texel_size() as usize);
    let mut converted = Vec::with_capacity(each.len() * format.texel_size() as usize);
    for texel in each {
        converted.extend_from_slice(&texel_bytes(format, texel_numbers(stored, texel)));
    }
    Picture { format, extent, texels: converted }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A PNG chunk with its checksum.
    fn chunk(name: &[u8; 4], data: &[u8]) -> Vec<u8> {
        let mut crc = u32::MAX;
        for byte in name.iter().chain(data) {
            crc ^= u32::from(*byte);
            for _ in 0..8 {
                crc = if crc & 1 == 1 { crc >> 1 ^ 0xEDB8_8320 } else { crc >> 1 };
            }
        }
        let length = (data.len() as u32).to_be_bytes();
        [&length[..], name, data, &(!crc).to_be_bytes()].concat()
    }

    /// A PNG of 1 x 1 texel, which says another size in its header.
    fn png(width: u32, height: u32) -> Vec<u8> {
        let mut bytes = Vec::new();
        let image = image::RgbaImage::from_raw(1, 1, vec![1, 2, 3, 4]).unwrap();
        image.write_to(&mut Cursor::new(&mut bytes), ImageFormat::Png).unwrap();
        let mut header = bytes[16..29].to_vec();
        header[..4].copy_from_slice(&width.to_be_bytes());
        header[4..8].copy_from_slice(&height.to_be_bytes());
        [&bytes[..8], &chunk(b"IHDR", &header), &bytes[33..]].concat()
    }

    fn refused(bytes: &[u8], limits: &InputLimits) -> String {
        let error = Picture::decode_within(Path::new("a.png"), bytes, None, limits).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::InvalidImage);
        error.to_string()
    }

    #[test]
    fn metadata_is_left_out_and_texels_stay() {
        let whole = png(1, 1);
        assert_eq!(&*png_without_metadata(&whole), &whole[..]);
        // What inflates to a gigabyte: a thousand blocks of a million zeros.
        let profile = [b"name\0\0".as_slice(), &[0x78, 0x9c], &[0; 1000]].concat();
        let with = |chunk: &[u8]| [&whole[..33], chunk, &whole[33..]].concat();
        for name in [b"iCCP", b"zTXt", b"eXIf", b"iTXt", b"acTL"] {
            let file = with(&chunk(name, &profile));
            assert_eq!(&*png_without_metadata(&file), &whole[..], "{name:?}");
            assert_eq!(Picture::decode(Path::new("a.png"), &file, None).unwrap().texels, [1, 2, 3, 4]);
        }
        // A chunk without an end swallows the rest, and what is no chunk is left to the decoder.
        let cut = with(&[0xff, 0xff, 0xff, 0xf0, b'i', b'C', b'C', b'P']);
        assert_eq!(&*png_without_metadata(&cut), &whole[..33]);
        assert_eq!(&*png_without_metadata(&whole[..12]), &whole[..12]);
    }

    #[test]
    fn sizes_are_judged_before_anything_is_allocated() {
        let limits = InputLimits::default();
        let words = refused(&png(40_000, 1), &limits);
        assert!(words.contains("the limit `image-side` of 32768"), "{words}");
        // 32768^2 texels of four bytes, twice.
        let words = refused(&png(32_768, 32_768), &limits);
        assert!(
            words.contains("8589934592 bytes of an image are more than the limit `image-bytes`"),
            "{words}"
        );
        let words = refused(&png(8192, 8192), &limits);
        assert!(words.contains("bytes cannot hold 8192 x 8192 texels"), "{words}");
        let small = limits.with(InputLimit::ImageBytes, 7);
        assert!(refused(&png(1, 1), &small).contains("`image-bytes` of 7"));
        let small = limits.with(InputLimit::ImageSide, 0);
        assert!(refused(&png(1, 1), &small).contains("`image-side` of 0"));
    }
}
