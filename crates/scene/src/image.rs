//! Decodes picture files into texels, and encodes texels as PNG.

mod decode;
mod decoded;
#[cfg(feature = "exr")]
mod openexr;
mod orientation;
#[cfg(feature = "images")]
mod png_jpeg;
mod radiance;

use std::io::{BufWriter, Write};
use std::ops::Range;
use std::path::Path;

use crate::read::Named;
use anyhit_base::atomic_file::{self, AtomicFile};
#[cfg(not(all(feature = "exr", feature = "images")))]
use anyhit_base::error::feature_note;
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_base::threads::map_on_threads;
use anyhit_engine::machine;
use anyhit_engine::machine::format::{Class, Component, Format};

/// GLSL's names of image formats in small letters; `srgb8_alpha8` as in OpenGL.
impl Named for Format {
    const WHAT: &'static str = "image format";
    const NAMES: &'static [(&'static str, Self)] = Self::NAMED;
}

/// A format's name as a scene writes it.
pub fn format_name(format: Format) -> &'static str {
    format.name()
}

/// The format of a name, as [`format_name`] gives it.
pub fn format_named(name: &str) -> Option<Format> {
    Format::NAMES.iter().find(|(known, _)| *known == name).map(|(_, format)| *format)
}

/// The bytes of the texel nearest to four numbers.
pub fn texel_bytes(format: Format, color: [f64; 4]) -> Vec<u8> {
    format.encode_numbers(color).to_le_bytes()[..format.texel_size() as usize].to_vec()
}

/// Four numbers from the bytes of a texel.
pub fn texel_numbers(format: Format, bytes: &[u8]) -> [f64; 4] {
    let mut texel = [0; 16];
    texel[..bytes.len()].copy_from_slice(bytes);
    format.decode_numbers(u128::from_le_bytes(texel))
}

/// How the numbers of an image become the 8-bit pixels of a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PixelEncoding {
    /// True if linear colours are encoded as sRGB, which is what picture viewers expect; numbers
    /// are stored unchanged otherwise. Texels that are stored sRGB-encoded are kept.
    pub to_srgb: bool,
    /// True if pixels have the image's alpha; they are opaque otherwise.
    pub keep_alpha: bool,
}

impl PixelEncoding {
    /// All numbers unchanged: that of a picture file that is read.
    pub const STORED: Self = Self { to_srgb: false, keep_alpha: true };
}

/// A decoded picture file: rows from the top, texels from the left.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Its texels' format.
    pub format: Format,
    /// Width and height.
    pub extent: [u32; 2],
    /// `width * height * format.texel_size()` bytes.
    pub texels: Vec<u8>,
}

/// What the header of a picture file says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PictureHeader {
    /// The format of the texels as they are decoded.
    pub format: Format,
    /// Width and height.
    pub extent: [u32; 2],
}

impl Picture {
    /// The first layer, slice and sample of level 0 of an image.
    pub fn of(image: &machine::image::Image) -> Self {
        let [width, height, _] = image.shape().extent;
        let texels = (0..height).flat_map(|row| image.row_bytes(row)).collect();
        Self { format: image.format(), extent: [width, height], texels }
    }

    /// The pixels as 8-bit RGBA.
    ///
    /// # Errors
    /// `InvalidImage` for integer texels wider than 8 bits or a size that does not match.
    pub fn rgba8(&self, encoding: PixelEncoding) -> Result<Vec<u8>> {
        let size = self.format.texel_size() as usize;
        let count = self.extent[0] as usize * self.extent[1] as usize;
        if self.texels.len() != count * size {
            return Err(invalid(format!(
                "{} bytes do not match {count} texels of {size} bytes",
                self.texels.len()
            )));
        }
        Ok(PngConversion::new(self.format, encoding)?.pixels(&self.texels))
    }

    /// Four numbers for every texel.
    pub fn numbers(&self) -> Vec<f64> {
        let texels = self.texels.chunks_exact(self.format.texel_size() as usize);
        texels.flat_map(|texel| texel_numbers(self.format, texel)).collect()
    }

    /// Writes an 8-bit RGBA PNG of [`Picture::rgba8`].
    ///
    /// # Errors
    /// As [`Picture::rgba8`].
    pub fn encode_png(&self, encoding: PixelEncoding) -> Result<Vec<u8>> {
        let pixels = self.rgba8(encoding)?;
        encode_png(self.extent, &pixels, encoding.to_srgb || self.format.srgb)
    }

