//! Images as arrays: texels of the format and dimension that shaders declare.

use std::sync::Arc;

use anyhit::{Dimension, Format, Image, ImageShape, Program, Texels};
use anyhit_engine::machine::Binding;
use anyhit_engine::machine::format::Class;
use anyhit_engine::ops::image::declared::declared_format;
use anyhit_engine::ops::image::view::View;
use anyhit_engine::program::descriptors::image_of_slot;
use anyhit_scene::image::format_named;
use numpy::{PyArrayDescr, PyArrayDescrMethods, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::argument::Objects;
use crate::array::{from_bytes, shape_text, slice, typed};
use crate::error::{invalid, raised};
use crate::numbers::Number;

/// What a shader declares of an image.
#[derive(Clone, Copy)]
pub(crate) struct Declared {
    format: Format,
    dimension: Dimension,
}

/// The image that a shader of these declares at a binding.
pub(crate) fn declared<'a>(
    programs: impl IntoIterator<Item = &'a Arc<Program>>,
    binding: Binding,
) -> Option<Declared> {
    programs.into_iter().find_map(|program| {
        let slot = program.slots.iter().find(|slot| slot.binding == binding)?;
        let ty = image_of_slot(program, slot)?;
        let view = View::of(&program.module, &ty)?;
        Some(Declared { format: declared_format(&program.module, &ty), dimension: view.dimension })
    })
}

/// The numbers of an array: as a shader writes them, bits of a binary32 or integers extended to 64
/// bits; and the lengths of the array.
type Numbers = (Vec<u64>, Vec<usize>);

/// Numbers of arrays, one for each component of a texel.
#[derive(Clone)]
pub(crate) struct TexelArray {
    /// The mip levels, the largest first.
    levels: Arc<[Numbers]>,
    class: Class,
    is_wide: bool,
    /// The format that the caller names.
    format: Option<Format>,
}

impl TexelArray {
    /// The texels of an array of float32, or of uint32, int32, uint64 or int64, with the name of a
    /// format or without one, and of arrays of the same type for further mip levels.
    pub(crate) fn of(texels: &Bound<'_, PyAny>, format: Option<&str>, levels: &Objects) -> PyResult<Self> {
        let format = format.map(named).transpose()?;
        let given = match (format, texels.cast::<PyUntypedArray>()) {
            (Some(format), _) => (format.class(), format.is_wide()),
            (None, Ok(array)) => match (array.dtype().kind(), array.dtype().itemsize()) {
                (b'u', 8) => (Class::Uint, true),
                (b'u', 4) => (Class::Uint, false),
                (b'i', 8) => (Class::Sint, true),
                (b'i', 4) => (Class::Sint, false),
                _ => (Class::Float, false),
            },
            (None, Err(_)) => (Class::Float, false),
        };
        let (class, is_wide) = given;
        let numbers = |name: &str, texels: &Bound<'_, PyAny>| match given {
            (Class::Float, _) => words::<f32>(name, texels, |number| number.to_bits().into()),
            (Class::Uint, false) => words::<u32>(name, texels, u64::from),
            (Class::Uint, true) => words::<u64>(name, texels, |number| number),
            (Class::Sint, false) => words::<i32>(name, texels, |number| i64::from(number) as u64),
            (Class::Sint, true) => words::<i64>(name, texels, |number| number as u64),
        };
        let mut all = vec![numbers("texels", texels)?];
        for (at, level) in levels.0.iter().enumerate() {
            all.push(numbers(&format!("levels[{at}]"), level.bind(texels.py()))?);
        }
        Ok(Self { levels: all.into(), class, is_wide, format })
    }

    /// The image, as a shader declares it; a plane of 32-bit components where none does.
    pub(crate) fn image(&self, declared: Option<Declared>) -> PyResult<Arc<Image>> {
        let own = match (self.class, self.is_wide) {
            (Class::Float, _) => "rgba32f",
            (Class::Uint, false) => "rgba32ui",
            (Class::Uint, true) => "r64ui",
            (Class::Sint, false) => "rgba32i",
            (Class::Sint, true) => "r64i",
        };
        let format = self.format.or(declared.map(|declared| declared.format));
        let format = format.map_or_else(|| named(own), Ok)?;
        if (format.class(), format.is_wide()) != (self.class, self.is_wide) {
            return Err(invalid(format!(
                "texels: an array of {}, but the shader declares the format {}: use `texels.astype(numpy.{})`",
                dtype(self.class, self.is_wide),
                format.name(),
                dtype(format.class(), format.is_wide())
            )));
        }
        let dimension = declared.map_or(Dimension::D2, |declared| declared.dimension);
        let (size, is_signed) = (format.texel_size() as usize, format.class() == Class::Sint);
        let one = if self.class == Class::Float { u64::from(1f32.to_bits()) } else { 1 };
        let (mut shape, mut bytes) = (None, Vec::new());
        for (number, (words, lengths)) in (0_u32..).zip(&*self.levels) {
            let name = number.checked_sub(1).map_or("texels".to_owned(), |at| format!("levels[{at}]"));
            let (own, channels) = shape_of(&name, lengths, dimension, format)?;
            let whole = *shape.get_or_insert(own);
            let extent = whole.level_extent(number);
            if (own.extent, own.layers) != (extent, whole.layers) {
                let found = shape_text(lengths);
                let sides = sides_of(&ImageShape { extent, ..whole });
                let wanted: Vec<String> = sides.iter().map(ToString::to_string).collect();
                let wanted = wanted.join(", ");
                return Err(invalid(format!("{name}: an array of shape {found}, not ({wanted}, 4)")));
            }
            bytes.reserve(words.len() / channels * size);
            for own in words.chunks_exact(channels) {
                let mut texel = [0, 0, 0, one];
                texel[..channels].copy_from_slice(own);
                bytes.extend_from_slice(&format.encode(texel, is_signed).to_le_bytes()[..size]);
            }
        }
        let levels = self.levels.len() as u32;
        let shape = ImageShape { levels, ..shape.unwrap_or(ImageShape::plane(0, 0)) };
        Image::new(format, shape, &bytes).map_err(raised)
    }
}

