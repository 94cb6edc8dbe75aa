//! `[[expect.image]]` with a file: an image as a whole.

use std::path::{Path, PathBuf};

use crate::expect::difference::PictureDifference;
use crate::expect::numbers;
use crate::expect::similarity::similarity;
use crate::expect::{Difference, Fix, ObservedMemory};
use anyhit_base::count::grouped;
use anyhit_base::error::Result;
use anyhit_engine::machine::format::Component;
use anyhit_scene::image::{Picture, PixelEncoding, Rgba8, exr_support};
use anyhit_scene::read::{Parse, Spanned, Table, TomlValue};
use anyhit_scene::{Files, SceneFiles};
use anyhit_unit_test::number::{ExpectedNumber, NumberType, Tolerance};

/// A picture file that an image must be like.
///
/// A file of 8 bits is compared with the image as `render` would save it; one of floats (EXR, HDR)
/// with the image's own numbers. Numbers go from 0 to 1 in files of 8 bits, too.
#[derive(Clone, Debug)]
pub struct PictureExpectation {
    /// The resource's name in the scene.
    pub name: Spanned<String>,
    /// The file, relative to the scene.
    pub file: Spanned<String>,
    /// How it is measured.
    pub measure: Measure,
    /// Why this is expected.
    pub because: Option<String>,
    /// How the file is read.
    pub files: SceneFiles,
}

/// How pictures are compared.
#[derive(Clone, Debug, PartialEq)]
pub enum Measure {
    /// Every channel of every texel by itself.
    Each(Tolerance),
    /// The root of the mean of all channels' squared differences is at most this.
    Rmse(Spanned<f64>),
    /// How alike they look, from 0 to 1 for equal, is at least this: the hybrid measure of the
    /// crate `image-compare` on the pictures as 8-bit RGBA. Of each pixel the least of three
    /// counts: the structural similarity (SSIM) of the luma in its block of 8 x 8, and how near
    /// colours and alpha are.
    Similarity(Spanned<f64>),
}

impl Parse for PictureExpectation {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        let (name, file) = (table.required("name"), table.required("file"));
        let tolerance = numbers::tolerance(&table);
        let rmse: Option<Spanned<f64>> = table.optional("rmse");
        let similarity: Option<Spanned<f64>> = table.optional("similarity");
        let because = table.optional("because");
        table.finish();
        if let Some(similarity) = similarity.as_ref().filter(|one| !(0.0..=1.0).contains(&one.value)) {
            let message = "`similarity` must be from 0 to 1, where 1 means equal";
            table.report().push(similarity.span.error(message));
            return None;
        }
        let measure = match (tolerance?, rmse, similarity) {
            (tolerance, None, None) => Measure::Each(tolerance),
            (Tolerance::Exact, Some(rmse), None) => Measure::Rmse(rmse),
            (Tolerance::Exact, None, Some(similarity)) => Measure::Similarity(similarity),
            (_, Some(one), _) | (_, None, Some(one)) => {
                let message = "one of `ulp`, `absolute`, `relative`, `rmse` and `similarity`";
                table.report().push(one.span.error(message));
                return None;
            }
        };
        Some(Self { name: name?, file: file?, measure, because, files: SceneFiles::default() })
    }
}

impl PictureExpectation {
    pub(super) fn check(&self, images: &[ObservedMemory], differences: &mut Vec<Difference>) {
        let found = images.iter().find(|bytes| bytes.name == self.name.value);
        let Some((bytes, (image, encoding))) = found.and_then(|bytes| Some((bytes, bytes.image()?))) else {
            let known = images.iter().map(|bytes| bytes.name.as_str());
            differences.push(Difference::unknown(&self.name, "image", known));
            return;
        };
        let path = self.file.span.source.sibling(&self.file.value);
        if let Err(unreadable) = image.read() {
            differences.push(Difference::of(unreadable));
            return;
        }
        let found = Picture::of(image);
        match self.compare(&path, &found, encoding, bytes) {
            Ok(None) => {}
            Ok(Some(difference)) => differences.push(difference),
            Err(error) => {
                let fix = self.renewed(&path, &found, encoding);
                let error = error.at(self.file.span.place());
                let error = if fix.is_some() { error.note("write it with `--bless`") } else { error };
                differences.push(Difference { fix, ..Difference::of(error) });
            }
        }
    }

