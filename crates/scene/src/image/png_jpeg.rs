//! PNG and JPEG files, through the crates `png` and `zune-jpeg`.

use std::borrow::Cow;
use std::io::Cursor;

use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use crate::image::decoded::{Decoded, Header, Numbers};
use crate::image::invalid;
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
        error => invalid(error.to_string()),
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

/// Decodes a JPEG file.
pub(super) fn jpeg(bytes: &[u8], wanted: Option<Format>, limits: &InputLimits) -> Result<Decoded> {
    contained("zune-jpeg", ErrorKind::InvalidImage, || {
        let (mut decoder, header) = jpeg_decoder(bytes, bytes.len() as u64)?;
        header.check(bytes.len() as u64, wanted, limits)?;
        let numbers = decoder.decode().map_err(|error| invalid(error.to_string()))?;
        Ok(Decoded { extent: header.extent, channels: header.channels, numbers: Numbers::Bytes(numbers) })
    })
}

/// What the header of a JPEG file says, given its first bytes and how many it has.
pub(super) fn jpeg_header(head: &[u8], size: u64) -> Result<Header> {
    contained("zune-jpeg", ErrorKind::InvalidImage, || jpeg_decoder(head, size).map(|(_, header)| header))
}

fn jpeg_decoder(bytes: &[u8], size: u64) -> Result<(JpegDecoder<ZCursor<&[u8]>>, Header)> {
    let options =
        DecoderOptions::default().set_strict_mode(false).set_max_width(usize::MAX).set_max_height(usize::MAX);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder.decode_headers().map_err(|error| invalid(error.to_string()))?;
    let (Some((width, height)), Some(space)) = (decoder.dimensions(), decoder.input_colorspace()) else {
        return Err(invalid("the JPEG file has no frame"));
    };
    // Grey stays grey; everything else becomes red, green and blue.
    let space = if space == ColorSpace::Luma { space } else { ColorSpace::RGB };
    decoder.set_options(options.jpeg_set_out_colorspace(space));
    let side = |side: usize| u32::try_from(side).unwrap_or(u32::MAX);
    let header = Header {
        extent: [side(width), side(height)],
        channels: space.num_components(),
        width: 1,
        plausible: size.saturating_mul(JPEG_TEXELS),
        // A progressive JPEG keeps a coefficient of 16 bits for each number.
        copies: 3,
    };
    Ok((decoder, header))
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
