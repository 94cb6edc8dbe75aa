//! Something that is not as expected, at its place in the scene file.

use anyhit_base::error::names::nearest;
use anyhit_base::error::{Error, ErrorKind};
use anyhit_engine::math::array;
use anyhit_scene::image::{Picture, PixelEncoding, Rgba8};
use anyhit_scene::read::{Span, Spanned};

/// How many differences of one table are shown.
pub(super) const SHOWN: usize = 6;

/// Something that is not as expected.
#[derive(Clone, Debug)]
pub struct Difference {
    /// What differs, at its place in the scene file.
    pub error: Error,
    /// What makes the expectation hold; not there where the value is derived.
    pub fix: Option<Fix>,
    /// Which result differs.
    pub subject: Subject,
    /// Both pictures, where pictures differ.
    pub picture: Option<Box<PictureDifference>>,
    /// Whether it is counted by the difference before and need not be shown.
    pub counted: bool,
}

/// A change of a scene file, or another file to write.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Fix {
    /// Another text for a range of the file.
    Text(Span, String),
    /// A file, written as a whole.
    File(std::path::PathBuf, Vec<u8>),
}

/// The result that differs from an expectation.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Subject {
    /// Nothing in particular.
    #[default]
    Launch,
    /// Bytes of the buffer at set, binding and array element.
    Buffer([u32; 3], usize),
    /// Bytes of the buffer that is bound nowhere, by its name.
    UnboundBuffer(String, usize),
    /// A texel of the image at set, binding and array element.
    Texel([u32; 3], [u32; 2]),
    /// A named ray, and the word of its payload where it is one.
    Ray(String, Option<usize>),
    /// A word of the payload of the ray at hand.
    Payload(usize),
    /// A launch index.
    Invocation([u32; 3]),
}

impl Difference {
    /// A difference at a place of the scene file.
    pub fn new(span: &Span, message: impl Into<String>, because: Option<&String>) -> Self {
        let error = Error::new(ErrorKind::Expectation, message).at_with(span.place(), "");
        Self::of(match because {
            Some(because) => error.note(format!("because: {because}")),
            None => error,
        })
    }

    /// An error as a difference.
    pub fn of(error: Error) -> Self {
        Self { error, fix: None, subject: Subject::default(), picture: None, counted: false }
    }

    /// A name that the scene does not know, with those that it does.
    pub(super) fn unknown<'n>(
        name: &Spanned<String>,
        what: &str,
        known: impl Iterator<Item = &'n str> + Clone,
    ) -> Self {
        let label = nearest(&name.value, known.clone()).map(|near| format!("did you mean `{near}`?"));
        let message = format!("the scene has no {what} `{}`", name.value);
        let error = name.span.error_with(message, label.unwrap_or_default());
        let known: Vec<_> = known.map(|name| format!("`{name}`")).collect();
        let known = if known.is_empty() { "none".into() } else { known.join(", ") };
        Self::of(error.note(format!("available: {known}")))
    }

    /// Differences as one error; there must be some.
    pub fn as_error(differences: Vec<Self>) -> Error {
        let shown = differences.into_iter().filter(|difference| !difference.counted);
        Error::several(shown.map(|difference| difference.error).collect())
    }

    /// With what makes it hold, unless the value is derived.
    #[must_use]
    pub(super) fn mended(self, span: &Span, text: impl Into<String>, because: Option<&String>) -> Self {
        let fix = because.is_none().then(|| Fix::Text(span.clone(), text.into()));
        Self { fix, ..self }
    }

    #[must_use]
    pub(super) fn about(self, subject: Subject) -> Self {
        Self { subject, ..self }
    }
}

/// Two pictures, both as 8-bit RGBA.
#[derive(Clone, Debug)]
pub struct PictureDifference {
    /// The image's name.
    pub name: String,
    /// The expected picture.
    pub expected: Rgba8,
    /// What was found.
    pub found: Rgba8,
    /// The pixel that differs most, which messages name and pages open.
    pub worst: [u32; 2],
    /// The images or files of both, expected first, with the encodings that made their pixels;
    /// `None` where the pixels are all that is known.
    pub sources: [Option<(Picture, PixelEncoding)>; 2],
}

impl PictureDifference {
    /// Compares the bytes of two pictures; `None` if their sizes differ. `worst` is the first pixel
    /// with the greatest difference in a channel.
    pub fn new(name: &str, [width, height]: [u32; 2], expected: Vec<u8>, found: Vec<u8>) -> Option<Self> {
        let picture = |pixels: Vec<u8>| {
            let size = 4 * u64::from(width) * u64::from(height);
            (pixels.len() as u64 == size).then_some(Rgba8 { extent: [width, height], pixels })
        };
        let (expected, found) = (picture(expected)?, picture(found)?);
        let sources = [None, None];
        let mut compared = Self { name: name.into(), expected, found, worst: [0; 2], sources };
        let greatest = |most: (usize, u8), one: (usize, u8)| if one.1 > most.1 { one } else { most };
        let (at, _) = compared.distances().into_iter().enumerate().fold((0, 0), greatest);
        let row = width.max(1) as usize;
        compared.worst = [(at % row) as u32, (at / row) as u32];
        Some(compared)
    }

    /// By pixel, the greatest difference of a channel.
    pub fn distances(&self) -> Vec<u8> {
        let pixels = self.expected.pixels.chunks_exact(4).zip(self.found.pixels.chunks_exact(4));
        let distance = |(one, other): (&[u8], &[u8])| {
            one.iter().zip(other).map(|(one, other)| one.abs_diff(*other)).max().unwrap_or(0)
        };
        pixels.map(distance).collect()
    }

    /// The picture of the differences. Equal pixels are black; others have one hue, whose
    /// brightness is the greatest difference of a channel relative to that of all pixels.
    pub fn difference(&self) -> Rgba8 {
        let distances = self.distances();
        let most = distances.iter().copied().max().unwrap_or(0).max(1);
        let shown = distances.into_iter().flat_map(|distance| {
            let [r, g, b] = magnitude_colour(f64::from(distance) / f64::from(most));
            [r, g, b, 255]
        });
        Rgba8 { extent: self.expected.extent, pixels: shown.collect() }
    }
}

/// The colour of a magnitude from 0 to 1: black for 0, and above it an orange that grows brighter.
pub fn magnitude_colour(magnitude: f64) -> [u8; 3] {
    const DARK: [f64; 3] = [80.0, 34.0, 0.0];
    const BRIGHT: [f64; 3] = [255.0, 201.0, 128.0];
    match magnitude {
        0.0 => [0; 3],
        part => array::from_fn(|channel| (DARK[channel] + part * (BRIGHT[channel] - DARK[channel])) as u8),
    }
}
