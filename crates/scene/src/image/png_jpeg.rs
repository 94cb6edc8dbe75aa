//! PNG and JPEG files, through the crates `png` and `jpeg-decoder`.

use std::borrow::Cow;
use std::io::Cursor;

use jpeg_decoder::PixelFormat;

use crate::image::decoded::{Decoded, Header, Numbers};
use crate::image::invalid;
use crate::image::orientation::Orientation;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::input::{InputLimit, InputLimits, contained};
use anyhit_engine::machine::format::Format;

/// Texels that a byte of a PNG file can stand for: deflate makes at most 1032 bytes of one, and a
/// byte holds at most eight grey texels.
const PNG_TEXELS: u64 = 1032 * 8;
/// Texels that a byte of a JPEG file can stand for: a block of 8 x 8 takes a bit or more.
const JPEG_TEXELS: u64 = 64 * 8;

/// Decodes a PNG file.
pub(super) fn png(bytes: &[u8], wanted: Option<Format>, limits: &InputLimits) -> Result<Decoded> {
    contained("png", ErrorKind::InvalidImage, || {
        let essential = png_without_metadata(bytes);
        let (mut reader, header) = png_reader(&essential, bytes.len() as u64, limits)?;
        header.check(bytes.len() as u64, wanted, limits)?;
        let size =
            reader.output_buffer_size().ok_or_else(|| invalid("the image's size in bytes overflows"))?;
        let mut numbers = vec![0; size];
        reader.next_frame(&mut numbers).map_err(|error| broken_png(error, limits))?;
        let numbers = if header.width == 2 { Numbers::BigEndian(numbers) } else { Numbers::Bytes(numbers) };
        Ok(Decoded { extent: header.extent, channels: header.channels, numbers })
    })
}

/// What the header of a PNG file says, given its first bytes and how many it has.
pub(super) fn png_header(head: &[u8], size: u64, limits: &InputLimits) -> Result<Header> {
    contained("png", ErrorKind::InvalidImage, || {
        png_reader(&png_without_metadata(head), size, limits).map(|(_, header)| header)
    })
}

fn broken_png(error: png::DecodingError, limits: &InputLimits) -> Error {
    match error {
        png::DecodingError::LimitsExceeded => {
            limits.exceeded(InputLimit::ImageBytes, None, ErrorKind::InvalidImage)
        }
        png::DecodingError::IoError(error) if error.kind() == std::io::ErrorKind::UnexpectedEof => {
            invalid("the PNG file is truncated")
        }
        error => invalid(format!("not a readable PNG file: {error}")),
    }
}

fn png_reader<'b>(
    essential: &'b [u8],
    size: u64,
    limits: &InputLimits,
) -> Result<(png::Reader<Cursor<&'b [u8]>>, Header)> {
    let memory = usize::try_from(limits.get(InputLimit::ImageBytes)).unwrap_or(usize::MAX);
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(essential), png::Limits { bytes: memory });
    decoder.ignore_checksums(false);
    // Palettes and fewer than eight bits become bytes, and a transparent colour becomes alpha.
    decoder.set_transformations(png::Transformations::EXPAND);
    let reader = decoder.read_info().map_err(|error| broken_png(error, limits))?;
    let (color, depth) = reader.output_color_type();
    let (width, height) = reader.info().size();
    let header = Header {
        extent: [width, height],
        channels: color.samples(),
        width: if depth == png::BitDepth::Sixteen { 2 } else { 1 },
        plausible: size.saturating_mul(PNG_TEXELS),
        copies: 1,
    };
    Ok((reader, header))
}

