//! The files of expected output next to a scene: `expect.stdout`, `expect.stderr` and `expect.png`.

use std::path::{Path, PathBuf};

use crate::case::Loaded;
use crate::expect::{Difference, Fix, Observed, PictureDifference, printed_diff};
use anyhit_base::count::grouped;
use anyhit_base::error::{Error, ErrorKind, Place, Result};
use anyhit_engine::machine::image::Image;
use anyhit_engine::machine::{Binding, Descriptor, Resources};
use anyhit_scene::image::{Picture, PixelEncoding};
use anyhit_scene::resolved::ResolvedBinding;
use anyhit_scene::{Files, ResolvedScene};

/// Compares the output of a launch with the expected files next to its scene.
///
/// What shaders print is `expect.stdout`, the report of a trap `expect.stderr`, and the image that
/// `render` would save `expect.png`. `is_variant` skips the report: variants have lines of their
/// own.
///
/// # Errors
/// `Io` if an expected file cannot be read.
pub fn differences(loaded: &Loaded, observed: &Observed, is_variant: bool) -> Result<Vec<Difference>> {
    let mut found = Vec::new();
    let beside = |name: &str| Some(loaded.scene.path.with_file_name(name)).filter(|path| path.exists());
    if !loaded.scene.path.ends_with("scene.toml") {
        return Ok(found);
    }
    let report = observed.trap.as_ref().map(Error::render).unwrap_or_default();
    for (name, what, text) in [
        ("expect.stdout", "the text printed by the shaders", Some(&observed.printed)),
        ("expect.stderr", "the report of the trap", Some(&report).filter(|_| !is_variant)),
    ] {
        if let (Some(path), Some(text)) = (beside(name), text) {
            found.extend(text_difference(loaded, path, what, text)?);
        }
    }
    if let Some(path) = beside("expect.png") {
        found.extend(picture_difference(loaded, observed, path)?);
    }
    Ok(found)
}

/// The image of a scene with the key `output`, and its binding, as it stands in resources.
pub fn output_image<'s, 'r>(
    scene: &'s ResolvedScene,
    resources: &'r Resources,
) -> Option<(&'s ResolvedBinding, &'r Image)> {
    let output = scene.output()?;
    let binding = Binding { set: output.set, binding: output.binding };
    match resources.descriptors.get(&binding)?.get(output.element as usize)? {
        Descriptor::Image(image) => Some((output, image)),
        _ => None,
    }
}

fn differs(path: &Path, message: String) -> Difference {
    Difference::of(Error::new(ErrorKind::Expectation, message).at(Place::File(path.to_owned())))
}

fn text_difference(loaded: &Loaded, path: PathBuf, what: &str, text: &str) -> Result<Option<Difference>> {
    let expected = String::from_utf8(loaded.scene.files.read(&path)?)
        .map_err(|_| Error::new(ErrorKind::InvalidScene, "not UTF-8").at(Place::File(path.clone())))?;
    let expected = expected.replace("\r\n", "\n");
    if expected == text {
        return Ok(None);
    }
    let mut difference = differs(&path, format!("{what} differs"));
    difference.error = difference.error.note_lines(printed_diff(&expected, text));
    difference.fix = Some(Fix::File(path, text.as_bytes().to_vec()));
    Ok(Some(difference))
}

fn picture_difference(loaded: &Loaded, observed: &Observed, path: PathBuf) -> Result<Option<Difference>> {
    let output = loaded.scene.output();
    let image = output.and_then(|output| {
        let binding = [output.set, output.binding, output.element];
        observed.images.iter().find(|image| image.binding == Some(binding))
    });
    let Some((bytes, (image, encoding))) = image.and_then(|bytes| Some((bytes, bytes.image()?))) else {
        let message = "the scene has no output image: set `output = true` on one storage image";
        return Ok(Some(differs(&path, message.into())));
    };
    let found = Picture::of(image);
    let file = loaded.scene.files.read(&path)?;
    let renewed = Fix::File(path.clone(), found.encode_png(encoding)?);
    let expected = Picture::decode_within(&path, &file, None, &loaded.scene.files.limits);
    let expected = match expected {
        Ok(expected) if expected.extent == found.extent => expected,
        Ok(expected) => {
            let [[a, b], [c, d]] = [expected.extent, found.extent];
            let mut difference =
                differs(&path, format!("`{}` is {c} x {d}, but the file is {a} x {b}", bytes.name));
            difference.fix = Some(renewed);
            return Ok(Some(difference));
        }
        // An empty file is to be filled for the first time.
        Err(error) => {
            let mut difference = Difference::of(error);
            difference.fix = Some(renewed);
            return Ok(Some(difference));
        }
    };
    let (expected, pixels) = (expected.rgba8(PixelEncoding::STORED)?, found.rgba8(encoding)?);
    let compared = PictureDifference::new(&bytes.name, found.extent, expected, pixels)
        .expect("bug in anyhit: two pictures of one extent");
    let distances = compared.distances();
    let count = distances.iter().filter(|&&distance| distance > 0).count();
    if count == 0 {
        return Ok(None);
    }
    let ([x, y], count, all) = (compared.worst, grouped(count), grouped(distances.len()));
    let message = format!("`{}`: {count} of {all} pixels differ, most at ({x}, {y})", bytes.name);
    let mut difference = differs(&path, message);
    difference.subject = bytes.texel([x, y]);
    difference.fix = Some(renewed);
    let sources = [None, Some((found, encoding))];
    difference.picture = Some(Box::new(PictureDifference { sources, ..compared }));
    Ok(Some(difference))
}
