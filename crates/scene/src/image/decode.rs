//! Picture files as texels, whatever their format.
//!
//! What a file says of itself is believed only as far as its bytes can back it: sides, the memory
//! of decoding and the texels are compared with the limits before anything of their size is
//! allocated. Metadata is left out before decoding: a compressed colour profile of a kilobyte may
//! stand for a gigabyte.

use std::path::Path;

use crate::deferred_file::DeferredFile;
use crate::image::decoded::{Decoded, Header, Numbers};
#[cfg(not(feature = "exr"))]
use crate::image::missing_exr;
#[cfg(not(feature = "images"))]
use crate::image::missing_images;
#[cfg(feature = "exr")]
use crate::image::openexr;
#[cfg(feature = "images")]
use crate::image::png_jpeg;
use crate::image::radiance::Radiance;
use crate::image::{Picture, PictureHeader, invalid, texel_bytes, texel_numbers};
use anyhit_base::error::{ErrorKind, Place, Result};
use anyhit_base::input::{InputLimit, InputLimits, contained};
use anyhit_engine::machine::format::{Class, Component, Format};

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

/// The formats of picture files that this build reads.
enum PictureFormat {
    #[cfg(feature = "images")]
    Png,
    #[cfg(feature = "images")]
    Jpeg,
    #[cfg(feature = "exr")]
    Exr,
    Radiance,
}

impl PictureFormat {
    /// The format of a file, by its first bytes.
    fn of(bytes: &[u8]) -> Result<Self> {
        match bytes {
            #[cfg(not(feature = "images"))]
            [0x89, b'P', b'N', b'G', ..] | [0xff, 0xd8, 0xff, ..] => Err(missing_images()),
            #[cfg(feature = "images")]
            [0x89, b'P', b'N', b'G', 0x0d, 0x0a, 0x1a, 0x0a, ..] => Ok(Self::Png),
            #[cfg(feature = "images")]
            [0xff, 0xd8, 0xff, ..] => Ok(Self::Jpeg),
            #[cfg(not(feature = "exr"))]
            [0x76, 0x2f, 0x31, 0x01, ..] => Err(missing_exr()),
            #[cfg(feature = "exr")]
            [0x76, 0x2f, 0x31, 0x01, ..] => Ok(Self::Exr),
            _ if Radiance::is(bytes) => Ok(Self::Radiance),
            _ => Err(invalid("unknown image format: expected PNG, JPEG, HDR or EXR")),
        }
    }
}

impl PictureHeader {
    /// Reads the header of a picture file, and compares what decoding takes with the limits.
    ///
    /// # Errors
    /// As [`Picture::decode`]; what is wrong with the texels is found when they are decoded.
    pub fn read(
        path: &Path,
        file: &DeferredFile,
        wanted: Option<Format>,
        limits: &InputLimits,
    ) -> Result<Self> {
        let (head, size) = file.head()?;
        let read = |bytes: &[u8]| {
            contained("image", ErrorKind::InvalidImage, || header(bytes, size, wanted, limits))
        };
        let found = match read(&head) {
            // Metadata may fill more than what was read.
            Err(_) if (head.len() as u64) < size => read(&file.bytes()?),
            found => found,
        };
        found.map_err(|error| error.at(Place::File(path.to_path_buf())))
    }
}

fn header(bytes: &[u8], size: u64, wanted: Option<Format>, limits: &InputLimits) -> Result<PictureHeader> {
    limits.check(InputLimit::ImageBytes, size, ErrorKind::InvalidImage)?;
    let header = match PictureFormat::of(bytes)? {
        #[cfg(feature = "images")]
        PictureFormat::Png => png_jpeg::png_header(bytes, size, limits)?,
        #[cfg(feature = "images")]
        PictureFormat::Jpeg => png_jpeg::jpeg_header(bytes, size)?,
        #[cfg(feature = "exr")]
        PictureFormat::Exr => openexr::header(bytes)?,
        PictureFormat::Radiance => radiance_header(&Radiance::new(bytes)?, size),
    };
    header.check(size, wanted, limits)?;
    Ok(PictureHeader { format: wanted.unwrap_or(header.stored()), extent: header.extent })
}