/// Decodes a JPEG file, whose Exif data may turn or mirror it.
pub(super) fn jpeg(bytes: &[u8], wanted: Option<Format>, limits: &InputLimits) -> Result<Decoded> {
    contained("jpeg-decoder", ErrorKind::InvalidImage, || {
        let JpegFile { mut decoder, format, stored, orientation } = JpegFile::new(bytes)?;
        let header = jpeg_header_of(format, orientation.extent(stored), bytes.len() as u64);
        header.check(bytes.len() as u64, wanted, limits)?;
        let numbers = decoder.decode().map_err(broken_jpeg)?;
        let numbers = match format {
            PixelFormat::L8 | PixelFormat::RGB24 => Numbers::Bytes(numbers),
            PixelFormat::L16 => {
                let words = numbers.as_chunks().0.iter().map(|word| u16::from_ne_bytes(*word));
                Numbers::BigEndian(words.flat_map(u16::to_be_bytes).collect())
            }
            PixelFormat::CMYK32 => {
                Numbers::Bytes(numbers.as_chunks().0.iter().flat_map(|ink| rgb_of_cmyk(*ink)).collect())
            }
        };
        Ok(orientation.apply(Decoded { extent: stored, channels: header.channels, numbers }))
    })
}

/// Red, green and blue of cyan, magenta, yellow and black ink: each takes its part of the light.
fn rgb_of_cmyk([cyan, magenta, yellow, black]: [u8; 4]) -> [u8; 3] {
    let light = |ink: u8| u32::from(u8::MAX - ink);
    [cyan, magenta, yellow].map(|ink| ((light(ink) * light(black) + 127) / 255) as u8)
}

/// What the header of a JPEG file says, given its first bytes and how many it has.
pub(super) fn jpeg_header(head: &[u8], size: u64) -> Result<Header> {
    contained("jpeg-decoder", ErrorKind::InvalidImage, || {
        let JpegFile { format, stored, orientation, .. } = JpegFile::new(head)?;
        Ok(jpeg_header_of(format, orientation.extent(stored), size))
    })
}

fn jpeg_header_of(format: PixelFormat, extent: [u32; 2], size: u64) -> Header {
    let (channels, width) = match format {
        PixelFormat::L8 => (1, 1),
        PixelFormat::L16 => (1, 2),
        PixelFormat::RGB24 | PixelFormat::CMYK32 => (3, 1),
    };
    let plausible = size.saturating_mul(JPEG_TEXELS);
    // A progressive JPEG keeps a coefficient of 16 bits for each number, its planes and its texels.
    Header { extent, channels, width, plausible, copies: 4 }
}

/// A JPEG file of which all is read that is before its data.
struct JpegFile<'b> {
    decoder: jpeg_decoder::Decoder<&'b [u8]>,
    format: PixelFormat,
    /// Width and height before the picture is turned.
    stored: [u32; 2],
    orientation: Orientation,
}

impl<'b> JpegFile<'b> {
    fn new(bytes: &'b [u8]) -> Result<Self> {
        let mut decoder = jpeg_decoder::Decoder::new(bytes);
        decoder.read_info().map_err(broken_jpeg)?;
        let info = decoder.info().ok_or_else(|| invalid("the JPEG file has no frame"))?;
        let orientation = decoder.exif_data().map(Orientation::of_exif).unwrap_or_default();
        let stored = [info.width, info.height].map(u32::from);
        Ok(Self { decoder, format: info.pixel_format, stored, orientation })
    }
}

fn broken_jpeg(error: jpeg_decoder::Error) -> Error {
    match error {
        jpeg_decoder::Error::Io(_) => invalid("the JPEG file is truncated"),
        error => invalid(error.to_string()),
    }
}