    fn compare(
        &self,
        path: &Path,
        found: &Picture,
        encoding: PixelEncoding,
        bytes: &ObservedMemory,
    ) -> Result<Option<Difference>> {
        if is_exr(path) {
            // Before the file is read: where there is none, `--bless` could not write it either.
            exr_support()?;
        }
        let file = self.files.read(path)?;
        let expected = Picture::decode_within(path, &file, None, &self.files.limits)?;
        let because = self.because.as_ref();
        let difference = |message: String| {
            let mut difference = Difference::new(&self.file.span, message, because);
            difference.fix = self.renewed(path, found, encoding);
            difference
        };
        if expected.extent != found.extent {
            let [[a, b], [c, d]] = [expected.extent, found.extent];
            return Ok(Some(difference(format!("`{}` is {c} x {d}, but the file is {a} x {b}", bytes.name))));
        }
        let is_float = expected.format.component == Component::Float32;
        let numbers = Numbers::of(&expected, found, encoding)?;
        let shown = |encoding: PixelEncoding| PixelEncoding {
            to_srgb: encoding.to_srgb || is_float,
            keep_alpha: encoding.keep_alpha || is_float,
        };
        let encodings = [shown(PixelEncoding::STORED), shown(encoding)];
        let [expected_picture, found_picture] =
            [rgba8(&expected, encodings[0])?, rgba8(found, encodings[1])?];
        let (message, texel) = match &self.measure {
            Measure::Each(tolerance) => match numbers.each(*tolerance) {
                None => return Ok(None),
                Some((count, texel, words)) => {
                    let [x, y] = texel;
                    let all = u64::from(expected.extent[0]) * u64::from(expected.extent[1]);
                    let (count, all) = (grouped(count), grouped(all));
                    let message = format!(
                        "`{}`: {count} of {all} texels differ, most at ({x}, {y}): {words}",
                        bytes.name
                    );
                    (message, texel)
                }
            },
            Measure::Rmse(limit) => {
                let rmse = numbers.rmse();
                if rmse <= limit.value {
                    return Ok(None);
                }
                let message = format!(
                    "`{}`: the RMSE is {rmse:.6}, but at most {} is allowed",
                    bytes.name, limit.value
                );
                (message, numbers.worst(|_| true))
            }
            Measure::Similarity(limit) => {
                let alike = similarity(&expected_picture, &found_picture);
                if alike >= limit.value {
                    return Ok(None);
                }
                let (name, limit) = (&bytes.name, limit.value);
                let message =
                    format!("`{name}`: the similarity is {alike:.6}, but at least {limit} is required");
                (message, numbers.worst(|_| true))
            }
        };
        let mut difference = difference(message).about(bytes.texel(texel));
        difference.picture = Some(Box::new(PictureDifference {
            name: bytes.name.clone(),
            expected: expected_picture,
            found: found_picture,
            worst: texel,
            sources: [Some((expected, encodings[0])), Some((found.clone(), encodings[1]))],
        }));
        Ok(Some(difference))
    }

    /// The file as it would have to be.
    fn renewed(&self, path: &Path, found: &Picture, encoding: PixelEncoding) -> Option<Fix> {
        if self.because.is_some() || !self.files.may_replace(path) {
            return None;
        }
        let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or("");
        let bytes = match extension.to_ascii_lowercase().as_str() {
            "exr" => found.encode_exr().ok()?,
            "png" => found.encode_png(encoding).ok()?,
            _ => return None,
        };
        Some(Fix::File(PathBuf::from(path), bytes))
    }
}

fn is_exr(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("exr"))
}

/// The channels of two pictures of one size, side by side.
struct Numbers {
    width: usize,
    /// The distance of neighbouring numbers; none for floats.
    step: Option<f64>,
    /// Four channels a texel: expected and found.
    channels: Vec<[f64; 2]>,
}

impl Numbers {
    fn of(expected: &Picture, found: &Picture, encoding: PixelEncoding) -> Result<Self> {
        // What is stored as sRGB stays so: both sides are compared as a file stores them.
        let stored = |bytes: Vec<u8>| bytes.into_iter().map(|byte| f64::from(byte) / 255.0).collect();
        let (step, [expected_numbers, found_numbers]): (_, [Vec<f64>; 2]) = match expected.format.component {
            Component::Unorm8 => (
                Some(1.0 / 255.0),
                [stored(expected.rgba8(PixelEncoding::STORED)?), stored(found.rgba8(encoding)?)],
            ),
            Component::Unorm16 => (Some(1.0 / 65_535.0), [expected.numbers(), found.numbers()]),
            _ => (None, [expected.numbers(), found.numbers()]),
        };
        let pairs = expected_numbers.into_iter().zip(found_numbers);
        let channels = pairs.map(|(expected, found)| [expected, found]).collect();
        Ok(Self { width: expected.extent[0] as usize, step, channels })
    }

    fn differs(&self, tolerance: Tolerance, [expected, found]: [f64; 2]) -> bool {
        let distance = (expected - found).abs();
        match (tolerance, self.step) {
            (_, None) => {
                let bits = |number: f64| u64::from((number as f32).to_bits());
                let wanted = ExpectedNumber::Number(bits(expected), expected);
                tolerance.difference(NumberType::F32, &wanted, bits(found)).is_some()
            }
            (Tolerance::Exact, Some(step)) => distance > step / 2.0,
            (Tolerance::Ulp(bound), Some(step)) => distance > (bound + 1e-6) * step,
            (Tolerance::Absolute(bound), _) => distance > bound,
            (Tolerance::Relative(bound), _) => distance > bound * expected.abs(),
        }
    }