    /// Writes an OpenEXR file of the numbers, as 32-bit floats.
    ///
    /// # Errors
    /// `InvalidImage` where the file cannot be made, `UnsupportedTool` without the feature `exr`.
    pub fn encode_exr(&self) -> Result<Vec<u8>> {
        #[cfg(feature = "exr")]
        {
            let numbers: Vec<f32> = self.numbers().into_iter().map(|number| number as f32).collect();
            openexr::encode(self.extent, &numbers)
        }
        #[cfg(not(feature = "exr"))]
        Err(missing_exr())
    }
}

/// A picture of 8-bit red, green, blue and alpha, as a PNG shows it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rgba8 {
    /// Width and height.
    pub extent: [u32; 2],
    /// `4 * width * height` bytes, rows from the top.
    pub pixels: Vec<u8>,
}

impl Rgba8 {
    /// Writes a PNG.
    ///
    /// # Errors
    /// `InvalidImage` for a picture without pixels, or another number of bytes.
    pub fn encode_png(&self) -> Result<Vec<u8>> {
        encode_png(self.extent, &self.pixels, false)
    }
}

fn encode_png(extent: [u32; 2], pixels: &[u8], is_srgb: bool) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let failed = |error: std::io::Error| invalid(error.to_string());
    png(extent, is_srgb, &mut bytes, &failed, |to| to.write_all(pixels).map_err(failed))?;
    Ok(bytes)
}

/// What a picture is saved as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureKind {
    /// Eight bits a channel.
    Png,
    /// OpenEXR, of 32-bit floats.
    Exr,
    /// The bytes of the texels as the image holds them, rows from the top, without any header.
    Raw,
}

impl PictureKind {
    /// What a file's extension says; PNG where it has none, `None` for another one.
    pub fn of(path: &Path) -> Option<Self> {
        let Some(extension) = path.extension() else { return Some(Self::Png) };
        let kinds = [("png", Self::Png), ("exr", Self::Exr), ("raw", Self::Raw)];
        kinds.into_iter().find(|(name, _)| extension.eq_ignore_ascii_case(name)).map(|(_, kind)| kind)
    }

    /// Refuses what this build cannot write, before anything is computed.
    ///
    /// # Errors
    /// `UnsupportedTool` for an EXR without the feature `exr`.
    pub fn check(self) -> Result<()> {
        if self == Self::Exr { exr_support() } else { Ok(()) }
    }
}

/// Writes the first layer and slice of an image's level 0 as what the file's extension says, a PNG
/// as [`write_png`] does. Numbers of an EXR and bytes of a raw picture are those of the image: the
/// encoding is of a PNG alone.
///
/// # Errors
/// As [`write_png`], [`Picture::encode_exr`], and `Io`.
pub fn write_picture(path: &Path, image: &machine::image::Image, encoding: PixelEncoding) -> Result<()> {
    match PictureKind::of(path).unwrap_or(PictureKind::Png) {
        PictureKind::Png => write_png(path, image, encoding),
        PictureKind::Exr => atomic_file::write(path, Picture::of(image).encode_exr()?),
        PictureKind::Raw => atomic_file::write(path, Picture::of(image).texels),
    }
}

/// Writes the first layer and slice of an image's level 0 as a PNG, as [`Picture::encode_png`]
/// does, but row by row, so that hardly any memory is needed in addition to the image.
///
/// # Errors
/// As [`Picture::rgba8`], and `Io`.
pub fn write_png(path: &Path, image: &machine::image::Image, encoding: PixelEncoding) -> Result<()> {
    let [width, height, _] = image.shape().extent;
    stream_png(path, [width, height], image.format(), encoding, |png| {
        png.rows(0..height, |row| Ok(image.row_bytes(row)))
    })
}

