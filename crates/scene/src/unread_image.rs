//! Images whose picture files are decoded when something first reads a texel.

use std::path::PathBuf;

use crate::deferred_file::DeferredFile;
use crate::image::{Picture, PictureHeader, format_name};
use crate::mip;
use crate::read::Span;
use anyhit_base::error::{Error, Result};
use anyhit_base::input::InputLimits;
use anyhit_engine::machine::format::Format;
use anyhit_engine::machine::image::ImageShape;

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
    /// [`Image`](anyhit_engine::machine::image::Image).
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

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::image::PixelEncoding;
    use crate::{Assembled, LoadOptions, SceneFiles, assemble, load_text};
    use anyhit_base::error::ErrorKind;
    use anyhit_engine::machine::Descriptor;
    use anyhit_engine::pipeline::{BatchWidth, RunOptions};

    /// The scene of sampled images, one of which is read from a file.
    fn scene(file: &Path, read_all: bool) -> Result<Assembled> {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shaders/pass/images/sampling/scene.toml");
        let text = std::fs::read_to_string(path).expect("a scene");
        let given = "binding = 3\nformat = \"r32f\"\nsize = [4, 2]\n\
                     data = { f32 = [[0, 1, 2, 3], [10, 11, 12, 13]] }";
        assert!(text.contains(given));
        let file = file.to_str().expect("a path of UTF-8");
        let text = text.replace(given, &format!("binding = 3\nformat = \"r32f\"\nfile = '{file}'"));
        let files = SceneFiles { read_all, ..SceneFiles::default() };
        assemble(&load_text(Path::new(path), &text, &files, &LoadOptions::default())?)
    }

    fn image(scene: &Assembled) -> &anyhit_engine::machine::image::Image {
        let key = anyhit_engine::machine::Binding { set: 0, binding: 3 };
        match &scene.resources.descriptors[&key][0] {
            Descriptor::ImageSampler(image, _) => image,
            other => panic!("{other:?}"),
        }
    }

    fn png() -> Vec<u8> {
        let texels = (0..32).collect();
        let picture = Picture { format: Format::RGBA8_SRGB, extent: [4, 2], texels };
        picture.encode_png(PixelEncoding::STORED).expect("a PNG")
    }

    #[test]
    fn pictures_are_decoded_when_a_shader_reads_a_texel() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("a.png");
        std::fs::write(&file, png()).expect("a file");
        let scene = scene(&file, false).expect("a scene");
        let image = image(&scene);
        assert_eq!((image.shape().extent, image.is_read()), ([4, 2, 1], false));
        scene.run(&scene.resources, RunOptions::default()).expect("it runs");
        assert!(image.is_read());
        // The red of the second texel, an eight-bit number that is read as it is stored.
        assert_eq!(image.bytes()[4..8], (4.0_f32 / 255.0).to_le_bytes());
    }

    #[test]
    fn a_picture_that_cannot_be_decoded_is_the_error_of_the_run() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("a.png");
        let whole = png();
        // The header is whole, and the texels end early.
        std::fs::write(&file, &whole[..whole.len() - 20]).expect("a file");
        let scene_of = |read_all| scene(&file, read_all);
        let lazy = scene_of(false).expect("a scene");
        for error in [
            lazy.run(&lazy.resources, RunOptions::default()).expect_err("an error"),
            scene_of(true).expect_err("an error"),
        ] {
            let text = error.render();
            assert_eq!(error.kind(), ErrorKind::InvalidImage, "{text}");
            assert!(text.contains("a.png") && text.contains("scene.toml:"), "{text}");
        }
        let error = lazy.run(&lazy.resources, RunOptions::of(BatchWidth::One)).expect_err("an error");
        assert!(error.notes().iter().any(|note| note.contains("launch id (0, 0, 0)")), "{error}");
    }

    #[test]
    fn a_file_that_is_not_what_it_was_is_an_error() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("a.png");
        std::fs::write(&file, png()).expect("a file");
        let scene = scene(&file, false).expect("a scene");
        let other = Picture { format: Format::RGBA8_SRGB, extent: [2, 4], texels: vec![0; 32] };
        std::fs::write(&file, other.encode_png(PixelEncoding::STORED).expect("a PNG")).expect("a file");
        let error = scene.run(&scene.resources, RunOptions::default()).expect_err("an error");
        assert!(error.message().contains("the file has changed"), "{error}");
    }
}