    /// How many texels differ, the one that differs most, and its numbers in words.
    fn each(&self, tolerance: Tolerance) -> Option<(usize, [u32; 2], String)> {
        let texels = self.channels.chunks_exact(4);
        let differs = |texel: &[[f64; 2]]| texel.iter().any(|&pair| self.differs(tolerance, pair));
        let count = texels.filter(|texel| differs(texel)).count();
        if count == 0 {
            return None;
        }
        let texel = self.worst(differs);
        let at = 4 * (texel[1] as usize * self.width + texel[0] as usize);
        let words = |side: usize| {
            let numbers = self.channels[at..at + 4].iter().map(|pair| match self.step {
                // Steps, as an image editor shows them.
                Some(step) => format!("{:.0}", pair[side] / step),
                None => format!("{:?}", pair[side] as f32),
            });
            format!("({})", numbers.collect::<Vec<_>>().join(", "))
        };
        Some((count, texel, format!("expected {}, found {}", words(0), words(1))))
    }

    /// Returns the texel that differs most among those that meet a condition.
    fn worst(&self, counts: impl Fn(&[[f64; 2]]) -> bool) -> [u32; 2] {
        let distance = |texel: &[[f64; 2]]| {
            let channels = texel.iter().map(|[expected, found]| (expected - found).abs());
            // NaN on one side only is as far away as can be.
            channels.fold(0.0, |most: f64, one| if one.is_nan() { f64::INFINITY } else { most.max(one) })
        };
        let texels = self.channels.chunks_exact(4).enumerate().filter(|(_, texel)| counts(texel));
        let distances = texels.map(|(at, texel)| (at, distance(texel)));
        let most = distances.fold((0, -1.0), |most, one| if one.1 > most.1 { one } else { most });
        [(most.0 % self.width.max(1)) as u32, (most.0 / self.width.max(1)) as u32]
    }

    /// The root of the mean squared difference of all channels.
    fn rmse(&self) -> f64 {
        let squares = self.channels.iter().map(|[expected, found]| (expected - found).powi(2));
        (squares.sum::<f64>() / self.channels.len().max(1) as f64).sqrt()
    }
}

fn rgba8(picture: &Picture, encoding: PixelEncoding) -> Result<Rgba8> {
    Ok(Rgba8 { extent: picture.extent, pixels: picture.rgba8(encoding)? })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(step: Option<f64>, pairs: &[[f64; 2]]) -> Numbers {
        Numbers { width: 1, step, channels: pairs.to_vec() }
    }

    #[test]
    fn the_rmse_is_the_root_of_the_mean_square() {
        // sqrt((3^2 + 4^2 + 0 + 0) / 4) = 5/2
        let four = numbers(None, &[[3.0, 0.0], [0.0, 4.0], [1.0, 1.0], [0.0, 0.0]]);
        assert_eq!(four.rmse(), 2.5);
    }

    #[test]
    fn steps_of_8_bits_are_its_ulps() {
        let step = Some(1.0 / 255.0);
        let pair = [[10.0 / 255.0, 12.0 / 255.0], [0.0, 0.0], [0.0, 0.0], [1.0, 1.0]];
        let numbers = numbers(step, &pair);
        assert!(numbers.each(Tolerance::Exact).is_some());
        assert!(numbers.each(Tolerance::Ulp(1.0)).is_some());
        assert!(numbers.each(Tolerance::Ulp(2.0)).is_none());
        assert!(numbers.each(Tolerance::Absolute(0.01)).is_none());
        let (count, texel, words) = numbers.each(Tolerance::Exact).unwrap();
        assert_eq!((count, texel), (1, [0, 0]));
        assert_eq!(words, "expected (10, 0, 0, 255), found (12, 0, 0, 255)");
    }

    /// A texel within a relative tolerance is not named, however large its difference is.
    #[test]
    fn the_texel_named_is_one_that_differs() {
        let texel = |expected: f64, found: f64| [[expected, found], [0.0; 2], [0.0; 2], [0.0; 2]];
        // 8 of 1000 are 0.8 %; 0.5 of 10 are 5 %.
        let numbers = numbers(None, &[texel(1000.0, 1008.0), texel(10.0, 10.5)].concat());
        let (count, texel, _) = numbers.each(Tolerance::Relative(0.01)).unwrap();
        assert_eq!((count, texel), (1, [0, 1]));
    }

    #[test]
    fn not_a_number_differs_most() {
        let mut pairs = vec![[0.0, 1.0]; 4];
        pairs.extend([[0.0, f64::NAN], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]]);
        let numbers = numbers(None, &pairs);
        assert_eq!(numbers.worst(|_| true), [0, 1]);
        assert!(numbers.each(Tolerance::Absolute(1e30)).is_some_and(|(count, ..)| count == 1));
    }
}