/// Writes a PNG row by row, from texels of a format, with the pixels of
/// [`Picture::encode_png`]. A file at the path is replaced only
/// when everything is written, and is kept if `fill` fails.
///
/// # Errors
/// As [`Picture::rgba8`], `Io`, and those of `fill`, which must give all rows.
pub fn stream_png<T>(
    path: &Path,
    size: [u32; 2],
    format: Format,
    encoding: PixelEncoding,
    fill: impl FnOnce(&mut PngRows<'_>) -> Result<T>,
) -> Result<T> {
    let io = |error| Error::io(path, error);
    let conversion = PngConversion::new(format, encoding)?;
    let mut file = AtomicFile::create(path)?;
    let mut buffered = BufWriter::new(&mut file);
    let filled = png(size, conversion.target.srgb, &mut buffered, &io, |to| {
        fill(&mut PngRows { path, conversion, to })
    })
    .and_then(|filled| buffered.flush().map(|()| filled).map_err(io));
    drop(buffered);
    match filled {
        Ok(filled) => file.finish().map(|()| filled),
        Err(error) => Err(file.abandon(error)),
    }
}

/// Writes the rows of a PNG, the top one first.
#[allow(missing_debug_implementations, reason = "it borrows a writer")]
pub struct PngRows<'a> {
    path: &'a Path,
    conversion: PngConversion,
    to: &'a mut (dyn Write + Send),
}

impl PngRows<'_> {
    /// Writes the next rows, given the bytes of the texels of each.
    ///
    /// # Errors
    /// `Io`, and those of `bytes`.
    pub fn rows(&mut self, rows: Range<u32>, bytes: impl Fn(u32) -> Result<Vec<u8>> + Sync) -> Result<()> {
        // The number of rows that all threads convert before this thread writes them.
        const ROWS_PER_CHUNK: u32 = 64;
        let (conversion, end) = (&self.conversion, rows.end);
        for first in rows.step_by(ROWS_PER_CHUNK as usize) {
            let count = ROWS_PER_CHUNK.min(end - first) as usize;
            let pixels = |at: usize| Ok(conversion.pixels(&bytes(first + at as u32)?));
            let pixels: Vec<_> = map_on_threads(count, pixels).into_iter().collect::<Result<_>>()?;
            let written = pixels.iter().try_for_each(|row| self.to.write_all(row));
            written.map_err(|error| Error::io(self.path, error))?;
        }
        Ok(())
    }
}

/// Writes the RGBA8 pixels from `fill` as a PNG, whose chunks sRGB and gAMA say so where the
/// colours are encoded as sRGB.
#[cfg(feature = "images")]
fn png<T>(
    [width, height]: [u32; 2],
    is_srgb: bool,
    to: &mut (impl Write + Send),
    failed: &dyn Fn(std::io::Error) -> Error,
    fill: impl FnOnce(&mut (dyn Write + Send)) -> Result<T>,
) -> Result<T> {
    let failed = |error: png::EncodingError| failed(error.into());
    let mut encoder = png::Encoder::new(to, width, height);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fast);
    if is_srgb {
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        // For programs that do not read sRGB: 1 / 2.2 (PNG, 11.3.2.5).
        encoder.set_source_gamma(png::ScaledFloat::from_scaled(45455));
    }
    let mut header = encoder.write_header().map_err(failed)?;
    let mut stream = header.stream_writer().map_err(failed)?;
    let filled = fill(&mut stream)?;
    stream.finish().map_err(failed)?;
    header.finish().map_err(failed)?;
    Ok(filled)
}

#[cfg(not(feature = "images"))]
fn png<T>(
    _: [u32; 2],
    _: bool,
    _: &mut (impl Write + Send),
    _: &dyn Fn(std::io::Error) -> Error,
    _: impl FnOnce(&mut (dyn Write + Send)) -> Result<T>,
) -> Result<T> {
    Err(missing_images())
}

/// The conversion of texels of a format to 8-bit RGBA.
struct PngConversion {
    format: Format,
    target: Format,
    /// True if every pixel is opaque: it is asked for, or the format has no alpha.
    is_opaque: bool,
}

impl PngConversion {
    fn new(format: Format, encoding: PixelEncoding) -> Result<Self> {
        if format.class() != Class::Float && format.component != Component::Uint8 {
            return Err(invalid(format!("a PNG file cannot store {} texels", format_name(format))));
        }
        Ok(Self {
            format,
            target: Format { srgb: encoding.to_srgb || format.srgb, ..Format::new(Component::Unorm8, 4) },
            is_opaque: !encoding.keep_alpha || format.channels < 4,
        })
    }