/// A PNG file's chunks that its texels depend on; all others are marked as ancillary by their
/// names (PNG, 5.4). What is broken stays for the decoder to report.
pub(super) fn png_without_metadata(bytes: &[u8]) -> Cow<'_, [u8]> {
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

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::image::Picture;

    /// Four squares of 16 x 16 texels in three scans, whose colours have half of the rows and
    /// columns: `cjpeg -quality 90 -sample 2x2 -optimize` with the scans `0; 1; 2;`.
    const SCANS: &str = "\
        ffd8ffe000104a46494600010100000100010000ffdb004300030202030202030303030403030405080505040405\
        0a070706080c0a0c0c0b0a0b0b0d0e12100d0e110e0b0b1016101113141515150c0f171816141812141514ffdb00\
        430103040405040509050509140d0b0d141414141414141414141414141414141414141414141414141414141414\
        1414141414141414141414141414141414141414ffc00011080020002003012200021101031101ffc40017000101\
        010100000000000000000000000000060807ffc40014100100000000000000000000000000000000ffda00080101\
        00003f00e282ec420bb1c906e0187c6e01ffc40017010003010000000000000000000000000006070809ffc40014\
        110100000000000000000000000000000000ffda0008010211003f005b871a4c911fffc400170100030100000000\
        00000000000000000005070809ffc40014110100000000000000000000000000000000ffda0008010311003f00b5\
        594a740ebfffd9";

    fn scans() -> Vec<u8> {
        let digits = SCANS.as_bytes().as_chunks().0;
        let byte = |two: &[u8; 2]| u8::from_str_radix(std::str::from_utf8(two).unwrap(), 16).unwrap();
        digits.iter().map(byte).collect()
    }

    fn decode(bytes: &[u8]) -> Result<Picture> {
        Picture::decode(Path::new("a.jpg"), bytes, None)
    }

    fn texel(picture: &Picture, x: u32, y: u32) -> [u8; 4] {
        picture.texels.as_chunks().0[(y * picture.extent[0] + x) as usize]
    }

    /// The texels of `djpeg`, up to 2 for another rounding.
    #[test]
    fn colours_of_several_scans_have_their_places() {
        let picture = decode(&scans()).unwrap();
        assert_eq!(picture.extent, [32, 32]);
        let djpeg = [
            ((4, 4), [200, 40, 40]),
            ((27, 4), [40, 159, 39]),
            ((4, 27), [61, 60, 200]),
            ((27, 27), [160; 3]),
        ];
        for ((x, y), wanted) in djpeg {
            let found = texel(&picture, x, y);
            let is_near = found.iter().zip(wanted).all(|(found, wanted)| found.abs_diff(wanted) <= 2);
            assert!(is_near && found[3] == 255, "{x} {y}: {found:?}, not {wanted:?}");
        }
    }

    /// As of Pillow: "image file is truncated".
    #[test]
    fn truncated_files_are_errors() {
        let whole = scans();
        for cut in 3..whole.len() {
            let error = decode(&whole[..cut]).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::InvalidImage, "{cut}");
        }
        assert_eq!(decode(&whole[..300]).unwrap_err().message(), "the JPEG file is truncated");
    }

    /// An orientation of 6 is that of a camera turned to the left: the first row is the right side,
    /// the first column the top.
    #[test]
    fn exif_data_turns_pictures() {
        let mut flat = Vec::new();
        let colors =
            image::RgbImage::from_fn(16, 8, |x, _| image::Rgb(if x < 8 { [200; 3] } else { [50; 3] }));
        colors.write_to(&mut Cursor::new(&mut flat), image::ImageFormat::Jpeg).unwrap();
        let tiff = b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0";
        let length = (2 + 6 + tiff.len() as u16).to_be_bytes();
        let turned = [&flat[..2], b"\xff\xe1", &length, b"Exif\0\0", tiff, &flat[2..]].concat();
        let (stored, turned) = (decode(&flat).unwrap(), decode(&turned).unwrap());
        assert_eq!((stored.extent, turned.extent), ([16, 8], [8, 16]));
        for x in 0..8 {
            for y in 0..16 {
                assert_eq!(texel(&turned, x, y), texel(&stored, y, 7 - x));
            }
        }
        assert!(texel(&turned, 0, 0)[0] > 180 && texel(&turned, 0, 15)[0] < 70);
    }

    /// 1 - 40 / 255 of the light is left by the ink, and of that 1 - 100 / 255 by black.
    #[test]
    fn ink_takes_light() {
        assert_eq!(rgb_of_cmyk([255, 0, 40, 0]), [0, 255, 215]);
        assert_eq!(rgb_of_cmyk([0, 40, 0, 100]), [155, 131, 155]);
    }
}
