//! What `anyhit render` draws in a share of the bands of a picture.

use std::io::{Read, Write};
use std::sync::Arc;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::read::DeflateDecoder;
use flate2::write::DeflateEncoder;
use serde::{Deserialize, Serialize};

use crate::shares::results::{ShareResult, ShareResults};
use anyhit_base::error::{Error, ErrorKind, Result};
use anyhit_engine::machine::format::Format;
use anyhit_engine::machine::image::{Image, ImageShape};
use anyhit_engine::pipeline::Band;
use anyhit_scene::image::{format_name, format_named};

/// The most texels of a picture, as of one that is rendered.
const MAX_TEXELS: u64 = 1 << 30;

/// What the shares of a picture have in common.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RenderWhole {
    /// The scene's file.
    pub scene: String,
    /// The scene's variant.
    pub variant: Option<String>,
    /// The precision of intersections, where the scene's own is not used.
    pub precision: Option<String>,
    /// Width and height.
    pub size: [u32; 2],
    /// The name of the texels' format.
    pub format: String,
    /// Whether a PNG encodes them as sRGB.
    pub to_srgb: bool,
    /// Whether a PNG has their alpha; it is opaque otherwise.
    #[serde(default)]
    pub keep_alpha: bool,
}

/// What was drawn.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RenderResult {
    /// The bands, from the top.
    pub bands: Vec<RenderedBand>,
}

/// Consecutive rows of the picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RenderedBand {
    /// The first row, from the top.
    first: u32,
    /// How many rows there are.
    rows: u32,
    /// The bytes of the texels: compressed (RFC 1951), in base64 (RFC 4648).
    texels: String,
}

impl RenderedBand {
    /// The rows of a band.
    ///
    /// # Errors
    /// Those of the band; `Io` where the compressor fails.
    pub fn of(band: Band<'_>) -> Result<Self> {
        let rows = band.rows();
        let failed = |error| Error::io("a compressed band", error);
        let mut compressed = DeflateEncoder::new(Vec::new(), Compression::fast());
        for row in rows.clone() {
            compressed.write_all(&band.row_bytes(row)?).map_err(failed)?;
        }
        let texels = STANDARD.encode(compressed.finish().map_err(failed)?);
        Ok(Self { first: rows.start, rows: rows.end - rows.start, texels })
    }

    /// The bytes of the texels, of rows of so many bytes.
    fn bytes(&self, row_bytes: u64) -> Result<Vec<u8>> {
        let Self { first, rows, texels } = self;
        let invalid = |why: &str| {
            Error::new(ErrorKind::InvalidImage, format!("the band of {rows} rows from row {first}: {why}"))
        };
        let compressed = STANDARD.decode(texels).map_err(|error| invalid(&error.to_string()))?;
        let size = u64::from(*rows) * row_bytes;
        let mut bytes = Vec::new();
        // One byte more shows that there are too many.
        let read = DeflateDecoder::new(&compressed[..]).take(size + 1).read_to_end(&mut bytes);
        read.map_err(|error| invalid(&error.to_string()))?;
        if bytes.len() as u64 != size {
            return Err(invalid("it has a different number of texels"));
        }
        Ok(bytes)
    }
}

impl RenderWhole {
    /// The format of the texels and the bytes of a row.
    fn layout(&self) -> Result<(Format, u64)> {
        let [width, height] = self.size;
        let invalid = |message: String| Error::new(ErrorKind::InvalidImage, message);
        let format = format_named(&self.format)
            .ok_or_else(|| invalid(format!("unknown image format `{}`", self.format)))?;
        if u64::from(width) * u64::from(height) > MAX_TEXELS {
            return Err(invalid(format!("a picture of {width}x{height} has more than 2^30 texels")));
        }
        Ok((format, u64::from(width) * u64::from(format.texel_size())))
    }

    /// The name of a format, as `format` has it.
    pub fn format_of(format: Format) -> String {
        format_name(format).to_owned()
    }
}

impl RenderResult {
    /// The picture of all shards; the texels of missing ones are zeros.
    ///
    /// # Errors
    /// `InvalidImage` where a band is none of the picture, or rows are in none though no share is
    /// missing.
    pub fn picture(results: &ShareResults<Self>) -> Result<Arc<Image>> {
        let whole = results.whole();
        let (format, row_bytes) = whole.layout()?;
        let [width, height] = whole.size;
        let mut bytes = vec![0; (row_bytes * u64::from(height)) as usize];
        let mut drawn = 0;
        for band in results.shares().flat_map(|share| &share.bands) {
            let end = band.first.checked_add(band.rows).filter(|end| *end <= height);
            let Some(end) = end else {
                let message =
                    format!("{} rows from row {} exceed the height {height}", band.rows, band.first);
                return Err(Error::new(ErrorKind::InvalidImage, message));
            };
            let range = [band.first, end].map(|row| (u64::from(row) * row_bytes) as usize);
            bytes[range[0]..range[1]].copy_from_slice(&band.bytes(row_bytes)?);
            drawn += u64::from(band.rows);
        }
        if results.missing().is_empty() && drawn != u64::from(height) {
            let message = format!("all shards together have {drawn} of {height} rows");
            return Err(Error::new(ErrorKind::InvalidImage, message));
        }
        Image::new(format, ImageShape::plane(width, height), &bytes)
    }
}

impl ShareResult for RenderResult {
    const COMMAND: &'static str = "render";
    type Whole = RenderWhole;

    fn without_times(&self) -> Self {
        self.clone()
    }
}