    fn pixels(&self, texels: &[u8]) -> Vec<u8> {
        let size = self.format.texel_size() as usize;
        let mut pixels = Vec::with_capacity(texels.len() / size * 4);
        for texel in texels.chunks_exact(size) {
            let mut color = texel_numbers(self.format, texel);
            let mut pixel = if self.format.component == Component::Uint8 {
                color.map(|x| x as u8)
            } else {
                // NaN is shown in magenta, because black would hide it.
                if color.iter().any(|x| x.is_nan()) {
                    color = [1.0, 0.0, 1.0, 1.0];
                }
                let [red, green, blue, alpha, ..] = self.target.encode_numbers(color).to_le_bytes();
                [red, green, blue, alpha]
            };
            if self.is_opaque {
                pixel[3] = u8::MAX;
            }
            pixels.extend(pixel);
        }
        pixels
    }
}

/// The error that this build has no crates for PNG and JPEG.
#[cfg(not(feature = "images"))]
fn missing_images() -> Error {
    Error::new(ErrorKind::UnsupportedTool, "this build of anyhit neither reads nor writes PNG and JPEG files")
        .note(feature_note("images") + "; or use HDR")
}

/// Whether this build reads and writes OpenEXR files.
///
/// # Errors
/// `UnsupportedTool` where it does not.
pub fn exr_support() -> Result<()> {
    #[cfg(feature = "exr")]
    return Ok(());
    #[cfg(not(feature = "exr"))]
    Err(missing_exr())
}

/// The error that this build has no crate for OpenEXR.
#[cfg(not(feature = "exr"))]
fn missing_exr() -> Error {
    Error::new(ErrorKind::UnsupportedTool, "this build neither reads nor writes OpenEXR files")
        .note(feature_note("exr") + "; or use HDR or PNG")
}

