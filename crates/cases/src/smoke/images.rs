//! Images with made-up texels.

use std::cell::RefCell;
use std::collections::HashMap;
use std::sync::Arc;

use crate::smoke::fill::{FillExtent, MadeUpBytes, MadeUpValues, ValueSource};
use anyhit_base::error::Result;
use anyhit_engine::machine::format::{Class, Component, Format};
use anyhit_engine::machine::image::{Dimension, Image, ImageShape};
use anyhit_engine::module::Module;
use anyhit_engine::module::ty::{ImageType, Type};
use anyhit_engine::ops::image::declared::declared_format;

/// Width, height and depth of images at least, as far as they have them.
const SIDE: u32 = 16;
/// Texels of an image at most, whatever there are invocations.
const MOST_TEXELS: u64 = 1 << 20;
/// `VK_SAMPLE_COUNT_64_BIT`
const MOST_SAMPLES: u32 = 64;
/// `Sampled` of an `OpTypeImage` that is used with a sampler: no valid module writes to it.
const SAMPLED: u32 = 1;
/// Bytes of the images that are kept.
const MOST_KEPT: u64 = 1 << 26;

/// Makes up images, and keeps those that shaders only read: entry points of one module are run on
/// the same values, for several kinds of geometry, and several times for each.
#[derive(Default)]
pub(super) struct MadeUpImages {
    kept: RefCell<KeptImages>,
}

#[derive(Default)]
struct KeptImages {
    images: HashMap<ImageKey, Arc<Image>>,
    bytes: u64,
}

/// What an image is made from.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
struct ImageKey {
    numbers: ValueSource,
    root: u64,
    format: Format,
    shape: ImageShape,
}

impl MadeUpImages {
    /// An image of a type with random texels; `None` for a type that no descriptor has. `root`
    /// tells it from others. Its bytes are counted whether it is made or kept.
    ///
    /// # Errors
    /// `UnsupportedModule` where it is larger than the module's limits allow.
    pub(super) fn of(
        &self,
        module: &Module,
        image: &ImageType,
        values: MadeUpValues,
        root: u64,
        made: &mut MadeUpBytes,
    ) -> Result<Option<Arc<Image>>> {
        let Some(shape) = shape(image, values.extent) else { return Ok(None) };
        let key = ImageKey { numbers: values.numbers, root, format: format(module, image), shape };
        let bytes = shape.texels().saturating_mul(u64::from(key.format.texel_size()));
        made.add(module, bytes)?;
        if image.sampled != SAMPLED || bytes > MOST_KEPT {
            return key.image().map(Some);
        }
        if let Some(kept) = self.kept.borrow().images.get(&key) {
            return Ok(Some(kept.clone()));
        }
        let new = key.image()?;
        let mut kept = self.kept.borrow_mut();
        if kept.bytes + bytes > MOST_KEPT {
            *kept = KeptImages::default();
        }
        kept.bytes += bytes;
        kept.images.insert(key, new.clone());
        Ok(Some(new))
    }
}

impl ImageKey {
    fn image(&self) -> Result<Arc<Image>> {
        let &Self { numbers, root, format, shape } = self;
        let size = format.texel_size() as usize;
        let mut bytes = Vec::with_capacity(shape.texels() as usize * size);
        for at in 0..shape.texels() {
            let places = [0, 1, 2, 3].map(|channel| 4 * at + channel);
            let texel = match format.class() {
                Class::Float => format.encode_numbers(places.map(|at| f64::from(numbers.float(root, at)))),
                Class::Sint | Class::Uint => format.encode(places.map(|at| numbers.integer(root, at)), false),
            };
            bytes.extend_from_slice(&texel.to_le_bytes()[..size]);
        }
        Image::new(format, shape, &bytes)
    }
}

/// A shape with a texel for every invocation, as far as its dimension has axes for them.
fn shape(image: &ImageType, extent: FillExtent) -> Option<ImageShape> {
    let (dimension, axes, layers) = match (image.dim, image.arrayed) {
        (0, false) => (Dimension::D1, 1, 1),
        (0, true) => (Dimension::D1Array, 1, 4),
        (1, false) => (Dimension::D2, 2, 1),
        (1, true) => (Dimension::D2Array, 2, 4),
        (2, false) => (Dimension::D3, 3, 1),
        (3, false) => (Dimension::Cube, 2, 6),
        (3, true) => (Dimension::CubeArray, 2, 12),
        (5, false) => (Dimension::Buffer, 1, 1),
        _ => return None,
    };
    // Vulkan has several samples for planes only (VUID-VkImageCreateInfo-samples-02257).
    if image.multisampled && !matches!(dimension, Dimension::D2 | Dimension::D2Array) {
        return None;
    }
    let invocations = extent.invocations;
    // Retries with larger resources: 4 and 16 times the side, of a line 64 and 512 times.
    let steps = extent.scale.images.ilog2() / 3;
    let side = match (axes, steps) {
        (1, 1..) => SIDE << (3 * steps + 3),
        _ => SIDE << (2 * steps),
    };
    let mut sides = [1; 3];
    for axis in 0..axes {
        sides[axis] = side.max(invocations[axis]);
    }
    let layers = match dimension {
        Dimension::D1Array => layers.max(invocations[1]).max(layers * extent.scale.layers),
        Dimension::D2Array => layers.max(invocations[2]).max(layers * extent.scale.layers),
        // Whole cubes.
        Dimension::CubeArray => layers * extent.scale.layers,
        _ => layers,
    };
    if dimension == Dimension::Buffer {
        sides[0] = extent.texels() as u32;
    }
    if matches!(dimension, Dimension::Cube | Dimension::CubeArray) {
        sides = [sides[0].max(sides[1]), sides[0].max(sides[1]), 1];
    }
    // The longest side gives way.
    let texels = |sides: [u32; 3]| sides.iter().map(|&side| u64::from(side)).product::<u64>();
    while texels(sides) * u64::from(layers) > MOST_TEXELS
        && let Some(longest) = sides.iter_mut().max()
        && *longest > SIDE
    {
        *longest /= 2;
        if matches!(dimension, Dimension::Cube | Dimension::CubeArray) {
            sides = [sides[0].min(sides[1]), sides[0].min(sides[1]), 1];
        }
    }
    let samples = if image.multisampled { (4 * extent.scale.samples).min(MOST_SAMPLES) } else { 1 };
    let one_level = image.sampled == 2 || image.multisampled || dimension == Dimension::Buffer;
    let levels = if one_level { 1 } else { sides.iter().max().map_or(1, |side| side.ilog2() + 1) };
    Some(ImageShape { dimension, extent: sides, layers, levels, samples })
}

/// The format that an image type declares, or one that suits its component type.
fn format(module: &Module, image: &ImageType) -> Format {
    let integer = matches!(module.ty(image.sampled_type), Type::Int { .. });
    match declared_format(module, image) {
        format if image.format != 0 || format.is_wide() => format,
        // Atomic instructions want a single component; no shader can tell that the rest lacks.
        format if integer => Format { channels: 1, ..format },
        format if image.depth == 1 => Format { channels: 1, ..format },
        format if image.sampled == 2 => format,
        _ => Format::new(Component::Unorm8, 4),
    }
}
