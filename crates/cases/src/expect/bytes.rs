//! `[[expect.buffer]]`, and `[[expect.image]]` by numbers.

use std::sync::{Arc, OnceLock};

use crate::expect::difference::SHOWN;
use crate::expect::numbers;
use crate::expect::numbers::TypedNumbers;
use crate::expect::{Difference, Subject};
use anyhit_base::count::grouped;
use anyhit_base::error::Result;
use anyhit_engine::machine::Buffer;
use anyhit_engine::machine::image::Image;
use anyhit_scene::image::PixelEncoding;
use anyhit_scene::read::{Parse, Spanned, Table, TomlValue};
use anyhit_unit_test::number::Tolerance;

/// A buffer or an image after a run. Its bytes are read when something compares them: a test of
/// many rays beside large resources reads what its expectations name.
#[derive(Clone, Debug)]
pub struct ObservedMemory {
    /// The name in the scene.
    pub name: String,
    /// Set, binding, array element; `None` for a buffer that is bound nowhere.
    pub binding: Option<[u32; 3]>,
    content: Content,
    bytes: OnceLock<Vec<u8>>,
}

#[derive(Clone, Debug)]
enum Content {
    Buffer(Arc<Buffer>),
    /// With the encoding of a saved picture.
    Image(Arc<Image>, PixelEncoding),
}

/// Numbers at a place of a buffer or an image.
#[derive(Clone, Debug)]
pub struct BytesExpectation {
    /// The resource's name in the scene.
    pub name: Spanned<String>,
    /// Where the first number lies, in bytes.
    pub offset: usize,
    /// Bytes from one outermost element to the next; without it they follow each other.
    pub stride: Option<usize>,
    /// An image's first texel, x and y.
    pub at: Option<Spanned<[u32; 2]>>,
    /// The numbers, by outermost element.
    pub numbers: TypedNumbers,
    /// How exact.
    pub tolerance: Tolerance,
    /// Why this is expected.
    pub because: Option<String>,
}

impl Parse for BytesExpectation {
    fn parse(value: TomlValue<'_>) -> Option<Self> {
        let table = Table::new(value)?;
        let name = table.required("name");
        let offset = table.or("offset", 0_u32) as usize;
        let stride = table.optional::<u32>("stride").map(|stride| stride as usize);
        let at = table.optional("at");
        let tolerance = numbers::tolerance(&table);
        let numbers = TypedNumbers::of(&table);
        let because = table.optional("because");
        table.finish();
        let (tolerance, numbers) = (tolerance?, numbers?);
        Some(Self { name: name?, offset, stride, at, numbers, tolerance, because })
    }
}

impl BytesExpectation {
    pub(super) fn check(&self, what: &str, memory: &[ObservedMemory], differences: &mut Vec<Difference>) {
        let because = self.because.as_ref();
        let Some(found) = memory.iter().find(|bytes| bytes.name == self.name.value) else {
            let known = memory.iter().map(|bytes| bytes.name.as_str());
            differences.push(Difference::unknown(&self.name, what, known));
            return;
        };
        if let Some(Err(unreadable)) = found.image().map(|(image, _)| image.read()) {
            differences.push(Difference::of(unreadable));
            return;
        }
        let start = match self.first_texel(found) {
            Ok(texel) => self.offset + texel,
            Err(mistake) => {
                differences.push(Difference::of(mistake));
                return;
            }
        };
        let scalar = self.numbers.scalar;
        let mut all: Vec<Difference> = Vec::new();
        for (index, element) in self.numbers.elements.iter().enumerate() {
            let packed = self.numbers.elements[..index].iter().map(|one| one.len() * scalar.size()).sum();
            let first = start + self.stride.map_or(packed, |stride| index * stride);
            for (position, expected) in element.iter().enumerate() {
                let offset = first + position * scalar.size();
                let Some(bits) = scalar.load(found.bytes(), offset) else {
                    let message = format!(
                        "byte {offset} is past the end of `{}`, which has {}",
                        found.name,
                        found.bytes().len()
                    );
                    all.push(Difference::new(&expected.span, message, because));
                    differences.extend(all);
                    return;
                };
                if let Some(message) = self.tolerance.difference(scalar, &expected.value, bits) {
                    let place = found.describe(offset);
                    let message = format!("{place}: {message}");
                    let difference = Difference::new(&expected.span, message, because)
                        .mended(&expected.span, scalar.literal(bits), because)
                        .about(found.subject(offset));
                    all.push(difference);
                }
            }
        }
        // All are kept, because all can be renewed; those beyond the first few are only counted.
        let more = all.len().saturating_sub(SHOWN);
        if more > 0 {
            let last = &mut all[SHOWN - 1];
            last.error = last.error.clone().note(format!("{} more differences in this table", grouped(more)));
            for hidden in &mut all[SHOWN..] {
                hidden.counted = true;
            }
        }
        differences.extend(all);
    }
}