pub(super) fn invalid(message: impl Into<String>) -> Error {
    Error::new(ErrorKind::InvalidImage, message)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn format(name: &str) -> Format {
        Format::NAMES.iter().find(|(known, _)| *known == name).unwrap().1
    }

    fn png(width: u32, height: u32, pixels: &[[u8; 4]]) -> Vec<u8> {
        let raw = pixels.concat();
        let mut bytes = Vec::new();
        let image = image::RgbaImage::from_raw(width, height, raw).unwrap();
        image.write_to(&mut std::io::Cursor::new(&mut bytes), image::ImageFormat::Png).unwrap();
        bytes
    }

    #[test]
    fn names_are_of_their_formats() {
        for (name, size) in [("r8", 1), ("rgba8_srgb", 4), ("rg16f", 4), ("rgba32f", 16), ("r64ui", 8)] {
            assert_eq!(format(name).texel_size(), size, "{name}");
            assert_eq!(format_name(format(name)), name);
        }
    }

    #[test]
    fn a_png_keeps_its_bytes_as_srgb_or_as_plain_numbers() {
        let bytes = png(2, 1, &[[1, 2, 3, 4], [250, 128, 0, 255]]);
        let picture = Picture::decode(Path::new("a.png"), &bytes, None).unwrap();
        assert_eq!(picture.extent, [2, 1]);
        assert_eq!(picture.format, format("rgba8_srgb"));
        assert_eq!(picture.texels, [1, 2, 3, 4, 250, 128, 0, 255]);
        let plain = Picture::decode(Path::new("a.png"), &bytes, Some(format("rgba8"))).unwrap();
        assert_eq!(plain.texels, picture.texels);
        let floats = Picture::decode(Path::new("a.png"), &bytes, Some(format("r32f"))).unwrap();
        assert_eq!(floats.texels[..4], (1.0_f32 / 255.0).to_le_bytes());
        assert_eq!(floats.texels.len(), 8);
        let numbers = Picture::decode(Path::new("a.png"), &bytes, Some(format("r32ui"))).unwrap();
        assert_eq!(numbers.texels, [1, 0, 0, 0, 250, 0, 0, 0]);
    }

    #[test]
    fn a_written_png_reads_back() {
        let texels: Vec<u8> =
            [0.0_f32, 1.0, 0.5, 1.0, f32::NAN, 0.0, 0.0, 1.0].iter().flat_map(|x| x.to_le_bytes()).collect();
        let picture = Picture { format: format("rgba32f"), extent: [1, 2], texels };
        let plain =
            Picture::decode(Path::new("b.png"), &picture.encode_png(PixelEncoding::STORED).unwrap(), None)
                .unwrap();
        assert_eq!(plain.texels, [0, 255, 128, 255, 255, 0, 255, 255]);
        // 1.055 * 0.5^(1/2.4) - 0.055 = 0.735357, times 255 = 187.5 (187.516): 188.
        let srgb = Picture::decode(
            Path::new("b.png"),
            &picture.encode_png(PixelEncoding { to_srgb: true, keep_alpha: false }).unwrap(),
            None,
        )
        .unwrap();
        assert_eq!(srgb.texels[..4], [0, 255, 188, 255]);
        let wrong = Picture { extent: [2, 2], ..picture };
        assert!(wrong.encode_png(PixelEncoding::default()).is_err());
    }

    #[test]
    fn pngs_of_encoded_colours_say_srgb() {
        let of = |name: &str, to_srgb: bool| {
            let texels = vec![0; format(name).texel_size() as usize];
            let picture = Picture { format: format(name), extent: [1, 1], texels };
            let bytes = picture.encode_png(PixelEncoding { to_srgb, keep_alpha: true }).unwrap();
            let has = |chunk: &[u8]| bytes.windows(chunk.len()).any(|part| part == chunk);
            // 1 / 2.2 in 1 / 100000, which PNG (11.3.2.5) recommends beside sRGB.
            (has(b"sRGB"), has(&[b"gAMA", &45455_u32.to_be_bytes()[..]].concat()), has(b"gAMA"))
        };
        let (encoded, plain) = ((true, true, true), (false, false, false));
        assert_eq!([of("rgba32f", true), of("rgba8", true), of("rgba8_srgb", false)], [encoded; 3]);
        assert_eq!([of("rgba32f", false), of("rgba8", false)], [plain; 2]);
    }

    #[test]
    fn pixels_are_opaque_unless_their_alpha_is_kept() {
        let kept = PixelEncoding { keep_alpha: true, ..PixelEncoding::default() };
        let pixels = |name: &str, texels: &[u8], encoding| {
            Picture { format: format(name), extent: [1, 1], texels: texels.to_vec() }.rgba8(encoding).unwrap()
        };
        for (name, texel, alpha) in [
            ("rgba8", &[10, 20, 30, 40][..], 40),
            ("rgba8_srgb", &[10, 20, 30, 40], 40),
            ("rgba8ui", &[10, 20, 30, 40], 40),
            // A quarter in 16 bits is 63.75 in 8.
            ("rgba16f", &[0, 0, 0, 0, 0, 0, 0, 0x34], 64),
            ("rgb10_a2", &[0, 0, 0, 0x40], 85),
            // Formats without alpha are opaque.
            ("r8", &[10], 255),
            ("r8ui", &[10], 255),
            ("r11f_g11f_b10f", &[0, 0, 0, 0], 255),
        ] {
            assert_eq!(pixels(name, texel, kept)[3], alpha, "{name}");
            assert_eq!(pixels(name, texel, PixelEncoding::default())[3], 255, "{name}");
            assert_eq!(pixels(name, texel, kept)[..3], pixels(name, texel, PixelEncoding::default())[..3]);
        }
    }

    #[test]
    fn an_image_is_written_row_by_row_as_its_picture_would_be() {
        let shape = machine::image::ImageShape::plane(3, 2);
        let texels: Vec<u8> = (0..24).map(|number| number * 10).collect();
        let image = machine::image::Image::new(format("rgba8"), shape, &texels).unwrap();
        let path = std::env::temp_dir().join(format!("anyhit-rows-{}.png", std::process::id()));
        write_png(&path, &image, PixelEncoding::STORED).unwrap();
        let written = std::fs::read(&path).unwrap();
        std::fs::remove_file(&path).unwrap();
        let back = Picture::decode(&path, &written, Some(format("rgba8"))).unwrap();
        assert_eq!((back.extent, back.texels), ([3, 2], texels));
        assert_eq!(written, Picture::of(&image).encode_png(PixelEncoding::STORED).unwrap());
        let error =
            write_png(Path::new("no/such/folder/a.png"), &image, PixelEncoding::default()).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Io);
    }

    #[test]
    fn broken_and_hostile_files_are_errors() {
        let error = Picture::decode(Path::new("a.txt"), b"hello", None).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::InvalidImage);
        let whole = png(2, 1, &[[1, 2, 3, 4], [5, 6, 7, 8]]);
        for cut in 8..whole.len() - 12 {
            let error = Picture::decode(Path::new("a.png"), &whole[..cut], None).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::InvalidImage, "{cut}");
        }
        // A Radiance header that claims a million texels each way.
        let hdr = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1000000 +X 1000000\n";
        let error = Picture::decode(Path::new("a.hdr"), hdr, None).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::InvalidImage);
        assert!(error.to_string().contains("a.hdr"), "{error}");
    }
}