fn decode(bytes: &[u8], wanted: Option<Format>, limits: &InputLimits) -> Result<Picture> {
    limits.check(InputLimit::ImageBytes, bytes.len() as u64, ErrorKind::InvalidImage)?;
    let decoded = match PictureFormat::of(bytes)? {
        #[cfg(feature = "images")]
        PictureFormat::Png => png_jpeg::png(bytes, wanted, limits)?,
        #[cfg(feature = "images")]
        PictureFormat::Jpeg => png_jpeg::jpeg(bytes, wanted, limits)?,
        #[cfg(feature = "exr")]
        PictureFormat::Exr => openexr::decode(bytes, wanted, limits)?,
        PictureFormat::Radiance => radiance(bytes, wanted, limits)?,
    };
    Ok(texels_of(decoded, wanted))
}

fn radiance_header(file: &Radiance<'_>, size: u64) -> Header {
    let [width, height] = file.extent();
    let plausible = (size / HDR_ROW).saturating_mul(width.max(height).into());
    Header { extent: file.extent(), channels: 3, width: 4, plausible, copies: 1 }
}

fn radiance(bytes: &[u8], wanted: Option<Format>, limits: &InputLimits) -> Result<Decoded> {
    let file = Radiance::new(bytes)?;
    let header = radiance_header(&file, bytes.len() as u64);
    header.check(bytes.len() as u64, wanted, limits)?;
    file.picture()
}

/// Texels of four numbers from texels of fewer: grey is red, green and blue, and what has no alpha
/// is opaque.
fn four<T: Copy>(numbers: &[T], channels: usize, opaque: T) -> impl Iterator<Item = [T; 4]> {
    numbers.chunks_exact(channels).map(move |texel| match *texel {
        [grey] => [grey, grey, grey, opaque],
        [grey, alpha] => [grey, grey, grey, alpha],
        [red, green, blue] => [red, green, blue, opaque],
        _ => [texel[0], texel[1], texel[2], texel[3]],
    })
}