/// The shape of a level of an image of a dimension, and how many numbers a texel has.
fn shape_of(
    name: &str,
    all: &[usize],
    dimension: Dimension,
    format: Format,
) -> PyResult<(ImageShape, usize)> {
    let sides: &[&str] = match dimension {
        Dimension::D1 | Dimension::Buffer => &["width"],
        Dimension::D1Array => &["layers", "width"],
        Dimension::D2 => &["height", "width"],
        Dimension::D3 => &["depth", "height", "width"],
        Dimension::Cube => &["6", "height", "width"],
        _ => &["layers", "height", "width"],
    };
    let axes = dimension.axes();
    let wrong = || {
        let lengths = shape_text(all);
        let sides = sides.join(", ");
        invalid(format!("{name}: an array of shape {lengths}, not ({sides}, 4) or ({sides})"))
    };
    let channels = match all.len().checked_sub(sides.len()) {
        // One component, without an axis of its own.
        Some(0) if format.channels == 1 => 1,
        Some(1) => *all.last().unwrap_or(&0),
        _ => return Err(wrong()),
    };
    if !(1..=4).contains(&channels) {
        return Err(wrong());
    }
    let side =
        |length: usize| u32::try_from(length).map_err(|_| invalid(format!("{name}: the array is too large")));
    let lengths: Vec<u32> = all[..sides.len()].iter().map(|&one| side(one)).collect::<Result<_, _>>()?;
    let (layers, own) = lengths.split_at(sides.len() - axes);
    let mut extent = [1; 3];
    own.iter().rev().zip(&mut extent).for_each(|(&length, to)| *to = length);
    let layers = layers.first().copied().unwrap_or(1);
    Ok((ImageShape { dimension, extent, layers, levels: 1, samples: 1 }, channels))
}

/// The format with a name of GLSL.
fn named(name: &str) -> PyResult<Format> {
    format_named(name).ok_or_else(|| {
        let names: Vec<&str> = Format::NAMED.iter().map(|(name, _)| *name).collect();
        invalid(format!("format: there is no format `{name}`: write one of {}", names.join(", ")))
    })
}

/// The numbers of an array as words, and its lengths.
fn words<T: Number>(name: &str, texels: &Bound<'_, PyAny>, word: impl Fn(T) -> u64) -> PyResult<Numbers> {
    let array = typed::<T>(name, texels)?;
    let words = slice(name, &array)?.iter().map(|&number| word(number)).collect();
    Ok((words, array.shape().to_vec()))
}

/// The dtype of the components of texels.
fn dtype(class: Class, is_wide: bool) -> &'static str {
    match (class, is_wide) {
        (Class::Float, _) => "float32",
        (Class::Uint, false) => "uint32",
        (Class::Uint, true) => "uint64",
        (Class::Sint, false) => "int32",
        (Class::Sint, true) => "int64",
    }
}

/// Layers, depth, height and width of an image, as far as its dimension has them.
fn sides_of(shape: &ImageShape) -> Vec<u32> {
    let [x, y, z] = shape.extent;
    let mut sides = match shape.dimension.axes() {
        1 => vec![x],
        2 => vec![y, x],
        _ => vec![z, y, x],
    };
    if shape.dimension.is_arrayed() || shape.dimension.is_cube() {
        sides.insert(0, shape.layers);
    }
    sides
}

/// R, G, B and A of all texels of a mip level, as a shader reads them: an array (height, width, 4)
/// of float32, or of the integers that the format holds. Images of other dimensions have their own
/// axes in front of the last.
pub(crate) fn texels<'py>(py: Python<'py>, texels: &Texels, level: u32) -> PyResult<Bound<'py, PyAny>> {
    let image = texels.image();
    if level >= image.shape().levels {
        let levels = image.shape().levels;
        return Err(invalid(format!("level: there is no mip level {level} of {levels}")));
    }
    let (format, shape) = (image.format(), *image.shape());
    let (class, size) = (format.class(), format.texel_size() as usize);
    let width = if format.is_wide() && class != Class::Float { 8 } else { 4 };
    let bytes: Vec<u8> = py.detach(|| {
        let level = image.level_bytes(level);
        if format == Format::RGBA32F {
            return level;
        }
        let components = level.chunks_exact(size).flat_map(|texel| {
            let mut bits = [0; 16];
            bits[..size].copy_from_slice(texel);
            format.decode(u128::from_le_bytes(bits))
        });
        components.flat_map(|part| part.to_le_bytes().into_iter().take(width)).collect()
    });
    let sides = sides_of(&ImageShape { extent: shape.level_extent(level), ..shape });
    let samples = (shape.samples > 1).then_some(shape.samples);
    let sides: Vec<isize> = sides.into_iter().chain(samples).chain([4]).map(|side| side as isize).collect();
    let dtype = PyArrayDescr::new(py, dtype(class, format.is_wide()))?;
    from_bytes(py, bytes, &dtype, &sides)
}
