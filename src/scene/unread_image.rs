//! Images whose picture files are decoded when something first reads a texel.

use std::path::PathBuf;

use crate::error::{Error, Result};
use crate::input::InputLimits;
use crate::machine::format::Format;
use crate::machine::image::ImageShape;
use crate::scene::deferred_file::DeferredFile;
use crate::scene::image::{Picture, PictureHeader, format_name};
use crate::scene::mip;
use crate::scene::read::Span;

/// A picture of which only the header was read.
#[derive(Clone, Debug)]
pub struct UnreadPicture {
    /// Its header.
    pub header: PictureHeader,
    /// Where the scene names it.
    pub span: Span,
    file: DeferredFile,
    path: PathBuf,
    wanted: Option<Format>,
    limits: InputLimits,
}

impl UnreadPicture {
    /// Reads the header of a picture whose texels have the wanted format, or the file's own.
    /// `linear` says that numbers of 8 bits are no colours and are not encoded as sRGB.
    ///
    /// # Errors
    /// As [`PictureHeader::read`].
    pub fn new(
        file: DeferredFile,
        path: PathBuf,
        span: &Span,
        wanted: Option<Format>,
        linear: bool,
        limits: InputLimits,
    ) -> Result<Self> {
        let header = PictureHeader::read(&path, &file, wanted, &limits);
        let mut header = header.map_err(|error| named_here(error, span))?;
        if linear && wanted.is_none() {
            header.format.srgb = false;
        }
        Ok(Self { header, span: span.clone(), file, path, wanted, limits })
    }

    fn texels(&self) -> Result<Vec<u8>> {
        let read = || -> Result<Picture> {
            let bytes = self.file.bytes()?;
            Picture::decode_within(&self.path, &bytes, self.wanted, &self.limits)
        };
        let picture = read().map_err(|error| named_here(error, &self.span))?;
        let PictureHeader { format, extent } = self.header;
        if (picture.extent, picture.format.component) != (extent, format.component) {
            let [width, height] = extent;
            let header = format!("{width} x {height} texels of {}", format_name(format));
            let message = format!("the file has changed since its header was read, which has {header}");
            return Err(self.span.error(message));
        }
        // Many names of one file are many pictures.
        let reserved = self.file.reserve(picture.texels.len() as u64);
        reserved.map_err(|error| error.at(self.span.place()))?;
        Ok(picture.texels)
    }
}

fn named_here(error: Error, span: &Span) -> Error {
    error.at_with(span.place(), "named here")
}

/// An image of which only the headers of its pictures were read. They fit its shape.
#[derive(Debug)]
pub struct UnreadImage {
    pictures: Vec<UnreadPicture>,
    shape: ImageShape,
    format: Format,
    /// Where the scene describes it.
    span: Span,
}

impl UnreadImage {
    /// The image of pictures, one for each layer, or for each layer of each level, level 0 first.
    ///
    /// # Errors
    /// `InvalidScene` where they do not fit the shape.
    pub fn new(pictures: Vec<UnreadPicture>, shape: ImageShape, format: Format, span: &Span) -> Result<Self> {
        let (given, layers) = (pictures.len() as u64, shape.layers);
        let all = u64::from(layers) * u64::from(shape.levels);
        if given != u64::from(layers) && given != all {
            let message = format!(
                "{given} files for {layers} layers: list one file per layer, or one per layer of each \
                 level, level 0 first"
            );
            return Err(span.error(message));
        }
        for (at, picture) in (0..).zip(&pictures) {
            let [width, height, _] = shape.level_extent(at / layers);
            if picture.header != (PictureHeader { format, extent: [width, height] }) {
                return Err(picture.span.error(format!(
                    "this file must have {width} x {height} texels, in the first file's format"
                )));
            }
        }
        if given != all {
            mip::check(format).map_err(|message| span.error(message))?;
        }
        Ok(Self { pictures, shape, format, span: span.clone() })
    }

    /// Decodes the pictures, and makes the levels that they leave out: all texels in the order of
    /// [`Image`](crate::machine::image::Image).
    ///
    /// # Errors
    /// `Io` or `InvalidImage` about a file, and `InvalidScene` beyond the limit `scene-memory` or
    /// where a file is not what it was.
    pub fn texels(&self) -> Result<Vec<u8>> {
        let size = self.shape.texels().saturating_mul(u64::from(self.format.texel_size()));
        if let Some(picture) = self.pictures.first() {
            picture.file.reserve(size).map_err(|error| error.at(self.span.place()))?;
        }
        let mut texels = match &self.pictures[..] {
            [picture] => picture.texels()?,
            pictures => pictures.iter().map(UnreadPicture::texels).collect::<Result<Vec<_>>>()?.concat(),
        };
        if (texels.len() as u64) < size {
            let more = mip::generate(self.format, &self.shape, &texels);
            texels.extend(more.map_err(|message| self.span.error(message))?);
        }
        Ok(texels)
    }
}