impl BytesExpectation {
    /// Where the first texel begins, in bytes.
    fn first_texel(&self, found: &ObservedMemory) -> Result<usize> {
        let Some(Spanned { value, span }) = &self.at else { return Ok(0) };
        let Some([width, texel]) = found.row() else {
            return Err(span.error("`at` selects a texel of an image: use `offset`, in bytes, for a buffer"));
        };
        let [x, y] = value.map(|side| side as usize);
        let height = found.bytes().len() / (width * texel).max(1);
        if x >= width || y >= height {
            let message =
                format!("texel ({x}, {y}) is outside `{}`, which has {width} x {height}", found.name);
            return Err(span.error(message));
        }
        Ok((y * width + x) * texel)
    }
}

impl ObservedMemory {
    /// A buffer, at its set, binding and array element; `None` for one that is bound nowhere.
    pub fn of_buffer(name: String, binding: Option<[u32; 3]>, buffer: Arc<Buffer>) -> Self {
        Self { name, binding, content: Content::Buffer(buffer), bytes: OnceLock::new() }
    }

    /// An image, at its set, binding and array element.
    pub fn of_image(name: String, binding: [u32; 3], image: Arc<Image>, encoding: PixelEncoding) -> Self {
        let content = Content::Image(image, encoding);
        Self { name, binding: Some(binding), content, bytes: OnceLock::new() }
    }

    /// The content, of images texel by texel.
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get_or_init(|| match &self.content {
            Content::Buffer(buffer) => buffer.bytes(),
            Content::Image(image, _) => image.bytes(),
        })
    }

    /// The image, and the encoding of a saved picture of it.
    pub fn image(&self) -> Option<(&Arc<Image>, PixelEncoding)> {
        match &self.content {
            Content::Buffer(_) => None,
            Content::Image(image, encoding) => Some((image, *encoding)),
        }
    }

    /// Returns whether two runs left different bytes.
    pub fn differs(&self, other: &Self) -> bool {
        match (&self.content, &other.content) {
            (Content::Buffer(one), Content::Buffer(other)) => !one.has_equal_bytes(other),
            (Content::Image(one, _), Content::Image(other, _)) => !one.has_equal_texels(other),
            _ => true,
        }
    }

    /// An image's width, and the bytes of a texel.
    fn row(&self) -> Option<[usize; 2]> {
        let (image, _) = self.image()?;
        Some([image.shape().extent[0] as usize, image.format().texel_size() as usize])
    }

    fn describe(&self, offset: usize) -> String {
        match self.row() {
            None => format!("`{}` at byte {offset}", self.name),
            Some([width, texel]) => {
                let (index, rest) = (offset / texel, offset % texel);
                format!("`{}` at texel ({}, {}) byte {rest}", self.name, index % width, index / width)
            }
        }
    }

    pub(super) fn subject(&self, offset: usize) -> Subject {
        match (self.binding, self.row()) {
            (None, _) => Subject::UnboundBuffer(self.name.clone(), offset),
            (Some(binding), None) => Subject::Buffer(binding, offset),
            (Some(_), Some([width, texel])) => {
                let index = offset / texel;
                self.texel([(index % width) as u32, (index / width) as u32])
            }
        }
    }

    /// A texel of an image as the subject of a difference.
    pub fn texel(&self, texel: [u32; 2]) -> Subject {
        self.binding.map_or(Subject::Launch, |binding| Subject::Texel(binding, texel))
    }
}