fn texels_of(decoded: Decoded, wanted: Option<Format>) -> Picture {
    let Decoded { extent, channels, numbers } = decoded;
    let (stored, texels) = match numbers {
        Numbers::Floats(numbers) => {
            let mut texels = Vec::with_capacity(numbers.len() / channels * 16);
            for texel in four(&numbers, channels, 1.0) {
                texel.iter().for_each(|number| texels.extend_from_slice(&number.to_le_bytes()));
            }
            (Format::new(Component::Float32, 4), texels)
        }
        Numbers::BigEndian(bytes) => {
            let (numbers, _) = bytes.as_chunks();
            let mut texels = Vec::with_capacity(numbers.len() / channels * 8);
            for texel in four(numbers, channels, [u8::MAX; 2]) {
                texel.iter().for_each(|[high, low]| texels.extend_from_slice(&[*low, *high]));
            }
            (Format::new(Component::Unorm16, 4), texels)
        }
        Numbers::Bytes(bytes) if channels == 4 => (Format::RGBA8_SRGB, bytes),
        Numbers::Bytes(bytes) => {
            let mut texels = Vec::with_capacity(bytes.len() / channels * 4);
            four(&bytes, channels, u8::MAX).for_each(|texel| texels.extend_from_slice(&texel));
            (Format::RGBA8_SRGB, texels)
        }
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
    use std::io::Cursor;

    use super::*;
    use crate::image::png_jpeg::png_without_metadata;

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
        image.write_to(&mut Cursor::new(&mut bytes), image::ImageFormat::Png).unwrap();
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
    fn files_are_decoded_as_image_decodes_them() {
        use image::{DynamicImage, ImageFormat, Rgb, Rgb32FImage, RgbImage};

        let colours = RgbImage::from_fn(19, 13, |x, y| Rgb([(x * 13) as u8, (y * 19) as u8, (x * y) as u8]));
        let colours = DynamicImage::ImageRgb8(colours);
        let floats = Rgb32FImage::from_fn(19, 13, |x, y| Rgb([x as f32 * 0.25, y as f32 * 100.0, 1e-3]));
        for (picture, file) in [
            (DynamicImage::ImageLuma8(colours.to_luma8()), ImageFormat::Png),
            (DynamicImage::ImageLumaA8(colours.to_luma_alpha8()), ImageFormat::Png),
            (colours.clone(), ImageFormat::Png),
            (DynamicImage::ImageRgba8(colours.to_rgba8()), ImageFormat::Png),
            (DynamicImage::ImageLuma16(colours.to_luma16()), ImageFormat::Png),
            (DynamicImage::ImageLumaA16(colours.to_luma_alpha16()), ImageFormat::Png),
            (DynamicImage::ImageRgb16(colours.to_rgb16()), ImageFormat::Png),
            (DynamicImage::ImageRgba16(colours.to_rgba16()), ImageFormat::Png),
            (DynamicImage::ImageLuma8(colours.to_luma8()), ImageFormat::Jpeg),
            (colours, ImageFormat::Jpeg),
            (DynamicImage::ImageRgb32F(floats), ImageFormat::Hdr),
        ] {
            let mut bytes = Cursor::new(Vec::new());
            picture.write_to(&mut bytes, file).unwrap();
            let bytes = bytes.into_inner();
            let found = Picture::decode(Path::new("picture"), &bytes, None).unwrap();
            let judged = image::load_from_memory(&bytes).unwrap();
            assert_eq!(found.extent, [judged.width(), judged.height()]);
            let (component, texels) = match file {
                ImageFormat::Hdr => {
                    let numbers = judged.into_rgba32f().into_raw();
                    (Component::Float32, numbers.iter().flat_map(|x| x.to_le_bytes()).collect())
                }
                _ if picture.color().bytes_per_pixel() / picture.color().channel_count() == 2 => {
                    let numbers = judged.into_rgba16().into_raw();
                    (Component::Unorm16, numbers.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>())
                }
                _ => (Component::Unorm8, judged.into_rgba8().into_raw()),
            };
            assert_eq!(found.format.component, component, "{:?} {file:?}", picture.color());
            // Decoders of JPEG may round differently.
            let most = if file == ImageFormat::Jpeg { 4 } else { 0 };
            let is_near = found.texels.iter().zip(&texels).all(|(one, other)| one.abs_diff(*other) <= most);
            assert!(is_near && found.texels.len() == texels.len(), "{:?} {file:?}", picture.color());
        }
    }

    /// Two bits a texel with a palette, one colour of which is transparent.
    #[test]
    fn palettes_become_colours() {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 4, 1);
        encoder.set_color(png::ColorType::Indexed);
        encoder.set_depth(png::BitDepth::Two);
        encoder.set_palette(vec![1, 2, 3, 4, 5, 6, 7, 8, 9]);
        encoder.set_trns(vec![255, 0]);
        encoder.write_header().unwrap().write_image_data(&[0b00_01_10_00]).unwrap();
        let found = Picture::decode(Path::new("a.png"), &bytes, None).unwrap();
        assert_eq!(found.texels, [1, 2, 3, 255, 4, 5, 6, 0, 7, 8, 9, 255, 1, 2, 3, 255]);
    }

    #[test]
    fn sizes_are_judged_before_anything_is_allocated() {
        let limits = InputLimits::default();
        let words = refused(&png(40_000, 1), &limits);
        assert!(words.contains("the limit `image-side` of 32768"), "{words}");
        // 32768^2 texels of four bytes, twice.
        let words = refused(&png(32_768, 32_768), &limits);
        assert!(words.contains("8589934592 bytes of an image exceed the limit `image-bytes`"), "{words}");
        let words = refused(&png(8192, 8192), &limits);
        assert!(words.contains("bytes cannot hold 8192 x 8192 texels"), "{words}");
        let small = limits.with(InputLimit::ImageBytes, 7);
        assert!(refused(&png(1, 1), &small).contains("`image-bytes` of 7"));
        let small = limits.with(InputLimit::ImageSide, 0);
        assert!(refused(&png(1, 1), &small).contains("`image-side` of 0"));
    }
}
